//! Random counts: Poisson and normal variates, exact at every mean.
//!
//! Below [`SWITCH`] a Poisson variate comes by inversion (the sum of probabilities up to it passes a uniform variate), above
//! by Hörmann's transformed rejection, PTRS (*The transformed rejection method for generating Poisson random variables*,
//! Insurance: Mathematics and Economics 12, 1993). Both are exact, so that dim pixels have the skew of true photon counts.

use rand::{Rng, RngExt};

/// The mean from which on the rejection is used; it needs 10.
const SWITCH: f64 = 10.0;

/// A Poisson variate of this mean; 0 where the mean is not positive.
pub fn poisson(mean: f64, random: &mut impl Rng) -> f64 {
    if mean >= SWITCH {
        rejection(mean, random)
    } else if mean > 0.0 {
        inversion(mean, random)
    } else {
        0.0
    }
}

/// A standard normal variate (Box and Muller).
pub fn normal(random: &mut impl Rng) -> f64 {
    // In (0, 1]: the logarithm is finite.
    let radius = (-2.0 * (1.0 - random.random::<f64>()).ln()).sqrt();
    radius * (std::f64::consts::TAU * random.random::<f64>()).cos()
}

fn inversion(mean: f64, random: &mut impl Rng) -> f64 {
    let mut rest: f64 = random.random();
    let (mut count, mut probability) = (0.0, (-mean).exp());
    // Past the last one that a uniform variate can tell from its neighbours, there is nothing left to pass.
    while rest >= probability && probability > 0.0 {
        rest -= probability;
        count += 1.0;
        probability *= mean / count;
    }
    count
}

fn rejection(mean: f64, random: &mut impl Rng) -> f64 {
    // The constants and names of the paper.
    let b = 0.931 + 2.53 * mean.sqrt();
    let a = -0.059 + 0.02483 * b;
    let inverse_alpha = 1.1239 + 1.1328 / (b - 3.4);
    let v_r = 0.9277 - 3.6224 / (b - 2.0);
    loop {
        let u = random.random::<f64>() - 0.5;
        let v = 1.0 - random.random::<f64>();
        let us = 0.5 - u.abs();
        let k = ((2.0 * a / us + b) * u + mean + 0.43).floor();
        if us >= 0.07 && v <= v_r {
            return k;
        }
        if k < 0.0 || (us < 0.013 && v > us) {
            continue;
        }
        let accepted = (v * inverse_alpha / (a / (us * us) + b)).ln();
        if accepted <= k * mean.ln() - mean - ln_factorial(k) {
            return k;
        }
    }
}

/// `ln k!`: by the product for small `k`, otherwise by Stirling's series, whose first omitted term is below 1e-9 there.
fn ln_factorial(k: f64) -> f64 {
    if k < 16.0 {
        return (2..=k as u32).map(f64::from).product::<f64>().ln();
    }
    let inverse = 1.0 / k;
    let square = inverse * inverse;
    let series = inverse * (1.0 / 12.0 - square * (1.0 / 360.0 - square / 1260.0));
    (k + 0.5) * k.ln() - k + 0.5 * std::f64::consts::TAU.ln() + series
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
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
        for (count, &found) in found.iter().enumerate() {
            let log = count as f64 * mean.ln() - mean - ln_factorial(count as f64);
            let expected = draws as f64 * log.exp();
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
        let rounded =
            &mut |mean: f64, random: &mut Pcg64| (mean + mean.sqrt() * normal(random)).round().max(0.0);
        let z = z(chi_square(12.5, 200_000, 1, rounded));
        assert!(z > 20.0, "the test tells them apart: z = {z}");
    }

    #[test]
    fn normal_variates_have_the_moments_of_a_normal_distribution() {
        let mut random = Pcg64::seed_from_u64(3);
        let draws = 400_000;
        let mut moments = [0.0; 4];
        for _ in 0..draws {
            let value = normal(&mut random);
            moments.iter_mut().zip(1..).for_each(|(moment, power)| *moment += value.powi(power));
        }
        // The variances of x, x², x³, x⁴ are 1, 2, 15, 96; five standard errors.
        for ((moment, expected), variance) in
            moments.iter().zip([0.0, 1.0, 0.0, 3.0]).zip([1.0_f64, 2.0, 15.0, 96.0])
        {
            let error = (moment / f64::from(draws) - expected).abs();
            assert!(error < 5.0 * (variance / f64::from(draws)).sqrt(), "{moment} for {expected}");
        }
    }
}
