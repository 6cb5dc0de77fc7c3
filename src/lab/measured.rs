//! An open rig with its processing stages, its costs so far, and the findings from its photos.

use crate::error::{Error, Result};
use crate::finding::{Finding, Grade, Ratio};
use crate::krylov::{dot, norm};
use crate::measure::{Calibration, FrameSource, Measurement, RigFile, RigRecord};
use crate::operator::Symmetry;
use crate::transport::{Channels, Part};

pub(super) struct MeasuredRig {
    pub(super) measurement: Measurement,
    calibration: Option<String>,
    /// The finding about the fit of the pixel map, if the map was examined.
    pub(super) map: Option<Finding>,
    /// The products so far, which show whether the matrix is symmetric.
    pub(super) products: Products,
}

impl MeasuredRig {
    /// The costs of the rig so far, for a run's record. If `is_complete`, the record also has the findings, and the noise and drift in the
    /// photos. If patterns were shown, this takes one photo of white.
    pub(super) fn record(&mut self, is_complete: bool) -> Result<RigRecord> {
        let (mut findings, mut noise, mut drift) = Default::default();
        if is_complete {
            findings = vec![self.measurement.sight()?, self.measurement.steadiness()?];
            findings.extend(self.map.clone().into_iter().chain(self.products.symmetry()));
            (noise, drift) = self.noise_and_drift()?;
        }
        Ok(RigRecord {
            calibration: self.calibration.clone(),
            measurement: self.measurement.options().clone(),
            patterns: self.measurement.patterns() as u64,
            effort: self.measurement.effort(),
            noise,
            drift,
            findings,
        })
    }

    fn noise_and_drift(&mut self) -> Result<(Option<f64>, Option<f64>)> {
        let white = self.measurement.white()?;
        let error = white.planes.iter().map(|plane| plane.standard_error()).fold(0.0, f64::hypot);
        let pixels = white.planes.iter().flat_map(|plane| plane.values.iter().zip(&plane.variance));
        let noise = Ratio::to_length(error, pixels.map(|(&value, &variance)| [value, variance]));
        let drift = self.measurement.drift()?;
        Ok((noise.value(), (drift.sentinels.len() > 1).then_some(drift.largest)))
    }
}

/// The stages that process raw frames. If `channels` is `None`, the devices determine the channels.
pub(super) fn measured(
    frames: Box<dyn FrameSource>,
    calibration: &Calibration,
    file: &RigFile,
    (channels, is_symmetric): (Option<Channels>, bool),
) -> Result<MeasuredRig> {
    let symmetry = if is_symmetric { Symmetry::Symmetric } else { Symmetry::General };
    let mut measurement =
        Measurement::new(frames, calibration.clone(), file.measurement.clone())?.declared(symmetry);
    match channels {
        Some(Channels::Luma) => measurement = measurement.in_luma(),
        Some(Channels::Rgb) if measurement.channels() != 3 => {
            let fault = format!("the camera of {} sees no colours", file.path.display());
            return Err(Error::option("--channels", fault).help("give --channels luma"));
        }
        _ => {}
    }
    let calibration = file.calibration.as_ref().map(|folder| folder.display().to_string());
    let products = Products::new(&measurement);
    Ok(MeasuredRig { measurement, calibration, map: None, products })
}

/// The largest ratio `‖H − Hᵀ‖ / ‖H‖` that counts as symmetric. `H` is the matrix restricted to the span of the patterns that were shown.
const MOST: f64 = 0.1;

/// The largest number of products that are kept, and the largest number of values in all of them (64 MiB).
const KEPT: usize = 12;
const NUMBERS: usize = 8 << 20;

/// The first products of a rig with one part and channel of its light.
pub(super) struct Products {
    /// For each product: the pattern scaled to norm 1, its product, and the standard error of the product's values.
    taken: Vec<(Vec<f64>, Vec<f64>, f64)>,
    of: Option<(Part, usize)>,
    most: usize,
}

impl Products {
    fn new(measurement: &Measurement) -> Self {
        let pixels = measurement.resolution().pixels();
        let most = match measurement.symmetry() {
            Symmetry::Symmetric => (NUMBERS / (2 * pixels.max(1))).clamp(2, KEPT),
            Symmetry::General => 0,
        };
        Self { taken: Vec::new(), of: None, most }
    }

    /// Keeps products of several patterns with their standard errors, until the limit is reached.
    pub(super) fn keep(&mut self, of: (Part, usize), xs: &[&[f64]], ys: &[&mut [f64]], errors: &[f64]) {
        if of.0 == Part::Direct || *self.of.get_or_insert(of) != of {
            return;
        }
        for ((x, y), error) in xs.iter().zip(ys).zip(errors) {
            let length = norm(x);
            if self.taken.len() < self.most && length > 0.0 {
                let scaled = |vector: &[f64]| vector.iter().map(|value| value / length).collect();
                self.taken.push((scaled(x), scaled(y), error / length / (y.len() as f64).sqrt()));
            }
        }
    }

    /// The finding about symmetry; `None` for fewer than two products, or for a rig that is not coaxial.
    fn symmetry(&self) -> Option<Finding> {
        let [mut squares, mut noise, mut energy, mut pairs] = [0.0; 4];
        for (i, (x, y, error)) in self.taken.iter().enumerate() {
            energy += dot(x, y).powi(2);
            for (other, product, other_error) in &self.taken[..i] {
                let [there, back] = [dot(other, y), dot(x, product)];
                squares += 2.0 * (there - back).powi(2);
                // The patterns have norm 1, so their inner products with a product have the variance of one value of the product.
                noise += 2.0 * (error * error + other_error * other_error);
                energy += there * there + back * back;
                pairs += 1.0;
            }
        }
        if pairs == 0.0 {
            return None;
        }
        let figure = Ratio::of((squares - noise).max(0.0).sqrt(), energy.sqrt(), noise.sqrt());
        let Some(value) = figure.value() else {
            return Some(Finding::unmeasured("asymmetry", "the products are no more than noise"));
        };
        // A mean of `pairs` squares of Gaussians has a relative error of √(2/pairs). Its square root has half of this relative error.
        let error = (squares / energy).sqrt() * (0.5_f64 / pairs).sqrt();
        let found = format!(
            "light from one pixel to another differs from light back by {figure}, ± {}, on the patterns that were shown",
            Ratio::from(error)
        );
        let help = "calibrate the rig with `krylux rig calibrate`: the pixel map is off, or camera and projector do not look from one point";
        let expected = format!("at most {:.0} %", 100.0 * MOST);
        Some(Finding::at_most("asymmetry", [value, error, MOST], Grade::Fails, found, expected, help))
    }
}
