//! The flat-field stage: the uneven brightness of projector and camera, above all their vignetting.
//!
//! A pattern `x` leaves the projector as `p ∘ x`, and light `y` is photographed as `c ∘ y`, with smooth factors `p` and `c` on the
//! projector's pixels. So the rig's matrix is `diag(c) A diag(p)`, which is not symmetric. Patterns are divided by `p`, and photos by
//! `c`.

use super::photo::Plane;
use crate::error::{Error, Result};

/// The relative brightness of the projector and of the camera at each of the projector's pixels.
#[derive(Clone, Debug, PartialEq)]
pub struct FlatField {
    /// The projector's: the least is 1, so that every pattern that is divided by it can be shown.
    pub projector: Vec<f64>,
    /// The camera's, with a mean of 1.
    pub camera: Vec<f64>,
}

impl FlatField {
    /// The flat field of a rig whose camera and projector differ by the factor `ratio`, `p / c`: what the symmetry of `A` tells. The
    /// whole factor is taken as the camera's. What is common to both stays in the photos, where it leaves the matrix symmetric.
    ///
    /// # Errors
    /// As [`Self::check`].
    pub fn of_ratio(ratio: &[f64]) -> Result<Self> {
        let camera = ratio.iter().map(|ratio| 1.0 / ratio).collect();
        Self { projector: vec![1.0; ratio.len()], camera }.normalized()
    }

    /// The flat field of both devices, by the `sheet`: the photo of an evenly coloured matte sheet that stands square to the camera, lit by
    /// white. It shows `p c`; the factor between the two is that of this flat field.
    ///
    /// # Errors
    /// [`Error::Dimension`] if the sizes differ; as [`Self::check`].
    pub fn with_sheet(&self, sheet: &[f64]) -> Result<Self> {
        if sheet.len() != self.camera.len() {
            return Err(Error::Dimension {
                what: "pixels of the sheet's photo",
                expected: self.camera.len().to_string(),
                found: sheet.len().to_string(),
            });
        }
        let both = self.projector.iter().zip(&self.camera).map(|(p, c)| p / c).zip(sheet);
        let (projector, camera) =
            both.map(|(ratio, sheet)| ((sheet * ratio).sqrt(), (sheet / ratio).sqrt())).unzip();
        Self { projector, camera }.normalized()
    }

    fn normalized(mut self) -> Result<Self> {
        self.check()?;
        let least = self.projector.iter().copied().fold(f64::INFINITY, f64::min);
        self.projector.iter_mut().for_each(|value| *value /= least);
        let mean = self.camera.iter().sum::<f64>() / self.camera.len() as f64;
        self.camera.iter_mut().for_each(|value| *value /= mean);
        Ok(self)
    }

    /// Refuses factors that are not positive numbers.
    ///
    /// # Errors
    /// [`Error::Numerical`].
    pub fn check(&self) -> Result<()> {
        let all = self.projector.iter().chain(&self.camera);
        match all.copied().find(|value| !(*value > 0.0 && value.is_finite())) {
            None => Ok(()),
            Some(value) => Err(Error::Numerical(format!(
                "the brightness of projector and camera is {value} at a pixel\n  help: the sheet must fill the view, and must not be saturated"
            ))),
        }
    }

    /// The pattern to show for `x`.
    pub(crate) fn pattern(&self, x: &[f64]) -> Vec<f64> {
        x.iter().zip(&self.projector).map(|(x, factor)| x / factor).collect()
    }

    /// What a pattern that was shown stands for.
    pub(crate) fn shown(&self, pattern: &[f64]) -> Vec<f64> {
        pattern.iter().zip(&self.projector).map(|(x, factor)| x * factor).collect()
    }

    /// The light of a photo.
    pub(crate) fn light(&self, plane: Plane) -> Plane {
        let divided = |values: Vec<f64>, power: i32| -> Vec<f64> {
            values.into_iter().zip(&self.camera).map(|(value, factor)| value / factor.powi(power)).collect()
        };
        Plane { values: divided(plane.values, 1), variance: divided(plane.variance, 2) }
    }

    /// Whether patterns are shown as they are.
    pub(crate) fn leaves_patterns(&self) -> bool {
        self.projector.iter().all(|&factor| factor == 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ratio_and_sheet_tell_both_devices() -> Result<()> {
        let (p, c) = ([1.0, 0.9, 0.8], [0.7, 1.0, 0.95]);
        let of = |f: fn(f64, f64) -> f64| -> Vec<f64> { p.iter().zip(c).map(|(p, c)| f(*p, c)).collect() };
        let alone = FlatField::of_ratio(&of(|p, c| p / c))?;
        assert!(alone.leaves_patterns());
        let both = alone.with_sheet(&of(|p, c| 3.0 * p * c))?;
        for pixel in 0..3 {
            // Roundings of a few operations.
            assert!((both.projector[pixel] - p[pixel] / 0.8).abs() < 1e-14);
            assert!((both.camera[pixel] - c[pixel] / (2.65 / 3.0)).abs() < 1e-14);
            assert!((both.shown(&both.pattern(&p))[pixel] - p[pixel]).abs() < 1e-15);
        }
        assert!(alone.with_sheet(&[1.0, 0.0, 1.0]).is_err() && alone.with_sheet(&[1.0]).is_err());
        Ok(())
    }
}
