//! The direct stage: the direct image `diag(A_direct)`, which holds the light that each pixel reflects
//! straight back to itself.
//!
//! The projector shows a checkerboard of small squares, shifted step by step. Global light is an average over
//! many pixels and hardly changes with the shift. Direct light follows the pixel's own pattern value. With
//! direct light `d`, global light `g` and the pattern value `x_m(i)` of shift `m`, the photos of pixel `i`
//! are
//!
//! ```text
//! y_m = d x_m(i) + g,      d = Σ_m (x_m − x̄) y_m / Σ_m (x_m − x̄)²
//! ```
//!
//! where `d` is the least-squares fit to the patterns *as shown*, after rounding to levels. Nayar, Krishnan,
//! Grossberg and Raskar, *Fast separation of direct and global components of a scene using high frequency
//! illumination* (2006), doi:10.1145/1141911.1141977.

use super::ambient::BlackPhotos;
use super::calibration::Registration;
use super::hdr::RateFrame;
use super::photo::Plane;
use super::registration::combine;
use crate::image::Resolution;

/// The shifted checkerboards, with squares of `side` pixels. Each pixel is lit in about half of the patterns.
/// Pixels that are not `lit` stay dark.
pub(super) fn patterns(resolution: Resolution, side: usize, lit: &[bool]) -> Vec<Vec<f64>> {
    // The shift is half a square: each pixel is at least once well inside a bright square, and once well
    // inside a dark one.
    let step = side.div_ceil(2);
    let shifts = |to: usize| (0..to).step_by(step);
    let pattern = |right: usize, down: usize| {
        (0..resolution.pixels())
            .map(|pixel| {
                let (x, y) = (pixel % resolution.width + right, pixel / resolution.width + down);
                f64::from(u8::from(lit[pixel] && (x / side + y / side).is_multiple_of(2)))
            })
            .collect()
    };
    shifts(side)
        .flat_map(|down| shifts(2 * side).map(move |right| (right, down)))
        .map(|(x, y)| pattern(x, y))
        .collect()
}

/// The direct image of one channel, from the photos of the patterns that were shown. `channel` is its index
/// and the number of channels.
pub(super) fn demodulate(
    registration: &Registration,
    rate_frames: &[&RateFrame],
    shown: &[Vec<f64>],
    blacks: &BlackPhotos,
    channel: (usize, usize),
) -> Plane {
    let count = shown.len() as f64;
    let pixels = registration.projector.pixels();
    let mean: Vec<f64> = (0..pixels).map(|i| shown.iter().map(|x| x[i]).sum::<f64>() / count).collect();
    let square: Vec<f64> =
        (0..pixels).map(|i| shown.iter().map(|x| (x[i] - mean[i]).powi(2)).sum::<f64>()).collect();
    let slope = |i: usize, m: usize| if square[i] > 0.0 { (shown[m][i] - mean[i]) / square[i] } else { 0.0 };
    combine(registration, rate_frames, &slope, blacks, channel)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_pixel_is_lit_in_half_of_the_patterns() {
        let resolution = Resolution::new(9, 7);
        for side in 1..6 {
            let patterns = patterns(resolution, side, &[true; 63]);
            for pixel in 0..63 {
                let light: f64 = patterns.iter().map(|pattern| pattern[pixel]).sum();
                // When the step does not divide the square, one side has one more pattern.
                assert!((2.0 * light - patterns.len() as f64).abs() <= 2.0 * side as f64, "{side} {pixel}");
                assert!(light > 0.0 && light < patterns.len() as f64);
            }
        }
    }
}
