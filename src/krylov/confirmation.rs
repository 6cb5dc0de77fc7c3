//! When a search that is down to the noise of its products may end.

use super::stats::Status;

/// Lets a search end within noise only after further steps have found nothing more.
///
/// A photo of the start vector, whose component along any one eigenvector is about `1/√n`, may hide that eigenvector in its noise. All residuals are
/// then within the noise although one of the largest eigenvalues is missing. The steps that follow start in effect from the noise of the products,
/// which is a random direction. They multiply its component along an eigenvalue that exceeds the last wanted one by the share `ε` by about
/// `exp(2√ε)` each, beside all others (the growth of Chebyshev polynomials: Kuczyński and Woźniakowski, doi:10.1137/0613066). `½ ln n` steps raise
/// `1/√n` to 1 for `ε = ¼`; an eigenvalue that is nearer to the last wanted one may still be missed.
#[derive(Debug)]
pub(super) struct Confirmation {
    /// The number of further steps.
    steps: usize,
    /// The steps so far in which the residuals stayed within the noise; none where they are not.
    within: Option<usize>,
}

impl Confirmation {
    /// For vectors of `n` entries.
    pub(super) fn new(n: usize) -> Self {
        let steps = (0.5 * (n.max(1) as f64).ln()).ceil();
        // Exact: at most 22, the half of the logarithm of the largest integer.
        Self { steps: steps as usize, within: None }
    }

    /// The status with which the search ends after this step, given the status that the residuals have reached: an end within noise is put off.
    pub(super) fn end(&mut self, reached: Option<Status>) -> Option<Status> {
        if reached != Some(Status::NoiseFloor) {
            self.within = None;
            return reached;
        }
        let within = self.within.map_or(0, |steps| steps + 1);
        self.within = Some(within);
        (within >= self.steps).then_some(Status::NoiseFloor)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_end_within_noise_waits_for_half_the_logarithm_of_the_size() {
        let mut confirmation = Confirmation::new(576);
        // ½ ln 576 is 3.2.
        for _ in 0..4 {
            assert_eq!(confirmation.end(Some(Status::NoiseFloor)), None);
        }
        assert_eq!(confirmation.end(Some(Status::NoiseFloor)), Some(Status::NoiseFloor));
    }

    #[test]
    fn a_residual_above_the_noise_starts_it_anew_and_a_tolerance_needs_none() {
        let mut confirmation = Confirmation::new(9);
        assert_eq!(confirmation.end(Some(Status::NoiseFloor)), None);
        assert_eq!(confirmation.end(Some(Status::NoiseFloor)), None);
        assert_eq!(confirmation.end(None), None);
        assert_eq!(confirmation.end(Some(Status::NoiseFloor)), None);
        assert_eq!(confirmation.end(Some(Status::ReachedTolerance)), Some(Status::ReachedTolerance));
    }
}
