//! The driver that GigE Vision and USB3 Vision cameras share. Software triggers the cameras, and the cameras describe their features by
//! GenICam. The crate `viva-genicam` implements the protocols.
//!
//! Each trigger gives one frame, which has a number and a time. An [`Anchor`] relates the camera's clock to the rig's clock. [`Numbers`]
//! converts the camera's frame numbers to numbers that increase over all sessions. The function [`set_up`] checks the camera's limits and
//! switches automatic features off. [`Abilities::of`] reads the camera's abilities.

use std::time::Duration;

use viva_genicam::genapi::{RegisterIo, ValueRange};
use viva_genicam::{Camera as Described, Frame, GenicamError, StandardFeature};

use super::hardware::{in_use, is_busy};
use super::{Abilities, Camera, CameraInfo, GenicamSpec, Losses, RawFrame, WallClock, camera_fault};
use crate::error::{Error, Result};
use crate::machine;

/// The answer of a camera's protocol.
pub type Answered<T> = std::result::Result<T, GenicamError>;

/// The transport layer of a camera: GigE Vision or USB3 Vision.
pub trait TransportLayer: Send {
    /// The access to the camera's registers.
    type Registers: RegisterIo + Send;
    /// The stream of frames.
    type Stream: Send;

    /// The camera's place, e.g. `at 192.168.1.20`.
    fn place(&self) -> String;

    /// Opens the camera.
    fn connect(&self) -> Result<Described<Self::Registers>>;

    /// Opens the stream of frames.
    fn stream(&self, camera: &mut Described<Self::Registers>) -> Answered<Self::Stream>;

    /// The next complete frame. `None` or [`GenicamError::Timeout`] means that no frame came within `patience`.
    fn next(stream: &mut Self::Stream, patience: Duration) -> Answered<Option<Frame>>;

    /// The camera's number of a frame, which counts from 1.
    fn number(frame: &Frame) -> u64;

    /// The losses since the stream was opened.
    fn losses(stream: &Self::Stream) -> Losses;
}

/// An open camera that is set up and waits for its trigger. Dropping the link stops and releases the camera.
struct Link<T: TransportLayer> {
    camera: Described<T::Registers>,
    stream: T::Stream,
}

impl<T: TransportLayer> Link<T> {
    fn open(transport: &T, spec: &GenicamSpec) -> Result<Self> {
        let place = transport.place();
        // The protocol's library needs a thread, and would end the program if no thread can be started.
        if !machine::has_thread() {
            let fault = format!("no thread can be started for the camera {place}");
            return Err(camera_fault(fault, "raise the limit of processes (`ulimit -u`)"));
        }
        let mut camera = transport.connect()?;
        set_up(&mut camera, spec, &place)?;
        let stream = transport.stream(&mut camera).map_err(|why| said(&place, "open its stream", &why))?;
        camera.acquisition_start().map_err(|why| said(&place, "start", &why))?;
        Ok(Self { camera, stream })
    }
}

impl<T: TransportLayer> Drop for Link<T> {
    fn drop(&mut self) {
        // An error is ignored, because a camera that no longer answers stops by itself.
        let _ = self.camera.acquisition_stop();
    }
}

/// A camera that is triggered by software.
pub struct Triggered<T: TransportLayer> {
    info: CameraInfo,
    transport: T,
    spec: GenicamSpec,
    clock: WallClock,
    link: Option<Link<T>>,
    anchor: Option<Anchor>,
    /// The requested exposure, and the exposure that the camera set, in seconds.
    exposure: Option<[f64; 2]>,
    numbers: Numbers,
    /// The losses until the camera was last closed.
    losses: Losses,
}

