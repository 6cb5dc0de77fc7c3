//! The interface between an audit and a source.

use crate::error::Result;
use crate::finding::{Finding, Grade};
use crate::image::Resolution;
use crate::measure::{Measurement, Photo, Plane};
use crate::operator::Operator;

/// A photo of one channel, with the variance of each pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct Seen {
    /// The light of each pixel, without ambient light.
    pub values: Vec<f64>,
    /// The variance of each pixel; 0 where there is no noise.
    pub variance: Vec<f64>,
}

/// A source that can be audited: one channel, with equal rasters of camera and projector.
pub trait Audited {
    /// The resolution of patterns and photos.
    fn resolution(&self) -> Resolution;

    /// The photo of a pattern of values in \[0, 1\].
    ///
    /// # Errors
    /// Any error of taking the photo.
    fn photograph(&mut self, pattern: &[f64]) -> Result<Seen>;

    /// Whether white gives any light to measure: a finding of the name `light`. It is asked after the white photo was taken.
    ///
    /// # Errors
    /// Any error of taking that photo.
    fn sight(&mut self) -> Result<Finding>;

    /// Which pixels the camera sees; the others are never lit.
    fn seen(&self) -> Vec<bool>;

    /// The direct light under white, if it is known.
    ///
    /// # Errors
    /// Any error of measuring it.
    fn direct(&mut self) -> Result<Option<Seen>>;

    /// The light without a pattern, if it is known.
    ///
    /// # Errors
    /// Any error of measuring it.
    fn ambient(&mut self) -> Result<Option<Seen>>;

    /// The share of the camera's samples of white that are saturated in some exposure; none where there is no camera.
    ///
    /// # Errors
    /// Any error of taking the white photo.
    fn saturated(&mut self) -> Result<Option<f64>>;

    /// Photos of the projector's red, green and blue alone, in each camera channel; none if either device is monochrome.
    ///
    /// # Errors
    /// Any error of taking them.
    fn primaries(&mut self) -> Result<Option<[[Vec<f64>; 3]; 3]>> {
        Ok(None)
    }

    /// The largest relative change of the lamp's light that was measured and corrected; none if it was not monitored.
    ///
    /// # Errors
    /// Any error of measuring it.
    fn drift(&mut self) -> Result<Option<f64>>;
}

/// Operators without noise, as of a simulated scene.
pub struct Exact<'a> {
    /// All of the light.
    pub full: &'a mut dyn Operator,
    /// Direct light under white; none if unknown.
    pub direct: Option<Vec<f64>>,
    /// The resolution of patterns and photos.
    pub resolution: Resolution,
}

impl Audited for Exact<'_> {
    fn resolution(&self) -> Resolution {
        self.resolution
    }

    fn photograph(&mut self, pattern: &[f64]) -> Result<Seen> {
        let mut values = vec![0.0; self.full.rows()];
        self.full.apply(pattern, &mut values)?;
        Ok(exact(values))
    }

    fn sight(&mut self) -> Result<Finding> {
        let mut white = vec![0.0; self.full.rows()];
        self.full.apply(&vec![1.0; self.full.cols()], &mut white)?;
        let lit = white.iter().filter(|light| **light > 0.0).count();
        let grade = if lit == 0 { Grade::Fails } else { Grade::Ok };
        let found = format!("{lit} of {} pixels have light under white", white.len());
        let help = "light the scene, or turn the camera to it";
        Ok(Finding::graded("light", grade, found, "one or more", help))
    }

    fn seen(&self) -> Vec<bool> {
        vec![true; self.resolution.pixels()]
    }

    fn direct(&mut self) -> Result<Option<Seen>> {
        Ok(self.direct.clone().map(exact))
    }

    fn ambient(&mut self) -> Result<Option<Seen>> {
        Ok(None)
    }

    fn saturated(&mut self) -> Result<Option<f64>> {
        Ok(None)
    }

    fn drift(&mut self) -> Result<Option<f64>> {
        Ok(None)
    }
}

fn exact(values: Vec<f64>) -> Seen {
    Seen { variance: vec![0.0; values.len()], values }
}

impl Audited for Measurement {
    fn resolution(&self) -> Resolution {
        Self::resolution(self)
    }

    fn photograph(&mut self, pattern: &[f64]) -> Result<Seen> {
        let samples = pattern.iter().map(|&value| value as f32).collect();
        let image = crate::image::Image::new(Self::resolution(self), 1, samples)?;
        first(Self::photograph(self, &image)?)
    }

    fn sight(&mut self) -> Result<Finding> {
        Self::sight(self)
    }

    fn seen(&self) -> Vec<bool> {
        Self::seen(self).to_vec()
    }

    fn direct(&mut self) -> Result<Option<Seen>> {
        match self.options().direct {
            crate::measure::DirectBy::None => Ok(None),
            crate::measure::DirectBy::Patterns => Ok(Some(first(Self::direct(self)?)?)),
        }
    }

    fn ambient(&mut self) -> Result<Option<Seen>> {
        if !self.options().ambient {
            return Ok(None);
        }
        Ok(Some(first(Self::ambient(self)?)?))
    }

    fn saturated(&mut self) -> Result<Option<f64>> {
        Self::saturated(self).map(Some)
    }

    fn primaries(&mut self) -> Result<Option<[[Vec<f64>; 3]; 3]>> {
        Self::primaries(self)
    }

    fn drift(&mut self) -> Result<Option<f64>> {
        let report = Self::drift(self)?;
        Ok((report.sentinels.len() > 1).then_some(report.largest))
    }
}

fn first(photo: Photo) -> Result<Seen> {
    let plane = photo.planes.into_iter().next();
    let Plane { values, variance } =
        plane.ok_or_else(|| crate::Error::Numerical("a photo without channels".into()))?;
    Ok(Seen { values, variance })
}
