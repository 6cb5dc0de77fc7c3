//! A rig as a linear operator: the stages put together.

use std::collections::HashSet;
use std::sync::Arc;

use super::bit_planes::decompose;
use super::calibration::{Calibration, Registration};
use super::direct;
use super::display::{Display, Displayed};
use super::drift::DriftReport;
use super::hdr::Sighting;
use super::noise::NoiseAhead;
use super::operator::MeasuredOperator;
use super::options::{DirectBy, MeasureOptions};
use super::photo::{Photo, Plane};
use super::photographer::{Exposer, Photographer};
use super::registration::{choose, combine};
use super::response::CameraCurve;
use super::shots::{Effort, Shots};
use super::signed::Signed;
use crate::error::{Error, Result};
use crate::image::{Blur, Image, Resolution};
use crate::rig::Frame;
use crate::transport::Part;

/// Relative luminance of linear Rec. 709.
const LUMINANCE: [f64; 3] = [0.2126, 0.7152, 0.0722];

/// A rig that is measured: raw frames in, photos and products out.
///
/// Nothing is shot before it is needed; then, first of all, white test shots (unless exposures are given), black and
/// white. What is shot is a function of the options, of what is asked for, and of the frames so far.
///
/// All results are on the projector's pixels, in linear DN per second for a full-range pattern. Pixels that no camera pixel sees are masked:
/// they are never lit, and their values are 0.
pub struct Measurement {
    photographer: Photographer,
    display: Display,
    registration: Registration,
    importance: Vec<f64>,
    seen: Vec<bool>,
    blur: Option<Blur>,
    options: MeasureOptions,
    luma: bool,
    white: Option<Vec<Plane>>,
    direct: Option<Vec<Plane>>,
    last: Option<Plane>,
}

/// A photo that a product is made of.
struct Term {
    coefficient: f64,
    sighting: Arc<Sighting>,
    displayed: Displayed,
}

impl Measurement {
    /// Of the rig behind `shots`.
    ///
    /// # Errors
    /// [`Error::Option`] where an option is out of range; [`Error::Dimension`] and [`Error::Numerical`] where the calibration
    /// is not of these devices or makes no sense.
    pub fn new(shots: Box<dyn Shots>, calibration: Calibration, options: MeasureOptions) -> Result<Self> {
        options.check()?;
        let (projector, camera) = (shots.projector().clone(), shots.camera().clone());
        if calibration.projector.len() != projector.channels {
            return Err(Error::Dimension {
                what: "response curves of the projector in the calibration",
                expected: format!("{}, one for each channel,", projector.channels),
                found: calibration.projector.len().to_string(),
            });
        }
        let [shortest, longest] = camera.exposures;
        if let Some(exposure) =
            options.exposures.iter().find(|&&seconds| !(shortest..=longest).contains(&seconds))
        {
            return Err(Error::Option {
                option: "[measurement] exposures".into(),
                fault: format!("{exposure} s is not among the camera's exposures"),
                help: format!("give seconds from {shortest} to {longest}"),
            });
        }
        let curve = CameraCurve::new(&calibration.camera, camera.bits, options.response)?;
        let display = Display::new(
            &projector,
            &calibration.projector,
            options.response,
            options.dither,
            options.dither_seed,
        )?;
        let registration = choose(&calibration.registration, &projector, &camera, options.registration)?;
        let seen = registration.seen();
        let importance = registration.importance(camera.resolution);
        let mask: Vec<f64> = seen.iter().map(|&seen| f64::from(u8::from(seen))).collect();
        let white = display.show_below(&[mask])?.frame;
        let black = Arc::new(Frame::filled(projector.resolution, projector.channels, 0));
        let exposer = Exposer {
            shots,
            curve,
            used: importance.iter().map(|&importance| importance > 0.0).collect(),
            white,
            black,
            options: options.clone(),
            shown: HashSet::new(),
        };
        Ok(Self {
            photographer: Photographer::new(exposer),
            display,
            blur: Blur::new(projector.resolution, options.blur),
            registration,
            importance,
            seen,
            options,
            luma: false,
            white: None,
            direct: None,
            last: None,
        })
    }

