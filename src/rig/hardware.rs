//! Rigs of real devices. A [`HardwareRig`] has a monitor of an X server as its projector, and a camera. A [`ProgramRig`] has devices that a
//! program implements, for example a camera that needs its maker's library. This module also recognizes the various errors of cameras that
//! another program has opened.

use std::error::Error as Why;
use std::io::ErrorKind;
use std::sync::{Arc, Mutex, PoisonError};
use std::{fmt, io};

use serde::{Deserialize, Serialize};

use super::{
    Camera, CameraInfo, CameraSpec, Devices, Gphoto2, Helper, ProjectorInfo, Stamp, WallClock, X11Projector,
    X11Spec, attached, camera_fault, number,
};
use crate::error::{Error, Result};
use crate::image::Resolution;

/// A description of a rig of real devices.
#[derive(Clone, Debug, PartialEq)]
pub struct HardwareRig {
    /// The projector.
    pub projector: X11Spec,
    /// The camera.
    pub camera: CameraSpec,
}

impl HardwareRig {
    /// Opens the projector and the camera. A process of `helper` first reads the camera's description ([`Self::camera_abilities`]). Another
    /// process of `helper` holds the projector's window. Time and frame numbers continue from `after`, an earlier session's last frame.
    ///
    /// # Errors
    /// [`Error::Rig`] when a device is missing, is in use, or cannot do what its description says.
    pub fn open(&self, helper: &Helper, after: Option<Stamp>) -> Result<Devices> {
        let clock = WallClock::starting_at(after.map_or(0.0, |stamp| stamp.time));
        self.camera_abilities(helper)?;
        let camera = camera(&self.camera, clock, after.map_or(0, |stamp| stamp.id))?;
        let projector = X11Projector::open(&self.projector, helper, clock)?;
        Ok(Devices { projector: Box::new(projector), camera, clock: Box::new(clock) })
    }

    /// The abilities that a machine vision camera states, in words. `None`: the camera is of another kind. A camera's description is an
    /// untrusted program in XML. A process of `helper` reads the description in at most 15 s and 1 GiB of address space, so a harmful
    /// description can end only that process.
    ///
    /// # Errors
    /// [`Error::Rig`] when the camera does not answer, or when its description cannot be read within these bounds.
    pub fn camera_abilities(&self, helper: &Helper) -> Result<Option<String>> {
        match &self.camera {
            CameraSpec::Genicam(spec) if spec.kind.is_built() => {
                Ok(Some(attached::ask(helper, spec.kind, spec.address_or_serial().as_deref())?.to_string()))
            }
            // This camera has no description, or this program does not support it.
            _ => Ok(None),
        }
    }

    /// Opens only the camera, whose description [`Self::camera_abilities`] must have read before.
    pub(crate) fn open_checked_camera(&self) -> Result<Box<dyn Camera>> {
        camera(&self.camera, WallClock::starting_at(0.0), 0)
    }

    /// Opens only the camera, as [`Self::open`] does.
    pub fn open_camera(&self, helper: &Helper) -> Result<Box<dyn Camera>> {
        self.camera_abilities(helper)?;
        self.open_checked_camera()
    }

    /// Opens only the projector, which then shows level 0.
    pub fn open_projector(&self, helper: &Helper) -> Result<X11Projector> {
        X11Projector::open(&self.projector, helper, WallClock::starting_at(0.0))
    }
}

fn camera(spec: &CameraSpec, clock: WallClock, after: u64) -> Result<Box<dyn Camera>> {
    Ok(match spec {
        #[cfg(feature = "gige")]
        CameraSpec::Genicam(spec) if spec.kind == super::CameraKind::Gige => {
            Box::new(super::GigeVision::open(spec, clock, after)?)
        }
        #[cfg(feature = "usb3")]
        CameraSpec::Genicam(spec) if spec.kind == super::CameraKind::Usb3 => {
            Box::new(super::Usb3Vision::open(spec, clock, after)?)
        }
        CameraSpec::Genicam(spec) => return Err(spec.kind.not_built()),
        #[cfg(feature = "v4l")]
        CameraSpec::V4l(spec) => Box::new(super::V4l::open(spec, clock, after)?),
        #[cfg(not(feature = "v4l"))]
        CameraSpec::V4l(spec) => return Err(spec.kind.not_built()),
        CameraSpec::Gphoto2(spec) => Box::new(Gphoto2::open(spec, clock, after)?),
    })
}

/// A description of a program's devices, from a rig file with `kind = "program"`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ProgramRig {
    /// The projector.
    pub projector: ProgramProjector,
    /// The camera.
    pub camera: ProgramCamera,
}

/// A description of a program's projector.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ProgramProjector {
    /// The projector's name, which is part of every photo's key in a journal.
    #[serde(default = "projector_name")]
    pub name: String,
    /// Width and height in pixels.
    pub size: [usize; 2],
    /// 1 (gray) or 3.
    #[serde(default = "number::<1, _>")]
    pub channels: usize,
    /// Bits of a level, 1 to 16.
    #[serde(default = "number::<8, _>")]
    pub bits: u32,
    /// Seconds from one refresh to the next. 0: the projector's light is steady.
    #[serde(default)]
    pub frame_time: f64,
}

