//! The filter of the directions of a factorization whose products are noisy.

use std::sync::Arc;

/// A function of the rest of a product and the share of noise in it; see [`Filter::new`].
type Of = dyn Fn(&[f64], f64) -> Option<Vec<f64>> + Send + Sync;

/// Removes noise from the next direction of a Krylov process.
///
/// The next direction is what a product adds to the span. Where most of it is noise, the process goes on into noise, and finds nothing. A
/// filter knows what noise looks like, and hands on a direction without most of it. Eigenvalues are not distorted: they come from the
/// products themselves, projected on whatever directions there are.
#[derive(Clone)]
pub struct Filter(Arc<Of>);

impl Filter {
    /// A filter by a function. It gets the rest of a product, of length `n`, and the expected share of noise in its norm, from 0 to 1. It
    /// returns the direction of length `n` to go on with; `None` leaves it as it is.
    pub fn new(of: impl Fn(&[f64], f64) -> Option<Vec<f64>> + Send + Sync + 'static) -> Self {
        Self(Arc::new(of))
    }

    /// The direction to go on with.
    pub fn apply(&self, rest: &[f64], share: f64) -> Option<Vec<f64>> {
        (self.0)(rest, share)
    }
}

impl std::fmt::Debug for Filter {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.write_str("Filter")
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_pcg::Pcg64;

    use super::*;
    use crate::error::Result;
    use crate::krylov::{BlockLanczos, Factorization, Which, dot, norm};
    use crate::operator::{Operator, Symmetry};

    /// `Σ λ_k u_k u_kᵀ` with three slow waves, and as much noise in each product as light.
    struct Noisy {
        random: Pcg64,
    }

    const N: usize = 400;

    /// A wave with `periods` half periods, of norm 1.
    fn wave(periods: usize) -> Vec<f64> {
        let at = |i: usize| (std::f64::consts::PI * periods as f64 * (i as f64 + 0.5) / N as f64).cos();
        let wave: Vec<f64> = (0..N).map(at).collect();
        let length = norm(&wave);
        wave.into_iter().map(|value| value / length).collect()
    }

    impl Operator for Noisy {
        fn rows(&self) -> usize {
            N
        }

        fn cols(&self) -> usize {
            N
        }

        fn symmetry(&self) -> Symmetry {
            Symmetry::Symmetric
        }

        fn apply(&mut self, x: &[f64], y: &mut [f64]) -> Result<()> {
            y.fill(0.0);
            for (periods, value) in [(1, 1.0), (2, 0.9), (3, 0.5)] {
                let wave = wave(periods);
                let along = value * dot(&wave, x);
                y.iter_mut().zip(&wave).for_each(|(y, wave)| *y += along * wave);
            }
            let noise = super::super::super::start::gaussian(N, &mut self.random);
            let scale = 0.5 / (N as f64).sqrt();
            y.iter_mut().zip(&noise).for_each(|(y, noise)| *y += scale * noise);
            Ok(())
        }

        fn standard_errors(&self) -> Vec<f64> {
            vec![0.5]
        }
    }

    /// The part of the slow waves in the span of two Ritz vectors after twelve products.
    fn found(filter: Option<Filter>) -> Result<f64> {
        let start: Vec<f64> = (0..N).map(|i| 1.0 + i as f64 / N as f64 + wave(1)[i] + wave(2)[i]).collect();
        let mut process = BlockLanczos::new(&[start], &[])?;
        if let Some(filter) = filter {
            process = process.filtered(filter);
        }
        let mut operator = Noisy { random: Pcg64::seed_from_u64(4) };
        for _ in 0..12 {
            process.expand(&mut operator)?;
        }
        let pairs = process.ritz(Which::LargestAlgebraic, 2)?;
        let vectors: Vec<Vec<f64>> = pairs.iter().map(|pair| process.ritz_vector(pair)).collect();
        let part = |wave: &[f64]| vectors.iter().map(|v| dot(v, wave).powi(2)).sum::<f64>();
        Ok(part(&wave(1)).min(part(&wave(2))))
    }

    #[test]
    fn a_low_pass_finds_slow_eigenvectors_in_noise() -> Result<()> {
        let low_pass = Filter::new(|rest, share| {
            let mean = |i: usize| {
                let near = &rest[i.saturating_sub(20)..(i + 21).min(N)];
                near.iter().sum::<f64>() / near.len() as f64
            };
            (share > 0.3).then(|| (0..N).map(mean).collect())
        });
        let (with, without) = (found(Some(low_pass))?, found(None)?);
        assert!(with > 0.95 && without < 0.85, "{with} {without}");
        Ok(())
    }
}
