//! The traits of devices ([`Projector`], [`Camera`] and [`Clock`]), and the struct [`Devices`], which holds one device of each kind.

use std::time::{Duration, Instant};

use super::{CameraInfo, Frame, ProjectorInfo, RawFrame};
use crate::error::Result;

/// A device that shows frames. It must implement [`Projector::info`] and [`Projector::show`]. The defaults of the other methods fit a
/// device whose frame stays on screen until the next frame is shown.
pub trait Projector: Send {
    /// The projector's properties, which do not change while the projector is open.
    fn info(&self) -> &ProjectorInfo;

    /// Shows `frame`, and returns when the device confirms that the frame is on screen. The light may appear later:
    /// [`crate::measure`] waits for the measured settle time.
    ///
    /// # Errors
    /// [`Error::Rig`](crate::Error::Rig) when the frame does not fit the device (see [`ProjectorInfo::check`]), or the device fails.
    fn show(&mut self, frame: &Frame) -> Result<Shown>;

    /// The time that the last [`Projector::show`] waited for refreshes. The default is 0, which means unknown.
    fn waited(&self) -> Waited {
        Waited::default()
    }

    /// Shows the frame that was on screen when an earlier session ended, so that this session can continue the earlier one. The default
    /// shows the frame like any other frame. A virtual projector overrides this method, because no simulated time passes between sessions.
    fn restore(&mut self, frame: &Frame) -> Result<Shown> {
        self.show(frame)
    }

    /// Confirms that the last frame has been on screen without interruption since it was shown, so that a photo taken meanwhile shows this
    /// frame. The default suits a device whose frame cannot be covered.
    ///
    /// # Errors
    /// [`Error::Rig`](crate::Error::Rig) when something else was on screen, or the device fails.
    fn confirm(&mut self) -> Result<()> {
        Ok(())
    }
}

/// A device that counts light. It must implement [`Camera::info`], [`Camera::configure`] and [`Camera::capture`].
pub trait Camera: Send {
    /// The camera's properties, which do not change while the camera is open.
    fn info(&self) -> &CameraInfo;

    /// Sets the exposure in seconds, and returns the exposure that the camera really set.
    ///
    /// # Errors
    /// [`Error::Rig`](crate::Error::Rig) when the exposure is out of range (see [`CameraInfo::check_exposure`]), or the camera fails.
    fn configure(&mut self, exposure: f64) -> Result<f64>;

    /// Takes one frame. `None`: no frame came in time, because it was dropped on the way or the camera hangs. The caller may try again.
    ///
    /// # Errors
    /// [`Error::Rig`](crate::Error::Rig) when the camera fails for good.
    fn capture(&mut self) -> Result<Option<RawFrame>>;

    /// Closes and reopens the stream of frames of a camera that hangs. The exposure stays as it was set. The default does nothing, which
    /// suits a camera without a stream.
    ///
    /// # Errors
    /// [`Error::Rig`](crate::Error::Rig) when the camera does not come back.
    fn restart(&mut self) -> Result<()> {
        Ok(())
    }

    /// The packets and frames that were lost on the way from the camera since the camera was opened. The default reports no losses.
    fn losses(&self) -> Losses {
        Losses::default()
    }
}

/// Packets and frames that were lost on the way from a camera.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Losses {
    /// Packets that were lost and sent again on request.
    pub resent: u64,
    /// Frames that came without some of their packets. These frames are discarded.
    pub incomplete: u64,
    /// Packets that never came, over all incomplete frames.
    pub missing: u64,
}

impl std::ops::Add for Losses {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            resent: self.resent + other.resent,
            incomplete: self.incomplete + other.incomplete,
            missing: self.missing + other.missing,
        }
    }
}

/// The clock of a rig, in seconds. Hardware uses real time ([`WallClock`]), and virtual devices use simulated time. The times
/// in a projector's confirmations and a camera's frames are read from this clock.
pub trait Clock: Send {
    /// Seconds since the rig was opened. A session that continues an earlier session counts on from the end of the earlier session.
    fn now(&self) -> f64;

    /// Lets this many seconds pass. By default the thread sleeps.
    fn sleep(&mut self, seconds: f64) {
        if let Ok(time) = Duration::try_from_secs_f64(seconds) {
            std::thread::sleep(time);
        }
    }
}

/// A projector's confirmation that a frame is on screen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shown {
    /// The time of the confirmation, in seconds on the rig's clock.
    pub at: f64,
}

/// The seconds that a projector spent waiting for refreshes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Waited {
    /// The wait until the refresh that brought the frame to the screen.
    pub refresh: f64,
    /// The wait for further refreshes until the frame counts as shown.
    pub settle: f64,
}

/// The number and time of a session's last frame, after which a later session continues.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stamp {
    /// The frame's number.
    pub id: u64,
    /// The end of the frame's exposure, in seconds on the rig's clock.
    pub time: f64,
}

impl Stamp {
    /// The stamp of this frame.
    pub fn of(frame: &RawFrame) -> Self {
        Self { id: frame.id, time: frame.started + frame.exposure }
    }
}

