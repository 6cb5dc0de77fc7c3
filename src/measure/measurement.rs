//! A rig as a linear operator: the stages put together.

use std::collections::HashSet;
use std::sync::Arc;

use super::calibration::{Calibration, Registration};
use super::display::Display;
use super::drift::DriftReport;
use super::frame_source::{Effort, FrameSource};
use super::hdr::Sighting;
use super::options::MeasureOptions;
use super::photo::{Photo, Plane};
use super::photographer::{Exposer, Photographer};
use super::registration::{choose, combine};
use super::response::CameraCurve;
use crate::error::{Error, Result};
use crate::image::{Blur, Image, Resolution};
use crate::operator::Symmetry;
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
    pub(super) photographer: Photographer,
    pub(super) display: Display,
    pub(super) registration: Registration,
    pub(super) importance: Vec<f64>,
    pub(super) seen: Vec<bool>,
    pub(super) blur: Option<Blur>,
    pub(super) options: MeasureOptions,
    luma: bool,
    symmetry: Symmetry,
    pub(super) white: Option<Vec<Plane>>,
    pub(super) direct: Option<Vec<Plane>>,
    pub(super) last: Option<Plane>,
}

impl Measurement {
    /// Of the rig behind `shots`.
    ///
    /// # Errors
    /// [`Error::Option`] where an option is out of range; [`Error::Dimension`] and [`Error::Numerical`] where the calibration
    /// is not of these devices or makes no sense.
    pub fn new(
        shots: Box<dyn FrameSource>,
        calibration: Calibration,
        options: MeasureOptions,
    ) -> Result<Self> {
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
            symmetry: Symmetry::Symmetric,
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

    /// Declares whether the rig is coaxial, projector and camera with the same pose and lens, so that `A = Aᵀ`. By default it is.
    #[must_use]
    pub fn declared(mut self, symmetry: Symmetry) -> Self {
        self.symmetry = symmetry;
        self
    }

    /// Whether the rig is declared coaxial, and so its matrix symmetric.
    pub fn symmetry(&self) -> Symmetry {
        self.symmetry
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

    /// Share of the camera's samples that some exposure of the white photo saturates: there the shorter ones count.
    ///
    /// # Errors
    /// Whatever keeps the white photo from being taken.
    pub fn saturated(&mut self) -> Result<f64> {
        Ok(self.photographer.basics()?.saturated)
    }

    /// What the drift sentinel saw.
    ///
    /// # Errors
    /// Whatever keeps the white photo from being taken.
    pub fn drift(&mut self) -> Result<DriftReport> {
        Ok(self.photographer.basics()?.drift.report())
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
        self.capture(1.0, &wish, Part::Full, &mut terms)?;
        let planes = (0..self.camera_channels())
            .map(|channel| self.sum(&terms, 0.0, channel))
            .collect::<Result<Vec<Plane>>>()?;
        Ok(self.photo(planes))
    }

    /// The last product, with the variance of each entry.
    pub fn last_product(&self) -> Option<&Plane> {
        self.last.as_ref()
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

    pub(super) fn photo(&self, planes: Vec<Plane>) -> Photo {
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
    pub(super) fn reading(&self, channel: usize) -> Vec<(usize, f64)> {
        if self.luma && self.camera_channels() == 3 {
            LUMINANCE.into_iter().enumerate().collect()
        } else {
            vec![(channel, 1.0)]
        }
    }

    pub(super) fn camera_channels(&self) -> usize {
        self.photographer.camera.shots.camera().channels
    }

    pub(super) fn masked(&self, x: &[f64]) -> Vec<f64> {
        x.iter().zip(&self.seen).map(|(&x, &seen)| if seen { x } else { 0.0 }).collect()
    }

    pub(super) fn check_length(&self, what: &'static str, found: usize) -> Result<()> {
        let expected = self.resolution().pixels();
        if found == expected {
            return Ok(());
        }
        Err(Error::Dimension { what, expected: expected.to_string(), found: found.to_string() })
    }
}
