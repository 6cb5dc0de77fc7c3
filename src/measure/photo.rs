//! A photo in linear light, with the variance of each value.

use crate::error::Result;
use crate::image::{Image, Resolution};

/// One channel of a photo: the value of each pixel, and its variance.
#[derive(Clone, Debug, PartialEq)]
pub struct Plane {
    /// The values in linear DN per second for a full-range pattern. Noise can make them negative. They are
    /// not clipped at zero, because a clipped photo is no longer linear in the pattern.
    pub values: Vec<f64>,
    /// The variances of the values, propagated from the camera's noise model. Neighbouring pixels are not
    /// independent where they share camera pixels.
    pub variance: Vec<f64>,
}

/// A photo on the projector's pixels, in the units of [`crate::measure`].
#[derive(Clone, Debug, PartialEq)]
pub struct Photo {
    /// The projector's pixels.
    pub resolution: Resolution,
    /// One or three channels.
    pub planes: Vec<Plane>,
}

impl Plane {
    /// A plane of zeros with variance 0.
    pub(crate) fn zero(pixels: usize) -> Self {
        Self { values: vec![0.0; pixels], variance: vec![0.0; pixels] }
    }

    /// The standard error of the plane as a vector, `√Σ variance`: the expected value of
    /// `‖measured − true‖₂`.
    pub fn standard_error(&self) -> f64 {
        self.variance.iter().sum::<f64>().sqrt()
    }

    /// Adds `factor` times another plane, whose noise is independent.
    pub(crate) fn add(&mut self, factor: f64, other: &Self) {
        for (value, more) in self.values.iter_mut().zip(&other.values) {
            *value += factor * more;
        }
        for (variance, more) in self.variance.iter_mut().zip(&other.variance) {
            *variance += factor * factor * more;
        }
    }
}

impl Photo {
    /// The values as an image of one or three channels.
    ///
    /// # Errors
    /// [`Error::Dimension`](crate::Error::Dimension) when there are neither one nor three planes.
    pub fn to_image(&self) -> Result<Image> {
        self.picture(|plane| &plane.values, |value| value)
    }

    /// The standard error of each pixel as an image of one or three channels.
    ///
    /// # Errors
    /// Those of [`Photo::to_image`].
    pub fn errors_to_image(&self) -> Result<Image> {
        self.picture(|plane| &plane.variance, f64::sqrt)
    }

    fn picture(&self, of: fn(&Plane) -> &Vec<f64>, shown: fn(f64) -> f64) -> Result<Image> {
        let samples = (0..self.resolution.pixels())
            .flat_map(|pixel| self.planes.iter().map(move |plane| shown(of(plane)[pixel]) as f32));
        Image::new(self.resolution, self.planes.len(), samples.collect())
    }
}
