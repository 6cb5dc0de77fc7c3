//! A rig of real devices: a projector that is a monitor of an X server, and a camera.

use super::x11::{Helper, X11Projector, X11Spec};
use super::{Camera, CameraInfo, CameraSpec, Devices, Gphoto2, ProjectorInfo, Stamp, WallClock};
use crate::error::Result;

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

    /// Opens projector and camera, the projector's window in a process of `helper`. With `after`, the last frame of an earlier session,
    /// time and frame numbers continue from there.
    ///
    /// # Errors
    /// [`Error::Rig`](crate::Error::Rig) when a device is missing, is in use, or cannot do what its description says.
    pub fn open(&self, helper: &Helper, after: Option<Stamp>) -> Result<Devices> {
        let clock = WallClock::starting_at(after.map_or(0.0, |stamp| stamp.time));
        let camera = camera(&self.camera, clock, after.map_or(0, |stamp| stamp.id))?;
        let projector = X11Projector::open(&self.projector, helper, clock)?;
        Ok(Devices { projector: Box::new(projector), camera, clock: Box::new(clock) })
    }

    /// Opens only the camera.
    ///
    /// # Errors
    /// As [`Self::open`].
    pub fn open_camera(&self) -> Result<Box<dyn Camera>> {
        camera(&self.camera, WallClock::starting_at(0.0), 0)
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
