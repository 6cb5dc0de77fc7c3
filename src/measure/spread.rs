//! The spread of light by the camera's pixels.
//!
//! A camera pixel sees the mean over its footprint, and each value of a photo is a sum over camera pixels. So a photo's value contains
//! light of neighbouring projector pixels: it is `S y` for the light `y` of the projector's pixels. The pixel map's weights make `S` nearly
//! the identity where the camera is finer than the projector. Where it is not, the rest matters for direct light, which is as sharp
//! as the pattern.

use rayon::prelude::*;

use super::calibration::Registration;
use super::footprint::shares;
use super::lens_map::LensMap;
use super::rows::{Entry, Rows, merged};

/// Entries of `S` below this are left out.
const SMALLEST: f64 = 1e-4;

/// The matrix `S`, `n × n` for `n` projector pixels, and its transpose.
#[derive(Clone, Debug)]
pub(super) struct Spread {
    rows: Rows,
    columns: Rows,
}

impl Spread {
    /// The spread of a pixel map that was made with `lens`.
    pub(super) fn new(registration: &Registration, lens: &LensMap) -> Self {
        let shares = shares(lens, &vec![true; registration.camera.pixels()]);
        let row = |pixel: usize| -> Vec<Entry> {
            let of_camera = registration.row(pixel).flat_map(|(camera, weight)| {
                shares.of(camera as u32).iter().map(move |&(at, share)| (at, weight * share))
            });
            let mut row = merged(of_camera.collect());
            row.retain(|entry| entry.1.abs() > SMALLEST);
            row
        };
        let n = registration.projector.pixels();
        let rows: Vec<Vec<Entry>> = (0..n).into_par_iter().map(row).collect();
        Self { rows: Rows::new(&rows), columns: Rows::transposed(&rows, n) }
    }

    /// `S y`, for `n` values.
    pub(super) fn apply(&self, y: &[f64]) -> Vec<f64> {
        self.rows.apply(y, |weight| weight)
    }

    /// Row `i` of `S`: pixels and their weights.
    pub(super) fn row(&self, pixel: usize) -> &[Entry] {
        self.rows.row(pixel)
    }

    /// `Sᵀ z`, for `n` values.
    pub(super) fn apply_transposed(&self, z: &[f64]) -> Vec<f64> {
        self.columns.apply(z, |weight| weight)
    }

    /// The variances of the entries of `S y`, if the entries of `y` are independent and have these variances.
    pub(super) fn variance(&self, variance: &[f64]) -> Vec<f64> {
        self.rows.apply(variance, |weight| weight * weight)
    }

    /// `Σ_i S_ik²` for each pixel `k`.
    pub(super) fn squares(&self) -> Vec<f64> {
        self.columns.squares()
    }
}
