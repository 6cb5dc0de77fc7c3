//! The direct image: what each pixel sends straight back to itself, `diag(A_direct)`.
//!
//! Squares of light and dark of high frequency are shown, shifted step by step. Indirect light hardly changes with the shift, as it
//! comes from everywhere; direct light follows the pixel's own pattern. So the photos of pixel `i` are
//!
//! ```text
//! y_m = d x_m(i) + g,      d = Σ_m (x_m − x̄) y_m / Σ_m (x_m − x̄)²
//! ```
//!
//! by least squares on the patterns *as shown*. Nayar, Krishnan, Grossberg and Raskar, *Fast separation of direct and global
//! components of a scene using high frequency illumination* (2006), doi:10.1145/1141911.1141977.

use super::ambient::Blacks;
use super::calibration::Registration;
use super::hdr::Sighting;
use super::photo::Plane;
use super::registration::combine;
use crate::image::Resolution;

/// The shifted squares, of `side` pixels: for each pixel as many patterns light as dark.
pub(super) fn patterns(resolution: Resolution, side: usize, lit: &[bool]) -> Vec<Vec<f64>> {
    // Half a square at a time: each pixel is once well inside a light square, and once inside a dark one.
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

/// The direct light of one channel from photos of patterns shown.
pub(super) fn demodulate(
    registration: &Registration,
    sightings: &[&Sighting],
    shown: &[Vec<f64>],
    blacks: &Blacks,
    channel: (usize, usize),
) -> Plane {
    let count = shown.len() as f64;
    let pixels = registration.projector.pixels();
    let mean: Vec<f64> = (0..pixels).map(|i| shown.iter().map(|x| x[i]).sum::<f64>() / count).collect();
    let square: Vec<f64> =
        (0..pixels).map(|i| shown.iter().map(|x| (x[i] - mean[i]).powi(2)).sum::<f64>()).collect();
    let slope = |i: usize, m: usize| if square[i] > 0.0 { (shown[m][i] - mean[i]) / square[i] } else { 0.0 };
    combine(registration, sightings, &slope, blacks, channel)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_pixel_is_as_often_light_as_dark() {
        let resolution = Resolution::new(9, 7);
        for side in 1..6 {
            let patterns = patterns(resolution, side, &[true; 63]);
            for pixel in 0..63 {
                let light: f64 = patterns.iter().map(|pattern| pattern[pixel]).sum();
                // Steps that do not divide the square leave one pattern more on one side.
                assert!((2.0 * light - patterns.len() as f64).abs() <= 2.0 * side as f64, "{side} {pixel}");
                assert!(light > 0.0 && light < patterns.len() as f64);
            }
        }
    }
}
