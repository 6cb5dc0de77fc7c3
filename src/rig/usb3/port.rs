//! The USB port of a camera: finding the camera and opening it.

use viva_genicam::u3v::{NusbTransfer, U3vDeviceInfo, UsbTransfer, discover};
use viva_genicam::{Camera as Described, U3vRegisterIo, connect_u3v};

use super::Usb3Spec;
use crate::error::{Error, Result};
use crate::rig::busy::{in_use, is_busy};
use crate::rig::camera_fault;

/// A way to open a camera.
pub(super) trait Port: Send {
    /// The transfer of bytes to the camera and back.
    type Wire: UsbTransfer + 'static;

    /// Where the camera is, for errors, e.g. `on USB`.
    fn place(&self) -> String;

    /// Opens the camera.
    fn open(&self) -> Result<Described<U3vRegisterIo<Self::Wire>>>;
}

impl Port for Usb3Spec {
    type Wire = NusbTransfer;

    fn place(&self) -> String {
        self.serial.as_ref().map_or_else(|| "on USB".into(), |serial| format!("with serial number {serial}"))
    }

    fn open(&self) -> Result<Described<U3vRegisterIo<NusbTransfer>>> {
        let device = choose(devices()?, self.serial.as_deref())?;
        connect_u3v(&device).map_err(|why| match is_busy(&why) {
            true => in_use(&self.place()),
            false => camera_fault(
                format!("the camera {} cannot be opened: {why}", self.place()),
                "the user needs the right to write to the device under /dev/bus/usb (a udev rule, mostly the maker's), and no other program may \
                 have it open",
            ),
        })
    }
}

/// Lists the cameras that are plugged in.
pub(super) fn devices() -> Result<Vec<U3vDeviceInfo>> {
    discover().map_err(|why| {
        camera_fault(
            format!("USB cameras cannot be searched for: {why}"),
            "check that the computer has USB, and that /sys is mounted",
        )
    })
}

/// Chooses the camera with this serial number, or the only one.
fn choose(mut devices: Vec<U3vDeviceInfo>, serial: Option<&str>) -> Result<U3vDeviceInfo> {
    let known: Vec<String> =
        devices.iter().map(|device| device.serial.clone().unwrap_or_else(|| "?".into())).collect();
    if let Some(serial) = serial {
        devices.retain(|device| device.serial.as_deref() == Some(serial));
    }
    let refused = |fault: String, help: String| -> Error { camera_fault(fault, help) };
    match (devices.len(), serial) {
        (1, _) => Ok(devices.remove(0)),
        (0, None) => Err(refused(
            "no USB3 Vision camera is plugged in".into(),
            "check its cable and power; `krylux rig list` names the cameras that are plugged in".into(),
        )),
        (0, Some(serial)) => Err(refused(
            format!("no USB3 Vision camera has the serial number {serial}"),
            if known.is_empty() {
                "none is plugged in: check its cable and power".into()
            } else {
                format!("there are {}: correct serial in [camera]", known.join(", "))
            },
        )),
        (count, _) => Err(refused(
            format!("{count} USB3 Vision cameras are plugged in"),
            format!("give serial in [camera]: {}", known.join(", ")),
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn device(serial: &str) -> U3vDeviceInfo {
        U3vDeviceInfo {
            bus: "1".into(),
            address: 4,
            vendor_id: 1,
            product_id: 2,
            serial: Some(serial.into()),
            manufacturer: None,
            model: None,
            speed: None,
        }
    }

    #[test]
    fn a_camera_is_chosen_by_its_serial_number_or_because_it_is_the_only_one() {
        let both = || vec![device("A1"), device("B2")];
        let of = |devices, serial| choose(devices, serial).map(|device| device.serial);
        let refused = |devices, serial| of(devices, serial).expect_err("it is refused").to_string();
        assert_eq!(of(both(), Some("B2")).expect("it is there"), Some("B2".into()));
        assert_eq!(of(vec![device("A1")], None).expect("the only one"), Some("A1".into()));
        assert!(refused(both(), None).contains("give serial in [camera]: A1, B2"));
        assert!(refused(both(), Some("C3")).contains("no USB3 Vision camera has the serial number C3"));
        assert!(refused(both(), Some("C3")).contains("there are A1, B2"));
        assert!(refused(Vec::new(), None).contains("no USB3 Vision camera is plugged in"));
    }
}
