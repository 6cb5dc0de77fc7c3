//! The agreement of two segmentations.

use std::collections::BTreeMap;

use super::MASKED;
use crate::error::{Error, Result};

/// The adjusted Rand index of two labellings: 1 if they are equal up to label names, 0 on average for random labels, and negative below
/// that. Pixels labelled 255 (masked) in either are ignored. The index is 1 for at most one pixel, or for one group in both.
///
/// With `n_ij` pixels in group `i` of the first and `j` of the second labelling, group sizes `a` and `b`, and `C(x) = x(x−1)/2`:
///
/// ```text
/// E = Σ C(a_i) · Σ C(b_j) / C(n),    ARI = (Σ C(n_ij) − E) / ((Σ C(a_i) + Σ C(b_j))/2 − E)
/// ```
///
/// Hubert and Arabie, *Comparing partitions*, Journal of Classification 2 (1985), doi:10.1007/BF01908075.
///
/// # Errors
/// [`Error::Dimension`] if the lengths differ.
pub fn adjusted_rand_index(a: &[u8], b: &[u8]) -> Result<f64> {
    if a.len() != b.len() {
        return Err(Error::dimension("labels to compare", a.len(), b.len()));
    }
    let mut both = BTreeMap::new();
    let mut left = BTreeMap::new();
    let mut right = BTreeMap::new();
    let mut count = 0_u64;
    for (&a, &b) in a.iter().zip(b).filter(|&(&a, &b)| a != MASKED && b != MASKED) {
        *both.entry((a, b)).or_insert(0_u64) += 1;
        *left.entry(a).or_insert(0_u64) += 1;
        *right.entry(b).or_insert(0_u64) += 1;
        count += 1;
    }
    let pairs = |size: u64| size as f64 * (size as f64 - 1.0) / 2.0;
    let together: f64 = both.values().map(|&size| pairs(size)).sum();
    let in_left: f64 = left.values().map(|&size| pairs(size)).sum();
    let in_right: f64 = right.values().map(|&size| pairs(size)).sum();
    let all = pairs(count);
    let by_chance = if all > 0.0 { in_left * in_right / all } else { 0.0 };
    let best = (in_left + in_right) / 2.0;
    // With a single group in both, or single pixels as groups in both, the labellings agree and the formula is 0/0.
    Ok(if best == by_chance { 1.0 } else { (together - by_chance) / (best - by_chance) })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn index(a: &[u8], b: &[u8]) -> f64 {
        adjusted_rand_index(a, b).expect("equal lengths")
    }

    #[test]
    fn names_do_not_matter_and_masked_pixels_do_not_count() {
        assert_eq!(index(&[0, 0, 1, 1, 2], &[7, 7, 3, 3, 0]), 1.0);
        assert_eq!(index(&[0, 0, 255, 1, 1, 0], &[1, 1, 0, 0, 0, 255]), 1.0);
    }

    #[test]
    fn agrees_with_a_table_worked_by_hand() {
        // n_ij = [[2, 1], [0, 3]]: together 1 + 3 = 4, a: 3 + 3 = 6, b: 1 + 6 = 7, all 15, by chance 2.8.
        let value = index(&[0, 0, 0, 1, 1, 1], &[0, 0, 1, 1, 1, 1]);
        assert!((value - (4.0 - 2.8) / (6.5 - 2.8)).abs() < 1e-15, "{value}");
    }

    #[test]
    fn crossed_groups_score_below_zero() {
        assert!((index(&[0, 0, 1, 1], &[0, 1, 0, 1]) + 0.5).abs() < 1e-15, "rounding of 2/3");
    }

    #[test]
    fn trivial_labellings_agree() {
        assert_eq!(index(&[0, 0, 0], &[4, 4, 4]), 1.0);
        assert_eq!(index(&[0, 1, 2], &[2, 0, 1]), 1.0);
        assert_eq!(index(&[255, 255], &[0, 1]), 1.0);
        assert!(adjusted_rand_index(&[0], &[0, 1]).is_err());
    }
}
