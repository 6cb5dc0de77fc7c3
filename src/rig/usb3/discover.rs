//! The search for cameras.

use viva_genicam::u3v::U3vDeviceInfo;

use super::Usb3Spec;
use super::port::{Port, devices};
use crate::error::Result;
use crate::rig::genicam::Abilities;

/// A USB3 Vision camera that is plugged in.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct FoundUsbCamera {
    /// The serial number, if the camera says.
    pub serial: Option<String>,
    /// The maker, if the camera says.
    pub maker: Option<String>,
    /// The model, if the camera says.
    pub model: Option<String>,
    /// The speed of the connection, if known.
    pub speed: Option<String>,
}

/// Finds the USB3 Vision cameras that are plugged in, without opening them.
///
/// # Errors
/// [`Error::Rig`](crate::Error::Rig) when the system does not list its USB devices.
pub fn usb_cameras() -> Result<Vec<FoundUsbCamera>> {
    let camera = |device: U3vDeviceInfo| FoundUsbCamera {
        serial: device.serial,
        maker: device.manufacturer,
        model: device.model,
        speed: device.speed.map(|speed| speed.to_string()),
    };
    Ok(devices()?.into_iter().map(camera).collect())
}

/// Opens the camera with this serial number (`None`: the only camera), reads what it can do, and closes it.
///
/// # Errors
/// [`Error::Rig`](crate::Error::Rig) when it is not plugged in, or another program holds it.
pub fn usb_camera_abilities(serial: Option<&str>) -> Result<Abilities> {
    let spec = Usb3Spec { serial: serial.map(str::to_owned), ..Usb3Spec::new(1, 1) };
    Ok(Abilities::of(&spec.open()?))
}
