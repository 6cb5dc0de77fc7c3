//! Evidence for a segmentation: the light that groups exchange, distances between pixels, and the agreement with other labels.
//!
//! Each group is lit alone. The photo then shows all pixels that light from this group reaches. Summed over the pixels of each group, these
//! photos give the exchanged light, `E_ab = 1_aᵀ G 1_b`, and the value of the cut, `Σ_a (1 − E_aa / Σ_b E_ab)`, without any model.

use std::collections::BTreeMap;

use super::{MASKED, Segmentation};
use crate::error::{Error, Result};
use crate::image::Resolution;
use crate::operator::{Operator, each_product};

/// Photos of a scene in which each group of a segmentation is lit alone.
#[derive(Clone, Debug)]
pub struct Evidence {
    /// The number of groups.
    pub groups: usize,
    /// The photo of each group (`n`). It has no direct light if the operator has none.
    pub photos: Vec<Vec<f64>>,
    /// `E_ab / Σ_c E_cb`, in row `a` and column `b`: the share of group `b`'s light to unmasked pixels that arrives in group `a`.
    pub exchange: Vec<Vec<f64>>,
}

impl Evidence {
    /// The share of its own light that each group keeps.
    pub fn kept(&self) -> Vec<f64> {
        (0..self.groups).map(|group| self.exchange[group][group]).collect()
    }

    /// The value of the normalized cut, which is the sum of the shares of light that leave their groups.
    pub fn cut(&self) -> f64 {
        self.kept().iter().map(|kept| 1.0 - kept).sum()
    }
}

/// Lights each group of `labels` alone, with one photo each by `operator`. `labels` has `n` entries, and pixels of label 255 are masked and
/// dark. Fails with [`Error::Dimension`] if there is not one label per pixel, or as the operator does.
pub fn evidence(operator: &mut dyn Operator, labels: &[u8]) -> Result<Evidence> {
    for side in [operator.cols(), operator.rows()] {
        Error::check_size("labels of the groups to be lit", side, labels.len())?;
    }
    let last = labels.iter().copied().filter(|&label| label != MASKED).max();
    let groups = last.map_or(0, |last| usize::from(last) + 1);
    let mut photos = Vec::with_capacity(groups);
    let mut exchange = vec![vec![0.0; groups]; groups];
    let pattern = |group| {
        let lit = |&label: &u8| f64::from(u8::from(usize::from(label) == group));
        labels.iter().map(lit).collect()
    };
    each_product(operator, (0..groups).map(pattern), |_, photo| {
        let group = photos.len();
        for (&label, value) in labels.iter().zip(&photo).filter(|(label, _)| **label != MASKED) {
            exchange[usize::from(label)][group] += value;
        }
        photos.push(photo);
        let all: f64 = exchange.iter().map(|row| row[group]).sum();
        exchange.iter_mut().for_each(|row| row[group] /= if all == 0.0 { 1.0 } else { all });
        Ok(())
    })?;
    Ok(Evidence { groups, photos, exchange })
}

/// Chosen pixels in the space of eigenvectors.
#[derive(Clone, Debug)]
pub struct FeatureView {
    /// The column and row of each pixel.
    pub pixels: Vec<(usize, usize)>,
    /// The coordinates of each pixel (`k − 1` numbers), starting with the second eigenvector.
    pub coordinates: Vec<Vec<f64>>,
    /// The distances between the pixels, row by row, relative to the root mean square distance of all pixels from the origin. A pixel that
    /// exchanged light equally with all other pixels would be at the origin.
    pub distances: Vec<Vec<f64>>,
}

/// Computes the coordinates and distances of pixels, given by column and row. Fails with [`Error::Option`] naming `--features` if a pixel
/// lies outside the raster, or is masked and so has no coordinates.
pub fn feature_view(
    found: &Segmentation,
    resolution: Resolution,
    pixels: &[(usize, usize)],
) -> Result<FeatureView> {
    let refuse = |(x, y): (usize, usize), fault: &str, help: String| {
        Err(Error::option("--features", format!("pixel {x},{y} {fault}")).help(help))
    };
    for &(x, y) in pixels {
        if x >= resolution.width || y >= resolution.height {
            return refuse((x, y), "is outside of the picture", format!("it has {resolution} pixels"));
        }
        if found.mask[y * resolution.width + x] {
            let help = "choose one with light that reached it from elsewhere".to_owned();
            return refuse((x, y), "is masked: it exchanges no light", help);
        }
    }
    let coordinates: Vec<Vec<f64>> =
        pixels.iter().map(|&(x, y)| found.feature(y * resolution.width + x)).collect();
    // `within` holds Σ w u² for the clamped entries u of each eigenvector.
    let squares = found.embedding.weights.iter().zip(&found.embedding.within);
    let spread = squares.map(|(weight, within)| weight * weight * within).sum::<f64>()
        / found.weights.iter().sum::<f64>();
    let scale = spread.sqrt().max(f64::MIN_POSITIVE);
    let distance = |a: &Vec<f64>, b: &Vec<f64>| {
        a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt() / scale
    };
    let distances =
        coordinates.iter().map(|a| coordinates.iter().map(|b| distance(a, b)).collect()).collect();
    Ok(FeatureView { pixels: pixels.to_vec(), coordinates, distances })
}

/// The true labels, given by the author of a scene.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub struct Truth {
    /// The region of each pixel (`n`), or [`MASKED`].
    pub labels: Vec<u8>,
    /// The names of the regions.
    pub regions: Vec<String>,
}

impl Truth {
    /// The number of regions that are visible in at least one pixel.
    pub fn seen(&self) -> usize {
        (0..MASKED).filter(|region| self.labels.contains(region)).count()
    }

    /// The adjusted Rand index of a segmentation for each of its numbers of groups.
    /// Fails with [`crate::Error::Dimension`] if the segmentation has another number of pixels.
    pub fn scores(&self, segmentation: &Segmentation) -> Result<Vec<(usize, f64)>> {
        let score =
            |(groups, labels): &(usize, Vec<u8>)| Ok((*groups, adjusted_rand_index(labels, &self.labels)?));
        segmentation.labels.iter().map(score).collect()
    }
}

/// The adjusted Rand index of two labellings. It is 1 if they are equal up to label names, 0 on average for random labels, and negative if
/// they agree less than random labels. Pixels with the label 255 (masked) in either labelling are ignored. The index is 1 if there is at
/// most one pixel, or if both labellings have only one group.
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
    Error::check_size("labels to compare", a.len(), b.len())?;
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
    // If both labellings have a single group, or if all groups of both are single pixels, the labellings agree and the formula is 0/0.
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
        // For n_ij = [[2, 1], [0, 3]], C sums to 1 + 3 = 4 over n_ij, 3 + 3 = 6 over a, and 1 + 6 = 7 over b. C(n) is 15, so E is 2.8.
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
