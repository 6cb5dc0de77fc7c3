//! Products with signed vectors (O'Toole and Kutulakos, section 7.1), assembled from photos of the patterns that were *actually* shown.
//!
//! ```text
//! full     Σ c_k photo_k + a A 1                       (+ D (x − shown), where rounding is compensated)
//! global   Σ c_k photo_k + a A 1 − D shown             shown = Σ c_k pattern_k + a
//! direct   D x                                         without a photo
//! ```
//!
//! Here `c_k` is the coefficient of the photo of pattern `k`, `D` is the direct light ([`DirectMatrix`]), and `a` is the coefficient of the
//! white photo `A 1`. The optional blur (section 8.2) is applied to the vector first and to the finished product last.

use std::sync::Arc;

use super::direct::{DirectMatrix, DirectPatterns};
use super::display::{Displayed, decompose};
use super::hdr::RateFrame;
use super::measurement::Measurement;
use super::options::DirectBy;
use super::photos::{Photo, Plane};
use super::registration::combine;
use super::signed::{NoisePrediction, Signed};
use crate::error::{Error, Result};
use crate::rig::Frame;
use crate::transport::Part;

/// One photo in the sum that makes a product.
pub(crate) struct PhotoTerm {
    coefficient: f64,
    rate_frame: Arc<RateFrame>,
    displayed: Displayed,
}

impl Measurement {
    /// The product of `x` with one part and one channel of the rig's matrix, and the variance of each entry.
    pub(crate) fn product(&mut self, part: Part, channel: usize, x: &[f64]) -> Result<&Plane> {
        self.check_length("entries of the vector to multiply", x.len())?;
        if x.iter().any(|value| !value.is_finite()) {
            return Err(Error::Numerical(
                "a vector with entries that are infinite or NaN cannot be shown".into(),
            ));
        }
        let target = match &self.blur {
            Some(blur) => self.even_pattern(&blur.apply(&self.masked(x))),
            None => self.even_pattern(x),
        };
        let product = self.unblurred(part, channel, &target)?;
        let mut product = self.light(product);
        if let Some(blur) = &self.blur {
            product.values = self.masked(&blur.apply(&self.masked(&product.values)));
            product.variance = self.masked(&blur.variance(&product.variance));
        }
        Ok(self.last.insert(product))
    }

    /// The pattern that a frame shows, for each of [`Measurement::channels`], and its photo.
    ///
    /// # Errors
    /// [`Error::Dimension`] when the frame does not have the projector's pixels, and the errors of taking the photo.
    pub fn photograph_frame(&mut self, frame: &Arc<Frame>) -> Result<(Vec<Vec<f64>>, Photo)> {
        self.check_length("pixels of the frame", frame.resolution().pixels())?;
        let displayed = self.display.of_frame(frame);
        let rate_frame = self.pipeline.photograph(frame)?;
        let terms = [PhotoTerm { coefficient: 1.0, rate_frame, displayed }];
        let planes = self.sums(&terms, 0.0)?;
        let pattern = |channel| {
            let shown = self.masked(&self.shown(&terms, 0.0, channel));
            match &self.flat {
                Some(flat) => flat.shown(&shown),
                None => shown,
            }
        };
        Ok(((0..self.channels()).map(pattern).collect(), self.photo(&planes)))
    }

    /// Photos of the projector's red, green and blue, each shown alone. For each primary, the result has the values of the camera's three
    /// channels. It is `None` when the projector or the camera is gray.
    pub fn primaries(&mut self) -> Result<Option<[[Vec<f64>; 3]; 3]>> {
        if self.camera_channels() != 3 || self.pipeline.frames.projector().channels != 3 {
            return Ok(None);
        }
        let pixels = self.resolution().pixels();
        let mut photos: [[Vec<f64>; 3]; 3] = Default::default();
        for (primary, photo) in photos.iter_mut().enumerate() {
            let plane = |channel| self.even_pattern(&vec![f64::from(u8::from(channel == primary)); pixels]);
            let target: Vec<Vec<f64>> = (0..3).map(plane).collect();
            let terms = self.capture(1.0, &target, Part::Full)?;
            for (channel, plane) in photo.iter_mut().enumerate() {
                let sum = self.sum(&terms, 0.0, channel)?;
                *plane = self.light(sum).values;
            }
        }
        Ok(Some(photos))
    }

