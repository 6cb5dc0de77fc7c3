//! What an audit asks of a source.

use crate::error::Result;
use crate::image::Resolution;
use crate::measure::{Measurement, Photo, Plane};
use crate::operator::Operator;

/// A photo of one channel, with the variance of each pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct Seen {
    /// Without ambient light.
    pub values: Vec<f64>,
    /// All 0 where there is no noise.
    pub variance: Vec<f64>,
}

/// A source that can be audited: camera and projector of equal rasters, one channel.
pub trait Audited {
    /// Pixels of patterns and photos.
    fn resolution(&self) -> Resolution;

    /// The photo of a pattern of values in \[0, 1\].
    ///
    /// # Errors
    /// Whatever keeps it from being taken.
    fn photograph(&mut self, pattern: &[f64]) -> Result<Seen>;

    /// Which pixels can be seen; the others are never lit.
    fn seen(&self) -> Vec<bool>;

    /// The direct light of white, if it is known.
    ///
    /// # Errors
    /// Whatever keeps it from being measured.
    fn direct(&mut self) -> Result<Option<Seen>>;

    /// The light that is there without a pattern, if it is known.
    ///
    /// # Errors
    /// Whatever keeps it from being measured.
    fn ambient(&mut self) -> Result<Option<Seen>>;

    /// Share of the camera's samples that some exposure of white saturates; none where there is no camera.
    ///
    /// # Errors
    /// Whatever keeps the white photo from being taken.
    fn saturated(&mut self) -> Result<Option<f64>>;

    /// Photos of the projector's red, green and blue alone, in each of the camera's channels; none where either is gray.
    ///
    /// # Errors
    /// Whatever keeps them from being taken.
    fn primaries(&mut self) -> Result<Option<[[Vec<f64>; 3]; 3]>> {
        Ok(None)
    }

    /// The largest relative change of the lamp's light that was seen, and corrected; none where nobody watched.
    ///
    /// # Errors
    /// Whatever keeps it from being measured.
    fn drift(&mut self) -> Result<Option<f64>>;
}

/// Operators without noise: a simulated scene's.
pub struct Exact<'a> {
    /// All light.
    pub full: &'a mut dyn Operator,
    /// Direct light under white; none: unknown.
    pub direct: Option<Vec<f64>>,
    /// Pixels of patterns and photos.
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
