//! The cameras for `krylux rig list`, of every kind that this program was built with.

use std::net::Ipv4Addr;

use serde::Serialize;
use serde_json::{Value, json};

use super::super::console::Console;
use crate::error::Result;
use crate::rig::{self, CameraSpec};

/// A camera: its lines of text, why more is not known, and the same for `--json`.
struct Found {
    lines: Vec<String>,
    note: Option<crate::Error>,
    described: Value,
}

/// Lists all cameras, and asks the camera of a rig file, too. Returns them for `--json`.
pub(super) fn list(of_file: Option<&CameraSpec>, console: &Console) -> Result<Vec<Value>> {
    let address = match of_file {
        Some(CameraSpec::Gige(spec)) => Some(spec.address),
        _ => None,
    };
    let mut found = Vec::new();
    for kind in [gige(address), usb3(), v4l(), gphoto2()] {
        match kind {
            Ok(cameras) => found.extend(cameras),
            // A kind that cannot be searched for does not hide the others.
            Err(why) => console.note(format_args!("note: {why}")),
        }
    }
    if found.is_empty() {
        console.say("camera    none answers")?;
    }
    for camera in &found {
        for (at, line) in camera.lines.iter().enumerate() {
            console.say(format_args!("{:<9} {line}", if at == 0 { "camera" } else { "" }))?;
        }
        if let Some(why) = &camera.note {
            console.note(format_args!("note: {why}"));
        }
    }
    Ok(found.into_iter().map(|camera| camera.described).collect())
}

impl Found {
    /// A camera of this kind, by the name of the kind in a rig file.
    fn new(kind: &str, camera: &impl Serialize, said: String) -> Self {
        let mut found = Self { lines: vec![said], note: None, described: json!(camera) };
        found.add("kind", kind.into());
        found
    }

    /// The same camera with its abilities.
    #[cfg(any(feature = "gige", feature = "usb3"))]
    fn able(mut self, abilities: Result<rig::Abilities>) -> Self {
        match abilities {
            Ok(abilities) => {
                self.lines.push(abilities.to_string());
                self.add("abilities", json!(abilities));
            }
            // The camera exists, but does not answer this question.
            Err(why) => self.note = Some(why),
        }
        self
    }

    fn add(&mut self, key: &str, value: Value) {
        if let Some(fields) = self.described.as_object_mut() {
            fields.insert(key.into(), value);
        }
    }
}

#[cfg(any(feature = "gige", feature = "usb3"))]
fn known(name: &Option<String>) -> &str {
    name.as_deref().unwrap_or("?")
}

#[cfg(feature = "gige")]
fn gige(address: Option<Ipv4Addr>) -> Result<Vec<Found>> {
    let cameras = rig::cameras(&address.into_iter().collect::<Vec<_>>())?;
    let said = |camera: &rig::FoundGigeCamera| {
        let (maker, model, serial) = (known(&camera.maker), known(&camera.model), known(&camera.serial));
        format!("gige {}: {maker} {model}, serial number {serial}", camera.address)
    };
    let found = |camera: &rig::FoundGigeCamera| {
        Found::new("gige", camera, said(camera)).able(rig::gige_camera_abilities(camera.address))
    };
    Ok(cameras.iter().map(found).collect())
}

#[cfg(feature = "usb3")]
fn usb3() -> Result<Vec<Found>> {
    let said = |camera: &rig::FoundUsbCamera| {
        let (maker, model, serial) = (known(&camera.maker), known(&camera.model), known(&camera.serial));
        let speed = camera.speed.as_ref().map_or_else(String::new, |speed| format!(", at {speed}"));
        format!("usb3 {serial}: {maker} {model}{speed}")
    };
    let found = |camera: &rig::FoundUsbCamera| {
        Found::new("usb3", camera, said(camera)).able(rig::usb_camera_abilities(camera.serial.as_deref()))
    };
    Ok(rig::usb_cameras()?.iter().map(found).collect())
}

#[cfg(feature = "v4l")]
fn v4l() -> Result<Vec<Found>> {
    let said = |device: &rig::FoundVideoDevice| {
        let formats = if device.formats.is_empty() {
            "no format that krylux reads".into()
        } else {
            format!("pixel_format {}", device.formats.join(", "))
        };
        format!("v4l {}: {}, {formats}", device.device, device.name)
    };
    Ok(rig::video_devices().iter().map(|device| Found::new("v4l", device, said(device))).collect())
}

fn gphoto2() -> Result<Vec<Found>> {
    let said = |camera: &rig::FoundStillCamera| format!("gphoto2 \"{}\", at {}", camera.model, camera.port);
    Ok(rig::still_cameras()?.iter().map(|camera| Found::new("gphoto2", camera, said(camera))).collect())
}

#[cfg(not(feature = "gige"))]
fn gige(_: Option<Ipv4Addr>) -> Result<Vec<Found>> {
    Err(rig::not_built("GigE Vision", "gige"))
}

#[cfg(not(feature = "usb3"))]
fn usb3() -> Result<Vec<Found>> {
    Err(rig::not_built("USB3 Vision", "usb3"))
}

#[cfg(not(feature = "v4l"))]
fn v4l() -> Result<Vec<Found>> {
    Err(rig::not_built("cameras of Linux's video interface", "v4l"))
}
