//! Colours of groups: labels 0 to 254, and 255 for masked pixels.

use super::colormap::linear_from_oklab;
use crate::image::Resolution;
use crate::io::raster::Raster;
use crate::io::raster::encode_srgb;

/// Colour of masked pixels, a gray that no colour map contains.
pub const MASKED: [u8; 3] = [0x3c, 0x3c, 0x40];

/// The label of a pixel without a group.
pub const MASKED_LABEL: u8 = 255;

/// Colours that most colour-blind readers can distinguish: seven by Okabe and Ito, then five from Paul Tol's "muted" scheme.
const HAND_PICKED: [[u8; 3]; 12] = [
    [0x00, 0x72, 0xb2],
    [0xe6, 0x9f, 0x00],
    [0x00, 0x9e, 0x73],
    [0xcc, 0x79, 0xa7],
    [0x56, 0xb4, 0xe9],
    [0xd5, 0x5e, 0x00],
    [0xf0, 0xe4, 0x42],
    [0x33, 0x22, 0x88],
    [0x99, 0x99, 0x33],
    [0x88, 0x22, 0x55],
    [0x44, 0xaa, 0x99],
    [0xdd, 0xcc, 0xbb],
];

/// The colour of a group. After the twelve hand-picked colours, hues advance by the golden angle in Oklab with alternating lightness, so
/// that consecutive labels differ in both. Label 255 is dark gray.
pub fn label_color(label: u8) -> [u8; 3] {
    if label == MASKED_LABEL {
        return MASKED;
    }
    if let Some(&color) = HAND_PICKED.get(usize::from(label)) {
        return color;
    }
    const GOLDEN_ANGLE: f32 = 2.399_963;
    const LIGHTNESS: [f32; 5] = [0.70, 0.54, 0.82, 0.62, 0.48];
    let step = usize::from(label) - HAND_PICKED.len();
    let hue = step as f32 * GOLDEN_ANGLE;
    let lightness = LIGHTNESS[step % LIGHTNESS.len()];
    // The chroma is the largest that sRGB has at this hue and lightness, up to 0.13.
    let saturation = (0..=13).rev().map(|hundredths| hundredths as f32 / 100.0);
    let color = saturation
        .map(|chroma| linear_from_oklab([lightness, chroma * hue.cos(), chroma * hue.sin()]))
        .find(|rgb| rgb.iter().all(|level| (0.0..=1.0).contains(level)));
    color.unwrap_or_default().map(encode_srgb)
}

/// Paints `labels` (`w·h`, row by row).
pub fn paint_labels(resolution: Resolution, labels: &[u8]) -> Raster {
    Palette::default().paint(resolution, labels)
}

/// The assignment of colours to groups.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Palette([u8; 256]);

impl Default for Palette {
    /// Group `k` has colour `k`.
    fn default() -> Self {
        Self(std::array::from_fn(|label| label as u8))
    }
}

