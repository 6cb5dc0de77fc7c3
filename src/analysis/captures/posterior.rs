//! The rows of the light transport matrix given captured photos, and the errors of their products.

use std::collections::BTreeMap;
use std::sync::{Arc, OnceLock};

use faer::{Mat, Side};
use rayon::prelude::*;

use super::basis::{Basis, Covariance};
use super::prior::Column;
use super::{Pairs, Places, Prior};
use crate::analysis::LowRank;
use crate::error::{Error, Result};
use crate::image::Resolution;
use crate::io::model::CapturedArrays;
use crate::krylov::{Start, dot};
use crate::sparse::Csr;

/// The numbers from which a [`Posterior`] is made again, for example from a file.
#[derive(Clone, Debug)]
pub struct PosteriorState {
    /// The captured patterns (`N × n`).
    pub patterns: Vec<Vec<f64>>,
    /// The resolution of patterns.
    pub projector: Resolution,
    /// The scales.
    pub prior: Prior,
    /// The home of each camera pixel (`m`), or nothing.
    pub homes: Places,
    /// The average entry of each row (`m`).
    pub levels: Vec<f64>,
    /// The standard deviation of a photo's value (`m`).
    pub noise: Vec<f64>,
    /// Pairs of photo and camera pixel where the camera was saturated.
    pub missing: Vec<[u32; 2]>,
}

impl PosteriorState {
    fn new(pairs: &Pairs, prior: Prior) -> Self {
        let levels = pairs.levels();
        let strongest =
            pairs.patterns.iter().map(|x| x.iter().map(|v| v.abs()).sum::<f64>()).fold(0.0, f64::max);
        let mean = pairs.patterns.iter().flatten().sum::<f64>() / pairs.patterns.len().max(1) as f64;
        let of = |j: usize, level: f64| {
            let told = pairs.noise.as_ref().map_or(level * mean, |noise| noise[j]);
            (prior.noise * told).hypot(EXACT * level * strongest)
        };
        let noise = levels.iter().enumerate().map(|(j, level)| of(j, *level)).collect();
        let missing = pairs.photos.iter().enumerate().flat_map(|(k, photo)| {
            let gaps = photo.iter().enumerate().filter(|(_, value)| value.is_nan());
            gaps.map(move |(j, _)| [k as u32, j as u32])
        });
        Self {
            patterns: pairs.patterns.clone(),
            projector: pairs.projector,
            prior,
            homes: pairs.homes.clone(),
            levels,
            noise,
            missing: missing.collect(),
        }
    }

    /// The state as arrays for a file, with the sparse matrix of the model's global part.
    pub fn arrays(&self, near: Option<Csr>) -> CapturedArrays {
        let place = |axis: usize| {
            let home = |j: usize| self.homes.get(j).copied().flatten().map_or(f64::NAN, |home| home[axis]);
            (0..self.levels.len()).map(home).collect()
        };
        let scales = match serde_json::to_value(self.prior) {
            Ok(scales) => serde_json::from_value(scales).unwrap_or_default(),
            Err(_) => BTreeMap::new(),
        };
        CapturedArrays {
            patterns: self.patterns.clone(),
            pixels: vec![place(0), place(1), self.levels.clone(), self.noise.clone()],
            missing: self.missing.clone(),
            near,
            scales,
        }
    }

    /// The state from the arrays of a file; `None` if a scale is missing.
    pub fn from_arrays(arrays: CapturedArrays, projector: Resolution, has_homes: bool) -> Option<Self> {
        let prior = serde_json::from_value(serde_json::to_value(arrays.scales).ok()?).ok()?;
        let [x, y, levels, noise] = <[Vec<f64>; 4]>::try_from(arrays.pixels).ok()?;
        let home = |(x, y): (&f64, &f64)| Some([*x, *y]).filter(|[x, y]| x.is_finite() && y.is_finite());
        let homes = if has_homes { x.iter().zip(&y).map(home).collect() } else { Vec::new() };
        let CapturedArrays { patterns, missing, .. } = arrays;
        Some(Self { patterns, projector, prior, homes, levels, noise, missing })
    }
}

