//! The session with a USB3 Vision camera.

use std::time::Duration;

use viva_genicam::u3v::U3vStreamOptions;
use viva_genicam::{Camera as Described, Frame, GenicamError, U3vFrameStream, U3vRegisterIo};

use super::Usb3Spec;
use super::port::Port;
use crate::error::Result;
use crate::rig::genicam::{Transport, Triggered};
use crate::rig::{Camera, CameraInfo, Losses, RawFrame, WallClock};

/// A USB3 Vision camera.
pub struct Usb3Vision(Triggered<OnUsb<Usb3Spec>>);

impl Usb3Vision {
    /// Opens the camera. Frames carry the times of `clock`, and numbers from `after + 1` on.
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

    fn losses(&self) -> Losses {
        self.0.losses()
    }
}

/// The USB3 Vision protocol over a port, which is real or simulated.
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
        // The camera's first frame has the number 0.
        frame.block_id + 1
    }

    fn losses(stream: &U3vFrameStream) -> Losses {
        let stats = stream.stats();
        Losses { resent: 0, incomplete: stats.frames_incomplete, missing: stats.packets_missing }
    }
}
