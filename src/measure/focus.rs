//! A focus score: how sharp a photo is, from two frames of it.
//!
//! The score is the Tenengrad, the mean square of the Sobel gradient (Tenenbaum, *Accommodation in computer
//! vision*, 1970; Krotkov, *Focusing*, IJCV 1, 1988), divided by the squared mean, so that it does not depend
//! on exposure and brightness. In the square of a gradient, noise counts as much as an edge. The score
//! therefore takes the *product* of the gradients of two frames of the same scene: their noise is independent
//! and averages out.

use crate::rig::RawFrame;

/// The focus score of two frames of the same scene under the same pattern. A larger score is sharper; that of
/// a uniform surface is 0 up to noise. `black` is the count without light. Pixels with a count of `limit` or
/// more are left out, and so are their neighbours. `None` when the frames differ in size, when no pixel
/// remains, or when there is no light.
pub fn focus(first: &RawFrame, second: &RawFrame, black: f64, limit: f64) -> Option<f64> {
    let (width, height, channels) = (first.resolution.width, first.resolution.height, first.channels);
    if (second.resolution, second.channels) != (first.resolution, channels) {
        return None;
    }
    let gray = |frame: &RawFrame| -> Vec<f64> {
        let pixels = frame.counts.chunks_exact(channels);
        pixels
            .map(|pixel| {
                let is_over = pixel.iter().any(|&count| f64::from(count) >= limit);
                let light = pixel.iter().map(|&count| f64::from(count) - black).sum::<f64>();
                if is_over { f64::NAN } else { light }
            })
            .collect()
    };
    let [a, b] = [gray(first), gray(second)];
    let (mut products, mut lights, mut count) = (0.0, [0.0; 2], 0.0);
    for y in 1..height.saturating_sub(1) {
        for x in 1..width.saturating_sub(1) {
            let ([ax, ay], [bx, by]) = (sobel(&a, width, x, y), sobel(&b, width, x, y));
            let product = ax * bx + ay * by;
            // A saturated neighbour makes the product NaN.
            if product.is_finite() {
                products += product;
                lights[0] += a[y * width + x];
                lights[1] += b[y * width + x];
                count += 1.0;
            }
        }
    }
    let light = lights[0] * lights[1] / count;
    (lights[0] > 0.0 && lights[1] > 0.0).then(|| products / light)
}