impl<T: TransportLayer> Triggered<T> {
    /// Opens the camera. The times of its frames are read from `clock`, and their numbers begin at `after + 1`.
    pub(crate) fn start(transport: T, spec: &GenicamSpec, clock: WallClock, after: u64) -> Result<Self> {
        let mut camera = Self {
            info: spec.info(),
            link: Some(Link::open(&transport, spec)?),
            transport,
            spec: spec.clone(),
            clock,
            anchor: None,
            exposure: None,
            numbers: Numbers::past(after),
            losses: Losses::default(),
        };
        camera.configure(spec.exposures[0])?;
        Ok(camera)
    }

    /// Triggers a frame and waits for it. Returns the frame, and the times of its trigger and of its arrival.
    fn frame(&mut self, exposure: f64) -> Answered<Option<(Frame, [f64; 2])>> {
        let Some(link) = &mut self.link else { return Ok(None) };
        while T::next(&mut link.stream, Duration::ZERO).is_ok_and(|frame| frame.is_some()) {}
        let now = self.clock.seconds();
        if self.anchor.is_none_or(|anchor| anchor.is_old(now)) {
            self.anchor = Anchor::take(&mut link.camera, self.clock);
        }
        let triggered = self.clock.seconds();
        link.camera.trigger_software()?;
        let patience = Duration::from_secs_f64(exposure + self.spec.timeout);
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
        // Some cameras stamp the end of the exposure. The result is limited to times after the trigger and one exposure before the arrival.
        time.min(came - exposure).max(triggered)
    }

