//! The photos of a measured rig: white, black, direct image, and patterns.

use super::flat_field::FlatField;
use super::hdr::RateFrame;
use super::measurement::Measurement;
use super::photo::{Photo, Plane};
use super::registration::combine;
use crate::error::{Error, Result};
use crate::image::Image;
use crate::transport::Part;

impl Measurement {
    /// The white photo, `A 1`. It is taken once.
    ///
    /// # Errors
    /// Those of taking it.
    pub fn white(&mut self) -> Result<Photo> {
        if let Some(white) = &self.white {
            return Ok(white.clone());
        }
        let even = self.flat.as_ref().is_none_or(FlatField::leaves_patterns);
        let mut terms = Vec::new();
        if !even {
            let target = self.even_pattern(&vec![1.0; self.resolution().pixels()]);
            self.capture(1.0, &[target], Part::Full, &mut terms)?;
        }
        let whole = f64::from(u8::from(even));
        let planes = (0..self.camera_channels())
            .map(|channel| self.sum(&terms, whole, channel))
            .collect::<Result<Vec<Plane>>>()?;
        let white = self.photo(planes);
        Ok(self.white.insert(white).clone())
    }

    /// The black photo: the light without a pattern. It is taken once. When the ambient stage is switched off
    /// it is unknown, and 0.
    ///
    /// # Errors
    /// Those of taking it.
    pub fn ambient(&mut self) -> Result<Photo> {
        let channels = self.camera_channels();
        let references = self.pipeline.references()?;
        // The longest exposure has the least noise where it is not saturated. That it is not follows from the
        // white photo.
        let Some((black, variance)) = references.blacks.exposed.last().zip(references.blacks.variance.last())
        else {
            let planes = vec![Plane::zero(self.registration.projector.pixels()); channels];
            return Ok(self.photo(planes));
        };
        let rate_frame = RateFrame {
            started: black.started,
            values: black.mean.iter().map(|mean| mean / black.exposure).collect(),
            variance: variance.clone(),
            shares: None,
            scale: 0.0,
        };
        let planes = (0..channels)
            .map(|channel| {
                combine(
                    &self.registration,
                    &[&rate_frame],
                    &|_, _| 1.0,
                    &references.blacks,
                    (channel, channels),
                )
            })
            .collect();
        Ok(self.photo(planes))
    }

    /// The direct image: the direct light under white, by shifted checkerboards. It is measured once.
    ///
    /// # Errors
    /// [`Error::Option`] when the options exclude this measurement; and those of taking its photos.
    pub fn direct(&mut self) -> Result<Photo> {
        let direct = self.direct_light()?;
        let white = self.even_pattern(&vec![1.0; self.resolution().pixels()]);
        let planes = (0..self.camera_channels()).map(|channel| direct.under(channel, &white)).collect();
        Ok(self.photo(planes))
    }

    /// The photo of a pattern of light in `[0, 1]`, gray or coloured.
    ///
    /// # Errors
    /// [`Error::Dimension`] when the pattern does not have the projector's size; [`Error::Numerical`] when a
    /// value is out of range; and those of taking the photo.
    pub fn photograph(&mut self, pattern: &Image) -> Result<Photo> {
        self.check_length("pixels of the pattern", pattern.resolution().pixels())?;
        if let Some(wrong) = pattern.samples().iter().find(|sample| !(0.0..=1.0).contains(*sample)) {
            return Err(Error::Numerical(format!(
                "a projector cannot show the value {wrong}\n  help: give patterns with values from 0 to 1"
            )));
        }
        let target: Vec<Vec<f64>> =
            (0..pattern.channels()).map(|channel| self.even_pattern(&pattern.plane(channel))).collect();
        let mut terms = Vec::new();
        self.capture(1.0, &target, Part::Full, &mut terms)?;
        let planes = (0..self.camera_channels())
            .map(|channel| self.sum(&terms, 0.0, channel))
            .collect::<Result<Vec<Plane>>>()?;
        Ok(self.photo(planes))
    }
}