    /// The product without the blur. It still contains the uneven brightness of the devices.
    fn unblurred(&mut self, part: Part, channel: usize, target: &[f64]) -> Result<Plane> {
        let channel_weights = self.channel_weights(channel);
        let mut terms = Vec::new();
        let mut white = 0.0;
        if part != Part::Direct {
            let signed = self.signed(channel, target)?;
            white = signed.white;
            for (coefficient, pattern) in signed.parts {
                terms.extend(self.capture(coefficient, &[pattern], part)?);
            }
        }
        let mut product = Plane::zero(target.len());
        for (camera_channel, weight) in channel_weights {
            let mut light = match part {
                Part::Direct => self.direct_under(camera_channel, target)?,
                Part::Full | Part::Global => self.sum(&terms, white, camera_channel)?,
            };
            if part == Part::Global {
                let shown = self.shown(&terms, white, camera_channel);
                light.add(-1.0, &self.direct_under(camera_channel, &shown)?);
            } else if part == Part::Full && self.options.compensate_rounding {
                let shown = self.shown(&terms, white, camera_channel);
                let missing: Vec<f64> =
                    target.iter().zip(shown).map(|(target, shown)| target - shown).collect();
                light.add(1.0, &self.direct_under(camera_channel, &missing)?);
            }
            product.add(weight, &light);
        }
        Ok(product)
    }

    /// Decomposes `target` into patterns, for the photos of one channel.
    fn signed(&mut self, channel: usize, target: &[f64]) -> Result<Signed> {
        let white = self.full_white()?;
        let white = self.folded(&white, channel);
        let channel_weights = self.channel_weights(channel);
        let channels = self.camera_channels();
        let references = self.pipeline.references()?;
        let noise = NoisePrediction {
            curve: &self.pipeline.curve,
            options: &self.options,
            references: &references,
            importance: &self.importance,
            channel_weights: &channel_weights,
            channels,
            white: &white.values,
        };
        Ok(Signed::choose(target, &self.seen, self.options.signed, &noise))
    }

    /// Shows a pattern in bit planes, and returns the photos of the bit planes.
    pub(crate) fn capture(
        &mut self,
        coefficient: f64,
        target: &[Vec<f64>],
        part: Part,
    ) -> Result<Vec<PhotoTerm>> {
        let planes = decompose(&self.display, target, part, self.options.bit_planes)?;
        let term = |(weight, displayed): (f64, Displayed)| {
            let rate_frame = self.pipeline.photograph(&displayed.frame)?;
            Ok(PhotoTerm { coefficient: coefficient * weight, rate_frame, displayed })
        };
        planes.into_iter().map(term).collect()
    }

    /// The sum `Σ coefficient · photo + white · A 1` for one channel of the camera.
    pub(crate) fn sum(&mut self, terms: &[PhotoTerm], white: f64, channel: usize) -> Result<Plane> {
        let channels = self.camera_channels();
        let references = self.pipeline.references()?;
        let mut rate_frames: Vec<&RateFrame> = vec![&references.white];
        let mut coefficients = vec![white];
        for term in terms {
            // The white photo may also be a term. It must not count as a second, independent photo.
            if Arc::ptr_eq(&term.rate_frame, &references.white) {
                coefficients[0] += term.coefficient;
            } else {
                rate_frames.push(&term.rate_frame);
                coefficients.push(term.coefficient);
            }
        }
        let constant = |_: usize, term: usize| coefficients[term];
        Ok(combine(&self.registration, &rate_frames, &constant, &references.blacks, (channel, channels)))
    }

