//! Colour maps: a signed map for eigenvectors, and a sequential map for amounts.

use std::sync::LazyLock;

pub use super::palette::MASKED;
use crate::error::{Error, Result};
use crate::image::Resolution;
use crate::io::raster;
pub use crate::io::raster::NOT_A_NUMBER;
use crate::io::raster::Raster;
use crate::io::raster::{decode_srgb, encode_srgb};

/// The quantile that defines a colour map's range. A few brighter pixels may saturate, so that they do not compress the range of the
/// others.
const RANGE_PERCENTILE: f64 = 0.995;

/// Colours from −1 (blue) over 0 (near white) to 1 (vermilion), darker towards both ends. Colour-blind readers can distinguish them.
const SIGNED_STOPS: [[u8; 3]; 7] = [
    [0x0a, 0x2a, 0x66],
    [0x1f, 0x6f, 0xb8],
    [0x8c, 0xbe, 0xe2],
    [0xf6, 0xf5, 0xf2],
    [0xf5, 0xb4, 0x83],
    [0xd1, 0x5a, 0x1e],
    [0x6b, 0x1b, 0x0b],
];

/// The interpolation steps between two stops. Each step changes a channel by at most one level.
const STEPS: usize = 512;

/// The interpolated signed map. It is computed once, because the interpolation would take most of the time per pixel.
static SIGNED: LazyLock<Vec<[u8; 3]>> = LazyLock::new(|| {
    let stops =
        SIGNED_STOPS.map(|stop| oklab_from_linear(stop.map(|byte| decode_srgb(f32::from(byte) / 255.0))));
    let color = |step: usize| {
        let below = (step / STEPS).min(stops.len() - 2);
        let fraction = (step - below * STEPS) as f32 / STEPS as f32;
        let [from, to] = [stops[below], stops[below + 1]];
        let mixed = [0, 1, 2].map(|axis| from[axis] + fraction * (to[axis] - from[axis]));
        linear_from_oklab(mixed).map(encode_srgb)
    };
    (0..=(stops.len() - 1) * STEPS).map(color).collect()
});

/// Colour of a signed `value`, clipped to \[−1, 1\]: negative is blue, 0 near white, positive vermilion.
pub fn signed_color(value: f64) -> [u8; 3] {
    if value.is_nan() {
        return NOT_A_NUMBER;
    }
    let middle = (SIGNED.len() / 2) as f64;
    SIGNED[(middle * (1.0 + value.clamp(-1.0, 1.0))).round() as usize]
}

/// Colour of `value`, clipped to \[0, 1\]: viridis, from dark violet over green to yellow, with uniform steps of lightness.
pub fn sequential_color(value: f64) -> [u8; 3] {
    if value.is_nan() {
        return NOT_A_NUMBER;
    }
    // Matt Zucker's polynomial of degree 6 for Matplotlib's viridis (both in the public domain), evaluated by Horner's rule.
    const COEFFICIENTS: [[f64; 3]; 7] = [
        [0.277_727_327_2, 0.005_407_344_5, 0.334_099_805_3],
        [0.105_093_043_1, 1.404_613_529_9, 1.384_590_162_6],
        [-0.330_861_828_7, 0.214_847_559_5, 0.095_095_163_0],
        [-4.634_230_499_0, -5.799_100_973_4, -19.332_440_956_3],
        [6.228_269_936_3, 14.179_933_366_8, 56.690_552_600_7],
        [4.776_384_997_7, -13.745_145_377_7, -65.353_032_633_4],
        [-5.435_455_855_9, 4.645_852_612_2, 26.312_435_249_6],
    ];
    let value = value.clamp(0.0, 1.0);
    [0, 1, 2].map(|channel| {
        let level = COEFFICIENTS.iter().rev().fold(0.0, |sum, row| sum * value + row[channel]);
        (level.clamp(0.0, 1.0) * 255.0).round() as u8
    })
}

