//! A rig of real devices: a projector that is a monitor of an X server, and a camera.

use super::x11::{Helper, X11Projector, X11Spec};
#[cfg(any(feature = "gige", feature = "usb3"))]
use super::{Abilities as Described, describe};
use super::{Camera, CameraInfo, CameraSpec, Devices, Gphoto2, ProjectorInfo, Stamp, WallClock};
use crate::error::Result;

/// Without features for machine vision cameras none describes itself.
#[cfg(not(any(feature = "gige", feature = "usb3")))]
type Described = String;

/// A description of a rig of real devices.
#[derive(Clone, Debug, PartialEq)]
pub struct HardwareRig {
    /// The projector.
    pub projector: X11Spec,
    /// The camera.
    pub camera: CameraSpec,
}

impl HardwareRig {
    /// The projector's properties.
    pub fn projector_info(&self) -> ProjectorInfo {
        self.projector.info()
    }

    /// The camera's properties.
    pub fn camera_info(&self) -> CameraInfo {
        self.camera.info()
    }

    /// Opens projector and camera, the projector's window in a process of `helper`, after another such process has read what the camera says of
    /// itself ([`Self::camera_abilities`]). With `after`, the last frame of an earlier session,
    /// time and frame numbers continue from there.
    ///
    /// # Errors
    /// [`Error::Rig`](crate::Error::Rig) when a device is missing, is in use, or cannot do what its description says.
    pub fn open(&self, helper: &Helper, after: Option<Stamp>) -> Result<Devices> {
        let clock = WallClock::starting_at(after.map_or(0.0, |stamp| stamp.time));
        self.camera_abilities(helper)?;
        let camera = camera(&self.camera, clock, after.map_or(0, |stamp| stamp.id))?;
        let projector = X11Projector::open(&self.projector, helper, clock)?;
        Ok(Devices { projector: Box::new(projector), camera, clock: Box::new(clock) })
    }

    /// What a machine vision camera says that it can do, in words; `None` of other cameras. Its description is a stranger's program in XML: it is read by a
    /// process of `helper`, in at most 15 s and 1 GiB of address space, and can end only that process.
    ///
    /// # Errors
    /// [`Error::Rig`](crate::Error::Rig) when it does not answer, or when its description cannot be read within these bounds.
    pub fn camera_abilities(&self, helper: &Helper) -> Result<Option<String>> {
        let described = match &self.camera {
            #[cfg(feature = "gige")]
            CameraSpec::Gige(spec) => Some(describe::ask(helper, "gige", Some(&spec.address.to_string()))?),
            #[cfg(feature = "usb3")]
            CameraSpec::Usb3(spec) => Some(describe::ask(helper, "usb3", spec.serial.as_deref())?),
            // It has no description, or it cannot be opened at all.
            _ => None::<Described>,
        };
        Ok(described.map(|abilities| abilities.to_string()))
    }

    /// Opens only the camera, whose description was read before by [`Self::camera_abilities`].
    ///
    /// # Errors
    /// As [`Self::open`].
    pub(crate) fn open_checked_camera(&self) -> Result<Box<dyn Camera>> {
        camera(&self.camera, WallClock::starting_at(0.0), 0)
    }

    /// Opens only the camera, as [`Self::open`] does.
    ///
    /// # Errors
    /// As [`Self::open`].
    pub fn open_camera(&self, helper: &Helper) -> Result<Box<dyn Camera>> {
        self.camera_abilities(helper)?;
        self.open_checked_camera()
    }

    /// Opens only the projector, which then shows level 0.
    ///
    /// # Errors
    /// As [`Self::open`].
    pub fn open_projector(&self, helper: &Helper) -> Result<X11Projector> {
        X11Projector::open(&self.projector, helper, WallClock::starting_at(0.0))
    }
}

/// Opens the camera.
fn camera(spec: &CameraSpec, clock: WallClock, after: u64) -> Result<Box<dyn Camera>> {
    Ok(match spec {
        #[cfg(feature = "gige")]
        CameraSpec::Gige(spec) => Box::new(super::GigeVision::open(spec, clock, after)?),
        #[cfg(feature = "usb3")]
        CameraSpec::Usb3(spec) => Box::new(super::Usb3Vision::open(spec, clock, after)?),
        #[cfg(feature = "v4l")]
        CameraSpec::V4l(spec) => Box::new(super::V4l::open(spec, clock, after)?),
        CameraSpec::Gphoto2(spec) => Box::new(Gphoto2::open(spec, clock, after)?),
        #[cfg(not(feature = "gige"))]
        CameraSpec::Gige(_) => return Err(super::not_built("GigE Vision", "gige")),
        #[cfg(not(feature = "usb3"))]
        CameraSpec::Usb3(_) => return Err(super::not_built("USB3 Vision", "usb3")),
        #[cfg(not(feature = "v4l"))]
        CameraSpec::V4l(_) => return Err(super::not_built("cameras of Linux's video interface", "v4l")),
    })
}