/// The Sobel gradient to the right and down, in counts per pixel.
fn sobel(picture: &[f64], width: usize, x: usize, y: usize) -> [f64; 2] {
    let at = |dx: usize, dy: usize| picture[(y + dy - 1) * width + x + dx - 1];
    let right = at(2, 0) + 2.0 * at(2, 1) + at(2, 2) - at(0, 0) - 2.0 * at(0, 1) - at(0, 2);
    let down = at(0, 2) + 2.0 * at(1, 2) + at(2, 2) - at(0, 0) - 2.0 * at(1, 0) - at(2, 0);
    [right / 8.0, down / 8.0]
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64;

    use super::*;
    use crate::image::{Blur, Resolution};

    const SIZE: Resolution = Resolution { width: 64, height: 48 };

    fn frame(light: impl Fn(usize) -> f64) -> RawFrame {
        let counts = (0..SIZE.pixels()).map(|pixel| light(pixel).round() as u16).collect();
        RawFrame { resolution: SIZE, channels: 1, counts, exposure: 0.1, id: 0, started: 0.0 }
    }

    /// A blurred checkerboard with squares of eight pixels, and with this much light on average.
    fn squares(blur: f64, light: f64) -> Vec<f64> {
        let sharp: Vec<f64> = (0..SIZE.pixels())
            .map(|pixel| (pixel % SIZE.width / 8 + pixel / SIZE.width / 8) % 2)
            .map(|square| light * (0.5 + square as f64))
            .collect();
        Blur::new(SIZE, blur).map_or(sharp.clone(), |blur| blur.apply(&sharp))
    }

    fn score(of: &[f64], noise: f64, seed: u64) -> f64 {
        let mut random = Pcg64::seed_from_u64(seed);
        // Uniform noise with a standard deviation of `noise`.
        let mut noisy = || -> Vec<f64> {
            of.iter().map(|v| v + 12.0_f64.sqrt() * noise * (random.random::<f64>() - 0.5)).collect()
        };
        let [a, b] = [noisy(), noisy()];
        focus(&frame(|i| 100.0 + a[i]), &frame(|i| 100.0 + b[i]), 100.0, 65535.0).expect("there is light")
    }

    #[test]
    fn the_score_grows_with_sharpness_and_not_with_brightness() {
        let scores = [0.0, 0.7, 1.5, 3.0].map(|blur| score(&squares(blur, 10_000.0), 0.0, 0));
        assert!(scores.is_sorted_by(|a, b| a > b), "{scores:?}");
        let dim = score(&squares(1.5, 2_500.0), 0.0, 0);
        // Rounding to counts is 1e-4 of the light.
        assert!((dim / scores[2] - 1.0).abs() < 1e-2, "{dim} {}", scores[2]);
    }

    /// Two slopes in three channels: gradients of (20, 6) and (40, −10), summed over channels, and a product of 740 everywhere.
    #[test]
    fn the_score_of_slopes_is_the_product_of_their_gradients_over_that_of_their_light() {
        let slope = |right: i32, down: i32, channels: usize| {
            let value = |sample: usize| {
                let (pixel, channel) = (sample / channels, sample % channels);
                let (x, y) = ((pixel % SIZE.width) as i32, (pixel / SIZE.width) as i32);
                // Channels share the slope; the third has none.
                let share = if channel < 2 { 1 } else { 0 };
                (5000 + share * (right * x + down * y)) as u16
            };
            let counts = (0..SIZE.pixels() * channels).map(value).collect();
            RawFrame { resolution: SIZE, channels, counts, exposure: 0.1, id: 0, started: 0.0 }
        };
        let (first, second) = (slope(10, 3, 3), slope(20, -5, 3));
        let found = focus(&first, &second, 1000.0, 65_535.0).expect("there is light");
        // The light of all pixels but the border's, on average that of the middle; black is subtracted from each channel.
        let light = |right: f64, down: f64| 3.0 * 4000.0 + 2.0 * (31.5 * right + 23.5 * down);
        let expected = (20.0 * 40.0 - 6.0 * 10.0) / (light(10.0, 3.0) * light(20.0, -5.0));
        // All numbers are whole until the last division.
        assert!((found / expected - 1.0).abs() < 1e-12, "{found} {expected}");
        assert_eq!(focus(&first, &slope(20, -5, 1), 1000.0, 65_535.0), None, "frames of different cameras");
    }

    #[test]
    fn noise_does_not_raise_the_score() {
        let even = vec![10_000.0; SIZE.pixels()];
        let by_one_frame = {
            let mut random = Pcg64::seed_from_u64(1);
            let noisy: Vec<f64> =
                (0..SIZE.pixels()).map(|_| 9_000.0 + 2_000.0 * random.random::<f64>()).collect();
            let frame = frame(|pixel| noisy[pixel]);
            focus(&frame, &frame, 0.0, 65535.0).expect("there is light")
        };
        // Noise of 6 %: its square has a large mean, but the product of two independent gradients has the
        // mean 0.
        let by_two = (0..8).map(|seed| score(&even, 577.0, seed).abs()).fold(0.0, f64::max);
        assert!(by_two < 0.1 * by_one_frame, "{by_two} {by_one_frame}");
        let (noisy, clean) =
            (score(&squares(1.5, 10_000.0), 577.0, 3), score(&squares(1.5, 10_000.0), 0.0, 0));
        assert!((noisy / clean - 1.0).abs() < 0.1, "{noisy} {clean}");
    }

    #[test]
    fn saturated_pixels_are_left_out_and_a_dark_frame_has_no_score() {
        let mut bright = squares(0.0, 10_000.0);
        bright.iter_mut().take(10 * SIZE.width).for_each(|value| *value = 65_535.0);
        let frame = frame(|pixel| bright[pixel]);
        let found = focus(&frame, &frame, 0.0, 65_000.0).expect("the rest is not saturated");
        let whole = score(&squares(0.0, 10_000.0), 0.0, 0);
        assert!((found / whole - 1.0).abs() < 0.1, "{found} {whole}");
        assert_eq!(focus(&frame, &frame, 65_535.0, 70_000.0), None);
    }
}