/// The light transport matrix given captured photos, as a Gaussian distribution. It tells the standard errors of products with any pattern.
#[derive(Clone, Debug)]
pub struct Posterior {
    state: Arc<PosteriorState>,
    basis: Arc<Basis>,
    /// For each camera pixel, the photos in which it was saturated. Empty if it never was.
    gaps: Arc<Vec<Vec<u32>>>,
    /// The mean square of the standard errors of products with random signs (`m`): the variance of all entries of a row.
    variances: Arc<OnceLock<Vec<f64>>>,
}

/// The number of patterns of random signs that estimate the variance of a row's entries. The relative error of the estimate is then below one
/// half, and that of a sum over many rows far smaller.
const SIGNS: u64 = 8;

/// The variance of a missing sample, relative to the square of the row's largest possible photo. The sample then tells nothing.
const UNKNOWN: f64 = 1e6;

/// The smallest noise, relative to the row's largest possible photo. It keeps the covariance of exact photos positive.
const EXACT: f64 = 1e-7;

impl Posterior {
    /// The posterior of these pairs. Fails with [`Error::Numerical`] if a value is not finite.
    pub fn new(pairs: &Pairs, prior: Prior) -> Result<Self> {
        Self::of(PosteriorState::new(pairs, prior))
    }

    /// The posterior of the same pairs under another prior. The basis is used again unless the reach of global light differs.
    pub(super) fn under(&self, pairs: &Pairs, prior: Prior) -> Result<Self> {
        let state = PosteriorState::new(pairs, prior);
        if prior.reach == self.state.prior.reach {
            return Ok(Self::around(state, Arc::clone(&self.basis)));
        }
        Self::of(state)
    }

    /// The posterior of a stored state. Fails as [`Self::new`].
    pub fn of(state: PosteriorState) -> Result<Self> {
        let basis = Basis::new(&state.patterns, state.projector, &state.prior)?;
        Ok(Self::around(state, Arc::new(basis)))
    }

    fn around(state: PosteriorState, basis: Arc<Basis>) -> Self {
        let mut gaps = Vec::new();
        if !state.missing.is_empty() {
            gaps = vec![Vec::new(); state.levels.len()];
            for [photo, pixel] in &state.missing {
                gaps[*pixel as usize].push(*photo);
            }
        }
        Self { state: Arc::new(state), basis, gaps: Arc::new(gaps), variances: Arc::default() }
    }

    /// The numbers that make this posterior.
    pub fn state(&self) -> &PosteriorState {
        &self.state
    }

    /// The standard deviation of a photo's value (`m`).
    pub fn noise(&self) -> &[f64] {
        &self.state.noise
    }

    /// The prior's columns around the home of a camera pixel: entries, and whether they are direct light.
    fn columns(&self, pixel: usize) -> Vec<Column> {
        let PosteriorState { prior, homes, projector, levels, .. } = &*self.state;
        let home = homes.get(pixel).copied().flatten();
        let mut columns = home.map_or_else(Vec::new, |home| prior.columns(*projector, home));
        let scale = levels[pixel] * projector.pixels() as f64;
        columns.iter_mut().flat_map(|(_, entries)| entries).for_each(|(_, entry)| *entry *= scale);
        columns
    }

    /// The covariance of the photos of a camera pixel with these columns.
    fn covariance(&self, pixel: usize, columns: &[Column]) -> Result<Covariance> {
        let PosteriorState { prior, levels, noise, projector, .. } = &*self.state;
        let seen = |(_, entries): &Column| {
            let mut column = vec![0.0; self.basis.values.len()];
            for &(at, entry) in entries {
                column.iter_mut().zip(&self.basis.pixels[at]).for_each(|(sum, value)| *sum += entry * value);
            }
            column
        };
        let mut columns: Vec<Vec<f64>> = columns.iter().map(seen).collect();
        let level = levels[pixel];
        if let Some(gaps) = self.gaps.get(pixel) {
            let unknown = UNKNOWN.sqrt() * level * projector.pixels() as f64;
            let gap = |&k: &u32| self.basis.photos[k as usize].iter().map(|u| unknown * u).collect();
            columns.extend(gaps.iter().map(gap));
        }
        let square = (level * prior.global).powi(2);
        Covariance::new(self.basis.values.iter().map(|value| square * value + noise[pixel].powi(2)), columns)
    }

