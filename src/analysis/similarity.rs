//! The similarity of two images: RMSE, PSNR and SSIM.
//!
//! ```text
//! RMSE = √(mean (a − b)²),   relative RMSE = ‖a − b‖ / ‖b‖,   PSNR = 20 log₁₀(L / RMSE) dB
//! SSIM = mean over windows of (2 μa μb + C₁)(2 σab + C₂) / ((μa² + μb² + C₁)(σa² + σb² + C₂)),  C₁ = (0.01 L)², C₂ = (0.03 L)²
//! ```
//!
//! `L` is the data range. The windows are Gaussian, 11×11 pixels with σ 1.5, and lie entirely inside the image. For colour images, the
//! result is the mean over channels. Reference: Wang, Bovik, Sheikh and Simoncelli, *Image quality assessment: from error visibility to
//! structural similarity* (2004), doi:10.1109/TIP.2003.819861. SSIM is implemented here for floating-point radiance, because
//! `image-compare` takes 8-bit images, in windows of 8×8 pixels.

use crate::error::{Error, Result};
use crate::image::{Image, Resolution};

/// The side of SSIM's window in pixels, and the standard deviation of its Gaussian.
const WINDOW: usize = 11;
const SIGMA: f64 = 1.5;

/// The measures of similarity of two images.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Similarity {
    /// The root mean square difference over all pixels and channels.
    pub rmse: f64,
    /// The RMSE divided by the root mean square of the reference; infinite if only the reference is black.
    pub relative_rmse: f64,
    /// The largest absolute difference.
    pub largest: f64,
    /// Peak signal-to-noise ratio in dB; infinite for equal images.
    pub psnr: f64,
    /// Structural similarity, from −1 to 1; `None` if the images are smaller than the window of 11×11 pixels.
    pub ssim: Option<f64>,
    /// The data range `L` of PSNR and SSIM.
    pub range: f64,
}

/// Compares `image` with `reference`; `range` is the data range `L`, for example [`data_range`].
///
/// # Errors
/// [`Error::Dimension`] if sizes or channels differ; [`Error::Option`] naming `--range` if the range is not positive.
pub fn similarity(image: &Image, reference: &Image, range: f64) -> Result<Similarity> {
    let shape = |image: &Image| format!("{}x{}", image.resolution(), image.channels());
    Error::check_size("pixels and channels of the two images", shape(reference), shape(image))?;
    if !(range > 0.0 && range.is_finite()) {
        return Err(Error::option("--range", format!("{range} is no data range"))
            .help("give a positive number: what the values could span, 1 for pictures in [0, 1]"));
    }
    let differences = || {
        let pairs = image.samples().iter().zip(reference.samples());
        pairs.map(|(a, b)| f64::from(*a) - f64::from(*b))
    };
    let count = image.samples().len() as f64;
    let rmse = (differences().map(|difference| difference * difference).sum::<f64>() / count).sqrt();
    let squares: f64 = reference.samples().iter().map(|&value| f64::from(value).powi(2)).sum();
    Ok(Similarity {
        rmse,
        relative_rmse: if rmse == 0.0 { 0.0 } else { rmse / (squares / count).sqrt() },
        largest: differences().fold(0.0, |largest, difference| largest.max(difference.abs())),
        psnr: psnr(rmse, range),
        ssim: ssim(image, reference, range),
        range,
    })
}

/// The largest minus the smallest value of the reference, or 1 if all values are equal. Use it as `L` if no better value is known.
pub fn data_range(reference: &Image) -> f64 {
    let extend = |(low, high): (f32, f32), &value: &f32| (low.min(value), high.max(value));
    let (low, high) = reference.samples().iter().fold((f32::INFINITY, f32::NEG_INFINITY), extend);
    if high > low { f64::from(high) - f64::from(low) } else { 1.0 }
}

/// `20 log₁₀(L / RMSE)` in dB; infinite for an RMSE of 0.
pub fn psnr(rmse: f64, range: f64) -> f64 {
    20.0 * (range / rmse).log10()
}

/// Structural similarity of two images with equal shapes; `None` if the images are smaller than the window.
fn ssim(a: &Image, b: &Image, range: f64) -> Option<f64> {
    let Resolution { width, height } = a.resolution();
    if width < WINDOW || height < WINDOW {
        return None;
    }
    let [c1, c2] = [0.01, 0.03].map(|k: f64| (k * range).powi(2));
    let mut sum = 0.0;
    for channel in 0..a.channels() {
        let [a, b] = [a, b].map(|image| image.plane(channel));
        let product = |x: &[f64], y: &[f64]| -> Vec<f64> { x.iter().zip(y).map(|(x, y)| x * y).collect() };
        let blurred = |plane: Vec<f64>| windowed(&plane, width, height);
        let [aa, bb, ab] = [product(&a, &a), product(&b, &b), product(&a, &b)].map(blurred);
        let [ma, mb] = [a, b].map(blurred);
        let local = |i: usize| {
            let (va, vb, cov) = (aa[i] - ma[i] * ma[i], bb[i] - mb[i] * mb[i], ab[i] - ma[i] * mb[i]);
            (2.0 * ma[i] * mb[i] + c1) * (2.0 * cov + c2)
                / ((ma[i] * ma[i] + mb[i] * mb[i] + c1) * (va + vb + c2))
        };
        sum += (0..ma.len()).map(local).sum::<f64>() / ma.len() as f64;
    }
    Some(sum / a.channels() as f64)
}

