//! A matte sheet in front of a virtual rig, by which its uneven brightness is measured.

use crate::error::{Error, Result};
use crate::image::{Image, Resolution};
use crate::transport::{Channels, Transport};

/// The light transport of an evenly coloured matte sheet that stands square to projector and camera: the photo is the pattern.
#[derive(Clone, Copy, Debug)]
pub struct MatteSheet {
    /// The pixels of patterns and of photos.
    pub resolution: Resolution,
    /// Gray or coloured.
    pub channels: Channels,
}

impl Transport for MatteSheet {
    fn pattern_resolution(&self) -> Resolution {
        self.resolution
    }

    fn photo_resolution(&self) -> Resolution {
        self.resolution
    }

    fn channels(&self) -> Channels {
        self.channels
    }

    fn photograph(&mut self, pattern: &Image) -> Result<Image> {
        if pattern.resolution() != self.resolution {
            return Err(Error::Dimension {
                what: "pixels of the pattern on a sheet",
                expected: self.resolution.to_string(),
                found: pattern.resolution().to_string(),
            });
        }
        let count = self.channels.count();
        let pixel = |light: &[f32]| -> Vec<f32> {
            (0..count).map(|channel| light[if light.len() == count { channel } else { 0 }]).collect()
        };
        let samples = pattern.samples().chunks_exact(pattern.channels()).flat_map(pixel).collect();
        Image::new(self.resolution, count, samples)
    }
}
