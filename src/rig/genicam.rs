//! Machine vision cameras that are triggered by software, as far as GigE Vision and USB3 Vision are alike. Both describe their features by
//! GenICam, and the crate `viva-genicam` implements the protocols.
//!
//! Each trigger gives one frame, which has a number and a time. An [`Anchor`] relates the camera's clock to the rig's clock. [`Numbers`]
//! increase over all sessions with a camera. The function [`set_up()`](set_up::set_up) checks the camera's limits, switches automatic
//! features off, and reads the camera's abilities.

pub(crate) mod set_up;

use std::time::Duration;

use viva_genicam::genapi::RegisterIo;
use viva_genicam::{Camera as Described, Frame, GenicamError};

use super::sensor::Settings;
use super::{Camera, CameraInfo, Losses, RawFrame, WallClock, camera_fault};
use crate::error::Result;
use crate::machine;
use set_up::{said, set_exposure, set_up};

/// The transport layer of a camera: GigE Vision or USB3 Vision.
pub trait Transport: Send {
    /// The access to the camera's registers.
    type Registers: RegisterIo + Send;
    /// The stream of frames.
    type Stream: Send;

    /// The camera's place, e.g. `at 192.168.1.20`.
    fn place(&self) -> String;

    /// Opens the camera.
    fn connect(&self) -> Result<Described<Self::Registers>>;

    /// Opens the stream of frames.
    fn stream(
        &self,
        camera: &mut Described<Self::Registers>,
    ) -> std::result::Result<Self::Stream, GenicamError>;

    /// The next complete frame. `None` or [`GenicamError::Timeout`] means that no frame came within `patience`.
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
    fn open(transport: &T, settings: &Settings) -> Result<Self> {
        let place = transport.place();
        // The protocol's library needs a thread, and would end the program without one.
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
        // A camera that no longer answers stops without this request.
        let _ = self.camera.acquisition_stop();
    }
}

/// A camera that is triggered by software.
pub struct Triggered<T: Transport> {
    info: CameraInfo,
    transport: T,
    settings: Settings,
    clock: WallClock,
    link: Option<Link<T>>,
    anchor: Option<Anchor>,
    /// The requested exposure, and the exposure that the camera set, in seconds.
    exposure: Option<[f64; 2]>,
    numbers: Numbers,
    /// The losses of earlier sessions.
    losses: Losses,
}

