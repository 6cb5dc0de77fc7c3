//! A machine vision camera that is triggered by software: each trigger gives one frame, which has a number and a time.

use std::time::Duration;

use viva_genicam::genapi::RegisterIo;
use viva_genicam::{Camera as Described, Frame, GenicamError};

use super::anchor::Anchor;
use super::numbers::Numbers;
use super::set_up::{said, set_exposure, set_up};
use super::settings::Settings;
use crate::error::Result;
use crate::machine;
use crate::rig::{Camera, CameraInfo, Losses, RawFrame, WallClock, camera_fault};

/// The transport layer of a camera: GigE Vision or USB3 Vision.
pub(in crate::rig) trait Transport: Send {
    /// The access to the camera's registers.
    type Registers: RegisterIo + Send;
    /// The stream of frames.
    type Stream: Send;

    /// Where the camera is, e.g. `at 192.168.1.20`.
    fn place(&self) -> String;

    /// Opens the camera.
    fn connect(&self) -> Result<Described<Self::Registers>>;

    /// Opens the stream of frames.
    fn stream(
        &self,
        camera: &mut Described<Self::Registers>,
    ) -> std::result::Result<Self::Stream, GenicamError>;

    /// The next complete frame. `None` or [`GenicamError::Timeout`]: none came within `patience`.
    fn next(
        stream: &mut Self::Stream,
        patience: Duration,
    ) -> std::result::Result<Option<Frame>, GenicamError>;

    /// The camera's number of a frame, which counts from 1.
    fn number(frame: &Frame) -> u64;

    /// The losses since the stream was opened.
    fn losses(stream: &Self::Stream) -> Losses;
}

/// An open camera that is set up and waits for its trigger. Dropping it stops and releases the camera.
struct Link<T: Transport> {
    camera: Described<T::Registers>,
    stream: T::Stream,
}

impl<T: Transport> Link<T> {
    /// Opens the camera, sets it up, and starts the acquisition.
    fn open(transport: &T, settings: &Settings) -> Result<Self> {
        let place = transport.place();
        // The protocol's library needs one, and would end the program.
        if !machine::has_thread() {
            let fault = format!("no thread can be started for the camera {place}");
            return Err(camera_fault(fault, "raise the limit of processes (`ulimit -u`)"));
        }
        let mut camera = transport.connect()?;
        set_up(&mut camera, settings, &place)?;
        let stream = transport.stream(&mut camera).map_err(|why| said(&place, "open its stream", &why))?;
        camera.acquisition_start().map_err(|why| said(&place, "start", &why))?;
        Ok(Self { camera, stream })
    }
}

impl<T: Transport> Drop for Link<T> {
    fn drop(&mut self) {
        // A camera that no longer answers stops by itself.
        let _ = self.camera.acquisition_stop();
    }
}

/// A camera that is triggered by software.
pub(in crate::rig) struct Triggered<T: Transport> {
    info: CameraInfo,
    transport: T,
    settings: Settings,
    clock: WallClock,
    link: Option<Link<T>>,
    anchor: Option<Anchor>,
    /// The exposure that was asked for, and the one that was set, in seconds.
    exposure: Option<[f64; 2]>,
    numbers: Numbers,
    /// The losses of earlier sessions.
    losses: Losses,
}

impl<T: Transport> Triggered<T> {
    /// Opens the camera. Frames carry the times of `clock`, and numbers from `after + 1` on.
    pub(in crate::rig) fn open(
        transport: T,
        settings: Settings,
        info: CameraInfo,
        clock: WallClock,
        after: u64,
    ) -> Result<Self> {
        let link = Link::open(&transport, &settings)?;
        let shortest = settings.exposures[0];
        let mut camera = Self {
            info,
            transport,
            settings,
            clock,
            link: Some(link),
            anchor: None,
            exposure: None,
            numbers: Numbers::past(after),
            losses: Losses::default(),
        };
        camera.configure(shortest)?;
        Ok(camera)
    }

    /// Triggers a frame and waits for it. Returns the frame, and the times when the trigger was sent and when the frame arrived.
    fn frame(&mut self, exposure: f64) -> std::result::Result<Option<(Frame, [f64; 2])>, GenicamError> {
        let Some(link) = &mut self.link else { return Ok(None) };
        // Discard frames of the previous trigger that arrived too late.
        while T::next(&mut link.stream, Duration::ZERO).is_ok_and(|frame| frame.is_some()) {}
        let now = self.clock.seconds();
        if self.anchor.is_none_or(|anchor| anchor.is_old(now)) {
            self.anchor = Anchor::take(&mut link.camera, self.clock);
        }
        let triggered = self.clock.seconds();
        link.camera.trigger_software()?;
        let patience = Duration::from_secs_f64(exposure + self.settings.timeout);
        match T::next(&mut link.stream, patience) {
            Ok(frame) => Ok(frame.map(|frame| (frame, [triggered, self.clock.seconds()]))),
            Err(GenicamError::Timeout(_)) => Ok(None),
            Err(why) => Err(why),
        }
    }

