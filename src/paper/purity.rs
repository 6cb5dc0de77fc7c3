//! Purity of groups, and how closely groups form horizontal bands.

use std::collections::{BTreeMap, BTreeSet};

use crate::analysis::MASKED;
use crate::image::Resolution;

/// The share of pixels that belong to the majority region of their group; masked pixels do not count.
pub(super) fn purity(labels: &[u8], truth: &[u8]) -> f64 {
    let mut counts: BTreeMap<u8, BTreeMap<u8, usize>> = BTreeMap::new();
    for (&label, &region) in labels.iter().zip(truth).filter(|&(&l, &r)| l != MASKED && r != MASKED) {
        *counts.entry(label).or_default().entry(region).or_default() += 1;
    }
    let most: usize = counts.values().filter_map(|regions| regions.values().max()).sum();
    let all: usize = counts.values().flat_map(BTreeMap::values).sum();
    if all == 0 { f64::NAN } else { most as f64 / all as f64 }
}

/// How closely groups form horizontal bands.
pub(super) struct Bands {
    /// Number of groups that hold the majority of some row of a region. Groups narrower than half of their region in every row
    /// are no bands and do not count.
    pub(super) count: usize,
    /// Share of pixels in the majority group of their row and region; 1 if all borders run along the rows.
    pub(super) share: f64,
}

/// Evaluates each row of each region separately; masked pixels do not count.
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

/// Labels of straight bands with borders along the rows: `groups` in total, the same number in each region, with equal light
/// within a region. `light` is each pixel's light; pixels masked in `truth` or `mask` stay masked.
pub(super) fn straight_bands(
    light: &[f64],
    mask: &[bool],
    truth: &[u8],
    groups: usize,
    resolution: Resolution,
) -> Vec<u8> {
    let regions: BTreeSet<u8> = truth.iter().copied().filter(|&region| region != MASKED).collect();
    let bands = (groups / regions.len().max(1)).max(1);
    let mut labels = vec![MASKED; truth.len()];
    for (index, &region) in regions.iter().enumerate() {
        let inside = |&pixel: &usize| truth[pixel] == region && !mask[pixel];
        let all: f64 = (0..truth.len()).filter(inside).map(|pixel| light[pixel]).sum();
        let mut above = 0.0;
        for row in 0..resolution.height {
            let pixels = row * resolution.width..(row + 1) * resolution.width;
            let here: f64 = pixels.clone().filter(inside).map(|pixel| light[pixel]).sum();
            // The band that contains the middle of this row's light.
            let band = ((above + here / 2.0) / all * bands as f64) as usize;
            for pixel in pixels.filter(inside) {
                labels[pixel] = (index * bands + band.min(bands - 1)) as u8;
            }
            above += here;
        }
    }
    labels
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
        // Two regions side by side, each with two bands.
        let found = bands(&[0, 0, 1, 1, 2, 2, 3, 3], &[0, 0, 1, 1, 0, 0, 1, 1], resolution);
        assert_eq!((found.count, found.share), (4, 1.0));
        // One region with a spot of one pixel.
        let found = bands(&[0, 7, 0, 0, 0, 0, 0, 0], &[0; 8], resolution);
        assert_eq!((found.count, found.share), (1, 0.875));
        // Left and right halves are no bands.
        assert_eq!(bands(&[0, 0, 1, 1, 0, 0, 1, 1], &[0; 8], resolution).count, 0);
    }

    #[test]
    fn straight_bands_share_a_regions_light_equally() {
        let resolution = Resolution::new(2, 4);
        let light = [1.0, 3.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0];
        let truth = [0, 1, 0, 1, 0, 1, 0, 1];
        let mut mask = [false; 8];
        assert_eq!(straight_bands(&light, &mask, &truth, 4, resolution), [0, 2, 0, 3, 1, 3, 1, 3]);
        mask[0] = true;
        assert_eq!(straight_bands(&light, &mask, &truth, 4, resolution)[..3], [MASKED, 2, 0]);
    }
}
