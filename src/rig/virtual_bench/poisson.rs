//! Electrons at a pixel: Poisson variates, exact at every mean.

use rand::Rng;
use rand_distr::{Distribution, Poisson};

/// A Poisson variate of this mean; 0 where the mean is not positive.
///
/// `rand_distr` counts products of uniform variates below a mean of 12, and above uses the rejection of Ahrens and Dieter, *Computer
/// generation of Poisson deviates from modified normal distributions* (1982), doi:10.1145/355993.355997. Both are exact, so that dim
/// pixels have the skew of true photon counts.
pub fn poisson(mean: f64, random: &mut impl Rng) -> f64 {
    match Poisson::new(mean) {
        Ok(distribution) => distribution.sample(random),
        // Above a mean of 10¹⁹ a variate differs from it in the tenth digit.
        Err(_) => mean.max(0.0),
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_distr::StandardNormal;
    use rand_pcg::Pcg64;

    use super::*;

    /// Pearson's statistic of `draws` variates against the Poisson probabilities, and its degrees of freedom. Counts with
    /// less than 10 expected are put together with their neighbours.
    fn chi_square(
        mean: f64,
        draws: usize,
        seed: u64,
        draw: &mut dyn FnMut(f64, &mut Pcg64) -> f64,
    ) -> [f64; 2] {
        let mut random = Pcg64::seed_from_u64(seed);
        let limit = (mean + 12.0 * mean.sqrt() + 12.0) as usize;
        let mut found = vec![0.0; limit + 1];
        for _ in 0..draws {
            found[(draw(mean, &mut random) as usize).min(limit)] += 1.0;
        }
        let (mut statistic, mut cells) = (0.0, 0.0);
        let (mut expected_sum, mut found_sum, mut expected_left) = (0.0, 0.0, draws as f64);
        let mut log_probability = -mean;
        for (count, &found) in found.iter().enumerate() {
            if count > 0 {
                log_probability += (mean / count as f64).ln();
            }
            let expected = draws as f64 * log_probability.exp();
            expected_sum += expected;
            found_sum += found;
            if expected_sum >= 10.0 && expected_left - expected_sum >= 10.0 {
                statistic += (found_sum - expected_sum) * (found_sum - expected_sum) / expected_sum;
                cells += 1.0;
                expected_left -= expected_sum;
                (expected_sum, found_sum) = (0.0, 0.0);
            }
        }
        // The tail: everything that is left.
        statistic += (found_sum - expected_left) * (found_sum - expected_left) / expected_left;
        [statistic, cells]
    }

    /// The statistic as a standard normal variate (Wilson and Hilferty 1931).
    fn z([statistic, freedom]: [f64; 2]) -> f64 {
        let spread = 2.0 / (9.0 * freedom);
        ((statistic / freedom).cbrt() - (1.0 - spread)) / spread.sqrt()
    }

    #[test]
    fn counts_are_distributed_as_poisson_says_at_every_mean() {
        for (seed, mean) in [0.05, 0.7, 3.0, 9.99, 10.0, 12.5, 40.0, 333.3, 6e4].into_iter().enumerate() {
            let z = z(chi_square(mean, 200_000, seed as u64, &mut |mean, random| poisson(mean, random)));
            // Nine one-sided tests at 4 standard deviations: one in 3,500 seeds would fail.
            assert!(z < 4.0, "mean {mean}: z = {z}");
        }
    }

    #[test]
    fn a_rounded_normal_variate_would_not_pass() {
        let rounded = &mut |mean: f64, random: &mut Pcg64| {
            let normal: f64 = StandardNormal.sample(random);
            (mean + mean.sqrt() * normal).round().max(0.0)
        };
        let z = z(chi_square(12.5, 200_000, 1, rounded));
        assert!(z > 20.0, "the test tells them apart: z = {z}");
    }
}