    /// The counts of a frame, which must have the requested format and size.
    fn counts(&self, frame: &Frame) -> Result<Vec<u16>> {
        let format = self.spec.pixel_format;
        let [width, height] = self.spec.size;
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
        self.link = Some(Link::open(&self.transport, &self.spec)?);
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

impl<T: TransportLayer> Camera for Triggered<T> {
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
            // The camera does not answer, or another program holds it. The next restart opens the camera again, or fails.
            Err(_) => {
                self.close();
                return Ok(None);
            }
        };
        Ok(Some(RawFrame {
            resolution: self.info.resolution,
            channels: self.info.channels,
            counts: self.spec.sensor().pixels(self.counts(&frame)?),
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

/// Half the range of a GigE Vision camera's frame numbers. If a number is lower than the last number by more than this, the numbers have
/// wrapped around.
const WRAP: u64 = 1 << 15;

pub(crate) struct Numbers {
    base: u64,
    last: u64,
}

impl Numbers {
    pub(crate) fn past(after: u64) -> Self {
        Self { base: after, last: 0 }
    }

    /// The rig's number for a frame. `number` is the camera's number of the frame, which counts from 1.
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
// time between two readings of the rig's clock, so its error is at most half the interval between these readings. Afterwards the error
// grows with the drift between the two quartz oscillators.

/// A bound on the relative drift between two quartz oscillators.
const DRIFT: f64 = 1e-4;

/// The age in seconds after which an anchor is renewed.
const AGE: f64 = 10.0;

/// The features that latch the camera's time and read it: the command, the value, and the ticks per second if the standard fixes them. The
/// first entry belongs to SFNC 2, the second to GigE Vision 1.
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

// The setup of a camera. It makes the camera take one frame for each software trigger, switches automatic features off, and checks all
// values.

/// The largest difference between the requested gain and the gain that was set, in the camera's unit (usually decibels). It is half of the
/// usual step of 0.1, plus a margin.
const GAIN_TOLERANCE: f64 = 0.06;

/// The features that are switched off: automatic ones, and gamma and look-up tables, which make counts nonlinear.
const SWITCHED_OFF: [(&str, &str); 5] = [
    ("ExposureAuto", "Off"),
    ("GainAuto", "Off"),
    ("BalanceWhiteAuto", "Off"),
    ("GammaEnable", "false"),
    ("LUTEnable", "false"),
];

/// The features that state the exposure in microseconds. The second name is that of older cameras.
const EXPOSURE: [&str; 2] = ["ExposureTime", "ExposureTimeAbs"];

/// Sets up an open camera. `place` names the camera in errors.
fn set_up<T: RegisterIo>(camera: &mut Described<T>, spec: &GenicamSpec, place: &str) -> Result<()> {
    let failed = |doing: &str, why: &GenicamError| said(place, doing, why);
    // A session that ended abruptly leaves the acquisition running.
    let _ = camera.acquisition_stop();
    for (name, off) in SWITCHED_OFF {
        if camera.get(name).is_ok_and(|value| value != off) {
            camera.set(name, off).map_err(|why| failed(&format!("switch {name} off"), &why))?;
        }
    }
    set_format(camera, spec, place)?;
    set_region(camera, spec, place)?;
    camera.set_acquisition_mode("Continuous").map_err(|why| failed("take frames one after another", &why))?;
    camera
        .enable_trigger("FrameStart", "Software")
        .map_err(|why| failed("wait for a software trigger", &why))?;
    if let Some(gain) = spec.gain {
        set_gain(camera, place, gain)?;
    }
    check_exposures(camera, spec, place)
}

fn set_format<T: RegisterIo>(camera: &mut Described<T>, spec: &GenicamSpec, place: &str) -> Result<()> {
    let format = spec.pixel_format.name();
    camera.set_enum("PixelFormat", format).map_err(|why| {
        camera_fault(
            format!("the camera {place} has no pixel format {format}: {why}"),
            format!("give another pixel_format in [camera]; it has {}", pixel_formats(camera).join(", ")),
        )
    })
}

/// The camera's names for its pixel formats, as far as it reports them.
fn pixel_formats<T: RegisterIo>(camera: &Described<T>) -> Vec<String> {
    camera.feature_state("PixelFormat").ok().and_then(|state| state.enum_entries).unwrap_or_default()
}

/// Sets the part of the sensor that is read. Offsets are first set to their minimum, because the limits of sizes and offsets depend on each
/// other.
fn set_region<T: RegisterIo>(camera: &mut Described<T>, spec: &GenicamSpec, place: &str) -> Result<()> {
    for name in ["OffsetX", "OffsetY"] {
        let least = limits(camera, name).map_or(0, |range| range.min as i64);
        if camera.get_integer(name).is_ok_and(|now| now != least) {
            camera
                .set_integer(name, least)
                .map_err(|why| said(place, &format!("set {name} to {least}"), &why))?;
        }
    }
    let [[width, height], [x, y]] = [spec.size, spec.offset];
    for (key, at, name, value) in [
        ("size", 0, "Width", width),
        ("size", 1, "Height", height),
        ("offset", 0, "OffsetX", x),
        ("offset", 1, "OffsetY", y),
    ] {
        let range = limits(camera, name);
        if let Some(range) = range.filter(|range| !allows(*range, value as f64)) {
            return Err(camera_fault(
                format!("camera.{key}[{at}] is {value}, but {name} of the camera {place} is {}", told(range)),
                match key {
                    "size" => "correct size in [camera]",
                    _ => "correct offset in [camera], or give a smaller size",
                },
            ));
        }
        // A camera without offsets always reads from its first pixel.
        if key == "offset" && value == 0 && camera.feature_state(name).is_err() {
            continue;
        }
        camera
            .set_integer(name, value as i64)
            .map_err(|why| said(place, &format!("set {name} to {value}"), &why))?;
    }
    Ok(())
}

fn set_gain<T: RegisterIo>(camera: &mut Described<T>, place: &str, gain: f64) -> Result<()> {
    let failed = |why: GenicamError| said(place, &format!("set a gain of {gain}"), &why);
    let name = camera.resolve(StandardFeature::Gain).map_err(failed)?.name;
    if let Some(range) = limits(camera, name).filter(|range| !(range.min..=range.max).contains(&gain)) {
        return Err(camera_fault(
            format!("camera.gain is {gain}, but {name} of the camera {place} is {}", told(range)),
            "correct gain in [camera]",
        ));
    }
    camera.set_gain(gain).map_err(failed)?;
    let set = camera.gain().map_err(failed)?;
    if (set - gain).abs() > GAIN_TOLERANCE {
        return Err(camera_fault(
            format!("asked for a gain of {gain}, the camera {place} has set {set}"),
            format!("write gain = {set} in [camera]"),
        ));
    }
    Ok(())
}

fn check_exposures<T: RegisterIo>(camera: &Described<T>, spec: &GenicamSpec, place: &str) -> Result<()> {
    if EXPOSURE.iter().all(|name| camera.feature_state(name).is_err()) {
        return Err(camera_fault(
            format!("the camera {place} does not say its exposure in microseconds"),
            "use a camera with the feature ExposureTime",
        ));
    }
    let Some(range) = EXPOSURE.iter().find_map(|name| limits(camera, name)) else { return Ok(()) };
    let [least, most] = [range.min, range.max];
    let [shortest, longest] = spec.exposures;
    // Many cameras round exposures to whole microseconds.
    if 1e6 * shortest < least - 1.0 || 1e6 * longest > most + 1.0 {
        return Err(camera_fault(
            format!(
                "the camera {place} does exposures from {} to {} s, but the rig file says {shortest} to {longest} s",
                least / 1e6,
                most / 1e6
            ),
            "correct exposures in [camera]",
        ));
    }
    Ok(())
}

/// Sets the exposure in seconds, and returns the exposure that was really set.
fn set_exposure<T: RegisterIo>(camera: &mut Described<T>, place: &str, exposure: f64) -> Result<f64> {
    let failed = |why: GenicamError| said(place, &format!("set an exposure of {exposure} s"), &why);
    camera.set_exposure_time(1e6 * exposure).map_err(failed)?;
    let set = camera.exposure_time().map_err(failed)?;
    Ok(set / 1e6)
}

/// The range of values that a feature may have now, if the camera reports it.
fn limits<T: RegisterIo>(camera: &Described<T>, name: &str) -> Option<ValueRange> {
    camera.feature_state(name).ok()?.range
}

fn allows(range: ValueRange, value: f64) -> bool {
    // Both values are integers that `f64` represents exactly.
    let is_step = range.inc.is_none_or(|step| step <= 0.0 || (value - range.min).rem_euclid(step) == 0.0);
    (range.min..=range.max).contains(&value) && is_step
}

/// A range in words, for example `4 to 48 in steps of 4`.
fn told(range: ValueRange) -> String {
    let steps = range.inc.filter(|step| *step > 1.0);
    let steps = steps.map_or_else(String::new, |step| format!(" in steps of {step}"));
    format!("{} to {}{steps}", range.min, range.max)
}

pub(crate) fn said(place: &str, doing: &str, why: &GenicamError) -> Error {
    if is_busy(why) || matches!(why, GenicamError::NotInControl(_)) {
        return in_use(place);
    }
    camera_fault(
        format!("the camera {place} did not {doing}: {why}"),
        "check its cable and power, and that no other program uses it",
    )
}

impl Abilities {
    pub(crate) fn of<T: RegisterIo>(camera: &Described<T>) -> Self {
        let range = |names: &[&str]| {
            names.iter().find_map(|name| limits(camera, name)).map(|range| [range.min, range.max])
        };
        let whole = |names: &[&str]| {
            let number = names.iter().find_map(|name| camera.get_integer(name).ok());
            number.and_then(|number| usize::try_from(number).ok()).filter(|&number| number > 0)
        };
        // Width and height may describe a part of the sensor, but their maximum describes the whole sensor.
        let sides = [whole(&["WidthMax", "SensorWidth"]), whole(&["HeightMax", "SensorHeight"])];
        Self {
            sensor: sides[0].zip(sides[1]).map(|(width, height)| [width, height]),
            pixel_formats: pixel_formats(camera),
            // The camera's exposures are in microseconds.
            exposures: range(&EXPOSURE).map(|range| range.map(|time| time / 1e6)),
            gains: range(&["Gain"]),
        }
    }
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
