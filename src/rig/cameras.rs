//! The kinds of cameras, and the description of each in a rig file.

use serde::Deserialize;

use super::{CameraInfo, GigeSpec, Gphoto2Spec, Usb3Spec, V4lSpec};

/// The kinds of cameras.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum CameraKind {
    /// A GigE Vision camera.
    Gige,
    /// A USB3 Vision camera.
    Usb3,
    /// A camera of Linux's video interface.
    V4l,
    /// A still camera that the program `gphoto2` drives.
    Gphoto2,
}

/// The description of a camera of any kind.
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
    /// The camera's properties.
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

/// The default range of exposures, in seconds, which most machine vision cameras have.
pub(super) fn exposures() -> [f64; 2] {
    [1e-4, 1.0]
}

/// The default time in seconds to wait for a frame beyond its exposure.
pub(super) fn timeout() -> f64 {
    1.0
}

/// The error where krylux was built without support for a kind of camera.
#[cfg(not(all(feature = "gige", feature = "usb3", feature = "v4l")))]
pub(super) fn not_built(what: &str, feature: &str) -> crate::Error {
    super::camera_fault(
        format!("this krylux was built without {what}"),
        format!("build it with --features {feature}"),
    )
}