    /// Reads a colour camera as a gray one from here on: its channels weighted by luminance.
    #[must_use]
    pub fn in_luma(mut self) -> Self {
        self.luma = true;
        self
    }

    /// The projector's pixels: those of patterns and photos.
    pub fn resolution(&self) -> Resolution {
        self.registration.projector
    }

    /// The channels that can be measured, 1 or 3.
    pub fn channels(&self) -> usize {
        if self.luma { 1 } else { self.camera_channels() }
    }

    /// How it is measured.
    pub fn options(&self) -> &MeasureOptions {
        &self.options
    }

    /// Which pixels some camera pixel sees. The others are masked.
    pub fn seen(&self) -> &[bool] {
        &self.seen
    }

    /// What it has cost so far.
    pub fn effort(&self) -> Effort {
        self.photographer.camera.shots.effort()
    }

    /// Different patterns shown so far, black and white among them.
    pub fn patterns(&self) -> usize {
        self.photographer.camera.shown.len()
    }

    /// The exposures in use, in seconds.
    ///
    /// # Errors
    /// Whatever keeps the photos from being taken that they are chosen by.
    pub fn exposures(&mut self) -> Result<Vec<f64>> {
        Ok(self.photographer.basics()?.exposures.clone())
    }

    /// What the drift sentinel saw.
    ///
    /// # Errors
    /// Whatever keeps the white photo from being taken.
    pub fn drift(&mut self) -> Result<DriftReport> {
        Ok(self.photographer.basics()?.drift.report())
    }

