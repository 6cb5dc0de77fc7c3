//! What is shown, and what was counted: rasters of integers.

use crate::error::{Error, Result};
use crate::image::Resolution;

/// What a projector is told to show: a level for each pixel and channel, from 0 to `2^bits − 1`, interleaved, row by row
/// from the top left as in [`crate::image::Image`].
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Frame {
    resolution: Resolution,
    channels: usize,
    levels: Vec<u16>,
}

impl Frame {
    /// Wraps levels laid out as the type says.
    ///
    /// # Errors
    /// [`Error::Dimension`] when `channels` is neither 1 nor 3, or the number of levels is not `w·h·channels`.
    pub fn new(resolution: Resolution, channels: usize, levels: Vec<u16>) -> Result<Self> {
        check(resolution, channels, levels.len(), "levels of a frame")?;
        Ok(Self { resolution, channels, levels })
    }

    /// A frame of one level.
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

/// What a camera counted in one exposure, with all that is needed to trust it.
#[derive(Clone, Debug, PartialEq)]
pub struct RawFrame {
    /// Size in pixels: the camera's own.
    pub resolution: Resolution,
    /// 1 (mono) or 3.
    pub channels: usize,
    /// Digital numbers, interleaved, row by row from the top left; from 0 to `2^bits − 1`.
    pub counts: Vec<u16>,
    /// Seconds that the sensor was open: what was really set, not what was asked for.
    pub exposure: f64,
    /// The camera's own number of the frame. It grows from frame to frame; a gap is a frame lost, a repetition is the same
    /// frame handed out twice.
    pub id: u64,
    /// When the exposure began, in seconds on the rig's clock (see [`super::Clock`]).
    pub started: f64,
}

impl RawFrame {
    /// That the counts fill the raster.
    ///
    /// # Errors
    /// [`Error::Dimension`].
    pub fn check(&self) -> Result<()> {
        check(self.resolution, self.channels, self.counts.len(), "counts of a camera's frame")
    }
}

fn check(resolution: Resolution, channels: usize, found: usize, what: &'static str) -> Result<()> {
    if channels != 1 && channels != 3 {
        return Err(Error::Dimension {
            what: "channels of a frame",
            expected: "1 or 3".into(),
            found: channels.to_string(),
        });
    }
    if found != resolution.pixels() * channels {
        return Err(Error::Dimension {
            what,
            expected: format!("{resolution}x{channels}"),
            found: found.to_string(),
        });
    }
    Ok(())
}
