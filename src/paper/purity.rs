//! How pure groups are, and how far they are horizontal bands.

use std::collections::{BTreeMap, BTreeSet};

use crate::analysis::MASKED;
use crate::image::Resolution;

/// The share of pixels that belong to the region which most pixels of their group belong to; masked ones do not count.
pub(super) fn purity(labels: &[u8], truth: &[u8]) -> f64 {
    let mut counts: BTreeMap<u8, BTreeMap<u8, usize>> = BTreeMap::new();
    for (&label, &region) in labels.iter().zip(truth).filter(|&(&l, &r)| l != MASKED && r != MASKED) {
        *counts.entry(label).or_default().entry(region).or_default() += 1;
    }
    let most: usize = counts.values().filter_map(|regions| regions.values().max()).sum();
    let all: usize = counts.values().flat_map(BTreeMap::values).sum();
    if all == 0 { f64::NAN } else { most as f64 / all as f64 }
}

/// How far groups are horizontal bands.
pub(super) struct Bands {
    /// Groups that most pixels of some row of a region belong to. What is narrower than half of its region in every row, and so
    /// no band, is not among them.
    pub(super) count: usize,
    /// The share of pixels that belong to the group of most of their row, in their region. 1 for borders along the rows.
    pub(super) share: f64,
}

/// Looks at each row of each region by itself; masked pixels do not count.
pub(super) fn bands(labels: &[u8], truth: &[u8], resolution: Resolution) -> Bands {
    let mut found = BTreeSet::new();
    let (mut agreeing, mut all) = (0_usize, 0_usize);
    for (labels, truth) in labels.chunks(resolution.width).zip(truth.chunks(resolution.width)) {
        let mut counts: BTreeMap<u8, BTreeMap<u8, usize>> = BTreeMap::new();
        for (&label, &region) in labels.iter().zip(truth).filter(|&(&l, &r)| l != MASKED && r != MASKED) {
            *counts.entry(region).or_default().entry(label).or_default() += 1;
        }
        for row in counts.values() {
            let total: usize = row.values().sum();
            all += total;
            if let Some((&label, &most)) = row.iter().max_by_key(|(_, count)| **count) {
                agreeing += most;
                if 2 * most > total {
                    found.insert(label);
                }
            }
        }
    }
    Bands { count: found.len(), share: agreeing as f64 / all as f64 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finer_groups_are_pure_and_mixed_ones_are_not() {
        assert_eq!(purity(&[0, 0, 1, 2], &[5, 5, 7, 7]), 1.0);
        assert_eq!(purity(&[0, 0, 0, 0], &[5, 5, 5, 7]), 0.75);
        assert_eq!(purity(&[0, 0, MASKED, 1], &[5, 7, 5, MASKED]), 0.5);
        assert!(purity(&[MASKED], &[0]).is_nan());
    }

    #[test]
    fn bands_span_their_region_and_spots_do_not() {
        let resolution = Resolution::new(4, 2);
        // Two regions side by side, each of two bands.
        let found = bands(&[0, 0, 1, 1, 2, 2, 3, 3], &[0, 0, 1, 1, 0, 0, 1, 1], resolution);
        assert_eq!((found.count, found.share), (4, 1.0));
        // One region, with a spot of one pixel.
        let found = bands(&[0, 7, 0, 0, 0, 0, 0, 0], &[0; 8], resolution);
        assert_eq!((found.count, found.share), (1, 0.875));
        // Upright halves are no bands.
        assert_eq!(bands(&[0, 0, 1, 1, 0, 0, 1, 1], &[0; 8], resolution).count, 0);
    }
}