    /// The photos of a camera pixel in the basis.
    fn turned(&self, photos: &[Vec<f64>], pixel: usize) -> Vec<f64> {
        let mut turned = vec![0.0; self.basis.values.len()];
        for (row, photo) in self.basis.photos.iter().zip(photos) {
            let value = photo[pixel];
            if !value.is_nan() {
                turned.iter_mut().zip(row).for_each(|(sum, u)| *sum += value * u);
            }
        }
        turned
    }

    /// The prediction of each photo of a camera pixel from the other photos (`N`): the difference from the photo, and its standard error
    /// with the noise of the photo. NaN where the photo is missing.
    pub(super) fn left_out(&self, photos: &[Vec<f64>], pixel: usize) -> Result<Vec<[f64; 2]>> {
        let covariance = self.covariance(pixel, &self.columns(pixel))?;
        let solved = covariance.solve(&self.turned(photos, pixel));
        let of = |(row, photo): (&Vec<f64>, &Vec<f64>)| {
            let entry = covariance.quadratic(row);
            if photo[pixel].is_nan() {
                [f64::NAN; 2]
            } else {
                [dot(row, &solved) / entry, entry.sqrt().recip()]
            }
        };
        Ok(self.basis.photos.iter().zip(photos).map(of).collect())
    }

    /// The rows of `A` as a model of low rank with direct light apart. Fails with [`Error::Numerical`] if a value is not finite.
    pub fn model(&self, pairs: &Pairs) -> Result<LowRank> {
        let PosteriorState { prior, levels, projector, .. } = &*self.state;
        let row = |pixel: usize| -> Result<Row> {
            let columns = self.columns(pixel);
            let covariance = self.covariance(pixel, &columns)?;
            let solved = covariance.solve(&self.turned(&pairs.photos, pixel));
            let (mut direct, mut near) = (BTreeMap::new(), BTreeMap::new());
            for ((is_direct, entries), column) in columns.into_iter().zip(&covariance.columns) {
                let share = dot(column, &solved);
                let part = if is_direct { &mut direct } else { &mut near };
                entries
                    .into_iter()
                    .for_each(|(at, entry)| *part.entry(at as u32).or_insert(0.0) += share * entry);
            }
            let square = (levels[pixel] * prior.global).powi(2);
            Ok(Row { smooth: solved.into_iter().map(|value| square * value).collect(), direct, near })
        };
        let rows: Vec<Row> = (0..levels.len()).into_par_iter().map(row).collect::<Result<_>>()?;
        let [basis, photos] = self.orthonormal(&rows)?;
        let model = LowRank::new(basis, photos, Vec::new(), false)?.with_posterior(self.clone());
        if self.state.homes.is_empty() {
            return Ok(model);
        }
        let [direct, near] = [|row: &Row| row.direct.clone(), |row: &Row| row.near.clone()]
            .map(|part| Csr::of_rows(projector.pixels(), rows.iter().map(part)));
        model.with_direct_matrix(direct?)?.with_near_matrix(near?)
    }

