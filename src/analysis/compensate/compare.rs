//! A comparison of all methods at equal numbers of photos.

use super::run::ROUNDING;
use super::{CompensateOptions, CompensationRow, Prior, Target, compensate_with};
use crate::error::Result;
use crate::finding::{Ratio, decimal};
use crate::krylov::{Constraint, METHODS, Method};
use crate::operator::{Adjoint, Symmetry};

/// The result of one method in a comparison.
#[derive(Clone, Debug)]
pub struct MethodRun {
    /// The method.
    pub method: Method,
    /// The method's name on the command line.
    pub name: &'static str,
    /// The residual after each photo, as the method computes it for its unclipped pattern. Each row has the smallest residual so far.
    pub history: Vec<CompensationRow>,
    /// The residual after each step, from a photo of the method's pattern clipped to the projector's range.
    pub displayed: Vec<CompensationRow>,
    /// The number of photos taken by the method, without preparation.
    pub photos: usize,
    /// The number of frames that the camera had taken for the method after each photo. It counts the frames of the positive and negative
    /// parts of patterns, of bit planes, exposures and repetitions, and of photos that measure the drift of the lamp. Empty if photos are
    /// computed.
    pub frames: Vec<u64>,
    /// The relative residual of the final photo.
    pub residual: f64,
    /// Structural similarity of the final photo and the target; `None` below 11×11 pixels.
    pub ssim: Option<f64>,
}

/// Runs every method that the operators allow (MINRES and CG need symmetry) with the number of photos in `options`. `options.method` is
/// ignored. A preconditioner is used only by the methods that accept one. Fails as [`compensate_with`] does.
pub fn compare_methods<O: Adjoint>(
    channels: &mut [O],
    target: &Target,
    options: &CompensateOptions,
    prior: &Prior,
) -> Result<Vec<MethodRun>> {
    let coupled = prior.crosstalk.as_ref().is_some_and(|crosstalk| crosstalk.coupled);
    let symmetric = !coupled && channels.iter().all(|operator| operator.symmetry() == Symmetry::Symmetric);
    let mut runs = Vec::new();
    for facts in METHODS.iter().filter(|facts| symmetric || !facts.needs_symmetry) {
        let free = facts.constraint == Constraint::None;
        let options = CompensateOptions {
            method: facts.method,
            precondition: options.precondition.filter(|_| free),
            baseline: facts.constraint != Constraint::Box,
            ..*options
        };
        let found = compensate_with(channels, target, &options, prior)?;
        let displayed = match found.clamping {
            Some(clamping) => clamping.displayed,
            None => found.history.clone(),
        };
        runs.push(MethodRun {
            method: facts.method,
            name: facts.name,
            history: found.history,
            displayed,
            photos: found.photos,
            frames: found.frames,
            residual: found.residual,
            ssim: found.similarity.ssim,
        });
    }
    Ok(runs)
}

/// A comparison of an unconstrained method with a box-constrained method. The pattern of the unconstrained method is clamped after each
/// photo.
#[derive(Clone, Debug, PartialEq)]
pub struct Clamping {
    /// The residual after each step, from the photo of the clamped pattern.
    pub displayed: Vec<CompensationRow>,
    /// The residuals of [`Method::KrylovBox`] with the same number of photos.
    pub boxed: Vec<CompensationRow>,
    /// The residual if the target is projected without compensation.
    pub uncompensated: f64,
}

impl Clamping {
    /// The final residual after clamping.
    pub fn last(&self) -> f64 {
        self.displayed.last().map_or(f64::INFINITY, |row| row.residual)
    }

    /// The final residual of the box-constrained method.
    pub fn inside(&self) -> f64 {
        self.boxed.last().map_or(f64::INFINITY, |row| row.residual)
    }

    /// Returns true if projecting the target without compensation would have been better.
    pub fn is_worse_than_nothing(&self) -> bool {
        self.last() > self.uncompensated + ROUNDING
    }

    /// The residual after clamping, divided by the residual of the box-constrained method. It has no value if the residual of the
    /// box-constrained method is only rounding.
    pub fn price(&self) -> Ratio {
        Ratio::of(self.last(), self.inside(), ROUNDING)
    }

    /// The number of the photo with the best clamped result, if later photos made the clamped result worse.
    pub fn turning_point(&self) -> Option<usize> {
        let best = self.displayed.iter().min_by(|a, b| a.residual.total_cmp(&b.residual))?;
        // A difference of 1 % does not count as worse.
        (self.last() > 1.01 * best.residual + ROUNDING).then_some(best.photo)
    }

    /// A warning with figures if clamping raises the residual by more than a tenth.
    pub fn warning(&self) -> Option<String> {
        let [last, inside, nothing] =
            [self.last(), self.inside(), self.uncompensated].map(|residual| decimal(residual, 4));
        let turn = self.turning_point().map_or(String::new(), |photo| {
            format!("; it was best after {photo} photo(s), and more of them made it worse")
        });
        if self.is_worse_than_nothing() {
            return Some(format!(
                "clamping leaves a residual of {last}, worse than {nothing} of the target projected as it is; krylov-box leaves {inside} with as many photos{turn}"
            ));
        }
        self.price().value().is_some_and(|price| price > 1.1).then(|| {
            format!("clamping leaves a residual of {last}, krylov-box {inside} with as many photos{turn}")
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(residuals: &[f64]) -> Vec<CompensationRow> {
        let row = |(index, &residual)| CompensationRow { photo: index + 1, residual };
        residuals.iter().enumerate().map(row).collect()
    }

    #[test]
    fn a_warning_names_the_figures_and_the_photo_after_which_it_went_wrong() {
        let clamped = |displayed: &[f64], boxed: &[f64]| Clamping {
            displayed: rows(displayed),
            boxed: rows(boxed),
            uncompensated: 0.3,
        };
        let harmless = clamped(&[0.2, 0.1], &[0.2, 0.095]);
        assert_eq!((harmless.warning(), harmless.turning_point()), (None, None));
        let worse = clamped(&[0.2, 0.15, 0.4], &[0.2, 0.1, 0.1]);
        let warning = worse.warning().unwrap_or_default();
        assert!(worse.is_worse_than_nothing() && worse.turning_point() == Some(2));
        for part in ["0.4000", "0.3000", "0.1000", "after 2 photo"] {
            assert!(warning.contains(part), "{part}: {warning}");
        }
        let dear = clamped(&[0.2], &[0.1]);
        assert!(dear.warning().is_some_and(|text| text.contains("krylov-box 0.1000")));
    }
}
