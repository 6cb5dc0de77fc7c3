//! A measured rig: all stages between its raw frames and its photos.

use std::sync::Arc;

use super::calibration::{Calibration, FlatField, Registration};
use super::direct::DirectMatrix;
use super::display::PatternDisplay;
use super::frame_source::{Effort, FrameSource};
use super::options::MeasureOptions;
use super::photo_pipeline::{DriftReport, PhotoPipeline};
use super::photos::{Photo, Plane};
use super::registration::choose;
use super::response::CameraCurve;
use crate::error::{Error, Result};
use crate::image::{Blur, LUMINANCE, Resolution};
use crate::operator::{Adjoint, Operator, Symmetry};
use crate::transport::Part;

/// A measured rig: it takes raw frames, and makes photos and products from them.
///
/// Each photo is taken when it is first needed. The first photos are test photos of white (unless the options give exposures), then photos
/// of black and white. The set of photos depends only on the options, the calls and the earlier frames, so that a journal can replay them.
///
/// All results are on the projector's pixels, in linear DN per second for a full-range pattern. Pixels that no camera pixel sees are
/// masked: they are never lit, and their values are 0.
pub struct Measurement {
    pub(crate) pipeline: PhotoPipeline,
    pub(crate) display: PatternDisplay,
    pub(crate) registration: Registration,
    pub(crate) importance: Vec<f64>,
    pub(crate) seen: Vec<bool>,
    pub(crate) flat: Option<FlatField>,
    pub(crate) blur: Option<Blur>,
    pub(crate) options: MeasureOptions,
    luma: bool,
    symmetry: Symmetry,
    /// The photo of the brightest frame, with one plane for each of the camera's channels.
    pub(crate) full_white: Option<Arc<Vec<Plane>>>,
    /// The photo of white after the projector's uneven brightness is corrected.
    pub(crate) white: Option<Photo>,
    pub(crate) direct: Option<Arc<DirectMatrix>>,
    pub(crate) last: Option<Plane>,
}

