//! How pure groups are, and how their borders run.

use std::collections::BTreeMap;

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

/// Of all neighbours in one region but in different groups, the share of those one above the other: 1 where every border
/// within a region runs horizontally, ½ for borders without a direction. NaN where there is none.
pub(super) fn horizontal_share(labels: &[u8], truth: &[u8], resolution: Resolution) -> f64 {
    let Resolution { width, height } = resolution;
    let parted = |a: usize, b: usize| {
        truth[a] == truth[b] && labels[a] != labels[b] && labels[a] != MASKED && labels[b] != MASKED
    };
    let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    let (mut above, mut beside) = (0_usize, 0_usize);
    for (x, y) in pixels {
        let at = y * width + x;
        above += usize::from(y + 1 < height && parted(at, at + width));
        beside += usize::from(x + 1 < width && parted(at, at + 1));
    }
    above as f64 / (above + beside) as f64
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
    fn borders_between_regions_do_not_count() {
        let resolution = Resolution::new(2, 2);
        // Rows: groups 0 1 above groups 2 3, of the regions 0 (left) and 1 (right).
        assert_eq!(horizontal_share(&[0, 1, 2, 3], &[0, 1, 0, 1], resolution), 1.0);
        assert_eq!(horizontal_share(&[0, 1, 0, 1], &[0, 0, 0, 0], resolution), 0.0);
        assert_eq!(horizontal_share(&[0, 1, 2, 3], &[0; 4], resolution), 0.5);
    }
}