impl<T: Transport> Triggered<T> {
    /// Opens the camera. Its frames have times of `clock`, and numbers from `after + 1`.
    pub(crate) fn start(
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

    /// Triggers a frame and waits for it. Returns the frame, and the times of its trigger and of its arrival.
    fn frame(&mut self, exposure: f64) -> std::result::Result<Option<(Frame, [f64; 2])>, GenicamError> {
        let Some(link) = &mut self.link else { return Ok(None) };
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

    /// The time at which the exposure began, estimated from the camera's time stamp and the trigger.
    fn started(&self, frame: &Frame, exposure: f64, [triggered, came]: [f64; 2]) -> f64 {
        let (Some(anchor), Some(stamp)) = (self.anchor, frame.ts_dev) else {
            // Without a stamp, only the time of the trigger is known. Late frames of earlier triggers have already been discarded.
            return triggered;
        };
        let [time, error] = anchor.time_of(stamp);
        if time < triggered - error {
            return time;
        }
        // Some cameras stamp the end of the exposure.
        time.min(came - exposure).max(triggered)
    }

    /// The counts of a frame, which must have the requested format and size.
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
            // The camera does not answer, or another program holds it. The next restart opens it again, or fails.
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

/// Half the range of a GigE Vision camera's frame numbers. A number that lies farther back than this belongs to the next round.
const WRAP: u64 = 1 << 15;

pub(crate) struct Numbers {
    base: u64,
    last: u64,
}

impl Numbers {
    pub(crate) fn past(after: u64) -> Self {
        Self { base: after, last: 0 }
    }

    /// The rig's number of the frame with the camera's `number`, which counts from 1.
    pub(crate) fn of(&mut self, number: u64) -> u64 {
        if number + WRAP < self.last {
            // The camera's number after 65535 is 1.
            self.base += 2 * WRAP - 1;
        }
        self.last = number;
        self.base + number
    }

    /// Notes that the camera's numbers start again at 1.
    pub(crate) fn begin(&mut self) {
        self.base += self.last;
        self.last = 0;
    }
}

// The relation between the camera's clock and the rig's clock. A camera stamps its frames with its own clock. An anchor reads the camera's
// time between two readings of the rig's clock, so its error is at most half the interval. Afterwards the error grows with the drift
// between the two quartz oscillators.

/// A bound on the relative drift between two quartz oscillators.
const DRIFT: f64 = 1e-4;

/// The age in seconds after which an anchor is renewed.
const AGE: f64 = 10.0;

/// The features that latch and read the camera's time: the command, the value, and the ticks per second if the standard fixes them. The
/// first entry belongs to SFNC 2, and the second to GigE Vision 1.
const LATCHES: [(&str, &str, Option<f64>); 2] = [
    ("TimestampLatch", "TimestampLatchValue", Some(1e9)),
    ("GevTimestampControlLatch", "GevTimestampValue", None),
];

/// One simultaneous reading of both clocks.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Anchor {
    ticks: f64,
    per_second: f64,
    time: f64,
    /// The largest error of `time` in seconds.
    error: f64,
}

impl Anchor {
    /// Reads both clocks. `None`: the camera does not report its time.
    pub(crate) fn take<T: RegisterIo>(camera: &mut Described<T>, clock: WallClock) -> Option<Self> {
        for (latch, value, unit) in LATCHES {
            let before = clock.seconds();
            if camera.execute_command(latch).is_err() {
                continue;
            }
            let after = clock.seconds();
            camera.invalidate(value);
            let (Ok(ticks), Some(per_second)) =
                (camera.get_integer(value), unit.or_else(|| frequency(camera)))
            else {
                continue;
            };
            let (time, error) = (0.5 * (before + after), 0.5 * (after - before));
            return Some(Self { ticks: ticks as f64, per_second, time, error });
        }
        None
    }

    pub(crate) fn is_old(&self, now: f64) -> bool {
        now - self.time > AGE
    }

    /// The rig's time for a time stamp of the camera, and its largest error, both in seconds.
    pub(crate) fn time_of(&self, stamp: u64) -> [f64; 2] {
        let since = (stamp as f64 - self.ticks) / self.per_second;
        [self.time + since, self.error + DRIFT * since.abs()]
    }
}

/// Ticks per second of a GigE Vision 1 camera.
fn frequency<T: RegisterIo>(camera: &Described<T>) -> Option<f64> {
    let ticks = camera.get_integer("GevTimestampTickFrequency").ok()?;
    (ticks > 0).then_some(ticks as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_increase_when_the_camera_wraps_around_and_when_it_restarts() {
        let mut numbers = Numbers::past(10);
        assert_eq!(
            [1, 2, 2, 65_535, 1, 2].map(|number| numbers.of(number)),
            [11, 12, 12, 65_545, 65_546, 65_547]
        );
        numbers.begin();
        assert_eq!([1, 2].map(|number| numbers.of(number)), [65_548, 65_549]);
    }

    #[test]
    fn a_stamp_is_converted_to_the_rigs_time_with_the_error_of_drift() {
        let anchor = Anchor { ticks: 5e9, per_second: 1e9, time: 100.0, error: 0.001 };
        let [time, error] = anchor.time_of(3_000_000_000);
        assert!((time - 98.0).abs() < 1e-9 && (error - 0.0012).abs() < 1e-12, "{time} ± {error}");
        assert!(anchor.is_old(111.0) && !anchor.is_old(109.0));
    }
}
