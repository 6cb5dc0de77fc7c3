//! Photos as products with the traced matrix.

use std::sync::Arc;

use super::{Assembled, Channels, Part, Products, Transport, from_planes, planes};
use crate::error::Result;
use crate::image::{Image, Resolution};

/// A traced scene as a rig. It is linear, so patterns may be signed and of any magnitude.
#[derive(Debug)]
pub struct Simulated {
    /// The matrix on its backend, and the ambient light.
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
        photograph(&self.traced, pattern)
    }
}

/// A traced scene that several rigs share.
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
        photograph(self, pattern)
    }
}

fn photograph(traced: &Assembled, pattern: &Image) -> Result<Image> {
    let matrix = &traced.matrix;
    let lit = planes(pattern, matrix.projector_resolution(), matrix.channels())?;
    let mut photo = vec![vec![0.0; matrix.resolution().pixels()]; lit.len()];
    for (channel, (pattern, plane)) in lit.iter().zip(&mut photo).enumerate() {
        traced.product(Part::Full, channel, pattern, plane)?;
        for (value, ambient) in plane.iter_mut().zip(traced.ambient.plane(channel)) {
            *value += ambient;
        }
    }
    from_planes(matrix.resolution(), &photo)
}
