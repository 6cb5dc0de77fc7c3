//! Photos as products with the traced matrix.

use std::sync::Arc;

use super::{Assembled, Channels, Part, Products, Transport, from_planes, planes};
use crate::error::Result;
use crate::image::{Image, Resolution};

/// A traced scene as a rig, which several may share. It is linear, so patterns may be signed and of any magnitude.
impl Transport for Arc<Assembled> {
    fn pattern_resolution(&self) -> Resolution {
        self.matrix.projector_resolution()
    }

    fn photo_resolution(&self) -> Resolution {
        self.matrix.resolution()
    }

    fn channels(&self) -> Channels {
        self.matrix.channels()
    }

    fn photograph(&mut self, pattern: &Image) -> Result<Image> {
        let matrix = &self.matrix;
        let lit = planes(pattern, matrix.projector_resolution(), matrix.channels())?;
        let mut photo = vec![vec![0.0; matrix.resolution().pixels()]; lit.len()];
        for (channel, (pattern, plane)) in lit.iter().zip(&mut photo).enumerate() {
            self.product(Part::Full, channel, pattern, plane)?;
            for (value, ambient) in plane.iter_mut().zip(self.ambient.plane(channel)) {
                *value += ambient;
            }
        }
        from_planes(matrix.resolution(), &photo)
    }
}