    /// The pattern that was shown. It differs from the target by rounding to levels.
    pub(crate) fn shown(&self, terms: &[PhotoTerm], white: f64, channel: usize) -> Vec<f64> {
        let mut shown: Vec<f64> = self.seen.iter().map(|&seen| if seen { white } else { 0.0 }).collect();
        for term in terms {
            let light = term.displayed.seen_by(channel, self.camera_channels());
            shown.iter_mut().zip(light).for_each(|(sum, light)| *sum += term.coefficient * light);
        }
        shown
    }

    /// The direct light under a pattern, for one channel of the camera.
    fn direct_under(&mut self, channel: usize, pattern: &[f64]) -> Result<Plane> {
        Ok(self.direct_light()?.under(channel, pattern))
    }

    /// The standard error of `xᵀ D x` for the direct light `D` of one channel.
    pub(crate) fn direct_error(&mut self, channel: usize, x: &[f64]) -> Result<f64> {
        self.check_length("entries of the vector to multiply", x.len())?;
        let blurred = match &self.blur {
            Some(blur) => self.masked(&blur.apply(&self.masked(x))),
            None => self.masked(x),
        };
        let pattern = self.even_pattern(&blurred);
        // `light` divides each pixel of a photo by a factor. Dividing the left vector by the same factors has the same effect.
        let photo = self.light(Plane { variance: vec![0.0; blurred.len()], values: blurred }).values;
        let direct = self.direct_light()?;
        let of_channel =
            |(channel, weight): (usize, f64)| weight * direct.error_of_form(channel, &photo, &pattern);
        Ok(self.channel_weights(channel).into_iter().map(of_channel).fold(0.0, f64::hypot))
    }

    /// The direct light. It is measured once.
    pub(crate) fn direct_light(&mut self) -> Result<Arc<DirectMatrix>> {
        if let Some(direct) = &self.direct {
            return Ok(Arc::clone(direct));
        }
        if self.options.direct == DirectBy::None {
            return Err(Error::option(
                "[measurement] direct",
                "the direct light is needed, but this option excludes its measurement",
            )
            .help("give \"patterns\", or keep the direct light (segment --keep-direct)"));
        }
        let channels = self.camera_channels();
        let patterns = match self.options.direct_square {
            Some(side) => DirectPatterns::Squares(side as usize),
            None => DirectPatterns::of(&self.registration),
        };
        let (rate_frames, displayed) = match self.photographs(patterns) {
            // Earlier versions showed squares of two or four pixels in place of codes. Their runs can still be queried.
            Err(Error::NotTaken { path, fault, help }) if patterns == DirectPatterns::Codes => self
                .photographs(DirectPatterns::Squares(2))
                .or_else(|_| self.photographs(DirectPatterns::Squares(4)))
                .map_err(|_| Error::not_taken(path, fault).help(help))?,
            photos => photos?,
        };
        let references = self.pipeline.references()?;
        let rate_frames: Vec<&RateFrame> = rate_frames.iter().map(|rate_frame| &**rate_frame).collect();
        let of_channel = |channel| -> Vec<Vec<f64>> {
            displayed.iter().map(|shown| shown.seen_by(channel, channels)).collect()
        };
        let shown: Vec<Vec<Vec<f64>>> = (0..channels).map(of_channel).collect();
        let direct =
            Arc::new(DirectMatrix::fit(&self.registration, &rate_frames, &shown, &references.blacks));
        self.direct = Some(Arc::clone(&direct));
        Ok(direct)
    }

    /// Photographs the patterns for direct light. Returns the photos and the shown patterns.
    fn photographs(&mut self, patterns: DirectPatterns) -> Result<(Vec<Arc<RateFrame>>, Vec<Displayed>)> {
        let (mut rate_frames, mut displayed) = (Vec::new(), Vec::new());
        for pattern in patterns.shown(self.resolution(), &self.seen) {
            let shown = self.display.show(&[pattern], Part::Direct)?;
            rate_frames.push(self.pipeline.photograph(&shown.frame)?);
            displayed.push(shown);
        }
        Ok((rate_frames, displayed))
    }
}
