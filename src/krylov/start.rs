//! Start vectors of Krylov processes.

use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64;

/// The first vector of a Krylov process. Its norm does not matter.
///
/// A random start has a component along every eigenvector. A chosen start may lack components: in a scene with mirror symmetry, a vector of
/// ones never finds the eigenvectors that differ between the two sides.
#[derive(Clone, Debug, PartialEq)]
pub enum Start {
    /// Random signs times uniform numbers in [½, 1), the same on every machine. Almost surely, no vector of a fixed set is orthogonal to
    /// the start. Projectors with few bits show the start well, because its largest entry is 1.3 times its root mean square.
    Random {
        /// The seed of the generator.
        seed: u64,
    },
    /// Entries −1 and +1 with equal probability, the same on every machine. As a pattern, this start uses the projector's whole range. It
    /// is often exactly orthogonal to an eigenvector of a structured matrix, so it suits estimates of traces but not the start of a search.
    Rademacher {
        /// The seed of the generator.
        seed: u64,
    },
    /// Standard normal entries, so that no direction is preferred. Rare values in the tails depend on `ln`, which differs between machines
    /// in the last bit.
    Gaussian {
        /// The seed of the generator.
        seed: u64,
    },
    /// The given vector.
    Given(Vec<f64>),
}

impl Default for Start {
    fn default() -> Self {
        Self::Random { seed: 0 }
    }
}

impl Start {
    /// The vector, of length `n` ([`Start::Given`] keeps the length of its vector).
    pub fn vector(&self, n: usize) -> Vec<f64> {
        self.block(n, 1).pop().unwrap_or_default()
    }

    /// The seed of a random start; 0 for a given start.
    pub(super) fn seed(&self) -> u64 {
        match self {
            Self::Random { seed } | Self::Rademacher { seed } | Self::Gaussian { seed } => *seed,
            Self::Given(_) => 0,
        }
    }

    /// Makes `count` vectors of length `n` for a block start. Random vectors are drawn one after the other from one generator, so the first
    /// vector is [`Start::vector`]. After the vector of [`Start::Given`], the vectors of [`Start::Random`] with seed 0 follow.
    pub fn block(&self, n: usize, count: usize) -> Vec<Vec<f64>> {
        let draw = |seed: u64, count: usize, one: fn(usize, &mut Pcg64) -> Vec<f64>| -> Vec<Vec<f64>> {
            let mut random = Pcg64::seed_from_u64(seed);
            (0..count).map(|_| one(n, &mut random)).collect()
        };
        match self {
            Self::Random { seed } => draw(*seed, count, signed),
            Self::Rademacher { seed } => draw(*seed, count, rademacher),
            Self::Gaussian { seed } => draw(*seed, count, gaussian),
            Self::Given(vector) => {
                let mut block = vec![vector.clone()];
                block.extend(draw(0, count.saturating_sub(1), signed));
                block.truncate(count);
                block
            }
        }
    }
}

fn signed(n: usize, random: &mut Pcg64) -> Vec<f64> {
    let entry = |random: &mut Pcg64| {
        let size = random.random_range(0.5..1.0);
        if random.random::<bool>() { size } else { -size }
    };
    (0..n).map(|_| entry(random)).collect()
}

fn rademacher(n: usize, random: &mut Pcg64) -> Vec<f64> {
    (0..n).map(|_| if random.random::<bool>() { 1.0 } else { -1.0 }).collect()
}

pub(super) fn seeded(n: usize, seed: u64) -> Vec<f64> {
    gaussian(n, &mut Pcg64::seed_from_u64(seed))
}

/// The seed of vector `number` of a search with the seed `seed`.
pub(super) fn seed_of(seed: u64, number: u64) -> u64 {
    seed.wrapping_add(number).wrapping_mul(0x9E37_79B9_7F4A_7C15)
}

pub(super) fn gaussian(n: usize, random: &mut Pcg64) -> Vec<f64> {
    random.sample_iter(StandardNormal).take(n).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn random_starts_have_mean_zero_and_variance_one() {
        let n = 100_000;
        for start in [Start::Rademacher { seed: 3 }, Start::Gaussian { seed: 3 }] {
            let vector = start.vector(n);
            assert_eq!(vector.len(), n);
            let mean = vector.iter().sum::<f64>() / n as f64;
            let square = vector.iter().map(|v| v * v).sum::<f64>() / n as f64;
            // Five standard deviations: 5/√n for the mean, 5·√(2/n) for the variance of a normal distribution.
            assert!(mean.abs() < 0.016, "{start:?}: mean {mean}");
            assert!((square - 1.0).abs() < 0.023, "{start:?}: variance {square}");
        }
    }

    #[test]
    fn a_random_start_has_no_zero_and_a_low_crest() {
        let vector = Start::default().vector(100_000);
        assert!(vector.iter().all(|v| (0.5..1.0).contains(&v.abs())));
        let mean = vector.iter().sum::<f64>() / 1e5;
        let square = vector.iter().map(|v| v * v).sum::<f64>() / 1e5;
        // The variance of an entry is 7/12. The variance of its square, uniform in [½, 1) squared, is 0.048. The bounds are five standard
        // deviations.
        assert!(mean.abs() < 0.0121 && (square - 7.0 / 12.0).abs() < 0.0035, "{mean} {square}");
    }

    #[test]
    fn a_seed_names_one_vector() {
        let vector = |seed| Start::Random { seed }.vector(64);
        assert_eq!(vector(1), vector(1));
        assert_ne!(vector(1), vector(2));
    }
}
