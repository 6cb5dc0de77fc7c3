//! When a search that is down to the noise of its products may end.

use super::stats::Status;

/// Lets a search end within noise only after further steps have found nothing more.
///
/// The noise of the first products may hide an eigenvector, along which a random start has a component of about `1/√n` only. All residuals are then
/// within the noise although one of the largest eigenvalues is missing. Further steps in effect start from the noise, which is a random direction.
/// Let the missing eigenvalue exceed the last wanted one by the share `ε`. Each step multiplies the component along its eigenvector by about
/// `exp(2√ε)`, relative to the others (the growth of Chebyshev polynomials: Kuczyński and Woźniakowski, doi:10.1137/0613066). `½ ln n` steps raise
/// `1/√n` to 1 for `ε = ¼`. An eigenvalue that is nearer to the last wanted one may still be missed.
#[derive(Debug)]
pub(super) struct Confirmation {
    /// The number of further steps.
    steps: usize,
    /// How many times in a row the end has been put off.
    put_off: usize,
}

impl Confirmation {
    /// For vectors of `n` entries.
    pub(super) fn new(n: usize) -> Self {
        let steps = (0.5 * (n.max(1) as f64).ln()).ceil();
        // Exact: at most 23, for the largest integer.
        Self { steps: steps as usize, put_off: 0 }
    }

    /// The status with which the search ends after this step, given the status that the residuals have reached: an end within noise is put off.
    pub(super) fn end(&mut self, reached: Option<Status>) -> Option<Status> {
        if reached != Some(Status::NoiseFloor) {
            self.put_off = 0;
            return reached;
        }
        if self.put_off == self.steps {
            return reached;
        }
        self.put_off += 1;
        None
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
