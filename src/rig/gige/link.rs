//! The session with a GigE Vision camera.

use std::time::{Duration, Instant};

use viva_genicam::gige::GigeError;
use viva_genicam::{
    Camera as Described, Frame, FrameStream, GenicamError, GigeRegisterIo, StreamOptions, blocking,
};

use super::GigeSpec;
use crate::error::Result;
use crate::rig::busy::{causes, in_use};
use crate::rig::genicam::{Transport, Triggered, said};
use crate::rig::{Camera, CameraInfo, Losses, RawFrame, WallClock, camera_fault};

/// How long to wait for a camera that does not answer or is held. After a session that ended abruptly, the camera is free once its
/// heartbeat of 3 s has run out.
const PATIENCE: Duration = Duration::from_secs(5);

/// The GigE Vision status of a camera that another program holds.
const ACCESS_DENIED: u16 = 0x8006;

/// How long to wait for the answer to one request.
pub(super) const ANSWER: Duration = Duration::from_millis(500);

/// A GigE Vision camera.
pub struct GigeVision(Triggered<GigeSpec>);

impl GigeVision {
    /// Opens the camera. Frames carry the times of `clock`, and numbers from `after + 1` on.
    ///
    /// # Errors
    /// [`Error::Rig`](crate::Error::Rig) when no camera answers there, another program holds it, or it cannot do what `spec` says.
    pub fn open(spec: &GigeSpec, clock: WallClock, after: u64) -> Result<Self> {
        Triggered::open(spec.clone(), spec.settings(), spec.info(), clock, after).map(Self)
    }
}

impl Camera for GigeVision {
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

impl Transport for GigeSpec {
    type Registers = GigeRegisterIo;
    type Stream = FrameStream;

    fn place(&self) -> String {
        format!("at {}", self.address)
    }

    fn connect(&self) -> Result<Described<GigeRegisterIo>> {
        let began = Instant::now();
        loop {
            let found = blocking::discover_ip(self.address, ANSWER);
            let why = match found.map_err(|why| said(&self.place(), "answer", &why))? {
                None => camera_fault(
                    format!("no GigE Vision camera answers at {}", self.address),
                    "check its power, its cable and its address; the network must be the computer's own; go on with --resume",
                ),
                Some(device) => match blocking::connect(&device) {
                    Ok(camera) => return Ok(camera),
                    Err(why) if is_denied(&why) => in_use(&self.place()),
                    Err(why) => said(&self.place(), "be opened", &why),
                },
            };
            if began.elapsed() >= PATIENCE {
                return Err(why);
            }
            std::thread::sleep(Duration::from_millis(100));
        }
    }

    fn stream(
        &self,
        camera: &mut Described<GigeRegisterIo>,
    ) -> std::result::Result<FrameStream, GenicamError> {
        let options = StreamOptions::new();
        camera.open_stream(match self.packet_size {
            Some(size) => options.packet_size(size),
            None => options,
        })
    }

    fn next(
        stream: &mut FrameStream,
        patience: Duration,
    ) -> std::result::Result<Option<Frame>, GenicamError> {
        stream.next_frame_blocking(patience)
    }

    fn number(frame: &Frame) -> u64 {
        frame.block_id
    }

    fn losses(stream: &FrameStream) -> Losses {
        let stats = stream.stats();
        Losses {
            resent: stats.resend_recovered,
            incomplete: stats.frames_incomplete,
            missing: stats.packets_missing,
        }
    }
}

/// Whether the camera refuses because another program controls it. One that is held exclusively refuses to be read, too, as its description is.
pub(super) fn is_denied(why: &GenicamError) -> bool {
    causes(why).any(|why| {
        matches!(why.downcast_ref(), Some(GigeError::Status(status)) if status.to_raw() == ACCESS_DENIED)
    })
}