/// A description of a program's camera.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ProgramCamera {
    /// The camera's name, which is part of every photo's key in a journal.
    #[serde(default = "camera_name")]
    pub name: String,
    /// Width and height in pixels.
    pub size: [usize; 2],
    /// 1 (mono) or 3.
    #[serde(default = "number::<1, _>")]
    pub channels: usize,
    /// Bits of a count, 1 to 16.
    #[serde(default = "number::<8, _>")]
    pub bits: u32,
    /// The shortest and the longest exposure in seconds.
    pub exposures: [f64; 2],
}

fn projector_name() -> String {
    "projector".into()
}

fn camera_name() -> String {
    "camera".into()
}

impl ProgramRig {
    /// The projector's properties.
    pub fn projector_info(&self) -> ProjectorInfo {
        let ProgramProjector { name, size: [width, height], channels, bits, frame_time } =
            self.projector.clone();
        ProjectorInfo { name, resolution: Resolution::new(width, height), channels, bits, frame_time }
    }

    /// The camera's properties.
    pub fn camera_info(&self) -> CameraInfo {
        let ProgramCamera { name, size: [width, height], channels, bits, exposures } = self.camera.clone();
        CameraInfo { name, resolution: Resolution::new(width, height), channels, bits, exposures }
    }
}

/// Opens the devices of a program. Copies open the same devices.
#[derive(Clone)]
pub struct DeviceOpener(Arc<Mutex<OpenDevices>>);

type OpenDevices = dyn FnMut(Option<Stamp>) -> Result<Devices> + Send;

impl DeviceOpener {
    /// An opener that calls `open` with the stamp of an earlier session's last frame, if any. Time and frame numbers continue after that
    /// frame.
    pub fn new(open: impl FnMut(Option<Stamp>) -> Result<Devices> + Send + 'static) -> Self {
        Self(Arc::new(Mutex::new(open)))
    }

    /// Opens the devices.
    pub fn open(&self, after: Option<Stamp>) -> Result<Devices> {
        let mut open = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        (*open)(after)
    }

    pub(crate) fn missing() -> Error {
        Error::rig("rig", "its devices are those of a program, which has not handed them over")
            .help("open the rig by that program, or ask the folder of one of its runs")
    }
}

impl fmt::Debug for DeviceOpener {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("DeviceOpener")
    }
}

/// Parts of messages that report a busy device without an error code: nusb ("interface is busy"), gphoto2 ("Could not claim the USB
/// device").
const WORDS: [&str; 3] = ["is busy", "resource busy", "could not claim"];

pub(crate) fn causes<'a>(why: &'a (dyn Why + 'static)) -> impl Iterator<Item = &'a (dyn Why + 'static)> {
    let mut next = Some(why);
    std::iter::from_fn(move || {
        let why = next?;
        next = why.source();
        Some(why)
    })
}

/// Whether an error or one of its causes says that another program has opened the device.
pub(crate) fn is_busy(why: &(dyn Why + 'static)) -> bool {
    causes(why).any(|why| {
        let text = why.to_string().to_lowercase();
        let code = why.downcast_ref::<io::Error>().map(io::Error::kind);
        code == Some(ErrorKind::ResourceBusy) || WORDS.iter().any(|words| text.contains(words))
    })
}

/// The error of a camera that another program has opened. `place` is for example `at 192.168.1.20`.
pub(crate) fn in_use(place: &str) -> Error {
    camera_fault(
        format!("the camera {place} is in use by another program"),
        "end that program: the maker's viewer, a video call, a desktop that has mounted the camera, another krylux; after a crash the camera is free \
         again in a few seconds",
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, thiserror::Error)]
    #[error("claim the control interface (0)")]
    struct Caused(#[source] io::Error);

    #[test]
    fn a_busy_device_is_known_by_its_code_or_by_words_of_the_cause() {
        let busy = |why: io::Error| is_busy(&Caused(why));
        assert!(busy(ErrorKind::ResourceBusy.into()));
        assert!(busy(io::Error::other("interface is busy (error 16)")));
        assert!(busy(io::Error::other(
            "*** Error ***\nAn error occurred in the io-library ('Could not claim the USB device'): …"
        )));
        for kind in [ErrorKind::TimedOut, ErrorKind::PermissionDenied, ErrorKind::NotFound] {
            assert!(!busy(kind.into()), "{kind}");
        }
        #[cfg(target_os = "linux")]
        assert!(busy(io::Error::from_raw_os_error(16)), "EBUSY");
    }

    #[test]
    fn a_description_gives_the_properties_of_both_devices() {
        let text = "[projector]\nsize = [8, 6]\n[camera]\nname = \"mine\"\nsize = [16, 12]\nbits = 12\nexposures = [1e-4, 1.0]\n";
        let rig: ProgramRig = toml::from_str(text).unwrap_or_else(|error| unreachable!("{error}"));
        let (projector, camera) = (rig.projector_info(), rig.camera_info());
        assert_eq!(
            (projector.name.as_str(), projector.resolution, projector.bits),
            ("projector", Resolution::new(8, 6), 8)
        );
        assert_eq!(
            (camera.name.as_str(), camera.resolution, camera.bits),
            ("mine", Resolution::new(16, 12), 12)
        );
        assert_eq!((projector.channels, camera.channels, camera.exposures), (1, 1, [1e-4, 1.0]));
    }

    #[test]
    fn errors_of_the_program_come_out_of_its_opener() {
        let opener = DeviceOpener::new(|_| Err(DeviceOpener::missing()));
        let said = opener.clone().open(None).err().map(|error| error.to_string());
        assert!(said.is_some_and(|said| said.contains("not handed them over")));
    }
}