    /// The time when the exposure began, estimated from the camera's stamp and the trigger.
    fn started(&self, frame: &Frame, exposure: f64, [triggered, came]: [f64; 2]) -> f64 {
        let (Some(anchor), Some(stamp)) = (self.anchor, frame.ts_dev) else {
            // Without a stamp only the trigger's time is known. Late frames of an earlier trigger were discarded before.
            return triggered;
        };
        let [time, error] = anchor.time_of(stamp);
        if time < triggered - error {
            return time;
        }
        // Some cameras stamp the end of the exposure.
        time.min(came - exposure).max(triggered)
    }

    /// The counts of a frame, which must have the format and the size that were set.
    fn counts(&self, frame: &Frame) -> Result<Vec<u16>> {
        let format = self.settings.pixel_format;
        let [width, height] = self.settings.sensor.size;
        let size = [frame.width, frame.height];
        if frame.pixel_format.name() != Some(format.name())
            || size.map(|side| side as usize) != [width, height]
        {
            let came = frame.pixel_format;
            return Err(camera_fault(
                format!(
                    "a frame of {}x{} in {came} came, where {width}x{height} in {} was expected",
                    size[0],
                    size[1],
                    format.name()
                ),
                "no other program may change the camera's settings",
            ));
        }
        format.counts(size, frame.row_stride(), &frame.payload).ok_or_else(|| {
            camera_fault(
                format!(
                    "a frame came with {} bytes, too few for {width}x{height} in {}",
                    frame.payload.len(),
                    format.name()
                ),
                "give another size or pixel_format in [camera]",
            )
        })
    }

    /// Sets the exposure of an open camera, in seconds.
    fn set(&mut self, exposure: f64) -> Result<f64> {
        match &mut self.link {
            Some(link) => set_exposure(&mut link.camera, &self.transport.place(), exposure),
            None => Err(camera_fault("the camera is closed", "open it again")),
        }
    }

    fn reopen(&mut self) -> Result<()> {
        self.close();
        self.link = Some(Link::open(&self.transport, &self.settings)?);
        self.numbers.begin();
        Ok(())
    }

    fn close(&mut self) {
        if let Some(link) = self.link.take() {
            self.losses = self.losses + T::losses(&link.stream);
        }
        self.anchor = None;
    }
}

impl<T: Transport> Camera for Triggered<T> {
    fn info(&self) -> &CameraInfo {
        &self.info
    }

    fn configure(&mut self, exposure: f64) -> Result<f64> {
        self.info.check_exposure(exposure)?;
        if self.link.is_none() {
            self.reopen()?;
        }
        let set = match self.set(exposure) {
            Ok(set) => set,
            // The camera may have been switched off and on since the last frame.
            Err(_) => self.reopen().and_then(|()| self.set(exposure))?,
        };
        self.exposure = Some([exposure, set]);
        Ok(set)
    }

    fn capture(&mut self) -> Result<Option<RawFrame>> {
        let exposure = self.exposure.map_or(self.info.exposures[0], |[_, set]| set);
        let (frame, times) = match self.frame(exposure) {
            Ok(Some(came)) => came,
            Ok(None) => return Ok(None),
            // The camera does not answer, or another program holds it: the next restart opens it again, or fails.
            Err(_) => {
                self.close();
                return Ok(None);
            }
        };
        Ok(Some(RawFrame {
            resolution: self.info.resolution,
            channels: self.info.channels,
            counts: self.settings.sensor.pixels(self.counts(&frame)?),
            exposure,
            id: self.numbers.of(T::number(&frame)),
            started: self.started(&frame, exposure, times),
        }))
    }

    fn restart(&mut self) -> Result<()> {
        self.reopen()?;
        if let Some([asked, _]) = self.exposure {
            self.exposure = Some([asked, self.set(asked)?]);
        }
        Ok(())
    }

    fn losses(&self) -> Losses {
        self.link.as_ref().map_or(self.losses, |link| self.losses + T::losses(&link.stream))
    }
}