/// The open devices of a rig.
///
/// You can implement your own devices. A projector needs two methods and a camera three; the other methods have defaults:
///
/// ```
/// use std::sync::{Arc, Mutex};
/// use std::time::Duration;
///
/// use krylux::image::Resolution;
/// use krylux::measure::{Calibration, LiveFrames, MeasureOptions, Measurement};
/// use krylux::operator::Operator;
/// use krylux::rig::{
///     Camera, CameraInfo, Devices, Frame, Projector, ProjectorInfo, RawFrame, Shown, WallClock,
/// };
/// use krylux::transport::Part;
///
/// /// A projector that keeps its frame in memory, where the camera below finds it.
/// struct MemoryProjector {
///     info: ProjectorInfo,
///     screen: Arc<Mutex<Frame>>,
///     clock: WallClock,
/// }
///
/// impl Projector for MemoryProjector {
///     fn info(&self) -> &ProjectorInfo {
///         &self.info
///     }
///
///     fn show(&mut self, frame: &Frame) -> krylux::Result<Shown> {
///         self.info.check(frame)?;
///         *self.screen.lock().unwrap() = frame.clone();
///         Ok(Shown { at: self.clock.seconds() })
///     }
/// }
///
/// /// A camera whose pixel `i` sees `reflectance[i]` of the projector's pixel `i`.
/// struct MemoryCamera {
///     info: CameraInfo,
///     screen: Arc<Mutex<Frame>>,
///     clock: WallClock,
///     reflectance: [f64; 4],
///     exposure: f64,
///     id: u64,
/// }
///
/// impl Camera for MemoryCamera {
///     fn info(&self) -> &CameraInfo {
///         &self.info
///     }
///
///     fn configure(&mut self, exposure: f64) -> krylux::Result<f64> {
///         self.info.check_exposure(exposure)?;
///         self.exposure = exposure;
///         Ok(exposure)
///     }
///
///     fn capture(&mut self) -> krylux::Result<Option<RawFrame>> {
///         let started = self.clock.seconds();
///         std::thread::sleep(Duration::from_secs_f64(self.exposure));
///         self.id += 1;
///         // At level 255 a white pixel fills half of the 12 bits in 1 ms.
///         let gain = 2048.0 / 255.0 * self.exposure / 1e-3;
///         let screen = self.screen.lock().unwrap();
///         let light = screen.levels().iter().zip(self.reflectance);
///         let counts = light.map(|(&level, reflectance)| (gain * reflectance * f64::from(level)) as u16);
///         Ok(Some(RawFrame {
///             resolution: self.info.resolution,
///             channels: 1,
///             counts: counts.map(|count| count.min(4095)).collect(),
///             exposure: self.exposure,
///             id: self.id,
///             started,
///         }))
///     }
/// }
///
/// # fn main() -> krylux::Result<()> {
/// let resolution = Resolution::new(2, 2);
/// let projector =
///     ProjectorInfo { name: "memory".into(), resolution, channels: 1, bits: 8, frame_time: 0.0 };
/// let camera =
///     CameraInfo { name: "memory".into(), resolution, channels: 1, bits: 12, exposures: [1e-4, 1e-2] };
/// let calibration = Calibration::ideal(&projector, &camera);
///
/// let clock = WallClock::starting_at(0.0);
/// let screen = Arc::new(Mutex::new(Frame::filled(resolution, 1, 0)));
/// let devices = Devices::new(
///     MemoryProjector { info: projector, screen: Arc::clone(&screen), clock },
///     MemoryCamera { info: camera, screen, clock, reflectance: [0.2, 0.4, 0.6, 1.0], exposure: 1e-3, id: 0 },
///     clock,
/// );
///
/// // The measurement converts the counts of the camera to the product `A x`.
/// let options = MeasureOptions { exposures: vec![1e-3], ..MeasureOptions::default() };
/// let frames = LiveFrames::new(devices, 0.0, options.tries);
/// let mut measurement = Measurement::new(Box::new(frames), calibration, options)?;
/// let mut photo = [0.0; 4];
/// measurement.operator(Part::Full, 0).apply(&[1.0, 0.0, 0.5, 1.0], &mut photo)?;
/// let relative = photo.map(|value| value / photo[3]);
/// for (value, expected) in relative.into_iter().zip([0.2, 0.0, 0.3, 1.0]) {
///     // Levels of 255 are rounded, by at most half a level. Counts of 2048 lose their fraction, which is less than one count.
///     assert!((value - expected).abs() < 0.5 / 255.0 + 1.0 / 2048.0);
/// }
/// # Ok(())
/// # }
/// ```
pub struct Devices {
    /// The projector.
    pub projector: Box<dyn Projector>,
    /// The camera.
    pub camera: Box<dyn Camera>,
    /// The clock that both devices use.
    pub clock: Box<dyn Clock>,
}

impl Devices {
    /// Devices made of a projector, a camera and a clock.
    pub fn new(
        projector: impl Projector + 'static,
        camera: impl Camera + 'static,
        clock: impl Clock + 'static,
    ) -> Self {
        Self { projector: Box::new(projector), camera: Box::new(camera), clock: Box::new(clock) }
    }
}

/// Real time in seconds, counted from a given moment. Copies tell the same time.
#[derive(Clone, Copy, Debug)]
pub struct WallClock {
    origin: Instant,
    /// The time at the origin, in seconds.
    start: f64,
}

impl WallClock {
    /// A clock whose time is now `start` seconds.
    pub fn starting_at(start: f64) -> Self {
        Self { origin: Instant::now(), start }
    }

    /// The time now, in seconds.
    pub fn seconds(&self) -> f64 {
        self.start + self.origin.elapsed().as_secs_f64()
    }
}

impl Clock for WallClock {
    fn now(&self) -> f64 {
        self.seconds()
    }
}
