//! Photos by replay: products with the frozen matrix.

use super::{Assembled, Channels, Part, Transport, from_planes, planes};
use crate::error::Result;
use crate::image::{Image, Resolution};

/// A traced scene as a rig. Patterns may be signed and of any size of value: it is linear.
#[derive(Debug)]
pub struct Simulated {
    /// The matrix and the ambient light.
    pub traced: Assembled,
}

impl Transport for Simulated {
    fn pattern_resolution(&self) -> Resolution {
        self.traced.matrix.projector_resolution()
    }

    fn photo_resolution(&self) -> Resolution {
        self.traced.matrix.resolution()
    }

    fn channels(&self) -> Channels {
        self.traced.matrix.channels()
    }

    fn photograph(&mut self, pattern: &Image) -> Result<Image> {
        let lit = planes(pattern, self.pattern_resolution(), self.channels())?;
        let mut photo = vec![vec![0.0; self.photo_resolution().pixels()]; lit.len()];
        for (channel, (pattern, plane)) in lit.iter().zip(&mut photo).enumerate() {
            self.traced.matrix.apply(Part::Full, channel, pattern, plane);
            for (value, ambient) in plane.iter_mut().zip(self.traced.ambient.plane(channel)) {
                *value += ambient;
            }
        }
        from_planes(self.photo_resolution(), &photo)
    }
}
