//! A test whether a coaxial rig is as symmetric as it must be, from the products that a run takes anyway.

use crate::finding::{Finding, Grade, Ratio, SIGMAS};
use crate::krylov::{dot, norm};
use crate::measure::Measurement;
use crate::operator::Symmetry;
use crate::transport::Part;

/// The largest ratio `‖H − Hᵀ‖ / ‖H‖` that passes, where `H` is the matrix restricted to the patterns that were shown.
const MOST: f64 = 0.1;

/// The largest numbers of products and of stored values (64 MiB).
const KEPT: usize = 12;
const NUMBERS: usize = 8 << 20;

/// The first products of a rig with one part of its light.
pub(in crate::lab) struct Products {
    /// Patterns of norm 1, their products, and the standard error of each value of a product.
    taken: Vec<(Vec<f64>, Vec<f64>, f64)>,
    of: Option<(Part, usize)>,
    most: usize,
}

impl Products {
    pub(super) fn new(measurement: &Measurement) -> Self {
        let pixels = measurement.resolution().pixels();
        let most = match measurement.symmetry() {
            Symmetry::Symmetric => (NUMBERS / (2 * pixels.max(1))).clamp(2, KEPT),
            Symmetry::General => 0,
        };
        Self { taken: Vec::new(), of: None, most }
    }

    /// Keeps products with several patterns, and their standard errors, up to the limit.
    pub(in crate::lab) fn keep(
        &mut self,
        of: (Part, usize),
        xs: &[&[f64]],
        ys: &[&mut [f64]],
        errors: &[f64],
    ) {
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
    pub(super) fn symmetry(&self) -> Option<Finding> {
        let [mut squares, mut noise, mut energy, mut pairs] = [0.0; 4];
        for (i, (x, y, error)) in self.taken.iter().enumerate() {
            energy += dot(x, y).powi(2);
            for (other, product, other_error) in &self.taken[..i] {
                let [there, back] = [dot(other, y), dot(x, product)];
                squares += 2.0 * (there - back).powi(2);
                // The patterns have norm 1, so the error of each value counts once.
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
        // A mean of squares of `pairs` Gaussians has a relative error of √(2/pairs). Its root has half of that relative error.
        let error = (squares / energy).sqrt() * (0.5_f64 / pairs).sqrt();
        let grade = if value - SIGMAS * error <= MOST { Grade::Ok } else { Grade::Fails };
        let found = format!(
            "light from one pixel to another differs from light back by {figure}, ± {}, on the patterns that were shown",
            Ratio::from(error)
        );
        let help = "calibrate the rig with `krylux rig calibrate`: the pixel map is off, or camera and projector do not look from one point";
        let finding =
            Finding::graded("asymmetry", grade, found, format!("at most {:.0} %", 100.0 * MOST), help);
        Some(finding.measured(value, error, MOST))
    }
}
