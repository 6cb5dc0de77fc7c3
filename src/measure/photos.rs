//! Photos in linear light with the variance of each value, and the photos of a measured rig: white, black, direct image and patterns.

use std::sync::Arc;

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use super::display::decompose;
use super::hdr::RateFrame;
use super::measurement::Measurement;
use super::product::PhotoTerm;
use super::registration::combine;
use super::spread::merged;
use crate::error::{Error, Result};
use crate::finding::{Finding, Grade, Ratio};
use crate::image::{Image, Resolution};
use crate::operator::Symmetry;
use crate::transport::Part;

/// The largest accepted deviation of a photo's total light from the light that was shown, as a fraction of white's total light. A rig that
/// was not calibrated is refused when the deviation is larger.
const PROPORTIONAL: f64 = 0.03;

/// The least accepted correlation of a photo with the pattern that was shown. With a wrong pixel map and 64 squares, the correlation is 0 ±
/// 0.13.
const LEAST_CORRELATION: f64 = 0.5;

/// Sums over all pixels of the products of any two of these three: white `w`, white times pattern `h`, and photo `y`. The correlation of
/// photo and pattern follows from these sums.
#[derive(Default)]
struct Likeness([[f64; 3]; 3]);

impl Likeness {
    fn add(&mut self, white: &[f64], pattern: &[f64], photo: &[f64]) {
        for ((&w, share), &y) in white.iter().zip(pattern).zip(photo) {
            let values = [w, w * share, y];
            for (row, a) in self.0.iter_mut().zip(values) {
                row.iter_mut().zip(values).for_each(|(sum, b)| *sum += a * b);
            }
        }
    }

    /// The finding about the correlation of pattern and photo. First, the component along white is removed from pattern and photo.
    fn finding(&self) -> Finding {
        let [[ww, of_white @ ..], ..] = self.0;
        let rest = |a: usize, b: usize| {
            let shared = Ratio::of(of_white[a - 1] * of_white[b - 1], ww, 0.0);
            self.0[a][b] - shared.value().unwrap_or(0.0)
        };
        let [hh, hy, yy] = [rest(1, 1), rest(1, 2), rest(2, 2)];
        let Some(value) = Ratio::of(hy, (hh * yy).max(0.0).sqrt(), 0.0).value() else {
            return Finding::unmeasured("pixel map", "the photo shows no pattern");
        };
        let found = format!("the photo of random squares correlates by {value:.2} with what was projected");
        let help = "turn the camera to what the projector lights, and calibrate with `krylux rig calibrate`: the pixel map does not fit";
        let expected = format!("at least {LEAST_CORRELATION}");
        Finding::at_least("pixel map", [value, 0.0, LEAST_CORRELATION], Grade::Fails, found, expected, help)
    }
}

impl Measurement {
    /// The white photo, `A 1`. It is taken once.
    pub fn white(&mut self) -> Result<Photo> {
        if let Some(white) = &self.white {
            return Ok(white.clone());
        }
        let planes = match &self.flat {
            Some(flat) if !flat.leaves_patterns() => {
                let target = self.even_pattern(&vec![1.0; self.resolution().pixels()]);
                let terms = self.capture(1.0, &[target], Part::Full)?;
                Arc::new(self.sums(&terms, 0.0)?)
            }
            _ => self.full_white()?,
        };
        let white = self.photo(&planes);
        Ok(self.white.insert(white).clone())
    }

    /// The black photo: the light without a pattern. It is taken once. If the ambient stage is off, this light is not known, and the photo
    /// is 0.
    pub fn ambient(&mut self) -> Result<Photo> {
        let channels = self.camera_channels();
        let references = self.pipeline.references()?;
        // The longest exposure has the least noise. The white photo has shown that the black photo is not saturated.
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
        let (map, blacks) = (&self.registration, &references.blacks);
        let plane = |channel| combine(map, &[&rate_frame], &|_, _| 1.0, blacks, (channel, channels));
        let planes: Vec<Plane> = (0..channels).map(plane).collect();
        Ok(self.photo(&planes))
    }

