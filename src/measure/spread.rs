//! The spread of light by the camera's pixels.
//!
//! A camera pixel sees the mean over its footprint, and each value of a photo is a sum over camera pixels. A photo's values therefore
//! contain light of neighbouring projector pixels: the photo is `S y` for the light `y` of the projector's pixels. The pixel map's weights
//! make `S` nearly the identity where the camera is finer than the projector. For a coarser camera, the other entries of `S` matter for
//! direct light, which is as sharp as the pattern.

use rayon::prelude::*;

use super::calibration::Registration;
use super::footprint::shares;
use super::lens_map::LensMap;
use crate::sparse::{SparseRows, WeightedColumn};

/// Entries of `S` below this value are left out.
const LEAST_SHARE: f64 = 1e-4;

/// The matrix `S`, `n × n` for `n` projector pixels, and its transpose.
#[derive(Clone, Debug)]
pub(crate) struct PixelSpread {
    rows: SparseRows,
    columns: SparseRows,
}

impl PixelSpread {
    /// The spread of a pixel map that was made with `lens`.
    pub(crate) fn new(registration: &Registration, lens: &LensMap) -> Self {
        let shares = shares(lens, &vec![true; registration.camera.pixels()]);
        let row = |pixel: usize| -> Vec<WeightedColumn> {
            let of_camera = registration.row(pixel).flat_map(|(camera, weight)| {
                shares.row(camera).iter().map(move |&(at, share)| (at, weight * share))
            });
            let mut row = merged(of_camera.collect());
            row.retain(|entry| entry.1.abs() > LEAST_SHARE);
            row
        };
        let n = registration.projector.pixels();
        let rows: Vec<Vec<WeightedColumn>> = (0..n).into_par_iter().map(row).collect();
        Self { rows: SparseRows::new(&rows), columns: SparseRows::transposed(&rows, n) }
    }

    /// The product `S y`, for `n` values.
    pub(crate) fn apply(&self, y: &[f64]) -> Vec<f64> {
        self.rows.apply(y, |weight| weight)
    }

    /// Row `i` of `S`, as pixels and their weights.
    pub(crate) fn row(&self, pixel: usize) -> &[WeightedColumn] {
        self.rows.row(pixel)
    }

    /// The product `Sᵀ z`, for `n` values.
    pub(crate) fn apply_transposed(&self, z: &[f64]) -> Vec<f64> {
        self.columns.apply(z, |weight| weight)
    }

    /// The variances of the entries of `S y`, if the entries of `y` are independent and have these variances.
    pub(crate) fn variance(&self, variance: &[f64]) -> Vec<f64> {
        self.rows.apply(variance, |weight| weight * weight)
    }

    /// The sum `Σ_i S_ik²` for each pixel `k`.
    pub(crate) fn squares(&self) -> Vec<f64> {
        self.columns.squares()
    }
}

/// The entries in ascending order of their columns. Entries of one column are added up.
pub(crate) fn merged(mut entries: Vec<WeightedColumn>) -> Vec<WeightedColumn> {
    entries.sort_by_key(|entry| entry.0);
    let runs = entries.chunk_by(|a, b| a.0 == b.0);
    runs.map(|run| (run[0].0, run.iter().map(|entry| entry.1).sum())).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Resolution;

    /// The spread of a camera whose inner pixels each cover a quarter of four projector pixels.
    fn across() -> PixelSpread {
        let size = Resolution::new(6, 5);
        let lens = LensMap {
            camera: size,
            projector: size,
            // The shift is half a pixel, in units of half a diagonal.
            homography: [1.0, 0.0, 1.0 / 61.0_f64.sqrt(), 0.0, 1.0, 1.0 / 61.0_f64.sqrt(), 0.0, 0.0],
            distortion: [0.0; 2],
        };
        PixelSpread::new(&Registration::by_area(size, size), &lens)
    }

    #[test]
    fn a_camera_between_the_pixels_sees_a_quarter_of_four() {
        let spread = across();
        let inner: Vec<(u32, f64)> = [7, 8, 13, 14].map(|at| (at, 0.25)).to_vec();
        for (found, expected) in spread.row(7).iter().zip(&inner) {
            assert!(found.0 == expected.0 && (found.1 - expected.1).abs() < 1e-9, "{:?}", spread.row(7));
        }
        assert_eq!(spread.row(7).len(), 4);
    }

    #[test]
    fn products_variances_and_squares_are_those_of_the_rows() {
        let spread = across();
        let y: Vec<f64> = (0..30).map(|pixel| f64::from(pixel * 7 % 11)).collect();
        let z: Vec<f64> = (0..30).map(|pixel| f64::from(pixel * 5 % 13)).collect();
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let (forward, back) = (dot(&spread.apply(&y), &z), dot(&y, &spread.apply_transposed(&z)));
        assert!((forward - back).abs() < 1e-9 * forward.abs(), "{forward} {back}");
        let of_row = |pixel: usize| {
            spread.row(pixel).iter().map(|&(at, weight)| weight * weight * y[at as usize]).sum::<f64>()
        };
        for (pixel, variance) in spread.variance(&y).into_iter().enumerate() {
            assert!((variance - of_row(pixel)).abs() < 1e-12, "{pixel}");
        }
        for (column, square) in spread.squares().into_iter().enumerate() {
            let all = (0..30).flat_map(|pixel| spread.row(pixel)).filter(|entry| entry.0 as usize == column);
            assert!((square - all.map(|entry| entry.1 * entry.1).sum::<f64>()).abs() < 1e-12, "{column}");
        }
    }

    #[test]
    fn a_matrix_and_its_transpose_have_the_same_entries() {
        let rows = [vec![(1, 2.0), (2, 3.0)], vec![], vec![(1, 5.0)]];
        let (matrix, transpose) = (SparseRows::new(&rows), SparseRows::transposed(&rows, 3));
        assert_eq!(matrix.apply(&[1.0, 10.0, 100.0], |weight| weight), [320.0, 0.0, 50.0]);
        assert_eq!(
            [transpose.row(0), transpose.row(1), transpose.row(2)],
            [&[][..], &[(0, 2.0), (2, 5.0)], &[(0, 3.0)]]
        );
        assert_eq!(transpose.squares(), [0.0, 29.0, 9.0]);
        assert_eq!(merged(vec![(4, 1.0), (2, 3.0), (4, 0.5)]), [(2, 3.0), (4, 1.5)]);
    }
}
