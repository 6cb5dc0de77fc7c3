//! Gaussian blurs that are applied hundreds of times: symmetric, and fast at any width.

use crate::image::{Blur, Resolution};

/// A Gaussian wider than this many pixels is applied to blocks of pixels. In units of blocks, its width is at most this value.
const WIDEST: f64 = 3.0;

/// The blur `K = Kᵀ = √B⁻¹ E K' Eᵀ √B⁻¹` of an image mirrored at its borders. `Eᵀ` sums the pixels of each block, `B` holds the number of
/// pixels of each block, and `K'` blurs the image of blocks.
#[derive(Clone, Debug)]
pub(super) struct Gaussian {
    resolution: Resolution,
    block: usize,
    /// The blur `K'` on blocks; `None` for the identity.
    blur: Option<Blur>,
}

impl Gaussian {
    pub(super) fn new(resolution: Resolution, width: f64) -> Self {
        let block = ((width / WIDEST).ceil() as usize).max(1);
        let blocks = Resolution::new(resolution.width.div_ceil(block), resolution.height.div_ceil(block));
        Self { resolution, block, blur: Blur::new(blocks, width / block as f64) }
    }

    pub(super) fn apply(&self, x: &[f64]) -> Vec<f64> {
        let Some(blur) = &self.blur else { return x.to_vec() };
        if self.block == 1 {
            return blur.apply(x);
        }
        let (Resolution { width, height }, blocks) = (self.resolution, blur.resolution());
        let of = |pixel: usize| (pixel / width / self.block) * blocks.width + pixel % width / self.block;
        let side = |at: usize, length: usize| self.block.min(length - at * self.block) as f64;
        let root =
            |block: usize| (side(block % blocks.width, width) * side(block / blocks.width, height)).sqrt();
        let mut sums = vec![0.0; blocks.pixels()];
        x.iter().enumerate().for_each(|(pixel, value)| sums[of(pixel)] += value);
        sums.iter_mut().enumerate().for_each(|(block, sum)| *sum /= root(block));
        let mut spread = blur.apply(&sums);
        spread.iter_mut().enumerate().for_each(|(block, value)| *value /= root(block));
        (0..x.len()).map(|pixel| spread[of(pixel)]).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn symmetric_and_as_wide_as_said_whether_by_pixels_or_by_blocks() {
        let resolution = Resolution::new(53, 31);
        let n = resolution.pixels();
        let noise = |seed: usize| -> Vec<f64> { (0..n).map(|i| ((i * 7919 + seed) % 101) as f64).collect() };
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let (x, y) = (noise(1), noise(17));
        for width in [0.0, 0.5, 2.0, 6.0, 12.0] {
            let gaussian = Gaussian::new(resolution, width);
            let [one, other] = [dot(&y, &gaussian.apply(&x)), dot(&x, &gaussian.apply(&y))];
            // The tolerance covers the rounding of some thousand terms.
            assert!((one - other).abs() < 1e-12 * one.abs(), "{width}: {one} {other}");
        }
        // The blurred impulse has the width of the exact kernel, up to the error of the blocks.
        let mut bump = vec![0.0; n];
        bump[15 * 53 + 26] = 1.0;
        for width in [2.0, 6.0] {
            let found = Gaussian::new(resolution, width).apply(&bump);
            let exact = Blur::new(resolution, width).map(|blur| blur.apply(&bump)).unwrap_or_default();
            let off: f64 =
                found.iter().zip(&exact).map(|(a, b)| (a - b).powi(2)).sum::<f64>() / dot(&exact, &exact);
            assert!(off.sqrt() < 0.15, "{width}: {}", off.sqrt());
        }
    }
}
