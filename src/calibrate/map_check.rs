//! The check of a calibration's pixel map, which shows how far the devices have moved since the calibration.
//!
//! Random squares are shown, photographed and resampled by the map. The photo at projector pixel `x` then shows the pattern at `x + d(x)`.
//! The small displacement `d` is found by comparing the photo with the pattern.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use super::displacement::{Displacement, displacement};
use super::session::{CalibrationSession, CameraModel};
use super::structured_light::sum;
use crate::error::Result;
use crate::image::{Resolution, percentile};
use crate::measure::{Calibration, FrameSource};

/// The side of a square, in pixels. In a small field, the side is half as long.
const SQUARE: usize = 4;

/// A field is small when it has fewer pixels than this on a side.
const SMALL: usize = 32;

/// The number of pixels, over all patterns, that determine the displacement well.
const PIXELS: usize = 2000;

/// The largest number of patterns. A small field needs several patterns to have enough pixels.
const PATTERNS: usize = 8;

/// Projector pixels with less than this fraction of the median light are not used.
const DARK: f64 = 0.1;

/// Measures the displacement of the pixel map of `known`. Photographs black, white and a pattern (several patterns in a small field) at
/// `exposure` seconds.
///
/// # Errors
/// [`crate::Error::Numerical`] when the photos do not show the pattern.
pub fn map_check(frames: &mut dyn FrameSource, known: &Calibration, exposure: f64) -> Result<Displacement> {
    let mut session = CalibrationSession::new(frames);
    let (model, map) = (CameraModel::of(&known.camera, exposure, 1), &known.registration);
    let size = map.projector;
    // The photo at each projector pixel, in linear DN summed over all channels. It is 0 where no camera pixel sees the projector pixel.
    let mut photo = |lit: &dyn Fn(usize, usize) -> bool| -> Result<Vec<f64>> {
        let light = sum(&mut session, &model, lit)?;
        let row = |pixel: usize| map.row(pixel).map(|(camera, weight)| weight * light[camera]).sum();
        Ok((0..size.pixels()).map(row).collect())
    };
    let (black, white) = (photo(&|_, _| false)?, photo(&|_, _| true)?);
    let white: Vec<f64> = white.iter().zip(&black).map(|(white, black)| white - black).collect();
    let bright = percentile(white.iter().copied().filter(|&light| light > 0.0), 0.5);
    let used: Vec<bool> = white.iter().map(|&light| light > DARK * bright && bright > 0.0).collect();
    let mut pairs = Vec::new();
    for number in 0..PIXELS.div_ceil(size.pixels()).clamp(1, PATTERNS) {
        let squares = squares(size, number as u64);
        let photo = photo(&|x, y| squares[y * size.width + x] > 0.0)?;
        let contrast = |pixel: usize| match used[pixel] {
            true => 2.0 * (photo[pixel] - black[pixel]) / white[pixel] - 1.0,
            false => 0.0,
        };
        let seen = (0..size.pixels()).map(contrast).collect();
        pairs.push((squares, seen));
    }
    displacement(size, &pairs, &used)
}

