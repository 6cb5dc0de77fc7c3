//! A product of signed vectors, put together from photos: `A x` of the pattern that was *actually* shown, and what is
//! then known of the rest.
//!
//! ```text
//! full     Σ c_k photo_k + a A 1                       (+ d ∘ (x − shown), where rounding is compensated)
//! global   Σ c_k photo_k + a A 1 − d ∘ shown           shown = Σ c_k pattern_k + a
//! direct   d ∘ x                                       without a photo
//! ```
//!
//! with `d` the direct image, and a blur on both sides of all of it.

use std::sync::Arc;

use super::bit_planes::decompose;
use super::direct;
use super::display::Displayed;
use super::hdr::Sighting;
use super::measurement::Measurement;
use super::noise::NoiseAhead;
use super::options::DirectBy;
use super::photo::{Photo, Plane};
use super::registration::combine;
use super::signed::Signed;
use crate::error::{Error, Result};
use crate::rig::Frame;
use crate::transport::Part;

/// A photo that a product is made of.
pub(super) struct Term {
    coefficient: f64,
    sighting: Arc<Sighting>,
    displayed: Displayed,
}

impl Measurement {
    /// `A x` with its variance, for one part and channel.
    pub(super) fn product(&mut self, part: Part, channel: usize, x: &[f64]) -> Result<&Plane> {
        self.check_length("entries of the vector to multiply", x.len())?;
        if x.iter().any(|value| !value.is_finite()) {
            return Err(Error::Numerical(
                "a vector with infinite entries, or such that are no numbers, cannot be shown".into(),
            ));
        }
        let wish = match &self.blur {
            Some(blur) => self.masked(&blur.apply(&self.masked(x))),
            None => self.masked(x),
        };
        let mut product = self.unblurred(part, channel, &wish)?;
        if let Some(blur) = &self.blur {
            product.values = self.masked(&blur.apply(&self.masked(&product.values)));
            product.variance = self.masked(&blur.variance(&product.variance));
        }
        Ok(self.last.insert(product))
    }

    /// What a frame of an earlier session showed, one pattern for each of [`Measurement::channels`], and its photo.
    ///
    /// # Errors
    /// [`Error::Dimension`] when the frame is not of this projector; and whatever keeps the photo from being taken.
    pub fn photograph_frame(&mut self, frame: &Arc<Frame>) -> Result<(Vec<Vec<f64>>, Photo)> {
        self.check_length("pixels of the frame", frame.resolution().pixels())?;
        let displayed = self.display.of_frame(frame);
        let sighting = self.photographer.photograph(frame)?;
        let terms = [Term { coefficient: 1.0, sighting, displayed }];
        let planes = (0..self.camera_channels())
            .map(|channel| self.sum(&terms, 0.0, channel))
            .collect::<Result<Vec<Plane>>>()?;
        let patterns = (0..self.channels()).map(|channel| self.masked(&self.shown(&terms, 0.0, channel)));
        Ok((patterns.collect(), self.photo(planes)))
    }

    /// Photos of the projector's red, green and blue alone: for each of them the planes of the camera's channels. None where either device
    /// is gray.
    ///
    /// # Errors
    /// Whatever keeps them from being taken.
    pub fn primaries(&mut self) -> Result<Option<[[Vec<f64>; 3]; 3]>> {
        if self.camera_channels() != 3 || self.photographer.camera.shots.projector().channels != 3 {
            return Ok(None);
        }
        let pixels = self.resolution().pixels();
        let mut photos: [[Vec<f64>; 3]; 3] = Default::default();
        for (primary, photo) in photos.iter_mut().enumerate() {
            let plane = |channel| self.masked(&vec![f64::from(u8::from(channel == primary)); pixels]);
            let wish: Vec<Vec<f64>> = (0..3).map(plane).collect();
            let mut terms = Vec::new();
            self.capture(1.0, &wish, Part::Full, &mut terms)?;
            for (channel, plane) in photo.iter_mut().enumerate() {
                *plane = self.sum(&terms, 0.0, channel)?.values;
            }
        }
        Ok(Some(photos))
    }

    fn unblurred(&mut self, part: Part, channel: usize, wish: &[f64]) -> Result<Plane> {
        let reading = self.reading(channel);
        let mut terms = Vec::new();
        let mut white = 0.0;
        if part != Part::Direct {
            let signed = self.signed(channel, wish)?;
            white = signed.white;
            for (coefficient, pattern) in signed.parts {
                self.capture(coefficient, &[pattern], part, &mut terms)?;
            }
        }
        let mut product = Plane::zero(wish.len());
        for (camera_channel, weight) in reading {
            let light = match part {
                Part::Direct => self.direct_light(camera_channel, wish)?,
                Part::Full if self.options.compensate_rounding => {
                    let mut light = self.sum(&terms, white, camera_channel)?;
                    let shown = self.shown(&terms, white, camera_channel);
                    let missing: Vec<f64> =
                        wish.iter().zip(shown).map(|(wish, shown)| wish - shown).collect();
                    light.add(1.0, &self.direct_light(camera_channel, &missing)?);
                    light
                }
                Part::Full => self.sum(&terms, white, camera_channel)?,
                Part::Global => {
                    let mut light = self.sum(&terms, white, camera_channel)?;
                    let shown = self.shown(&terms, white, camera_channel);
                    light.add(-1.0, &self.direct_light(camera_channel, &shown)?);
                    light
                }
            };
            product.add(weight, &light);
        }
        Ok(product)
    }

