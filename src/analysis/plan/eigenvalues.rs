//! Planning eigenvalues on the twin.

use super::{Cost, Planner};
use crate::error::Result;
use crate::krylov::{Eigs, EigsOptions, eigs, norm};
use crate::operator::{Observed, Operator};
use crate::transport::Part;

/// The eigenvalues on the twin and their errors.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct EigenvaluesTrial {
    /// Their cost.
    pub cost: Cost,
    /// The difference of each eigenvalue from the ideal devices' one, relative to the largest. The norms of the white photos
    /// convert the units.
    pub errors: Vec<f64>,
}

impl Planner<'_> {
    /// The eigenpairs with ideal devices, by the same method with the same number of photos. Fails as [`eigs`] does.
    pub fn ideal_eigenpairs(&self, part: Part, options: &EigsOptions) -> Result<Eigs> {
        eigs(&mut self.twin.operator(part, 0)?, options)
    }

    /// The eigenpairs with the noise of `seed`. `ideal` is from [`Planner::ideal_eigenpairs`]. Fails as [`eigs`] or the rig does.
    pub fn eigenvalues(
        &self,
        part: Part,
        options: &EigsOptions,
        ideal: &Eigs,
        seed: u64,
    ) -> Result<EigenvaluesTrial> {
        let mut measurement = self.measure(seed)?.in_luma();
        let mut operator = measurement.operator(part, 0);
        let found = eigs(&mut Observed::new(&mut operator, self.observer), options)?;
        let mut full = self.twin.operator(Part::Full, 0)?;
        let mut white = vec![0.0; full.rows()];
        full.apply(&vec![1.0; full.cols()], &mut white)?;
        let scale = match measurement.white()?.planes.first() {
            Some(plane) => norm(&white) / norm(&plane.values),
            None => f64::NAN,
        };
        let largest = ideal.values.iter().fold(0.0, |largest: f64, value| largest.max(value.abs()));
        let errors = found.values.iter().zip(&ideal.values);
        Ok(EigenvaluesTrial {
            cost: Cost::of(&measurement, found.stats.products),
            errors: errors.map(|(found, ideal)| (scale * found - ideal) / largest).collect(),
        })
    }
}
