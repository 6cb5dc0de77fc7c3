//! Colours of groups: labels 0 to 254, and 255 for masked pixels.

use super::oklab::linear_from_oklab;
use crate::image::Resolution;
use crate::io::raster::Raster;
use crate::io::srgb::encode_srgb;

/// Colour of masked pixels, a gray that no colour map contains.
pub const MASKED: [u8; 3] = [0x3c, 0x3c, 0x40];

/// The label of a pixel that belongs to no group.
pub const MASKED_LABEL: u8 = 255;

/// Colours that most colour-blind readers can distinguish: Okabe and Ito's seven, then five of Paul Tol's "muted" scheme.
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

/// Colour of a group. After the twelve hand-picked colours, hues advance by the golden angle in Oklab with alternating lightness,
/// so that consecutive labels differ in both. Label 255 is dark gray.
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
    // The most saturated sRGB colour of this hue and lightness, with chroma up to 0.13.
    let saturation = (0..=13).rev().map(|hundredths| hundredths as f32 / 100.0);
    let color = saturation
        .map(|chroma| linear_from_oklab([lightness, chroma * hue.cos(), chroma * hue.sin()]))
        .find(|rgb| rgb.iter().all(|level| (0.0..=1.0).contains(level)));
    color.unwrap_or_default().map(encode_srgb)
}

/// Paints `labels` (`w·h`, row by row).
pub fn paint_labels(resolution: Resolution, labels: &[u8]) -> Raster {
    Raster::from_pixels(resolution, labels.iter().map(|&label| label_color(label)))
}

#[cfg(test)]
mod tests {
    use super::super::oklab::oklab_from_linear;
    use super::*;
    use crate::io::srgb::decode_srgb;

    #[test]
    fn no_two_of_the_255_colors_are_equal() {
        let colors: std::collections::HashSet<_> = (0..=255).map(label_color).collect();
        assert_eq!(colors.len(), 256);
    }

    #[test]
    fn consecutive_labels_are_far_apart_and_none_is_near_the_mask() {
        let lab =
            |label| oklab_from_linear(label_color(label).map(|byte| decode_srgb(f32::from(byte) / 255.0)));
        let distance =
            |a: [f32; 3], b: [f32; 3]| a.iter().zip(b).map(|(x, y)| (x - y).powi(2)).sum::<f32>().sqrt();
        for label in 0..254 {
            // 0.02 is about one just noticeable difference in Oklab.
            assert!(distance(lab(label), lab(label + 1)) > 0.1, "labels {label} and {}", label + 1);
            assert!(distance(lab(label), lab(MASKED_LABEL)) > 0.1, "label {label} and the mask");
        }
    }
}