    /// How `wish` is made of patterns.
    fn signed(&mut self, channel: usize, wish: &[f64]) -> Result<Signed> {
        let white = self.white()?;
        let reading = self.reading(channel);
        let channels = self.camera_channels();
        let (basics, camera) = self.photographer.parts()?;
        let ahead = NoiseAhead {
            curve: &camera.curve,
            options: &self.options,
            basics,
            importance: &self.importance,
            reading: &reading,
            channels,
            white: &white.planes[channel].values,
        };
        Ok(Signed::choose(wish, &self.seen, self.options.signed, &ahead))
    }

    /// Shows a pattern, in bit planes, and adds the photos to `terms`.
    pub(super) fn capture(
        &mut self,
        coefficient: f64,
        wish: &[Vec<f64>],
        part: Part,
        terms: &mut Vec<Term>,
    ) -> Result<()> {
        for plane in decompose(&self.display, wish, part, self.options.bit_planes)? {
            let sighting = self.photographer.photograph(&plane.displayed.frame)?;
            terms.push(Term {
                coefficient: coefficient * plane.weight,
                sighting,
                displayed: plane.displayed,
            });
        }
        Ok(())
    }

    /// `Σ coefficient · photo + white · A 1` of one camera channel.
    pub(super) fn sum(&mut self, terms: &[Term], white: f64, channel: usize) -> Result<Plane> {
        let channels = self.camera_channels();
        let basics = self.photographer.basics()?;
        let mut sightings: Vec<&Sighting> = vec![&basics.white];
        let mut coefficients = vec![white];
        for term in terms {
            // The white photo is one photo, however it came in.
            if Arc::ptr_eq(&term.sighting, &basics.white) {
                coefficients[0] += term.coefficient;
            } else {
                sightings.push(&term.sighting);
                coefficients.push(term.coefficient);
            }
        }
        let constant = |_: usize, term: usize| coefficients[term];
        Ok(combine(&self.registration, &sightings, &constant, &basics.blacks, (channel, channels)))
    }

    /// The pattern that the photos stand for: what was shown, not what was wished.
    fn shown(&self, terms: &[Term], white: f64, channel: usize) -> Vec<f64> {
        let mut shown: Vec<f64> = self.seen.iter().map(|&seen| if seen { white } else { 0.0 }).collect();
        for term in terms {
            let light = term.displayed.seen_by(channel, self.camera_channels());
            shown.iter_mut().zip(light).for_each(|(sum, light)| *sum += term.coefficient * light);
        }
        shown
    }

    fn direct_light(&mut self, channel: usize, shown: &[f64]) -> Result<Plane> {
        let direct = &self.direct_planes()?[channel];
        Ok(Plane {
            values: direct.values.iter().zip(shown).map(|(direct, shown)| direct * shown).collect(),
            variance: direct
                .variance
                .iter()
                .zip(shown)
                .map(|(direct, shown)| direct * shown * shown)
                .collect(),
        })
    }

    pub(super) fn direct_planes(&mut self) -> Result<Vec<Plane>> {
        if let Some(direct) = &self.direct {
            return Ok(direct.clone());
        }
        if self.options.direct == DirectBy::None {
            return Err(Error::Option {
                option: "[measurement] direct".into(),
                fault: "the direct light is asked for, but not to be measured".into(),
                help: "give \"patterns\", or keep the direct light in (segment --keep-direct)".into(),
            });
        }
        let (channels, side) = (self.camera_channels(), self.options.direct_square as usize);
        let (mut sightings, mut displayed) = (Vec::new(), Vec::new());
        for pattern in direct::patterns(self.resolution(), side, &self.seen) {
            let shown = self.display.show(&[pattern], Part::Direct)?;
            sightings.push(self.photographer.photograph(&shown.frame)?);
            displayed.push(shown);
        }
        let blacks = &self.photographer.basics()?.blacks;
        let sightings: Vec<&Sighting> = sightings.iter().map(|sighting| &**sighting).collect();
        let of_channel = |channel| {
            let shown: Vec<Vec<f64>> =
                displayed.iter().map(|shown| shown.seen_by(channel, channels)).collect();
            direct::demodulate(&self.registration, &sightings, &shown, blacks, (channel, channels))
        };
        let planes: Vec<Plane> = (0..channels).map(of_channel).collect();
        self.direct = Some(planes.clone());
        Ok(planes)
    }
}
