//! The photos of a measured rig: white, black, direct image, and patterns.

use std::sync::Arc;

use super::hdr::RateFrame;
use super::measurement::Measurement;
use super::photo::{Photo, Plane};
use super::product::Term;
use super::registration::combine;
use super::rows::merged;
use crate::error::{Error, Result};
use crate::image::Image;
use crate::transport::Part;

/// Half of the light may be off by this share of white before a rig that was not calibrated is refused.
const PROPORTIONAL: f64 = 0.03;

impl Measurement {
    /// The white photo, `A 1`. It is taken once.
    ///
    /// # Errors
    /// Those of taking it.
    pub fn white(&mut self) -> Result<Photo> {
        if let Some(white) = &self.white {
            return Ok(white.clone());
        }
        let planes = match &self.flat {
            Some(flat) if !flat.leaves_patterns() => {
                let target = self.even_pattern(&vec![1.0; self.resolution().pixels()]);
                let mut terms = Vec::new();
                self.capture(1.0, &[target], Part::Full, &mut terms)?;
                Arc::new(self.sums(&terms, 0.0)?)
            }
            _ => self.full_white()?,
        };
        let white = self.photo(&planes);
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
            return Ok(self.photo(&planes));
        };
        let rate_frame = RateFrame {
            started: black.started,
            values: black.mean.iter().map(|mean| mean / black.exposure).collect(),
            variance: variance.clone(),
            shares: None,
            scale: 0.0,
        };
        let planes: Vec<Plane> = (0..channels)
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
        Ok(self.photo(&planes))
    }

    /// The direct image: the direct light under white, by shifted checkerboards. It is measured once.
    ///
    /// # Errors
    /// [`Error::Option`] when the options exclude this measurement; and those of taking its photos.
    pub fn direct(&mut self) -> Result<Photo> {
        let direct = self.direct_light()?;
        let white = self.even_pattern(&vec![1.0; self.resolution().pixels()]);
        let planes: Vec<Plane> =
            (0..self.camera_channels()).map(|channel| direct.under(channel, &white)).collect();
        Ok(self.photo(&planes))
    }

    /// Tests by the photo of half the light whether photos are in proportion to what is shown. Nothing is tested where the responses are
    /// switched off: then levels and counts are meant to be used as they are.
    ///
    /// # Errors
    /// [`Error::Rig`] when they are not; those of taking the photos.
    pub fn check_proportional(&mut self) -> Result<()> {
        if !self.options.response {
            return Ok(());
        }
        let half = self.masked(&vec![0.5; self.resolution().pixels()]);
        let mut terms = Vec::new();
        self.capture(1.0, &[half], Part::Full, &mut terms)?;
        let [mut shown, mut seen, mut white, mut error] = [0.0; 4];
        let whole = self.full_white()?;
        for (channel, full) in whole.iter().enumerate() {
            let photo = self.sum(&terms, 0.0, channel)?;
            let lit = self.shown(&terms, 0.0, channel);
            shown += full.values.iter().zip(&lit).map(|(light, share)| light * share).sum::<f64>();
            seen += photo.values.iter().sum::<f64>();
            white += full.values.iter().sum::<f64>();
            error += photo.variance.iter().sum::<f64>();
        }
        if (seen - shown).abs() <= PROPORTIONAL * white + 5.0 * error.sqrt() {
            return Ok(());
        }
        Err(Error::Rig {
            device: "rig".into(),
            fault: format!(
                "it was not calibrated, and its light is not in proportion to its levels: {:.1} % of white was shown, {:.1} % was seen",
                100.0 * shown / white,
                100.0 * seen / white
            ),
            help: "calibrate it with `krylux rig calibrate RIG --use`; or say in the rig file, as `response = false` in [measurement], that levels and counts are to be used as they are".into(),
        })
    }

    /// The matrix of the direct light of one channel, `n × n` for `n` pixels, by rows: columns in ascending order, and their weights. It is a
    /// diagonal where neither the projector's lens nor the camera's pixels spread light.
    ///
    /// # Errors
    /// As [`Measurement::direct`].
    pub fn direct_rows(&mut self, channel: usize) -> Result<Vec<Vec<(u32, f64)>>> {
        let direct = self.direct_light()?;
        let weights = self.channel_weights(channel);
        let row = |pixel: usize| {
            let of_channel = |&(camera_channel, weight): &(usize, f64)| {
                direct.row(camera_channel, pixel).into_iter().map(move |(at, w)| (at, weight * w))
            };
            let mut row = merged(weights.iter().flat_map(of_channel).collect());
            row.retain(|entry| self.seen[entry.0 as usize]);
            if let Some(flat) = &self.flat {
                row.iter_mut().for_each(|(at, weight)| {
                    *weight = *weight / flat.camera[pixel] / flat.projector[*at as usize];
                });
            }
            row
        };
        Ok((0..self.resolution().pixels()).map(row).collect())
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
        let planes = self.sums(&terms, 0.0)?;
        Ok(self.photo(&planes))
    }

    /// The photo of the brightest frame, for each of the camera's channels.
    pub(super) fn full_white(&mut self) -> Result<Arc<Vec<Plane>>> {
        if let Some(white) = &self.full_white {
            return Ok(Arc::clone(white));
        }
        let white = Arc::new(self.sums(&[], 1.0)?);
        Ok(Arc::clone(self.full_white.insert(white)))
    }

    /// `Σ coefficient · photo + white · A 1` for each of the camera's channels.
    pub(super) fn sums(&mut self, terms: &[Term], white: f64) -> Result<Vec<Plane>> {
        (0..self.camera_channels()).map(|channel| self.sum(terms, white, channel)).collect()
    }
}