    /// The direct image: the direct light under white, from patterns of high spatial frequency. It is measured once.
    ///
    /// # Errors
    /// [`Error::Option`] when the options exclude this measurement, and the errors of taking its photos.
    pub fn direct(&mut self) -> Result<Photo> {
        let direct = self.direct_light()?;
        let white = self.even_pattern(&vec![1.0; self.resolution().pixels()]);
        let planes: Vec<Plane> =
            (0..self.camera_channels()).map(|channel| direct.under(channel, &white)).collect();
        Ok(self.photo(&planes))
    }

    /// Examines the photo of one pattern. The photo must show the pattern where the pixel map expects it. For a rig that was not
    /// calibrated, the photo must also be in proportion to the shown light. The pattern has random squares if the rig is coaxial. Otherwise
    /// the places of photo and pattern do not correspond, so the pattern has half of the light everywhere. Proportion is not tested when
    /// the responses are switched off, because levels and counts are then used as they are.
    ///
    /// # Errors
    /// [`Error::Rig`] when photos are not in proportion, and the errors of taking the photos.
    pub fn check_pattern(&mut self, is_calibrated: bool) -> Result<Finding> {
        let squares = match self.symmetry() {
            Symmetry::Symmetric => self.squares(),
            Symmetry::General => vec![0.5; self.resolution().pixels()],
        };
        let terms = self.capture(1.0, &[self.masked(&squares)], Part::Full)?;
        let [mut shown, mut seen, mut white, mut error] = [0.0; 4];
        let mut likeness = Likeness::default();
        let whole = self.full_white()?;
        for (channel, full) in whole.iter().enumerate() {
            let photo = self.sum(&terms, 0.0, channel)?;
            let lit = self.shown(&terms, 0.0, channel);
            likeness.add(&full.values, &lit, &photo.values);
            shown += full.values.iter().zip(&lit).map(|(light, share)| light * share).sum::<f64>();
            seen += photo.values.iter().sum::<f64>();
            white += full.values.iter().sum::<f64>();
            error += photo.variance.iter().sum::<f64>();
        }
        let map = match self.symmetry() {
            Symmetry::Symmetric => likeness.finding(),
            Symmetry::General => Finding::unmeasured("pixel map", "projector and camera stand apart"),
        };
        let is_tested = self.options.response && !is_calibrated && map.grade != Grade::Fails;
        if !is_tested || (seen - shown).abs() <= PROPORTIONAL * white + 5.0 * error.sqrt() {
            return Ok(map);
        }
        let [shown, seen] = [shown, seen].map(|light| Ratio::of(light, white, 0.0));
        let fault = format!(
            "it was not calibrated, and its light is not in proportion to its levels: {shown} of white was shown, {seen} was seen"
        );
        Err(Error::rig("rig", fault).help(
            "calibrate it with `krylux rig calibrate RIG --use`; or say in the rig file, as `response = false` in \
             [measurement], that levels and counts are to be used as they are",
        ))
    }

    /// A pattern of random squares with a quarter or three quarters of the light, at least eight squares along each side if pixels suffice.
    fn squares(&self) -> Vec<f64> {
        let size = self.resolution();
        let side = (size.width.min(size.height) / 8).max(1);
        let (across, down) = (size.width.div_ceil(side), size.height.div_ceil(side));
        let mut random = Pcg64::seed_from_u64(0);
        let signs: Vec<f64> = (0..across * down).map(|_| if random.random() { 1.0 } else { -1.0 }).collect();
        let square = |pixel: usize| pixel / size.width / side * across + pixel % size.width / side;
        (0..size.pixels()).map(|pixel| 0.5 + 0.25 * signs[square(pixel)]).collect()
    }

    /// The matrix of the direct light of one channel, `n × n` for `n` pixels. Each row lists columns in ascending order with their weights.
    /// The matrix is diagonal when neither the projector's lens nor the camera's pixels spread light.
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
    /// [`Error::Dimension`] when the pattern does not have the projector's size; [`Error::Numerical`] when a value is out of range; and the
    /// errors of taking the photo.
    pub fn photograph(&mut self, pattern: &Image) -> Result<Photo> {
        self.check_length("pixels of the pattern", pattern.resolution().pixels())?;
        if let Some(wrong) = pattern.samples().iter().find(|sample| !(0.0..=1.0).contains(*sample)) {
            return Err(Error::Numerical(format!(
                "a projector cannot show the value {wrong}\n  help: give patterns with values from 0 to 1"
            )));
        }
        let target: Vec<Vec<f64>> =
            (0..pattern.channels()).map(|channel| self.even_pattern(&pattern.plane(channel))).collect();
        let terms = self.capture(1.0, &target, Part::Full)?;
        let planes = self.sums(&terms, 0.0)?;
        Ok(self.photo(&planes))
    }

