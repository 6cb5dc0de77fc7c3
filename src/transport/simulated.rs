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
    fn resolution(&self) -> Resolution {
        self.traced.matrix.resolution()
    }

    fn channels(&self) -> Channels {
        self.traced.matrix.channels()
    }

    fn photograph(&mut self, pattern: &Image) -> Result<Image> {
        let mut photo = planes(pattern, self.resolution(), self.channels())?;
        for (channel, plane) in photo.iter_mut().enumerate() {
            let pattern = std::mem::replace(plane, vec![0.0; self.traced.matrix.resolution().pixels()]);
            self.traced.matrix.apply(Part::Full, channel, &pattern, plane);
            for (value, ambient) in plane.iter_mut().zip(self.traced.ambient.plane(channel)) {
                *value += ambient;
            }
        }
        from_planes(self.resolution(), &photo)
    }
}
