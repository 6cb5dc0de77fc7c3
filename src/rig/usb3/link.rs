//! A session with a camera on USB.

use std::time::Duration;

use viva_genicam::u3v::U3vStreamOptions;
use viva_genicam::{Camera as Described, Frame, GenicamError, U3vFrameStream, U3vRegisterIo};

use super::Usb3Spec;
use super::port::Port;
use crate::error::Result;
use crate::rig::genicam::{Transport, Triggered};
use crate::rig::{Camera, CameraInfo, RawFrame, WallClock};

/// A USB3 Vision camera.
pub struct Usb3Vision(Triggered<OnUsb<Usb3Spec>>);

impl Usb3Vision {
    /// Opens the camera. Times are told by `clock`; frames are numbered from past `after` on.
    ///
    /// # Errors
    /// [`Error::Rig`](crate::Error::Rig) when it is not plugged in, another program holds it, or it cannot do what `spec` says.
    pub fn open(spec: &Usb3Spec, clock: WallClock, after: u64) -> Result<Self> {
        Triggered::open(OnUsb(spec.clone()), spec.settings(), spec.info(), clock, after).map(Self)
    }
}

impl Camera for Usb3Vision {
    fn info(&self) -> &CameraInfo {
        self.0.info()
    }

    fn configure(&mut self, exposure: f64) -> Result<f64> {
        self.0.configure(exposure)
    }

    fn capture(&mut self) -> Result<Option<RawFrame>> {
        self.0.capture()
    }

    fn restart(&mut self) -> Result<()> {
        self.0.restart()
    }
}

/// The protocol, on whatever carries its bytes.
pub(super) struct OnUsb<P>(pub(super) P);

impl<P: Port> Transport for OnUsb<P> {
    type Registers = U3vRegisterIo<P::Wire>;
    type Stream = U3vFrameStream;

    fn place(&self) -> String {
        self.0.place()
    }

    fn connect(&self) -> Result<Described<Self::Registers>> {
        self.0.open()
    }

    fn stream(
        &self,
        camera: &mut Described<Self::Registers>,
    ) -> std::result::Result<U3vFrameStream, GenicamError> {
        camera.open_stream(U3vStreamOptions::default())
    }

    fn next(
        stream: &mut U3vFrameStream,
        patience: Duration,
    ) -> std::result::Result<Option<Frame>, GenicamError> {
        stream.next_frame_blocking(patience)
    }

    fn number(frame: &Frame) -> u64 {
        // Their first is 0.
        frame.block_id + 1
    }

    fn resent(_: &U3vFrameStream) -> u64 {
        // Nothing is lost on USB but whole frames.
        0
    }
}