    /// One channel of the rig's matrix as the Krylov methods see it.
    pub fn operator(&mut self, part: Part, channel: usize) -> MeasuredOperator<'_> {
        debug_assert!(channel < self.channels());
        MeasuredOperator { measurement: self, part, channel }
    }

    /// The white photo, `A 1`. It is taken once.
    ///
    /// # Errors
    /// Whatever keeps it from being taken.
    pub fn white(&mut self) -> Result<Photo> {
        let planes = self.white_planes()?;
        Ok(self.photo(planes))
    }

    /// The black photo: what is there without a pattern. It is taken once; without the ambient stage it is unknown, and 0.
    ///
    /// # Errors
    /// Whatever keeps it from being taken.
    pub fn ambient(&mut self) -> Result<Photo> {
        let channels = self.camera_channels();
        let basics = self.photographer.basics()?;
        // The longest exposure has the least noise wherever it is not saturated, which the white photo has made sure of.
        let Some((black, variance)) = basics.blacks.exposed.last().zip(basics.blacks.variance.last()) else {
            let planes = vec![Plane::zero(self.registration.projector.pixels()); channels];
            return Ok(self.photo(planes));
        };
        let sighting = Sighting {
            started: black.started,
            values: black.mean.iter().map(|mean| mean / black.exposure).collect(),
            variance: variance.clone(),
            shares: None,
            scale: 0.0,
        };
        let planes = (0..channels)
            .map(|channel| {
                combine(&self.registration, &[&sighting], &|_, _| 1.0, &basics.blacks, (channel, channels))
            })
            .collect();
        Ok(self.photo(planes))
    }

    /// The direct image, `diag(A_direct)`, by shifted squares. It is taken once.
    ///
    /// # Errors
    /// [`Error::Option`] when the options do not have it measured; and whatever keeps it from being taken.
    pub fn direct(&mut self) -> Result<Photo> {
        let planes = self.direct_planes()?;
        Ok(self.photo(planes))
    }

    /// The photo of a pattern of light, gray or coloured, in `[0, 1]`.
    ///
    /// # Errors
    /// [`Error::Dimension`] when the pattern is not of the projector's size; [`Error::Numerical`] when it is out of range; and
    /// whatever keeps the photo from being taken.
    pub fn photograph(&mut self, pattern: &Image) -> Result<Photo> {
        self.check_length("pixels of the pattern", pattern.resolution().pixels())?;
        if let Some(wrong) = pattern.samples().iter().find(|sample| !(0.0..=1.0).contains(*sample)) {
            return Err(Error::Numerical(format!(
                "a projector cannot show {wrong}\n  help: give patterns of values from 0 to 1"
            )));
        }
        let wish: Vec<Vec<f64>> =
            (0..pattern.channels()).map(|channel| self.masked(&pattern.plane(channel))).collect();
        let mut terms = Vec::new();
        self.shoot(1.0, &wish, &mut terms)?;
        let planes = (0..self.camera_channels())
            .map(|channel| self.sum(&terms, 0.0, channel))
            .collect::<Result<Vec<Plane>>>()?;
        Ok(self.photo(planes))
    }

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

    /// The last product, with the variance of each entry.
    pub fn last_product(&self) -> Option<&Plane> {
        self.last.as_ref()
    }

    fn unblurred(&mut self, part: Part, channel: usize, wish: &[f64]) -> Result<Plane> {
        let reading = self.reading(channel);
        let mut terms = Vec::new();
        let mut white = 0.0;
        if part != Part::Direct {
            let signed = self.signed(channel, wish)?;
            white = signed.white;
            for (coefficient, pattern) in signed.parts {
                self.shoot(coefficient, &[pattern], &mut terms)?;
            }
        }
        let mut product = Plane::zero(wish.len());
        for (camera_channel, weight) in reading {
            let light = match part {
                Part::Direct => self.direct_light(camera_channel, wish)?,
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
    fn shoot(&mut self, coefficient: f64, wish: &[Vec<f64>], terms: &mut Vec<Term>) -> Result<()> {
        for plane in decompose(&self.display, wish, self.options.bit_planes)? {
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
    fn sum(&mut self, terms: &[Term], white: f64, channel: usize) -> Result<Plane> {
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

    fn white_planes(&mut self) -> Result<Vec<Plane>> {
        if self.white.is_none() {
            let planes = (0..self.camera_channels())
                .map(|channel| self.sum(&[], 1.0, channel))
                .collect::<Result<Vec<Plane>>>()?;
            self.white = Some(planes);
        }
        Ok(self.white.clone().unwrap_or_default())
    }

    fn direct_planes(&mut self) -> Result<Vec<Plane>> {
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
            let shown = self.display.show(&[pattern])?;
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

    fn photo(&self, planes: Vec<Plane>) -> Photo {
        let fold = |channel| {
            let mut folded = Plane::zero(self.registration.projector.pixels());
            for (camera_channel, weight) in self.reading(channel) {
                folded.add(weight, &planes[camera_channel]);
            }
            folded
        };
        Photo { resolution: self.resolution(), planes: (0..self.channels()).map(fold).collect() }
    }

    /// The camera's channels that one of ours is made of, and their weights.
    fn reading(&self, channel: usize) -> Vec<(usize, f64)> {
        if self.luma && self.camera_channels() == 3 {
            LUMINANCE.into_iter().enumerate().collect()
        } else {
            vec![(channel, 1.0)]
        }
    }

    fn camera_channels(&self) -> usize {
        self.photographer.camera.shots.camera().channels
    }

    fn masked(&self, x: &[f64]) -> Vec<f64> {
        x.iter().zip(&self.seen).map(|(&x, &seen)| if seen { x } else { 0.0 }).collect()
    }

    fn check_length(&self, what: &'static str, found: usize) -> Result<()> {
        let expected = self.resolution().pixels();
        if found == expected {
            return Ok(());
        }
        Err(Error::Dimension { what, expected: expected.to_string(), found: found.to_string() })
    }
}