/// A pattern of random squares of −1 and 1.
fn squares(size: Resolution, seed: u64) -> Vec<f64> {
    let mut random = Pcg64::seed_from_u64(seed);
    let side = if size.width.min(size.height) < SMALL { SQUARE / 2 } else { SQUARE };
    let across = size.width.div_ceil(side);
    let of: Vec<f64> = (0..across * size.height.div_ceil(side))
        .map(|_| if random.random::<bool>() { 1.0 } else { -1.0 })
        .collect();
    let square = |pixel: usize| pixel / size.width / side * across + pixel % size.width / side;
    (0..size.pixels()).map(|pixel| of[square(pixel)]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_pixel_has_the_value_of_its_square_and_squares_differ() {
        for (size, side) in [(Resolution::new(61, 47), 4), (Resolution::new(40, 31), 2)] {
            let squares = squares(size, 3);
            let at = |x: usize, y: usize| squares[y * size.width + x];
            let (mut across, mut down, mut all) = (0, 0, 0);
            for (y, x) in (0..size.height).flat_map(|y| (0..size.width).map(move |x| (y, x))) {
                let (left, top) = (x / side * side, y / side * side);
                assert_eq!(at(x, y), at(left, top), "{x} {y}");
                if (x, y) == (left, top) && x + side < size.width && y + side < size.height {
                    across += usize::from(at(x, y) != at(x + side, y));
                    down += usize::from(at(x, y) != at(x, y + side));
                    all += 1;
                }
            }
            // The changes between neighbouring squares are random (at least 150 coin tosses). The bound is four standard deviations √(n/4).
            let bound = 4.0 * (all as f64 / 4.0).sqrt();
            for changes in [across, down] {
                assert!((changes as f64 - 0.5 * all as f64).abs() < bound, "{changes} of {all}");
            }
            // The squares of two rows are independent.
            let rows_alike = (0..size.height / side - 1)
                .filter(|row| (0..size.width).all(|x| at(x, row * side) == at(x, (row + 1) * side)));
            assert_eq!(rows_alike.count(), 0);
        }
    }

    /// The camera sees points that lie one pixel to the right of the map's points and half a pixel above them. The camera has an offset and
    /// a curved response.
    #[test]
    fn a_map_that_is_off_by_a_shift_is_found_through_black_and_response() {
        use crate::measure::CaptureRequest;
        use crate::measure::simulated::Simulated;
        let size = Resolution::new(64, 48);
        let curve: Vec<f64> = (0..4096).map(|count| f64::from(count).powf(1.25)).collect();
        let count = {
            let curve = curve.clone();
            move |light: f64| curve.partition_point(|&linear| linear < light) as u16
        };
        let photo = move |request: &CaptureRequest, _| {
            let levels = request.frame.levels();
            let at = |x: usize, y: usize| f64::from(levels[y.min(47) * 64 + x.min(63)]) / 255.0;
            let light = |pixel: usize| {
                let (x, y) = (pixel % 64, pixel / 64);
                // The mean of two rows amounts to a shift by half a pixel.
                0.5 * (at(x + 1, y) + at(x + 1, y.saturating_sub(1)))
            };
            (0..64 * 48).map(|pixel| count(300.0 + 15_000.0 * light(pixel))).collect()
        };
        let mut frames = Simulated::new(size, size, 12, photo);
        let mut known = Calibration::ideal(&frames.projector, &frames.camera);
        (known.camera.black, known.camera.curve) = (0.0, Some(curve));
        let found = map_check(&mut frames, &known, 0.1).expect("the pattern is seen");
        let off = (found.shift[0] - 1.0).hypot(found.shift[1] + 0.5);
        assert!(off < 0.1 && found.agreement > 0.9, "{found:?}");
        // An uncorrected response changes the contrast of the squares, but not their position.
        known.camera.curve = None;
        let linear = map_check(&mut frames, &known, 0.1).expect("the pattern is seen");
        assert!(
            (linear.shift[0] - 1.0).abs() < 0.1 && linear.agreement <= found.agreement + 1e-9,
            "{linear:?}"
        );
    }

    #[test]
    fn squares_have_the_stated_side_and_half_of_them_are_bright() {
        let size = Resolution::new(61, 47);
        let squares = squares(size, 1);
        let same = |a: usize, b: usize| squares[a] == squares[b];
        assert!((0..4).all(|y| (0..4).all(|x| same(0, y * size.width + x))));
        let sum: f64 = squares.iter().sum();
        // The sum over 192 squares of 16 pixels has a standard deviation of 16 × √192 pixels.
        assert!(sum.abs() < 4.0 * 16.0 * 192.0_f64.sqrt(), "{sum}");
    }
}
