//! The covariance of a fitted map whose residuals come in groups that err alike (a cluster-robust covariance).

use std::collections::BTreeMap;

use crate::measure::lens_map::PARAMETERS;

/// The gradients of all residuals, summed by group: those of one column or row of the projector's pixels.
#[derive(Default)]
pub(crate) struct Clusters(BTreeMap<(usize, u64), [f64; PARAMETERS]>);

impl Clusters {
    /// Adds a residual with its derivatives by the parameters to the group of this axis and key.
    pub(crate) fn add(&mut self, group: (usize, u64), slopes: &[f64; PARAMETERS], weighted_residual: f64) {
        let pull = self.0.entry(group).or_insert([0.0; PARAMETERS]);
        pull.iter_mut().zip(slopes).for_each(|(pull, slope)| *pull += weighted_residual * slope);
    }

    /// The covariance of the parameters, row by row: the squares of what each group moves them by. `inverse` is that of the normal equations.
    pub(crate) fn covariance(&self, inverse: &[f64]) -> Vec<f64> {
        let mut covariance = vec![0.0; PARAMETERS * PARAMETERS];
        for pull in self.0.values() {
            let shift = times(inverse, pull);
            for (i, row) in covariance.chunks_exact_mut(PARAMETERS).enumerate() {
                row.iter_mut().zip(&shift).for_each(|(entry, other)| *entry += shift[i] * other);
            }
        }
        covariance
    }
}

/// `aᵀ M a` for a square matrix.
pub(crate) fn form(matrix: &[f64], a: &[f64; PARAMETERS]) -> f64 {
    a.iter().zip(times(matrix, a)).map(|(a, b)| a * b).sum()
}

/// The product of a square matrix with a vector.
fn times(matrix: &[f64], vector: &[f64; PARAMETERS]) -> [f64; PARAMETERS] {
    let mut product = [0.0; PARAMETERS];
    for (value, row) in product.iter_mut().zip(matrix.chunks_exact(PARAMETERS)) {
        *value = row.iter().zip(vector).map(|(a, x)| a * x).sum();
    }
    product
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn residuals_of_one_group_add_before_they_are_squared() {
        let mut identity = vec![0.0; PARAMETERS * PARAMETERS];
        (0..PARAMETERS).for_each(|i| identity[i * PARAMETERS + i] = 1.0);
        let mut first = [0.0; PARAMETERS];
        first[0] = 1.0;
        let [mut together, mut apart] = [Clusters::default(), Clusters::default()];
        for number in 0..4 {
            together.add((0, 7), &first, 0.5);
            apart.add((0, number), &first, 0.5);
        }
        // (4 · ½)² and 4 · (½)².
        assert_eq!(form(&together.covariance(&identity), &first), 4.0);
        assert_eq!(form(&apart.covariance(&identity), &first), 1.0);
    }
}