/// The absolute value that is shown as ±1 by [`signed_color`]. It is the 99.5th percentile, so outliers have no influence.
///
/// `mask`, if given, is `true` at pixels to leave out. The result is 1 if every value is zero, NaN or masked.
pub fn robust_range(values: &[f64], mask: Option<&[bool]>) -> f64 {
    let kept = |&(index, value): &(usize, &f64)| {
        value.is_finite() && !mask.is_some_and(|mask| mask.get(index).copied().unwrap_or(false))
    };
    let sizes: Vec<f64> = values.iter().enumerate().filter(kept).map(|(_, value)| value.abs()).collect();
    let largest = sizes.iter().copied().fold(0.0, f64::max);
    // The fallback is for images with more than 99.5 % zeros. They are sparse, so their nonzero values are not outliers.
    raster::percentile(sizes, RANGE_PERCENTILE).filter(|&range| range > 0.0).unwrap_or(match largest {
        0.0 => 1.0,
        largest => largest,
    })
}

/// Paints signed values (`w·h`, row by row). 0 is neutral, and ±`range` are the ends of the colour map. `mask` is as in [`robust_range`].
///
/// # Errors
/// [`Error::Dimension`] when the number of values or of mask entries differs from the number of pixels.
pub fn paint_signed(
    resolution: Resolution,
    values: &[f64],
    mask: Option<&[bool]>,
    range: f64,
) -> Result<Raster> {
    paint(resolution, values, mask, |value| signed_color(value / range))
}

/// Paints amounts (`w·h`, row by row). `low` is dark violet, and `high` is yellow. `mask` and errors are as in [`paint_signed`].
pub fn paint_sequential(
    resolution: Resolution,
    values: &[f64],
    mask: Option<&[bool]>,
    (low, high): (f64, f64),
) -> Result<Raster> {
    // A constant image has no range, so all its pixels have the colour of `low`.
    let span = if high > low { high - low } else { f64::INFINITY };
    paint(resolution, values, mask, |value| sequential_color((value - low) / span))
}

fn paint(
    resolution: Resolution,
    values: &[f64],
    mask: Option<&[bool]>,
    color: impl Fn(f64) -> [u8; 3],
) -> Result<Raster> {
    for (what, count) in
        [("values to paint", Some(values.len())), ("mask of values to paint", mask.map(<[bool]>::len))]
    {
        if count.is_some_and(|count| count != resolution.pixels()) {
            return Err(Error::dimension(what, resolution, count.unwrap_or_default()));
        }
    }
    let masked = |index: usize| mask.is_some_and(|mask| mask[index]);
    let pixels =
        values.iter().enumerate().map(|(index, &value)| if masked(index) { MASKED } else { color(value) });
    Ok(Raster::from_pixels(resolution, pixels))
}

/// The linear sRGB colour of `[L, a, b]` in Oklab (Björn Ottosson, *A perceptual color space for image processing*). In Oklab, equal
/// distances look equal.
pub(super) fn linear_from_oklab([lightness, a, b]: [f32; 3]) -> [f32; 3] {
    let long = (lightness + 0.396_337_78 * a + 0.215_803_76 * b).powi(3);
    let medium = (lightness - 0.105_561_346 * a - 0.063_854_17 * b).powi(3);
    let short = (lightness - 0.089_484_18 * a - 1.291_485_5 * b).powi(3);
    [
        4.076_741_7 * long - 3.307_711_6 * medium + 0.230_969_94 * short,
        -1.268_438 * long + 2.609_757_4 * medium - 0.341_319_4 * short,
        -0.004_196_086_3 * long - 0.703_418_6 * medium + 1.707_614_7 * short,
    ]
}

