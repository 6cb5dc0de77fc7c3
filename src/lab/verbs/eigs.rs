//! Eigenvalues and eigenvectors.

use crate::analysis::segment::possible;
use crate::error::Result;
use crate::finding::{Finding, Ratio, merge};
use crate::krylov::{Confirm, Eigs, EigsOptions, Singular, SingularOptions, eigs, singular};
use crate::lab::lock::lock;
use crate::lab::{Lab, LabOperator};
use crate::operator::Operator;
use crate::transport::Part;

impl Lab {
    /// Eigenpairs of one part of the light transport matrix. Where a model of a run's photos answers, their standard errors are the bounds.
    ///
    /// # Errors
    /// As [`eigs()`] and [`Lab::operator`].
    pub fn eigs(&mut self, part: Part, options: &EigsOptions) -> Result<Eigs> {
        self.allow_photos(options.products);
        let mut operator = self.operator(part)?;
        let (confirm, photos) = confirm_within(options.confirm, &operator);
        self.expect(options.products + photos);
        let options = &EigsOptions { confirm, ..options.clone() };
        let mut found = self.photos(|_| eigs(&mut operator, options))?;
        // What a model misses is no noise that averages out over the pixels: it makes all large eigenvalues smaller.
        if lock(self.transport()?).is_model() {
            found.standard_errors.clone_from(&found.bounds);
        }
        let finding = self.possible(part, &found)?;
        merge(&mut self.findings, finding);
        Ok(found)
    }

    /// Whether the eigenvalues of a rig's light are possible: none is larger than the largest row sum, which white tells.
    fn possible(&mut self, part: Part, found: &Eigs) -> Result<Option<Finding>> {
        let most = self.with_measurement(|measurement| {
            let mut sums = measurement.white()?.planes.swap_remove(0).values;
            if part != Part::Full {
                let direct = measurement.direct()?.planes.swap_remove(0).values;
                let rest = |(sum, direct): (&mut f64, f64)| {
                    *sum = if part == Part::Direct { direct } else { *sum - direct }
                };
                sums.iter_mut().zip(direct).for_each(rest);
            }
            Ok(sums.into_iter().fold(0.0, f64::max))
        })?;
        let Some(most) = most else { return Ok(None) };
        let pairs = found.values.iter().zip(&found.imaginary_values).zip(&found.standard_errors);
        let sizes = pairs.map(|((real, imaginary), error)| [real.hypot(*imaginary), *error]);
        let [size, error] = sizes.fold([0.0; 2], |most, one| if one[0] > most[0] { one } else { most });
        Ok(Some(match Ratio::of(size, most, 0.0).value() {
            Some(largest) => possible(largest, error / most),
            None => Finding::unmeasured("eigenvalues", "there is no light of this part"),
        }))
    }

    /// Singular values of one part of the light transport matrix, with the patterns and their photos. Every second photo is one of the transpose.
    ///
    /// # Errors
    /// As [`singular()`] and [`Lab::operator`]; a rig that is not coaxial takes no photos of its transpose ([`crate::operator::Exchanged`]).
    pub fn singular(&mut self, part: Part, options: &SingularOptions) -> Result<Singular> {
        self.allow_photos(options.products);
        let mut operator = self.operator(part)?;
        let (confirm, photos) = confirm_within(options.confirm, &operator);
        self.expect(options.products + 2 * photos);
        let options = &SingularOptions { confirm, ..options.clone() };
        self.photos(|_| singular(&mut operator, options))
    }
}

/// How an answer is confirmed by photos, and how many more it takes at most.
fn confirm_within(asked: Option<Confirm>, operator: &LabOperator) -> (Option<Confirm>, usize) {
    let confirm =
        asked.map(|confirm| if operator.is_free() { confirm } else { confirm.on_rig(operator.cols()) });
    let photos = confirm.filter(|_| !operator.is_free()).map_or(0, |confirm| confirm.products);
    (confirm, photos)
}
