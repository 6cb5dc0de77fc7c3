//! Which cameras there are.

use viva_genicam::u3v::U3vDeviceInfo;

use super::Usb3Spec;
use super::port::{Port, devices};
use crate::error::Result;
use crate::rig::genicam::Abilities;

/// A USB3 Vision camera that is plugged in.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct FoundUsbCamera {
    /// Its serial number, as far as it says.
    pub serial: Option<String>,
    /// Who made it, as far as it says.
    pub maker: Option<String>,
    /// What it is called.
    pub model: Option<String>,
    /// How fast it is connected.
    pub speed: Option<String>,
}

/// The USB3 Vision cameras that are plugged in. None is opened for that.
///
/// # Errors
/// [`Error::Rig`](crate::Error::Rig) when the system does not tell what is plugged in.
pub fn usb_cameras() -> Result<Vec<FoundUsbCamera>> {
    let camera = |device: U3vDeviceInfo| FoundUsbCamera {
        serial: device.serial,
        maker: device.manufacturer,
        model: device.model,
        speed: device.speed.map(|speed| speed.to_string()),
    };
    Ok(devices()?.into_iter().map(camera).collect())
}

/// What the camera of this serial number (none: the only one) can do. It is opened for that, and let go.
///
/// # Errors
/// [`Error::Rig`](crate::Error::Rig) when it is not there, or another program holds it.
pub fn usb_camera_abilities(serial: Option<&str>) -> Result<Abilities> {
    let spec = Usb3Spec { serial: serial.map(str::to_owned), ..Usb3Spec::new(1, 1) };
    Ok(Abilities::of(&spec.open()?))
}
