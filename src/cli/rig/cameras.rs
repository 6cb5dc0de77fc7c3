//! Cameras of every kind that this krylux was built with, as `krylux rig list` names them.

use std::net::Ipv4Addr;

use anyhow::Result;
use serde::Serialize;
use serde_json::{Value, json};

use super::super::console::Console;
use crate::rig::{self, CameraSpec};

/// A camera: what is said of it, and the same for `--json`.
type Found = (String, Value);

/// Names all cameras, and asks that of a rig file, too; those found.
pub(super) fn list(of_file: Option<&CameraSpec>, console: &Console) -> Result<Vec<Value>> {
    let address = match of_file {
        Some(CameraSpec::Gige(spec)) => Some(spec.address),
        _ => None,
    };
    let mut found = Vec::new();
    for kind in [gige(address), usb3(), v4l(), gphoto2()] {
        match kind {
            Ok(cameras) => found.extend(cameras),
            // One kind that cannot be looked for does not hide the others.
            Err(why) => console.note(format_args!("note: {why}")),
        }
    }
    if found.is_empty() {
        console.say("camera    none answers")?;
    }
    found.iter().try_for_each(|(said, _)| console.say(format_args!("camera    {said}")))?;
    Ok(found.into_iter().map(|(_, described)| described).collect())
}

/// A camera's description with its kind, under which a rig file names it.
fn described(kind: &str, camera: &impl Serialize) -> Value {
    let mut described = json!(camera);
    if let Some(fields) = described.as_object_mut() {
        fields.insert("kind".into(), kind.into());
    }
    described
}

#[cfg(any(feature = "gige", feature = "usb3"))]
fn known(name: &Option<String>) -> &str {
    name.as_deref().unwrap_or("?")
}

#[cfg(feature = "gige")]
fn gige(address: Option<Ipv4Addr>) -> crate::Result<Vec<Found>> {
    let cameras = rig::cameras(&address.into_iter().collect::<Vec<_>>())?;
    let said = |camera: &rig::FoundCamera| {
        let (maker, model, serial) = (known(&camera.maker), known(&camera.model), known(&camera.serial));
        format!("gige {}: {maker} {model}, serial number {serial}", camera.address)
    };
    Ok(cameras.iter().map(|camera| (said(camera), described("gige", camera))).collect())
}

#[cfg(feature = "usb3")]
fn usb3() -> crate::Result<Vec<Found>> {
    let said = |camera: &rig::FoundUsbCamera| {
        let (maker, model, serial) = (known(&camera.maker), known(&camera.model), known(&camera.serial));
        let speed = camera.speed.as_ref().map_or_else(String::new, |speed| format!(", at {speed}"));
        format!("usb3 {serial}: {maker} {model}{speed}")
    };
    Ok(rig::usb_cameras()?.iter().map(|camera| (said(camera), described("usb3", camera))).collect())
}

#[cfg(feature = "v4l")]
fn v4l() -> crate::Result<Vec<Found>> {
    let said = |device: &rig::FoundVideoDevice| {
        let formats = if device.formats.is_empty() {
            "no format that krylux reads".into()
        } else {
            format!("pixel_format {}", device.formats.join(", "))
        };
        format!("v4l {}: {}, {formats}", device.device, device.name)
    };
    Ok(rig::video_devices().iter().map(|device| (said(device), described("v4l", device))).collect())
}

fn gphoto2() -> crate::Result<Vec<Found>> {
    let said = |camera: &rig::FoundStillCamera| format!("gphoto2 \"{}\", at {}", camera.model, camera.port);
    Ok(rig::still_cameras()?.iter().map(|camera| (said(camera), described("gphoto2", camera))).collect())
}

#[cfg(not(feature = "gige"))]
fn gige(_: Option<Ipv4Addr>) -> crate::Result<Vec<Found>> {
    Err(rig::left_out("GigE Vision", "gige"))
}

#[cfg(not(feature = "usb3"))]
fn usb3() -> crate::Result<Vec<Found>> {
    Err(rig::left_out("USB3 Vision", "usb3"))
}

#[cfg(not(feature = "v4l"))]
fn v4l() -> crate::Result<Vec<Found>> {
    Err(rig::left_out("cameras of Linux's video interface", "v4l"))
}