/// The Gaussian mean of each window that lies entirely inside the image, row by row.
fn windowed(plane: &[f64], width: usize, height: usize) -> Vec<f64> {
    let middle = (WINDOW / 2) as f64;
    let weights: [f64; WINDOW] =
        std::array::from_fn(|i| (-0.5 * ((i as f64 - middle) / SIGMA).powi(2)).exp());
    let total: f64 = weights.iter().sum();
    let across = width + 1 - WINDOW;
    let along = |at: &dyn Fn(usize) -> f64| -> f64 {
        weights.iter().enumerate().map(|(k, weight)| weight * at(k)).sum::<f64>() / total
    };
    let rows: Vec<f64> = (0..height)
        .flat_map(|y| (0..across).map(move |x| y * width + x))
        .map(|first| along(&|k| plane[first + k]))
        .collect();
    (0..height + 1 - WINDOW)
        .flat_map(|y| (0..across).map(move |x| (x, y)))
        .map(|(x, y)| along(&|k| rows[(y + k) * across + x]))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn waves(scale: f32, shift: f32) -> Result<Image> {
        let value = |i: usize| {
            let (x, y) = ((i % 24) as f32, (i / 24) as f32);
            scale * (0.5 + 0.25 * (0.7 * x).sin() + 0.25 * (0.4 * y + 0.1 * x).cos()) + shift
        };
        Image::new(Resolution::new(24, 18), 1, (0..24 * 18).map(value).collect())
    }

    #[test]
    fn equal_images_are_wholly_alike() -> Result<()> {
        let found = similarity(&waves(1.0, 0.0)?, &waves(1.0, 0.0)?, 1.0)?;
        assert_eq!((found.rmse, found.relative_rmse, found.largest), (0.0, 0.0, 0.0));
        assert_eq!(found.psnr, f64::INFINITY);
        assert!(found.ssim.is_some_and(|ssim| (ssim - 1.0).abs() < 1e-12));
        Ok(())
    }

    #[test]
    fn even_images_differ_by_their_means_alone() -> Result<()> {
        let even = |value| Image::filled(Resolution::new(16, 12), 3, value);
        let found = similarity(&even(0.5), &even(0.25), 1.0)?;
        // With powers of two, only the last formula rounds.
        assert_eq!((found.rmse, found.relative_rmse, found.largest), (0.25, 1.0, 0.25));
        assert!((found.psnr - 20.0 * 4.0_f64.log10()).abs() < 1e-12);
        let expected = (2.0 * 0.5 * 0.25 + 1e-4) / (0.25 + 0.0625 + 1e-4);
        assert!(found.ssim.is_some_and(|ssim| (ssim - expected).abs() < 1e-12));
        Ok(())
    }

    #[test]
    fn structure_counts_as_another_implementation_has_it() -> Result<()> {
        // Both numbers are from SciPy's gaussian_filter with truncate=3.5, with five pixels cropped at each edge. The images here are f32.
        for (scale, shift, range, expected) in
            [(-1.0, 1.0, 1.0, -0.767_293_008_4), (0.5, 0.2, 2.0, 0.798_512_500_4)]
        {
            let ssim = similarity(&waves(scale, shift)?, &waves(1.0, 0.0)?, range)?.ssim;
            assert!(ssim.is_some_and(|ssim| (ssim - expected).abs() < 1e-5), "{ssim:?} for {expected}");
        }
        Ok(())
    }

    #[test]
    fn what_cannot_be_compared_is_refused() -> Result<()> {
        let image = waves(1.0, 0.0)?;
        assert!(similarity(&image, &Image::filled(Resolution::new(18, 24), 1, 0.0), 1.0).is_err());
        assert!(similarity(&image, &Image::filled(Resolution::new(24, 18), 3, 0.0), 1.0).is_err());
        assert!(similarity(&image, &image, 0.0).is_err());
        let small = Image::filled(Resolution::new(10, 30), 1, 0.5);
        assert_eq!(similarity(&small, &small, 1.0)?.ssim, None);
        assert_eq!(
            (data_range(&small), data_range(&Image::filled(Resolution::new(1, 1), 1, 7.0))),
            (1.0, 1.0)
        );
        Ok(())
    }
}
