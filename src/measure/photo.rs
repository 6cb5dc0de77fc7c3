//! A photo as light: values with the variance of each.

use crate::error::Result;
use crate::image::{Image, Resolution};

/// One channel: a value for each pixel, and its variance.
#[derive(Clone, Debug, PartialEq)]
pub struct Plane {
    /// Linear DN per second for a full-range pattern. Noise can make them negative, and they stay so: a photo that is
    /// clipped at zero is no longer linear.
    pub values: Vec<f64>,
    /// Their variances, propagated from the camera's noise model. Neighbours are not independent where the
    /// registration's footprints overlap.
    pub variance: Vec<f64>,
}

/// A photo on the projector's pixels, in the light units of [`crate::measure`].
#[derive(Clone, Debug, PartialEq)]
pub struct Photo {
    /// The projector's pixels.
    pub resolution: Resolution,
    /// One or three channels.
    pub planes: Vec<Plane>,
}

impl Plane {
    /// All zero, and known to be.
    pub(super) fn zero(pixels: usize) -> Self {
        Self { values: vec![0.0; pixels], variance: vec![0.0; pixels] }
    }

    /// The standard error of the whole as a vector, `√Σ variance`: what `‖measured − true‖₂` is expected to be.
    pub fn standard_error(&self) -> f64 {
        self.variance.iter().sum::<f64>().sqrt()
    }

    /// Adds `factor` times a plane of independent noise.
    pub(super) fn add(&mut self, factor: f64, other: &Self) {
        for (value, more) in self.values.iter_mut().zip(&other.values) {
            *value += factor * more;
        }
        for (variance, more) in self.variance.iter_mut().zip(&other.variance) {
            *variance += factor * factor * more;
        }
    }
}

impl Photo {
    /// As an image of one or three channels; variances are left behind.
    ///
    /// # Errors
    /// [`Error::Dimension`](crate::Error::Dimension) when there are neither one nor three planes.
    pub fn to_image(&self) -> Result<Image> {
        self.picture(|plane| &plane.values, |value| value)
    }

    /// The standard error of each pixel as an image.
    ///
    /// # Errors
    /// As [`Photo::to_image`].
    pub fn errors_to_image(&self) -> Result<Image> {
        self.picture(|plane| &plane.variance, f64::sqrt)
    }

    fn picture(&self, of: fn(&Plane) -> &Vec<f64>, shown: fn(f64) -> f64) -> Result<Image> {
        let samples = (0..self.resolution.pixels())
            .flat_map(|pixel| self.planes.iter().map(move |plane| shown(of(plane)[pixel]) as f32));
        Image::new(self.resolution, self.planes.len(), samples.collect())
    }
}
