//! The spread of light by the camera's pixels.
//!
//! A camera pixel sees the mean over its footprint, and each value of a photo is a sum over camera pixels. So a photo's value contains
//! light of neighbouring projector pixels: it is `S y` for the light `y` of the projector's pixels. The pixel map's weights make `S` nearly
//! the identity where the camera is finer than the projector. Where it is not, the rest matters for direct light, which is as sharp
//! as the pattern.

use rayon::prelude::*;

use super::calibrate::LensMap;
use super::calibration::Registration;
use super::footprint::shares;

/// Entries of `S` below this are left out.
const SMALLEST: f64 = 1e-4;

/// The matrix `S`, `n × n` for `n` projector pixels, in compressed sparse rows, and its transpose.
#[derive(Clone, Debug)]
pub(super) struct Spread {
    rows: Rows,
    columns: Rows,
}

#[derive(Clone, Debug)]
struct Rows {
    starts: Vec<usize>,
    entries: Vec<(u32, f64)>,
}

impl Rows {
    fn new(rows: &[Vec<(u32, f64)>]) -> Self {
        let mut starts = vec![0];
        for row in rows {
            starts.push(starts[starts.len() - 1] + row.len());
        }
        Self { starts, entries: rows.concat() }
    }

    fn row(&self, pixel: usize) -> &[(u32, f64)] {
        &self.entries[self.starts[pixel]..self.starts[pixel + 1]]
    }

    fn apply(&self, x: &[f64], weight: impl Fn(f64) -> f64 + Sync) -> Vec<f64> {
        let sum = |pixel: usize| self.row(pixel).iter().map(|&(at, w)| weight(w) * x[at as usize]).sum();
        (0..self.starts.len() - 1).into_par_iter().map(sum).collect()
    }
}

impl Spread {
    /// The spread of a pixel map that was made with `lens`.
    pub(super) fn new(registration: &Registration, lens: &LensMap) -> Self {
        let shares = shares(lens, &vec![true; registration.camera.pixels()]);
        let row = |pixel: usize| {
            let mut row: Vec<(u32, f64)> = Vec::new();
            for (camera, weight) in registration.row(pixel) {
                row.extend(shares.of(camera as u32).iter().map(|&(at, share)| (at, weight * share)));
            }
            row.sort_by_key(|entry| entry.0);
            let runs = row.chunk_by(|a, b| a.0 == b.0);
            let sums = runs.map(|run| (run[0].0, run.iter().map(|entry| entry.1).sum::<f64>()));
            sums.filter(|entry| entry.1.abs() > SMALLEST).collect::<Vec<(u32, f64)>>()
        };
        let rows: Vec<Vec<(u32, f64)>> =
            (0..registration.projector.pixels()).into_par_iter().map(row).collect();
        let mut columns = vec![Vec::new(); rows.len()];
        for (pixel, row) in rows.iter().enumerate() {
            row.iter().for_each(|&(at, weight)| columns[at as usize].push((pixel as u32, weight)));
        }
        Self { rows: Rows::new(&rows), columns: Rows::new(&columns) }
    }

    /// `S y`, for `n` values.
    pub(super) fn apply(&self, y: &[f64]) -> Vec<f64> {
        self.rows.apply(y, |weight| weight)
    }

    /// Row `i` of `S`: pixels and their weights.
    pub(super) fn row(&self, pixel: usize) -> &[(u32, f64)] {
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
        self.columns.apply(&vec![1.0; self.columns.starts.len() - 1], |weight| weight * weight)
    }
}
