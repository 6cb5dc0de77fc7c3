//! Groups of a segmentation: their pictures, purity and shape, and the eigenvalues that the light of a fold can have.

use std::collections::{BTreeMap, BTreeSet};

use super::bench::Stage;
use super::figure::{Content, Panel};
use crate::analysis::{MASKED, SegmentOptions, Segmentation};
use crate::image::Resolution;
use crate::lab::text::decimal;

/// Options of a segmentation that takes all photos from one starting pattern. The low-pass filter for noisy rigs needs the resolution.
pub(super) fn asked(photos: usize, groups: &[usize], resolution: Resolution) -> SegmentOptions {
    SegmentOptions {
        photos,
        tolerance: 0.0,
        starts: Some(1),
        resolution: Some(resolution),
        groups: groups.to_vec(),
        ..SegmentOptions::default()
    }
}

/// A wrong answer: random labels of this number of groups. Pixels that are masked in `like` stay masked.
pub(super) fn random_labels(like: &[u8], groups: usize) -> Vec<u8> {
    // Steps of the golden ratio, whose upper bits are spread evenly and do not follow the picture's rows.
    let hash = |pixel: usize| {
        ((pixel as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ (pixel as u64) << 7)
            .wrapping_mul(0xd6e8_feb8_6659_fd93)
    };
    let label = |pixel: usize| (hash(pixel) >> 40) as usize % groups;
    like.iter()
        .enumerate()
        .map(|(pixel, of)| if *of == MASKED { MASKED } else { label(pixel) as u8 })
        .collect()
}

/// The labels for this number of groups; empty if this number was not requested.
pub(super) fn labels(found: &Segmentation, groups: usize) -> &[u8] {
    found.labels.iter().find(|(of, _)| *of == groups).map_or(&[], |(_, labels)| labels)
}

/// The photo under white, the groups, and `eigenvectors` eigenvectors after the first one, which is constant.
pub(super) fn panels(stage: &Stage, found: &Segmentation, eigenvectors: usize) -> Vec<Panel> {
    let mut panels = vec![stage.white_panel()];
    for (groups, labels) in &found.labels {
        let groups_are = Content::Labels(labels.clone());
        panels.push(stage.panel(format!("groups-{groups}"), format!("{groups} groups"), groups_are));
    }
    for (index, vector) in found.eigenvectors.iter().enumerate().skip(1).take(eigenvectors) {
        let caption = format!("Eigenvector {}: λ = {}", index + 1, decimal(found.eigenvalues[index], 4));
        let name = format!("eigenvector-{}", index + 1);
        panels.push(stage.panel(name, caption, Content::Signed(vector.clone())));
    }
    panels
}

/// The fraction of pixels that belong to the majority region of their group. Masked pixels are ignored.
pub(super) fn purity(labels: &[u8], truth: &[u8]) -> f64 {
    let mut counts: BTreeMap<u8, BTreeMap<u8, usize>> = BTreeMap::new();
    for (&label, &region) in labels.iter().zip(truth).filter(|&(&l, &r)| l != MASKED && r != MASKED) {
        *counts.entry(label).or_default().entry(region).or_default() += 1;
    }
    let most: usize = counts.values().filter_map(|regions| regions.values().max()).sum();
    let all: usize = counts.values().flat_map(BTreeMap::values).sum();
    if all == 0 { f64::NAN } else { most as f64 / all as f64 }
}

/// Measures of how closely groups form horizontal bands.
pub(super) struct Bands {
    /// The number of groups that are the majority in some row of a region. A group narrower than half of its region in each row is ignored.
    pub(super) count: usize,
    /// The fraction of pixels in the majority group of their row and region. It is 1 if all borders are along the rows.
    pub(super) share: f64,
}

/// Evaluates each row of each region separately. Masked pixels are ignored.
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

/// Labels of straight bands with borders along the rows. There are `groups` bands in total, the same number in each region, with equal
/// light within a region. `light` is the light of each pixel. Pixels that are masked in `truth` or `mask` stay masked.
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
            // A row belongs to the band that contains the middle of the row's light.
            let band = ((above + here / 2.0) / all * bands as f64) as usize;
            for pixel in pixels.filter(inside) {
                labels[pixel] = (index * bands + band.min(bands - 1)) as u8;
            }
            above += here;
        }
    }
    labels
}

/// The connected components of the pixels with `label`, the largest first. Pixels with a common edge are connected.
pub(super) fn components(labels: &[u8], label: u8, resolution: Resolution) -> Vec<Vec<usize>> {
    let Resolution { width, height } = resolution;
    let mut seen = vec![false; labels.len()];
    let mut parts = Vec::new();
    for start in 0..labels.len() {
        if seen[start] || labels[start] != label {
            continue;
        }
        seen[start] = true;
        let (mut part, mut next) = (Vec::new(), vec![start]);
        while let Some(pixel) = next.pop() {
            part.push(pixel);
            let (x, y) = (pixel % width, pixel / width);
            let neighbours = [
                (x > 0).then(|| pixel - 1),
                (x + 1 < width).then_some(pixel + 1),
                (y > 0).then(|| pixel - width),
                (y + 1 < height).then_some(pixel + width),
            ];
            for neighbour in neighbours.into_iter().flatten() {
                if !seen[neighbour] && labels[neighbour] == label {
                    seen[neighbour] = true;
                    next.push(neighbour);
                }
            }
        }
        parts.push(part);
    }
    parts.sort_by_key(|part| std::cmp::Reverse(part.len()));
    parts
}

