//! The devices attached to this computer, as far as they can be found. A rig file may name them.

use std::net::Ipv4Addr;

use serde::Serialize;
use serde_json::{Value, json};

use super::{CameraSpec, HardwareRig, MonitorInfo, monitors};
use crate::error::{Error, Result};

/// The devices that were found.
#[derive(Clone, Debug)]
pub struct AttachedDevices {
    /// The monitors of the X server, in its order.
    pub monitors: Vec<MonitorInfo>,
    /// The cameras of every kind that this program supports.
    pub cameras: Vec<AttachedCamera>,
}

/// A camera that was found.
#[derive(Clone, Debug)]
pub struct AttachedCamera {
    /// The lines to print: first kind, address and name, then the abilities.
    pub lines: Vec<String>,
    /// The reason that its abilities are unknown although they were requested.
    pub unknown: Option<String>,
    /// The same data as an object: `kind` as in a rig file, the identity of the camera, and `abilities` if they are known.
    pub described: Value,
}

impl AttachedDevices {
    /// Searches for monitors and cameras. `display` names the X server; the default is the server of `of_file`, or otherwise of DISPLAY.
    /// `of_file` has the devices of a rig file, and its camera is asked for its abilities. With `all`, every camera is asked. A process of
    /// the helper program ([`Helper::find`](super::Helper::find)) reads each camera's description. If a search fails, `note` receives the
    /// error, and the other searches continue.
    pub fn find(
        display: Option<&str>,
        of_file: Option<&HardwareRig>,
        all: bool,
        note: &mut dyn FnMut(&Error),
    ) -> Self {
        let display = display.or(of_file.and_then(|rig| rig.projector.display.as_deref()));
        // A computer without a screen may still have cameras.
        let monitors = monitors(display).unwrap_or_else(|why| {
            note(&why);
            Vec::new()
        });
        let address = match of_file.map(|rig| &rig.camera) {
            Some(CameraSpec::Gige(spec)) => Some(spec.address),
            _ => None,
        };
        let of_usb = match of_file.map(|rig| &rig.camera) {
            Some(CameraSpec::Usb3(spec)) => Some(spec.serial.as_deref()),
            _ => None,
        };
        let mut cameras = Vec::new();
        for kind in [gige(address, all), usb3(of_usb, all), v4l(), gphoto2()] {
            match kind {
                Ok(found) => cameras.extend(found),
                Err(why) => note(&why),
            }
        }
        Self { monitors, cameras }
    }
}

impl AttachedCamera {
    /// A camera of this kind. `kind` is the name in a rig file.
    fn new(kind: &str, camera: &impl Serialize, said: String) -> Self {
        let mut found = Self { lines: vec![said], unknown: None, described: json!(camera) };
        found.add("kind", kind.into());
        found
    }

    /// The same camera with its abilities, if `is_asked`.
    #[cfg(any(feature = "gige", feature = "usb3"))]
    fn able(mut self, is_asked: bool, kind: &str, place: Option<&str>) -> Self {
        if !is_asked {
            return self;
        }
        let asked =
            super::Helper::find().and_then(|helper| crate::rig::genicam::set_up::ask(&helper, kind, place));
        match asked {
            Ok(abilities) => {
                self.lines.push(abilities.to_string());
                self.add("abilities", json!(abilities));
            }
            Err(why) => self.unknown = Some(why.to_string()),
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
fn gige(address: Option<Ipv4Addr>, all: bool) -> Result<Vec<AttachedCamera>> {
    let cameras = super::cameras(&address.into_iter().collect::<Vec<_>>())?;
    let said = |camera: &super::FoundGigeCamera| {
        let (maker, model, serial) = (known(&camera.maker), known(&camera.model), known(&camera.serial));
        format!("gige {}: {maker} {model}, serial number {serial}", camera.address)
    };
    let found = |camera: &super::FoundGigeCamera| {
        let (is_asked, place) = (all || address == Some(camera.address), camera.address.to_string());
        AttachedCamera::new("gige", camera, said(camera)).able(is_asked, "gige", Some(&place))
    };
    Ok(cameras.iter().map(found).collect())
}

#[cfg(feature = "usb3")]
fn usb3(of_file: Option<Option<&str>>, all: bool) -> Result<Vec<AttachedCamera>> {
    let said = |camera: &super::FoundUsbCamera| {
        let (maker, model, serial) = (known(&camera.maker), known(&camera.model), known(&camera.serial));
        let speed = camera.speed.as_ref().map_or_else(String::new, |speed| format!(", at {speed}"));
        format!("usb3 {serial}: {maker} {model}{speed}")
    };
    let found = |camera: &super::FoundUsbCamera| {
        let place = camera.serial.as_deref();
        let is_of_file = of_file.is_some_and(|serial| serial.is_none_or(|serial| place == Some(serial)));
        AttachedCamera::new("usb3", camera, said(camera)).able(all || is_of_file, "usb3", place)
    };
    Ok(super::usb_cameras()?.iter().map(found).collect())
}

#[cfg(feature = "v4l")]
fn v4l() -> Result<Vec<AttachedCamera>> {
    let said = |device: &super::FoundVideoDevice| {
        let formats = if device.formats.is_empty() {
            "no format that krylux reads".into()
        } else {
            format!("pixel_format {}", device.formats.join(", "))
        };
        format!("v4l {}: {}, {formats}", device.device, device.name)
    };
    let devices = super::video_devices();
    Ok(devices.iter().map(|device| AttachedCamera::new("v4l", device, said(device))).collect())
}

fn gphoto2() -> Result<Vec<AttachedCamera>> {
    let said = |camera: &super::FoundStillCamera| format!("gphoto2 \"{}\", at {}", camera.model, camera.port);
    let cameras = super::still_cameras()?;
    Ok(cameras.iter().map(|camera| AttachedCamera::new("gphoto2", camera, said(camera))).collect())
}

#[cfg(not(feature = "gige"))]
fn gige(_: Option<Ipv4Addr>, _: bool) -> Result<Vec<AttachedCamera>> {
    Err(super::not_built("GigE Vision", "gige"))
}

#[cfg(not(feature = "usb3"))]
fn usb3(_: Option<Option<&str>>, _: bool) -> Result<Vec<AttachedCamera>> {
    Err(super::not_built("USB3 Vision", "usb3"))
}

#[cfg(not(feature = "v4l"))]
fn v4l() -> Result<Vec<AttachedCamera>> {
    Err(super::not_built("cameras of Linux's video interface", "v4l"))
}
