//! What a projector and a camera can do.

use super::Frame;
use crate::error::{Error, Result};
use crate::image::Resolution;

/// The properties of a projector.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct ProjectorInfo {
    /// The projector's name; it is part of every photo's key in a journal.
    pub name: String,
    /// The pixels that can be addressed.
    pub resolution: Resolution,
    /// 1 (gray) or 3.
    pub channels: usize,
    /// Bits of a level, 1 to 16: the highest level is `2^bits − 1`.
    pub bits: u32,
    /// Seconds from one refresh to the next; exposures should be whole multiples of it. 0: the projector shows steadily.
    pub frame_time: f64,
}

/// The properties of a camera.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct CameraInfo {
    /// The camera's name; it is part of every photo's key in a journal.
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

    /// Checks that the projector can show a frame.
    ///
    /// # Errors
    /// [`Error::Rig`] when the frame has another size, another number of channels, or higher levels.
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
    /// Checks that an exposure, in seconds, is within the camera's range.
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
