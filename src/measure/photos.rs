//! The photos of a measured rig: white, black, direct image, and patterns.

use super::flat_field::FlatField;
use super::hdr::RateFrame;
use super::measurement::Measurement;
use super::photo::{Photo, Plane};
use super::registration::combine;
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
        for channel in 0..self.camera_channels() {
            let (photo, full) = (self.sum(&terms, 0.0, channel)?, self.sum(&[], 1.0, channel)?);
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
            help: "calibrate it with `krylux rig calibrate`, and name the calibration in the rig file; or say there, as `response = false` in [measurement], that levels and counts are to be used as they are".into(),
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
        let even = self.flat.as_ref();
        let row = |pixel: usize| {
            let mut row: Vec<(u32, f64)> = Vec::new();
            for &(camera_channel, weight) in &weights {
                row.extend(direct.row(camera_channel, pixel).into_iter().map(|(at, w)| (at, weight * w)));
            }
            row.sort_by_key(|entry| entry.0);
            let runs = row.chunk_by(|a, b| a.0 == b.0);
            let sums = runs.map(|run| (run[0].0, run.iter().map(|entry| entry.1).sum::<f64>()));
            let scaled = |(at, weight): (u32, f64)| {
                (at, even.map_or(weight, |flat| weight / flat.camera[pixel] / flat.projector[at as usize]))
            };
            let seen = |entry: &(u32, f64)| self.seen[entry.0 as usize];
            sums.filter(seen).map(scaled).collect()
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
        let planes = (0..self.camera_channels())
            .map(|channel| self.sum(&terms, 0.0, channel))
            .collect::<Result<Vec<Plane>>>()?;
        Ok(self.photo(planes))
    }
}
