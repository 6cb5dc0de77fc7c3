//! The devices attached to this computer, as far as they can be found. A rig file may name them.

use serde_json::{Value, json};

use super::abilities::ask;
use super::{CameraKind, CameraSpec, GenicamSpec, HardwareRig, Helper, MonitorInfo, monitors};
use crate::error::Error;

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
    kind: CameraKind,
    /// The address, the serial number, the device file or the port.
    place: Option<String>,
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
        let of_file = match of_file.map(|rig| &rig.camera) {
            Some(CameraSpec::Genicam(spec)) => Some(spec),
            _ => None,
        };
        let kinds = [
            #[cfg(feature = "gige")]
            super::gige::cameras(of_file.and_then(|spec| spec.address)),
            #[cfg(not(feature = "gige"))]
            Err(CameraKind::Gige.not_built()),
            #[cfg(feature = "usb3")]
            super::usb3::usb_cameras(),
            #[cfg(not(feature = "usb3"))]
            Err(CameraKind::Usb3.not_built()),
            #[cfg(feature = "v4l")]
            Ok(super::v4l::video_devices()),
            #[cfg(not(feature = "v4l"))]
            Err(CameraKind::V4l.not_built()),
            super::gphoto2::body::still_cameras(),
        ];
        let mut cameras = Vec::new();
        for kind in kinds {
            match kind {
                Ok(found) => cameras.extend(found),
                Err(why) => note(&why),
            }
        }
        for camera in &mut cameras {
            if all || of_file.is_some_and(|spec| camera.is_of(spec)) {
                camera.ask_abilities();
            }
        }
        Self { monitors, cameras }
    }
}

impl AttachedCamera {
    /// A camera of this kind. `place` is its address, serial number, device file or port. `line` and `facts` begin with it.
    pub(crate) fn new(kind: CameraKind, place: Option<String>, line: String, facts: Value) -> Self {
        let lines = vec![format!("{} {line}", kind.key())];
        let mut found = Self { kind, place, lines, unknown: None, described: facts };
        found.add("kind", kind.key().into());
        found
    }

    /// Whether a rig file describes this camera.
    fn is_of(&self, spec: &GenicamSpec) -> bool {
        let place = spec.address_or_serial();
        self.kind == spec.kind && (place.is_none() || self.place == place)
    }

    /// Adds the abilities of a camera that describes them.
    fn ask_abilities(&mut self) {
        if !matches!(self.kind, CameraKind::Gige | CameraKind::Usb3) {
            return;
        }
        match Helper::find().and_then(|helper| ask(&helper, self.kind, self.place.as_deref())) {
            Ok(abilities) => {
                self.lines.push(abilities.to_string());
                self.add("abilities", json!(abilities));
            }
            Err(why) => self.unknown = Some(why.to_string()),
        }
    }

    fn add(&mut self, key: &str, value: Value) {
        if let Some(fields) = self.described.as_object_mut() {
            fields.insert(key.into(), value);
        }
    }
}