    /// The global part as orthonormal patterns and their photos.
    fn orthonormal(&self, rows: &[Row]) -> Result<[Vec<Vec<f64>>; 2]> {
        let smooth = &self.basis.smooth;
        let products: Vec<Vec<f64>> =
            smooth.par_iter().map(|a| smooth.iter().map(|b| dot(a, b)).collect()).collect();
        let eigen = Mat::from_fn(smooth.len(), smooth.len(), |i, j| 0.5 * (products[i][j] + products[j][i]))
            .self_adjoint_eigen(Side::Lower)
            .map_err(|_| Error::Numerical("the captured patterns are not finite".into()))?;
        let values: Vec<f64> = eigen.S().column_vector().iter().copied().collect();
        let most = values.iter().copied().fold(0.0, f64::max);
        let vectors = eigen.U();
        let kept: Vec<usize> = (0..values.len()).rev().filter(|&i| values[i] > RANK * most).collect();
        let combined = |of: &dyn Fn(usize, usize) -> f64, at: usize, i: usize| -> f64 {
            (0..smooth.len()).map(|k| vectors[(k, i)] * of(k, at)).sum()
        };
        let pattern = |&i: &usize| -> Vec<f64> {
            let length = values[i].sqrt();
            (0..smooth[0].len()).map(|at| combined(&|k, at| smooth[k][at], at, i) / length).collect()
        };
        let photo = |&i: &usize| -> Vec<f64> {
            let length = values[i].sqrt();
            (0..rows.len()).map(|at| combined(&|k, at| rows[at].smooth[k], at, i) * length).collect()
        };
        Ok([kept.par_iter().map(pattern).collect(), kept.par_iter().map(photo).collect()])
    }

    /// The standard error of the norm of a product with the transpose, for a pattern of camera pixels (`m`). The errors of
    /// neighbouring rows are correlated, so the errors of all rows are added as if they were fully correlated. The true error may be smaller.
    pub fn dual_error(&self, pattern: &[f64]) -> f64 {
        let variances = self.variances.get_or_init(|| {
            let mut sums = vec![0.0; self.state.levels.len()];
            for seed in 0..SIGNS {
                let signs = Start::Rademacher { seed }.vector(self.state.projector.pixels());
                let errors = self.errors(&signs);
                sums.iter_mut().zip(errors).for_each(|(sum, error)| *sum += error * error / SIGNS as f64);
            }
            sums
        });
        variances.iter().zip(pattern).map(|(variance, y)| variance.sqrt() * y.abs()).sum()
    }

    /// The standard errors of a product with a pattern (`m`), without the noise of a new photo.
    pub fn errors(&self, pattern: &[f64]) -> Vec<f64> {
        let PosteriorState { prior, levels, projector, .. } = &*self.state;
        let smooth = prior.smooth(*projector, pattern);
        let before = dot(pattern, &smooth);
        let mut seen: Vec<f64> = self.basis.smooth.iter().map(|row| dot(row, pattern)).collect();
        seen.iter_mut().for_each(|value| *value *= prior.global.powi(2));
        let error = |pixel: usize| -> f64 {
            let square = levels[pixel].powi(2);
            let share = |(_, entries): &Column| -> f64 {
                entries.iter().map(|&(at, entry)| entry * pattern[at]).sum()
            };
            let columns = self.columns(pixel);
            let shares: Vec<f64> = columns.iter().map(share).collect();
            let Ok(covariance) = self.covariance(pixel, &columns) else { return f64::INFINITY };
            let mut known: Vec<f64> = seen.iter().map(|value| square * value).collect();
            for (share, column) in shares.iter().zip(&covariance.columns) {
                known.iter_mut().zip(column).for_each(|(known, value)| *known += share * value);
            }
            let around: f64 = shares.iter().map(|share| share * share).sum();
            let all = square * prior.global.powi(2) * before + around;
            prior.scale * (all - covariance.quadratic(&known)).max(0.0).sqrt()
        };
        (0..levels.len()).into_par_iter().map(error).collect()
    }
}

/// Patterns whose share of the model is below this, relative to the strongest, are rounding errors.
const RANK: f64 = 1e-12;

/// The row of a camera pixel: its light in the basis of smooth patterns, and its entries around the home.
struct Row {
    smooth: Vec<f64>,
    direct: BTreeMap<u32, f64>,
    near: BTreeMap<u32, f64>,
}
