//! Which kinds of cameras there are, and what a rig file says of each.

use serde::Deserialize;

use super::{CameraInfo, GigeSpec, Gphoto2Spec, Usb3Spec, V4lSpec};

/// Kinds of cameras.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum CameraKind {
    /// One that speaks GigE Vision.
    Gige,
    /// One that speaks USB3 Vision.
    Usb3,
    /// One behind Linux's video interface.
    V4l,
    /// A still camera that the program `gphoto2` drives.
    Gphoto2,
}

/// What is written about a camera.
#[derive(Clone, Debug, PartialEq)]
pub enum CameraSpec {
    /// See [`GigeSpec`].
    Gige(GigeSpec),
    /// See [`Usb3Spec`].
    Usb3(Usb3Spec),
    /// See [`V4lSpec`].
    V4l(V4lSpec),
    /// See [`Gphoto2Spec`].
    Gphoto2(Gphoto2Spec),
}

impl CameraSpec {
    /// The camera, as it presents itself.
    pub fn info(&self) -> CameraInfo {
        match self {
            Self::Gige(spec) => spec.info(),
            Self::Usb3(spec) => spec.info(),
            Self::V4l(spec) => spec.info(),
            Self::Gphoto2(spec) => spec.info(),
        }
    }
}

impl From<GigeSpec> for CameraSpec {
    fn from(spec: GigeSpec) -> Self {
        Self::Gige(spec)
    }
}

impl From<Usb3Spec> for CameraSpec {
    fn from(spec: Usb3Spec) -> Self {
        Self::Usb3(spec)
    }
}

impl From<V4lSpec> for CameraSpec {
    fn from(spec: V4lSpec) -> Self {
        Self::V4l(spec)
    }
}

impl From<Gphoto2Spec> for CameraSpec {
    fn from(spec: Gphoto2Spec) -> Self {
        Self::Gphoto2(spec)
    }
}

/// The exposures of a machine vision camera that most can do, in seconds.
pub(super) fn exposures() -> [f64; 2] {
    [1e-4, 1.0]
}

/// Seconds beyond the exposure after which a frame that does not come is given up.
pub(super) fn timeout() -> f64 {
    1.0
}

/// The error where krylux was built without a kind.
#[cfg(not(all(feature = "gige", feature = "usb3", feature = "v4l")))]
pub(crate) fn left_out(what: &str, feature: &str) -> crate::Error {
    super::camera_fault(
        format!("this krylux was built without {what}"),
        format!("build it with --features {feature}"),
    )
}