impl Measurement {
    /// A measurement of the rig that delivers `frames`.
    ///
    /// # Errors
    /// [`Error::Option`] when an option is out of range; [`Error::Dimension`] or [`Error::Numerical`] when the calibration is invalid or
    /// belongs to other devices.
    pub fn new(
        frames: Box<dyn FrameSource>,
        calibration: Calibration,
        options: MeasureOptions,
    ) -> Result<Self> {
        options.check()?;
        let (projector, camera) = (frames.projector().clone(), frames.camera().clone());
        if calibration.projector.len() != projector.channels {
            return Err(Error::dimension(
                "response curves of the projector in the calibration",
                format!("{}, one for each channel,", projector.channels),
                calibration.projector.len(),
            ));
        }
        let [shortest, longest] = camera.exposures;
        if let Some(exposure) =
            options.exposures.iter().find(|&&seconds| !(shortest..=longest).contains(&seconds))
        {
            return Err(Error::option(
                "[measurement] exposures",
                format!("{exposure} s is outside of the camera's range"),
            )
            .help(format!("give seconds from {shortest} to {longest}")));
        }
        let curve = CameraCurve::new(&calibration.camera, camera.bits, options.response)?;
        let display = PatternDisplay::new(
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
        let used = importance.iter().map(|&importance| importance > 0.0).collect();
        Ok(Self {
            pipeline: PhotoPipeline::new(frames, curve, used, white, options.clone()),
            display,
            blur: Blur::new(projector.resolution, options.blur),
            flat: calibration.flat_field.filter(|_| options.flat_field),
            registration,
            importance,
            seen,
            options,
            luma: false,
            symmetry: Symmetry::Symmetric,
            full_white: None,
            white: None,
            direct: None,
            last: None,
        })
    }

    /// Converts a colour camera to gray. Its channels are weighted by luminance.
    #[must_use]
    pub fn in_luma(mut self) -> Self {
        self.luma = true;
        self
    }

    /// Declares whether the rig is coaxial (the default). The projector and camera of a coaxial rig have the same pose and lens, so that `A
    /// = Aᵀ`.
    #[must_use]
    pub fn declared(mut self, symmetry: Symmetry) -> Self {
        self.symmetry = symmetry;
        self
    }

    /// Whether the rig was declared coaxial, so that its matrix is symmetric.
    pub fn symmetry(&self) -> Symmetry {
        self.symmetry
    }

    /// The projector's pixels, which are also the pixels of photos.
    pub fn resolution(&self) -> Resolution {
        self.registration.projector
    }

    /// The number of channels that can be measured, 1 or 3.
    pub fn channels(&self) -> usize {
        if self.luma { 1 } else { self.camera_channels() }
    }

    /// The options of the stages.
    pub fn options(&self) -> &MeasureOptions {
        &self.options
    }

    /// Whether each projector pixel is seen by at least one camera pixel. Projector pixels that are not seen are masked.
    pub fn seen(&self) -> &[bool] {
        &self.seen
    }

    /// The costs of the session so far.
    pub fn effort(&self) -> Effort {
        self.pipeline.frames.effort()
    }

    /// The number of different patterns that were shown so far, including black and white.
    pub fn patterns(&self) -> usize {
        self.pipeline.shown.len()
    }

    /// The exposures in use, in seconds.
    pub fn exposures(&mut self) -> Result<Vec<f64>> {
        Ok(self.pipeline.references()?.exposures.clone())
    }

    /// The fraction of the camera's samples that are saturated in some exposure of the white photo. Shorter exposures replace these
    /// samples.
    pub fn saturated(&mut self) -> Result<f64> {
        Ok(self.pipeline.references()?.saturated)
    }

    /// The drift of the lamp, measured by repeated photos of white.
    pub fn drift(&mut self) -> Result<DriftReport> {
        self.pipeline.references()?;
        Ok(self.pipeline.drift.report())
    }

    /// The last product of an operator of this rig, with the variance of each entry.
    pub fn last_product(&self) -> Option<&Plane> {
        self.last.as_ref()
    }

    /// Makes a photo from planes of the camera's channels.
    pub(crate) fn photo(&self, planes: &[Plane]) -> Photo {
        let of = |channel| self.light(self.folded(planes, channel));
        Photo { resolution: self.resolution(), planes: (0..self.channels()).map(of).collect() }
    }

    /// Makes one channel of the measurement from planes of the camera's channels.
    pub(crate) fn folded(&self, planes: &[Plane], channel: usize) -> Plane {
        let mut folded = Plane::zero(self.registration.projector.pixels());
        for (camera_channel, weight) in self.channel_weights(channel) {
            folded.add(weight, &planes[camera_channel]);
        }
        folded
    }

    /// The pattern to show for `x`. It is 0 at the masked pixels, and divided by the projector's uneven brightness.
    pub(crate) fn even_pattern(&self, x: &[f64]) -> Vec<f64> {
        let masked = self.masked(x);
        match &self.flat {
            Some(flat) => flat.pattern(&masked),
            None => masked,
        }
    }

    /// Divides a photo by the camera's uneven brightness.
    pub(crate) fn light(&self, plane: Plane) -> Plane {
        match &self.flat {
            Some(flat) => flat.light(plane),
            None => plane,
        }
    }

    /// The camera's channels that make up one channel of the measurement, and their weights.
    pub(crate) fn channel_weights(&self, channel: usize) -> Vec<(usize, f64)> {
        if self.luma && self.camera_channels() == 3 {
            LUMINANCE.into_iter().enumerate().collect()
        } else {
            vec![(channel, 1.0)]
        }
    }

    pub(crate) fn camera_channels(&self) -> usize {
        self.pipeline.frames.camera().channels
    }

    pub(crate) fn masked(&self, x: &[f64]) -> Vec<f64> {
        x.iter().zip(&self.seen).map(|(&x, &seen)| if seen { x } else { 0.0 }).collect()
    }

    pub(crate) fn check_length(&self, what: &'static str, found: usize) -> Result<()> {
        let expected = self.resolution().pixels();
        if found == expected {
            return Ok(());
        }
        Err(Error::dimension(what, expected, found))
    }
}

/// The operator `y = P x`, where `P` is one part and one channel of a rig's matrix. Each product takes the photos that it needs; a constant
/// `x` needs none.
///
/// The operator is symmetric if [`Measurement::symmetry`] says so, which `krylux audit` tests. A product with the transpose of a
/// nonsymmetric matrix cannot be photographed: camera and projector would have to change places.
pub struct MeasuredOperator<'a> {
    pub(crate) measurement: &'a mut Measurement,
    pub(crate) part: Part,
    pub(crate) channel: usize,
    /// The standard errors of the products of the last call.
    errors: Vec<f64>,
}