impl Palette {
    /// Colours for `labels` that match a picture of `reference` in this palette. The group with the most pixels in common with a region of
    /// the reference takes the colour of this region. Then the next group takes the colour of another region, and so on. The remaining
    /// groups take colours that the reference does not use.
    #[must_use]
    pub fn matched(&self, reference: &[u8], labels: &[u8]) -> Self {
        let mut shared = vec![0_usize; 256 * 256];
        for (&region, &label) in reference.iter().zip(labels) {
            if region != MASKED_LABEL && label != MASKED_LABEL {
                shared[usize::from(label) * 256 + usize::from(region)] += 1;
            }
        }
        let mut pairs: Vec<(usize, usize)> = (0..shared.len()).map(|at| (shared[at], at)).collect();
        pairs.retain(|(pixels, _)| *pixels > 0);
        // The pair with the most pixels comes first. Among equal pairs, the group with the lower number comes first.
        pairs.sort_by_key(|&(pixels, at)| (std::cmp::Reverse(pixels), at));
        let mut color_of = [None; 256];
        let mut is_taken = [false; 256];
        for (_, at) in pairs {
            let (label, color) = (at / 256, self.0[at % 256]);
            if color_of[label].is_none() && !is_taken[usize::from(color)] {
                color_of[label] = Some(color);
                is_taken[usize::from(color)] = true;
            }
        }
        // The colours of regions without a group are used only if there are no other colours.
        let of_reference: Vec<u8> = reference
            .iter()
            .filter(|&&region| region != MASKED_LABEL)
            .map(|&of| self.0[usize::from(of)])
            .collect();
        let mut is_avoided = is_taken;
        of_reference.iter().for_each(|&color| is_avoided[usize::from(color)] = true);
        let mut free = (0..MASKED_LABEL).filter(|&color| !is_avoided[usize::from(color)]);
        let mut left = (0..MASKED_LABEL)
            .filter(|&color| is_avoided[usize::from(color)] && !is_taken[usize::from(color)]);
        let mut is_there = [false; 256];
        labels.iter().for_each(|&label| is_there[usize::from(label)] = true);
        let groups = color_of.iter_mut().enumerate().take(usize::from(MASKED_LABEL));
        for (label, color) in groups.filter(|(_, color)| color.is_none()) {
            if is_there[label] {
                *color = free.next().or_else(|| left.next());
            }
        }
        Self(std::array::from_fn(|label| color_of[label].unwrap_or(label as u8)))
    }

    /// The colour of a group.
    pub fn color(&self, label: u8) -> [u8; 3] {
        label_color(if label == MASKED_LABEL { label } else { self.0[usize::from(label)] })
    }

    /// Paints `labels` (`w·h`, row by row).
    pub fn paint(&self, resolution: Resolution, labels: &[u8]) -> Raster {
        Raster::from_pixels(resolution, labels.iter().map(|&label| self.color(label)))
    }
}

#[cfg(test)]
mod tests {
    use super::super::colormap::oklab_from_linear;
    use super::*;
    use crate::io::raster::decode_srgb;

    #[test]
    fn no_two_of_the_255_colors_are_equal() {
        let colors: std::collections::HashSet<_> = (0..=255).map(label_color).collect();
        assert_eq!(colors.len(), 256);
    }

    #[test]
    fn groups_have_the_colors_of_the_regions_that_they_share_most_pixels_with() {
        let truth = [0, 0, 0, 1, 1, 1, 2, 2, 255];
        // Group 0 is region 1, and group 1 is region 2. Group 2 is most of region 0, and group 3 is a small part of region 0.
        let found = [2, 2, 3, 0, 0, 0, 1, 1, 255];
        let palette = Palette::default().matched(&truth, &found);
        assert_eq!([0, 1, 2].map(|label| palette.color(label)), [1, 2, 0].map(label_color));
        assert_eq!(palette.color(3), label_color(3), "a colour that no region has");
        assert_eq!(palette.color(MASKED_LABEL), MASKED);
        // If two groups are in one region, the larger group takes the colour of the region.
        let halves = palette.matched(&found, &[4, 4, 4, 5, 5, 6, 7, 7, 7]);
        assert_eq!([4, 5, 7].map(|label| halves.color(label)), [0, 1, 2].map(label_color));
        let colors: std::collections::HashSet<_> = [4, 5, 6, 7].map(|label| halves.color(label)).into();
        assert_eq!(colors.len(), 4);
    }

    #[test]
    fn consecutive_labels_are_far_apart_and_none_is_near_the_mask() {
        let lab =
            |label| oklab_from_linear(label_color(label).map(|byte| decode_srgb(f32::from(byte) / 255.0)));
        let distance =
            |a: [f32; 3], b: [f32; 3]| a.iter().zip(b).map(|(x, y)| (x - y).powi(2)).sum::<f32>().sqrt();
        for label in 0..254 {
            // One just noticeable difference is about 0.02 in Oklab.
            assert!(distance(lab(label), lab(label + 1)) > 0.1, "labels {label} and {}", label + 1);
            assert!(distance(lab(label), lab(MASKED_LABEL)) > 0.1, "label {label} and the mask");
        }
    }
}