const ALBEDO: f64 = 0.8;
/// The maximum number of transfers of light between the faces. A path that hits six surfaces has five transfers. The first of them leads to
/// the path's second bounce.
const BOUNCES: i32 = 5;

/// The value `κ(a)` at `a = real + i·imaginary`. Its imaginary part vanishes on `real = ½`, and for real `a`.
fn kernel(angle: f64, [real, imaginary]: [f64; 2]) -> f64 {
    // With t = e^x, the integrand falls exponentially at both ends, so the trapezoid rule converges faster than any power of the step.
    const REACH: f64 = 60.0;
    const STEPS: i32 = 24_000;
    let step = 2.0 * REACH / f64::from(STEPS);
    let at = |index: i32| {
        let x = step * f64::from(index) - REACH;
        let t = x.exp();
        let distance = 1.0 + t * t - 2.0 * t * angle.cos();
        let share = t * angle.sin().powi(2) / (2.0 * distance.powf(1.5));
        share * (x * (1.0 - real)).exp() * (imaginary * x).cos()
    };
    step * (0..=STEPS).map(at).sum::<f64>()
}

fn bounced(kernel: f64) -> f64 {
    (1..=BOUNCES).map(|bounce| ALBEDO.powi(bounce - 1) * kernel.powi(bounce)).sum()
}

/// The eigenvalue of the normalized cut at `a = ½ + iω` for a fold with this opening angle that is sharp at every scale. `ω` is
/// `frequency`, and the edge of the spectrum is at `ω = 0`.
///
/// Consider a strip at distance `s` from the crease on one face, and a strip at distance `t` on the other face. The first strip sends this
/// fraction of its light to the second, for the opening angle `φ`:
///
/// ```text
/// K(s, t) dt = s t sin²φ / (2 (s² + t² − 2 s t cos φ)^{3/2}) dt
/// ```
///
/// `K` is homogeneous of degree −1. Hence `s^{-a}` is an eigenfunction on the half line, with the eigenvalue `κ(a) = ∫ K(1, t) t^{-a} dt`.
/// The values at all `a = ½ + iω` form a continuous spectrum. Global light of albedo `ρ` and up to six bounces is the polynomial
/// `g(κ) = Σ ρ^{b−1} κ^b` with `b` from 1 to 5. The normalized cut divides it by `g(κ(0))`, the value for even light.
/// `guide/src/concepts/segmentation.md` explains the consequences.
pub(super) fn continuous(angle: f64, frequency: f64) -> f64 {
    bounced(kernel(angle, [0.5, frequency])) / bounced(kernel(angle, [0.0, 0.0]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn random_labels_are_even_and_tell_nothing() {
        let truth: Vec<u8> =
            (0..10_000).map(|pixel| if pixel == 7 { MASKED } else { u8::from(pixel % 100 < 50) }).collect();
        let random = random_labels(&truth, 5);
        assert_eq!(random[7], MASKED);
        let counts = [0, 1, 2, 3, 4].map(|group| random.iter().filter(|label| **label == group).count());
        // The standard deviation of a count of 2,000 in 10,000 is 40.
        assert!(counts.iter().all(|count| count.abs_diff(2000) < 200), "{counts:?}");
        assert!((purity(&random, &truth) - 0.5).abs() < 0.03, "{}", purity(&random, &truth));
    }

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
        // Two regions are side by side, and each has two bands.
        let found = bands(&[0, 0, 1, 1, 2, 2, 3, 3], &[0, 0, 1, 1, 0, 0, 1, 1], resolution);
        assert_eq!((found.count, found.share), (4, 1.0));
        // This is one region with a spot of one pixel.
        let found = bands(&[0, 7, 0, 0, 0, 0, 0, 0], &[0; 8], resolution);
        assert_eq!((found.count, found.share), (1, 0.875));
        // Left and right halves are not bands.
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

    #[test]
    fn parts_touch_by_edges_and_the_largest_comes_first() {
        #[rustfmt::skip]
        let labels = [
            1, 0, 1,
            0, 1, 1,
        ];
        let parts = components(&labels, 1, Resolution::new(3, 2));
        assert_eq!(parts.iter().map(Vec::len).collect::<Vec<_>>(), [3, 1]);
        assert_eq!(parts[1], [0]);
        assert!(components(&labels, 7, Resolution::new(3, 2)).is_empty());
    }

    #[test]
    fn even_light_is_shared_as_by_form_factors() {
        // The fraction of light from one face of an infinite fold to the other is (1 + cos φ) / 2, the form factor of two half planes.
        for angle in [0.6_f64, 1.176, std::f64::consts::FRAC_PI_2] {
            let wanted = (1.0 + angle.cos()) / 2.0;
            assert!((kernel(angle, [0.0, 0.0]) - wanted).abs() < 1e-9, "quadrature at {angle}");
        }
    }

    #[test]
    fn the_edge_of_the_zigzag_is_that_of_the_guide() {
        let angle = 2.0 * (0.2_f64 / 0.3).atan();
        assert!((continuous(angle, 0.0) - 0.790).abs() < 5e-4, "{}", continuous(angle, 0.0));
        // Eigenvalues of faster oscillations are smaller.
        assert!(continuous(angle, 0.5) < continuous(angle, 0.0));
    }
}
