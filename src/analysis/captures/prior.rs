//! The prior of a row of the light transport matrix: smooth global light, direct light from near its home, and noise.

use serde::{Deserialize, Serialize};

use crate::image::Resolution;

/// The scales of the prior. Entries of a row are in units of the row's average entry `s`, and `n` is the number of projector pixels.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Prior {
    /// The correlation length of global light, in projector pixels.
    pub reach: f64,
    /// The standard deviation of an entry of global light, in units of `s`.
    pub global: f64,
    /// The standard deviation of all direct light of a row, in units of `s n`.
    pub direct: f64,
    /// The standard deviation of a pixel's share of the direct light, relative to its share in the window.
    pub spread: f64,
    /// The standard deviation in projector pixels of the window of direct light.
    pub width: f64,
    /// The standard deviation of indirect light from around the home, as of each of 25 bumps, in units of `s n`.
    pub near: f64,
    /// The distance between bumps in projector pixels.
    pub spacing: f64,
    /// The standard deviation of the noise: in units of the noise that repeated photos tell, or else of the row's average photo.
    pub noise: f64,
    /// The factor of all standard errors that photos which were left out have asked for, at least 1.
    pub scale: f64,
}

/// A column of the prior: whether it is direct light, and its entries at projector pixels.
pub(super) type Column = (bool, Vec<(usize, f64)>);

/// The variance of the constant part of global light, relative to that of the part that varies.
const CONSTANT: f64 = 0.25;

/// The bumps of indirect light on each side of the home, along each axis.
const BUMPS: i32 = 2;

/// The standard deviation of a bump, relative to the distance between bumps.
const OVERLAP: f64 = 0.6;

impl Prior {
    /// The start of the search. `noise_is_known` tells whether repeated photos told the noise.
    pub(super) fn start(projector: Resolution, noise_is_known: bool) -> Self {
        let noise = if noise_is_known { 1.0 } else { 0.02 };
        let reach = 0.15 * projector.width.max(projector.height) as f64;
        Self {
            reach,
            global: 0.5,
            direct: 0.3,
            spread: 0.3,
            width: 0.6,
            near: 0.02,
            spacing: 2.0,
            noise,
            scale: 1.0,
        }
    }

    /// The product of the kernel of global light with a pattern, `K x` (`n`), for `global = 1`. The kernel is a Gaussian of the distance in
    /// pixels, and a constant.
    pub(super) fn smooth(&self, projector: Resolution, x: &[f64]) -> Vec<f64> {
        let Resolution { width, height } = projector;
        let gaussian = |d: usize| (-0.5 * (d as f64 / self.reach).powi(2)).exp();
        let weights: Vec<f64> = (0..width.max(height)).map(gaussian).collect();
        // Beyond this distance, the kernel is below the rounding of single precision.
        let far = weights.iter().position(|weight| *weight < 1e-9).unwrap_or(weights.len());
        let along = |line: &[f64]| -> Vec<f64> {
            let near = |i: usize| i.saturating_sub(far)..(i + far).min(line.len());
            (0..line.len())
                .map(|i| near(i).map(|k| weights.get(i.abs_diff(k)).copied().unwrap_or(0.0) * line[k]).sum())
                .collect()
        };
        let rows: Vec<f64> = x.chunks(width.max(1)).flat_map(along).collect();
        let mut smooth = vec![CONSTANT * x.iter().sum::<f64>(); x.len()];
        for column in 0..width {
            let line: Vec<f64> = (0..height).map(|row| rows[row * width + column]).collect();
            along(&line)
                .into_iter()
                .enumerate()
                .for_each(|(row, value)| smooth[row * width + column] += value);
        }
        smooth
    }

    /// The columns of the prior around a home, in units of `s n`: The first
    /// is the whole window of direct light; the next let each of its pixels vary; the last are bumps of indirect light, which is strong near
    /// the home where surfaces meet.
    pub(super) fn columns(&self, projector: Resolution, home: [f64; 2]) -> Vec<Column> {
        let window = bump(projector, home, self.width, 0.01);
        let whole = window.iter().map(|&(pixel, share)| (pixel, self.direct * share)).collect();
        let each = window
            .iter()
            .map(|&(pixel, share)| (true, vec![(pixel, self.direct * self.spread * share.sqrt())]));
        let steps = || (-BUMPS..=BUMPS).map(f64::from);
        let bumps = steps().flat_map(|v| steps().map(move |u| [u, v])).map(|[u, v]| {
            let centre = [home[0] + u * self.spacing, home[1] + v * self.spacing];
            let fall = self.near * (-0.5 * (u * u + v * v) / f64::from(BUMPS * BUMPS)).exp();
            let entries = bump(projector, centre, OVERLAP * self.spacing, 0.02);
            (false, entries.into_iter().map(|(pixel, share)| (pixel, fall * share)).collect())
        });
        std::iter::once((true, whole))
            .chain(each)
            .chain(bumps)
            .filter(|(_, entries)| !entries.is_empty())
            .collect()
    }

    /// The scales with four digits, which files keep exactly.
    pub(super) fn rounded(mut self) -> Self {
        let round = |value: f64| format!("{value:.3e}").parse().unwrap_or(value);
        let scale = round(self.scale);
        self.scales(true, false).into_iter().for_each(|(value, _)| *value = round(*value));
        Self { scale, ..self }
    }

    /// The scales that the search varies, each with its limits. `noise_is_known` fixes the noise.
    pub(super) fn scales(&mut self, has_homes: bool, noise_is_known: bool) -> Vec<(&mut f64, [f64; 2])> {
        let mut scales = vec![(&mut self.reach, [0.3, 500.0]), (&mut self.global, [1e-3, 30.0])];
        if has_homes {
            scales.push((&mut self.direct, [1e-4, 10.0]));
            scales.push((&mut self.spread, [0.02, 2.0]));
            scales.push((&mut self.width, [0.3, 2.5]));
            scales.push((&mut self.near, [1e-4, 1.0]));
            scales.push((&mut self.spacing, [1.0, 8.0]));
        }
        if !noise_is_known {
            scales.push((&mut self.noise, [1e-5, 1.0]));
        }
        scales
    }
}

/// A Gaussian of this width around a place: projector pixels, and their shares, which sum to 1. Pixels with less than `least` of the largest
/// share are left out. Empty for a place outside the projector.
fn bump(projector: Resolution, [x, y]: [f64; 2], width: f64, least: f64) -> Vec<(usize, f64)> {
    let reach = 3.0 * width.max(0.4);
    let range = |at: f64, length: usize| {
        let [low, high] = [(at - reach).ceil().max(0.0), (at + reach).floor().min(length as f64 - 1.0)];
        low as usize..if high < low { low as usize } else { high as usize + 1 }
    };
    let share = |u: usize, v: usize| {
        let square = (u as f64 - x).powi(2) + (v as f64 - y).powi(2);
        (-0.5 * square / width.powi(2)).exp()
    };
    let rows = range(y, projector.height);
    let pixels = rows.flat_map(|v| range(x, projector.width).map(move |u| (u, v)));
    let around: Vec<(usize, f64)> = pixels.map(|(u, v)| (v * projector.width + u, share(u, v))).collect();
    let most = around.iter().map(|(_, share)| *share).fold(0.0, f64::max);
    let kept: Vec<(usize, f64)> = around.into_iter().filter(|(_, share)| *share > least * most).collect();
    let sum: f64 = kept.iter().map(|(_, share)| share).sum();
    kept.into_iter().map(|(pixel, share)| (pixel, share / sum)).collect()
}
