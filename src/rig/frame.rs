//! Frames, which are rasters of a projector's levels or of a camera's counts, and the properties of both devices.

use crate::error::{Error, Result};
use crate::image::{Resolution, percentile};

/// A frame for a projector: a level from 0 to `2^bits − 1` for each pixel and channel, interleaved row by row from the top left as in
/// [`crate::image::Image`].
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Frame {
    resolution: Resolution,
    channels: usize,
    levels: Vec<u16>,
}

impl Frame {
    /// A frame with these levels, in the layout that [`Frame`] describes.
    ///
    /// # Errors
    /// [`Error::Dimension`] when `channels` is neither 1 nor 3, or the number of levels is not `w·h·channels`.
    pub fn new(resolution: Resolution, channels: usize, levels: Vec<u16>) -> Result<Self> {
        check(resolution, channels, levels.len(), "levels of a frame")?;
        Ok(Self { resolution, channels, levels })
    }

    /// A frame with the same level everywhere. `channels` is 1 or 3.
    pub fn filled(resolution: Resolution, channels: usize, level: u16) -> Self {
        debug_assert!(channels == 1 || channels == 3);
        Self { resolution, channels, levels: vec![level; resolution.pixels() * channels] }
    }

    /// Size in pixels.
    pub fn resolution(&self) -> Resolution {
        self.resolution
    }

    /// 1 (gray) or 3.
    pub fn channels(&self) -> usize {
        self.channels
    }

    /// All levels, interleaved.
    pub fn levels(&self) -> &[u16] {
        &self.levels
    }
}

/// A frame of a camera: the counts of one exposure, and the data to verify that this is the expected frame.
#[derive(Clone, Debug, PartialEq)]
pub struct RawFrame {
    /// Size in camera pixels.
    pub resolution: Resolution,
    /// 1 (mono) or 3.
    pub channels: usize,
    /// Counts (digital numbers) from 0 to `2^bits − 1`, interleaved, row by row from the top left.
    pub counts: Vec<u16>,
    /// The exposure that was really set, in seconds.
    pub exposure: f64,
    /// The number of the frame, which increases from frame to frame. A gap between two numbers means that a frame was lost. A repeated
    /// number means that the same frame was returned twice.
    pub id: u64,
    /// The time at which the exposure began, in seconds on the rig's clock (see [`crate::rig::Clock`]).
    pub started: f64,
}

impl RawFrame {
    /// Checks that there is one count for each pixel and channel. Returns [`Error::Dimension`] otherwise.
    pub fn check(&self) -> Result<()> {
        check(self.resolution, self.channels, self.counts.len(), "counts of a camera's frame")
    }

    /// The mean count.
    pub fn mean(&self) -> f64 {
        self.counts.iter().map(|&count| f64::from(count)).sum::<f64>() / self.counts.len() as f64
    }

    /// The quantile of all counts at `rank`, from 0 to 1. It is 0 if there are no counts.
    pub fn percentile(&self, rank: f64) -> f64 {
        percentile(self.counts.iter().map(|&count| count.into()), rank)
    }
}

fn check(resolution: Resolution, channels: usize, found: usize, what: &'static str) -> Result<()> {
    if channels != 1 && channels != 3 {
        return Err(Error::dimension("channels of a frame", "1 or 3", channels));
    }
    if found != resolution.pixels() * channels {
        return Err(Error::dimension(what, format!("{resolution}x{channels}"), found));
    }
    Ok(())
}

/// The properties of a projector.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct ProjectorInfo {
    /// The projector's name, which is part of every photo's key in a journal.
    pub name: String,
    /// The number of addressable pixels.
    pub resolution: Resolution,
    /// 1 (gray) or 3.
    pub channels: usize,
    /// Bits of a level, 1 to 16: the highest level is `2^bits − 1`.
    pub bits: u32,
    /// Seconds from one refresh to the next. Exposures should be whole multiples of this time. 0: the projector's light is steady.
    pub frame_time: f64,
}

/// The properties of a camera.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct CameraInfo {
    /// The camera's name, which is part of every photo's key in a journal.
    pub name: String,
    /// The pixels of a frame.
    pub resolution: Resolution,
    /// 1 (mono) or 3.
    pub channels: usize,
    /// Bits of a count, 1 to 16.
    pub bits: u32,
    /// The shortest and the longest exposure in seconds.
    pub exposures: [f64; 2],
}

impl ProjectorInfo {
    /// The highest level, `2^bits − 1`.
    pub fn highest(&self) -> u16 {
        ((1_u32 << self.bits) - 1) as u16
    }

    /// Returns [`Error::Rig`] when a frame has another size, another number of channels, or higher levels than the projector can show.
    pub fn check(&self, frame: &Frame) -> Result<()> {
        let highest = frame.levels().iter().copied().max().unwrap_or(0);
        if (frame.resolution(), frame.channels()) == (self.resolution, self.channels)
            && highest <= self.highest()
        {
            return Ok(());
        }
        Err(Error::rig(
            &self.name,
            format!(
                "it cannot show a frame of {} with {} channels and levels up to {highest}",
                frame.resolution(),
                frame.channels()
            ),
        )
        .help(format!(
            "it shows frames of {} with {} channels and levels up to {}",
            self.resolution,
            self.channels,
            self.highest()
        )))
    }
}

impl CameraInfo {
    /// Checks that an exposure in seconds is within the camera's range. Returns [`Error::Rig`] otherwise.
    pub fn check_exposure(&self, exposure: f64) -> Result<()> {
        let [shortest, longest] = self.exposures;
        if (shortest..=longest).contains(&exposure) {
            return Ok(());
        }
        Err(Error::rig(&self.name, format!("an exposure of {exposure} s cannot be set")).help(format!(
            "give exposures from {shortest} to {longest} s in [measurement], or correct those of [camera]"
        )))
    }
}