impl Measurement {
    /// The operator of one part and one channel of the rig's matrix.
    pub fn operator(&mut self, part: Part, channel: usize) -> MeasuredOperator<'_> {
        debug_assert!(channel < self.channels());
        MeasuredOperator { measurement: self, part, channel, errors: Vec::new() }
    }
}

impl MeasuredOperator<'_> {
    /// The last product, with the variance of each entry.
    pub fn last_product(&self) -> Option<&Plane> {
        self.measurement.last_product()
    }

    /// The measured rig.
    pub fn measurement(&self) -> &Measurement {
        self.measurement
    }
}

impl Operator for MeasuredOperator<'_> {
    fn rows(&self) -> usize {
        self.measurement.resolution().pixels()
    }

    fn cols(&self) -> usize {
        self.rows()
    }

    fn symmetry(&self) -> Symmetry {
        self.measurement.symmetry()
    }

    fn apply_block(&mut self, xs: &[&[f64]], ys: &mut [&mut [f64]]) -> Result<()> {
        self.errors.clear();
        for (x, y) in xs.iter().zip(ys) {
            if y.len() != self.rows() {
                return Err(Error::dimension("entries of the product", self.rows(), y.len()));
            }
            let product = self.measurement.product(self.part, self.channel, x)?;
            y.copy_from_slice(&product.values);
            self.errors.push(product.standard_error());
        }
        Ok(())
    }

    fn standard_errors(&self) -> Vec<f64> {
        self.errors.clone()
    }

    fn variances(&self) -> Vec<f64> {
        self.last_product().map_or_else(Vec::new, |product| product.variance.clone())
    }

    fn common_error(&mut self, x: &[f64]) -> Result<f64> {
        match self.part {
            Part::Full => Ok(0.0),
            Part::Direct | Part::Global => self.measurement.direct_error(self.channel, x),
        }
    }

    fn frames(&self) -> Option<u64> {
        Some(self.measurement.effort().frames())
    }
}

impl Adjoint for MeasuredOperator<'_> {
    fn apply_adjoint(&mut self, y: &[f64], x: &mut [f64]) -> Result<()> {
        match self.symmetry() {
            Symmetry::Symmetric => self.apply(y, x),
            Symmetry::General => Err(Error::Numerical(
                "a rig that is not coaxial cannot take photos of its transpose\n  help: use a method without the transpose, such as gmres or krylov-box, or exchange the devices: krylux::operator::Exchanged takes both rigs"
                    .into(),
            )),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::{JournaledFrames, LiveFrames, Opener};

    /// A call compiles only if `T` may move to another thread.
    fn assert_send<T: Send>() {}

    #[test]
    fn a_measurement_and_its_frame_sources_may_move_to_another_thread() {
        assert_send::<Measurement>();
        assert_send::<Box<dyn FrameSource>>();
        assert_send::<LiveFrames>();
        assert_send::<JournaledFrames<'_>>();
        assert_send::<Opener<'_>>();
    }
}
