//! Isotonic regression: the ascending curve that is nearest to noisy data.

/// The ascending sequence that is nearest to `values` in the weighted mean square, by the
/// pool-adjacent-violators algorithm.
pub(crate) fn ascending(values: &[f64], weights: &[f64]) -> Vec<f64> {
    let mut pools: Vec<(f64, f64, usize)> = Vec::new();
    for (&value, &weight) in values.iter().zip(weights) {
        let mut pool = (value, weight, 1);
        while let Some(&(before, weight, length)) = pools.last() {
            if before <= pool.0 {
                break;
            }
            pools.pop();
            let total = weight + pool.1;
            pool = ((before * weight + pool.0 * pool.1) / total, total, length + pool.2);
        }
        pools.push(pool);
    }
    pools.iter().flat_map(|&(value, _, length)| std::iter::repeat_n(value, length)).collect()
}

#[cfg(test)]
mod tests {
    #[test]
    fn neighbours_out_of_order_are_replaced_by_their_weighted_mean() {
        assert_eq!(super::ascending(&[1.0, 3.0, 2.0, 4.0], &[1.0, 1.0, 3.0, 1.0]), [1.0, 2.25, 2.25, 4.0]);
        assert_eq!(super::ascending(&[3.0, 2.0, 1.0], &[1.0; 3]), [2.0; 3]);
    }
}
