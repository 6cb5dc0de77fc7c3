//! A machine vision camera on USB 3: USB3 Vision (feature `usb3`). This driver has not been tried on hardware. [`super::genicam`] contains
//! and tests the functions shared with GigE Vision.

#[cfg(test)]
mod tests;

use std::time::Duration;

use serde_json::json;
use viva_genicam::u3v::{NusbTransfer, U3vDeviceInfo, U3vStreamOptions, UsbTransfer, discover};
use viva_genicam::{Camera as Described, Frame, U3vFrameStream, U3vRegisterIo, connect_u3v};

use super::genicam::{Answered, TransportLayer, Triggered};
use super::hardware::{in_use, is_busy};
use super::{Abilities, AttachedCamera, CameraKind, GenicamSpec, Losses, WallClock, camera_fault};
use crate::error::Result;

/// A USB3 Vision camera.
pub type Usb3Vision = Triggered<OnUsb<GenicamSpec>>;

impl Usb3Vision {
    /// Opens the camera. The times of frames are read from `clock`, and their numbers begin at `after + 1`.
    ///
    /// # Errors
    /// [`Error::Rig`](crate::Error::Rig) when the camera is not plugged in, another program holds it, or it cannot do what `spec` says.
    pub fn open(spec: &GenicamSpec, clock: WallClock, after: u64) -> Result<Self> {
        Self::start(OnUsb(spec.clone()), spec, clock, after)
    }
}

/// The USB3 Vision protocol over a real or simulated port.
pub struct OnUsb<P>(pub(crate) P);

impl<P: Port> TransportLayer for OnUsb<P> {
    type Registers = U3vRegisterIo<P::Wire>;
    type Stream = U3vFrameStream;

    fn place(&self) -> String {
        self.0.place()
    }

    fn connect(&self) -> Result<Described<Self::Registers>> {
        self.0.open()
    }

    fn stream(&self, camera: &mut Described<Self::Registers>) -> Answered<U3vFrameStream> {
        camera.open_stream(U3vStreamOptions::default())
    }

    fn next(stream: &mut U3vFrameStream, patience: Duration) -> Answered<Option<Frame>> {
        stream.next_frame_blocking(patience)
    }

    fn number(frame: &Frame) -> u64 {
        // The camera's first frame has the number 0.
        frame.block_id + 1
    }

    fn losses(stream: &U3vFrameStream) -> Losses {
        let stats = stream.stats();
        Losses { resent: 0, incomplete: stats.frames_incomplete, missing: stats.packets_missing }
    }
}

/// Finds the plugged-in USB3 Vision cameras without opening them.
pub(crate) fn usb_cameras() -> Result<Vec<AttachedCamera>> {
    let camera = |device: U3vDeviceInfo| {
        let names = [device.serial, device.manufacturer, device.model];
        let speed = device.speed.map(|speed| speed.to_string());
        let [serial, maker, model] = names.each_ref().map(|name| name.as_deref().unwrap_or("?"));
        let at = speed.as_ref().map_or_else(String::new, |speed| format!(", at {speed}"));
        let line = format!("{serial}: {maker} {model}{at}");
        let facts = json!({ "serial": names[0], "maker": names[1], "model": names[2], "speed": speed });
        let [serial, ..] = names;
        AttachedCamera::new(CameraKind::Usb3, serial, line, facts)
    };
    Ok(devices()?.into_iter().map(camera).collect())
}

/// Opens the camera with this serial number (`None`: the only camera), reads its abilities, and closes it.
///
/// # Errors
/// [`Error::Rig`](crate::Error::Rig) when the camera is not plugged in, or another program holds it.
pub fn usb_camera_abilities(serial: Option<&str>) -> Result<Abilities> {
    let spec = GenicamSpec { serial: serial.map(str::to_owned), ..GenicamSpec::usb3(1, 1) };
    Ok(Abilities::of(&spec.open()?))
}

/// A real or simulated port, through which a camera is opened.
pub trait Port: Send {
    /// The transfer of bytes to the camera and back.
    type Wire: UsbTransfer + 'static;

    /// The camera's place in errors, for example `on USB`.
    fn place(&self) -> String;

    /// Opens the camera.
    fn open(&self) -> Result<Described<U3vRegisterIo<Self::Wire>>>;
}

impl Port for GenicamSpec {
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

pub(crate) fn devices() -> Result<Vec<U3vDeviceInfo>> {
    discover().map_err(|why| {
        camera_fault(
            format!("USB cameras cannot be searched for: {why}"),
            "check that the computer has USB, and that /sys is mounted",
        )
    })
}

fn choose(mut devices: Vec<U3vDeviceInfo>, serial: Option<&str>) -> Result<U3vDeviceInfo> {
    let known: Vec<String> =
        devices.iter().map(|device| device.serial.clone().unwrap_or_else(|| "?".into())).collect();
    if let Some(serial) = serial {
        devices.retain(|device| device.serial.as_deref() == Some(serial));
    }
    match (devices.len(), serial) {
        (1, _) => Ok(devices.remove(0)),
        (0, None) => Err(camera_fault(
            "no USB3 Vision camera is plugged in",
            "check its cable and power; `krylux rig list` names the cameras that are plugged in",
        )),
        (0, Some(serial)) => Err(camera_fault(
            format!("no USB3 Vision camera has the serial number {serial}"),
            if known.is_empty() {
                "none is plugged in: check its cable and power".into()
            } else {
                format!("there are {}: correct serial in [camera]", known.join(", "))
            },
        )),
        (count, _) => Err(camera_fault(
            format!("{count} USB3 Vision cameras are plugged in"),
            format!("give serial in [camera]: {}", known.join(", ")),
        )),
    }
}