    /// Estimates the error of a photo of this pattern that is due to rounding to the projector's levels. For each channel, the estimate is
    /// the norm of the difference between the pattern and the shown pattern, multiplied pixel by pixel by the white photo. It needs no
    /// photo except the white photo.
    pub fn rounding(&mut self, pattern: &Image) -> Result<Vec<f64>> {
        let mut left: Vec<Vec<f64>> =
            (0..pattern.channels()).map(|channel| self.even_pattern(&pattern.plane(channel))).collect();
        let planes = decompose(&self.display, &left, Part::Full, self.options.bit_planes)?;
        let channels = planes.first().map_or(0, |(_, displayed)| displayed.light.len());
        left.resize(channels.max(left.len()), left[0].clone());
        for (weight, displayed) in planes {
            for (left, shown) in left.iter_mut().zip(&displayed.light) {
                left.iter_mut().zip(shown).for_each(|(left, shown)| *left -= weight * shown);
            }
        }
        let most = |pixel: usize| left.iter().map(|left| left[pixel].abs()).fold(0.0, f64::max);
        let light = |(pixel, white): (usize, &f64)| (white * most(pixel)).powi(2);
        let white = self.white()?;
        let of = |plane: &Plane| plane.values.iter().enumerate().map(light).sum::<f64>().sqrt();
        Ok(white.planes.iter().map(of).collect())
    }

    pub(crate) fn full_white(&mut self) -> Result<Arc<Vec<Plane>>> {
        if let Some(white) = &self.full_white {
            return Ok(Arc::clone(white));
        }
        let white = Arc::new(self.sums(&[], 1.0)?);
        Ok(Arc::clone(self.full_white.insert(white)))
    }

    /// The sum `Σ coefficient · photo + white · A 1` for each of the camera's channels.
    pub(crate) fn sums(&mut self, terms: &[PhotoTerm], white: f64) -> Result<Vec<Plane>> {
        (0..self.camera_channels()).map(|channel| self.sum(terms, white, channel)).collect()
    }
}

/// One channel of a photo: the value of each pixel, and its variance.
#[derive(Clone, Debug, PartialEq)]
pub struct Plane {
    /// The values in linear DN per second for a full-range pattern. Noise can make them negative. They are not clipped at zero, because a
    /// clipped photo is not linear in the pattern.
    pub values: Vec<f64>,
    /// The variances of the values, propagated from the camera's noise model. Neighbours that share camera pixels are not independent.
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
    pub(crate) fn zero(pixels: usize) -> Self {
        Self { values: vec![0.0; pixels], variance: vec![0.0; pixels] }
    }

    /// The standard error of the plane as a vector, `√Σ variance`: the expected value of `‖measured − true‖₂`.
    pub fn standard_error(&self) -> f64 {
        self.variance.iter().sum::<f64>().sqrt()
    }

    /// Adds `factor` times another plane with independent noise.
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
    /// [`Error::Dimension`] when there are neither one nor three planes.
    pub fn to_image(&self) -> Result<Image> {
        self.picture(|plane| &plane.values, |value| value)
    }

    /// The standard error of each pixel as an image of one or three channels.
    pub fn errors_to_image(&self) -> Result<Image> {
        self.picture(|plane| &plane.variance, f64::sqrt)
    }

    fn picture(&self, of: fn(&Plane) -> &Vec<f64>, shown: fn(f64) -> f64) -> Result<Image> {
        let samples = (0..self.resolution.pixels())
            .flat_map(|pixel| self.planes.iter().map(move |plane| shown(of(plane)[pixel]) as f32));
        Image::new(self.resolution, self.planes.len(), samples.collect())
    }
}
