//! What projectors and cameras promise, hardware and virtual alike.

use super::{Frame, RawFrame};
use crate::error::{Error, Result};
use crate::image::Resolution;

/// What a projector is.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct ProjectorInfo {
    /// How it calls itself; part of every photo's key in a journal.
    pub name: String,
    /// Pixels that can be addressed.
    pub resolution: Resolution,
    /// 1 (gray) or 3.
    pub channels: usize,
    /// Bits of a level, 1 to 16: the brightest is `2^bits − 1`.
    pub bits: u32,
    /// Seconds from one refresh to the next: exposures are best whole multiples of it. 0: it shows steadily.
    pub frame_time: f64,
}

/// What a camera is.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct CameraInfo {
    /// How it calls itself; part of every photo's key in a journal.
    pub name: String,
    /// Pixels of a frame.
    pub resolution: Resolution,
    /// 1 (mono) or 3.
    pub channels: usize,
    /// Bits of a count, 1 to 16.
    pub bits: u32,
    /// The shortest and the longest exposure in seconds.
    pub exposures: [f64; 2],
}

impl ProjectorInfo {
    /// The brightest level.
    pub fn highest(&self) -> u16 {
        ((1_u32 << self.bits) - 1) as u16
    }

    /// That a frame fits the projector.
    ///
    /// # Errors
    /// [`Error::Rig`] when it has another size, another number of channels, or higher levels.
    pub fn check(&self, frame: &Frame) -> Result<()> {
        let highest = frame.levels().iter().copied().max().unwrap_or(0);
        if (frame.resolution(), frame.channels()) == (self.resolution, self.channels)
            && highest <= self.highest()
        {
            return Ok(());
        }
        Err(Error::Rig {
            device: self.name.clone(),
            fault: format!(
                "it cannot show a frame of {} with {} channels and levels up to {highest}",
                frame.resolution(),
                frame.channels()
            ),
            help: format!(
                "it shows frames of {} with {} channels and levels up to {}",
                self.resolution,
                self.channels,
                self.highest()
            ),
        })
    }
}

impl CameraInfo {
    /// That an exposure, in seconds, is one that the camera does.
    ///
    /// # Errors
    /// [`Error::Rig`] when it is not.
    pub fn check_exposure(&self, exposure: f64) -> Result<()> {
        let [shortest, longest] = self.exposures;
        if (shortest..=longest).contains(&exposure) {
            return Ok(());
        }
        Err(Error::Rig {
            device: self.name.clone(),
            fault: format!("an exposure of {exposure} s cannot be set"),
            help: format!(
                "give exposures from {shortest} to {longest} s in [measurement], or correct those of [camera]"
            ),
        })
    }
}

/// A frame is on screen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shown {
    /// When that was confirmed, in seconds on the rig's clock.
    pub at: f64,
}

/// Seconds in which nothing but the projector's clock was waited for.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Waited {
    /// Until the next refresh brought the frame.
    pub refresh: f64,
    /// Refreshes after that one.
    pub settle: f64,
}

/// The last frame of a session, for another to go on after it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stamp {
    /// Its number.
    pub id: u64,
    /// When its exposure ended, in seconds on the rig's clock.
    pub time: f64,
}

impl Stamp {
    /// That of this frame.
    pub fn of(frame: &RawFrame) -> Self {
        Self { id: frame.id, time: frame.started + frame.exposure }
    }
}

/// Something that shows frames.
pub trait Projector: Send {
    /// What it is.
    fn info(&self) -> &ProjectorInfo;

    /// Shows `frame`, and returns when the device says that it is on screen (what the light does, see
    /// [`crate::measure`]'s settle time).
    ///
    /// # Errors
    /// [`Error::Rig`] when the frame does not fit the device, or the device is gone.
    fn show(&mut self, frame: &Frame) -> Result<Shown>;

    /// What of the last [`Self::show`] was waiting for the projector's refreshes, where it knows.
    fn waited(&self) -> Waited {
        Waited::default()
    }

    /// Shows the frame that an interrupted session had left on screen, so that another can go on from there. A virtual
    /// projector takes no time for that: in its time, there was no interruption.
    ///
    /// # Errors
    /// As [`Self::show`].
    fn restore(&mut self, frame: &Frame) -> Result<Shown> {
        self.show(frame)
    }

    /// That the frame shown last has been on screen ever since, and nothing else: a photo taken meanwhile is of it. A device that
    /// nothing can come before has nothing to say.
    ///
    /// # Errors
    /// [`Error::Rig`] when something else was on screen, or the device is gone.
    fn confirm(&mut self) -> Result<()> {
        Ok(())
    }
}

/// Something that counts light.
pub trait Camera: Send {
    /// What it is.
    fn info(&self) -> &CameraInfo;

    /// Sets the exposure, in seconds, and returns what was really set.
    ///
    /// # Errors
    /// [`Error::Rig`] when it is out of range, or the camera is gone.
    fn configure(&mut self, exposure: f64) -> Result<f64>;

    /// Takes one frame. `None`: none came in time (dropped on the way, or the camera hangs); try again.
    ///
    /// # Errors
    /// [`Error::Rig`] when the camera is gone.
    fn capture(&mut self) -> Result<Option<RawFrame>>;

    /// Closes and opens the stream, as one does with a camera that hangs. The exposure stays.
    ///
    /// # Errors
    /// [`Error::Rig`] when the camera does not come back.
    fn restart(&mut self) -> Result<()>;

    /// Packets of its frames that were lost on the way and came when they were asked for again.
    fn resent(&self) -> u64 {
        0
    }
}

/// The time of a rig: the wall's for hardware, simulated for virtual devices.
pub trait Clock: Send {
    /// Seconds since the rig was opened (or, in a resumed run, since it was first opened).
    fn now(&self) -> f64;

    /// Lets so many seconds pass.
    fn sleep(&mut self, seconds: f64);
}

/// An open rig.
pub struct Devices {
    /// What shows.
    pub projector: Box<dyn Projector>,
    /// What sees.
    pub camera: Box<dyn Camera>,
    /// Its time.
    pub clock: Box<dyn Clock>,
}