/// Oklab `[L, a, b]` of a linear sRGB colour.
pub(super) fn oklab_from_linear([red, green, blue]: [f32; 3]) -> [f32; 3] {
    let long = (0.412_221_46 * red + 0.536_332_55 * green + 0.051_445_995 * blue).cbrt();
    let medium = (0.211_903_5 * red + 0.680_699_5 * green + 0.107_396_96 * blue).cbrt();
    let short = (0.088_302_46 * red + 0.281_718_85 * green + 0.629_978_7 * blue).cbrt();
    [
        0.210_454_26 * long + 0.793_617_8 * medium - 0.004_072_047 * short,
        1.977_998_5 * long - 2.428_592_2 * medium + 0.450_593_7 * short,
        0.025_904_037 * long + 0.782_771_77 * medium - 0.808_675_77 * short,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zero_is_neutral_and_the_ends_mirror_in_lightness() {
        assert_eq!(signed_color(0.0), SIGNED_STOPS[3]);
        assert_eq!(signed_color(-7.0), SIGNED_STOPS[0]);
        assert_eq!(signed_color(f64::INFINITY), SIGNED_STOPS[6]);
        // Consecutive colours differ by at most one level, so no step is visible.
        let near = |pair: &[[u8; 3]]| (0..3).all(|channel| pair[0][channel].abs_diff(pair[1][channel]) <= 1);
        assert!(SIGNED.windows(2).all(near));
        let lightness = |value: f64| {
            oklab_from_linear(signed_color(value).map(|byte| decode_srgb(f32::from(byte) / 255.0)))[0]
        };
        for percent in 1..=100 {
            let value = f64::from(percent) / 100.0;
            assert!((lightness(value) - lightness(-value)).abs() < 0.08, "at {value}");
            assert!(
                lightness(value) < lightness(value - 0.01) + 0.004,
                "lightness falls away from zero at {value}"
            );
        }
    }

    #[test]
    fn the_range_ignores_outliers_masked_pixels_and_nan() {
        let mut values = vec![0.5; 1000];
        values[3] = -1e6;
        values[4] = f64::NAN;
        assert_eq!(robust_range(&values, None), 0.5);
        let mut mask = vec![true; 1000];
        mask[3] = false;
        assert_eq!(robust_range(&values, Some(&mask)), 1e6);
        assert_eq!(robust_range(&[0.0; 9], None), 1.0);
        let mut sparse = vec![0.0; 1000];
        sparse[0] = -2.0;
        assert_eq!(robust_range(&sparse, None), 2.0);
    }

    #[test]
    fn viridis_starts_violet_and_ends_yellow() {
        // Matplotlib's viridis ends at (68, 1, 84) and (253, 231, 37). The polynomial differs from it by a few levels.
        for (value, expected) in [(0.0, [68, 1, 84]), (0.5, [33, 145, 140]), (1.0, [253, 231, 37])] {
            for (level, wanted) in sequential_color(value).into_iter().zip(expected) {
                assert!(level.abs_diff(wanted) <= 6, "{value}: {:?}", sequential_color(value));
            }
        }
    }

    #[test]
    fn masked_and_undefined_pixels_stand_out() {
        let painted =
            paint_signed(Resolution::new(3, 1), &[0.0, f64::NAN, 1.0], Some(&[true, false, false]), 1.0)
                .unwrap_or_else(|error| unreachable!("{error}"));
        assert_eq!([0, 1].map(|x| painted.pixel(x, 0)), [MASKED, NOT_A_NUMBER]);
        assert!(paint_signed(Resolution::new(2, 1), &[0.0], None, 1.0).is_err());
    }

    #[test]
    fn oklab_round_trips() {
        for color in [[0.0, 0.0, 0.0], [1.0, 1.0, 1.0], [0.2, 0.5, 0.9], [1.0, 0.0, 0.0]] {
            for (back, value) in linear_from_oklab(oklab_from_linear(color)).into_iter().zip(color) {
                approx::assert_abs_diff_eq!(back, value, epsilon = 1e-4);
            }
        }
    }
}
