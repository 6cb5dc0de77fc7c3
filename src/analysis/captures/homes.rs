//! The map from camera to projector, found among captured patterns of any kind.

use rayon::prelude::*;

use super::{Pairs, Places};
use crate::image::Resolution;

/// A map found from captures.
#[derive(Clone, Debug)]
pub struct FoundHomes {
    /// The home of each camera pixel (`m`). `None` where the captures do not tell it.
    pub homes: Places,
    /// The number of camera pixels that see light of the projector.
    pub lit: usize,
}

/// A home is taken if the chance of another place is below this.
const DOUBT: f64 = 0.01;

/// A pixel counts as lit if its photos vary by more than this share of the most that any pixel varies.
const DARK: f64 = 0.02;

/// Finds the home of each camera pixel: the projector pixel whose values, over all patterns, explain the pixel's values best. Gray codes
/// give each projector pixel its own values, and so do random patterns if there are enough of them.
///
/// For each projector pixel, the light of the camera pixel is fitted by its values and a constant. With Gaussian errors of unknown size,
/// the likelihood falls with the power `(N − 2)/2` of the sum of squares that remains.
pub fn find_homes(pairs: &Pairs) -> FoundHomes {
    let (count, n, m) = (pairs.patterns.len(), pairs.projector.pixels(), pairs.pixels());
    if count < 4 {
        return FoundHomes { homes: vec![None; m], lit: 0 };
    }
    let patterns: Vec<Option<Vec<f64>>> =
        (0..n).into_par_iter().map(|i| unit(pairs.patterns.iter().map(|x| x[i]))).collect();
    let spread = |j: usize| {
        let values: Vec<f64> = pairs.photos.iter().map(|photo| photo[j]).filter(|v| !v.is_nan()).collect();
        let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
        values.iter().map(|value| (value - mean).powi(2)).sum::<f64>()
    };
    let spreads: Vec<f64> = (0..m).into_par_iter().map(spread).collect();
    let most = spreads.iter().copied().fold(0.0, f64::max);
    let is_lit = |j: usize| spreads[j] > (DARK * DARK) * most;
    let home = |j: usize| {
        let values = pairs.photos.iter().map(|photo| photo[j]);
        // A saturated sample was brighter than all others.
        let brightest = values.clone().filter(|value| !value.is_nan()).fold(0.0, f64::max);
        let photo = unit(values.map(|value| if value.is_nan() { brightest } else { value }))?;
        is_lit(j).then(|| best(&patterns, &photo, pairs.projector, count)).flatten()
    };
    let homes = (0..m).into_par_iter().map(home).collect();
    FoundHomes { homes, lit: (0..m).filter(|&j| is_lit(j)).count() }
}

/// The values less their mean, divided by their norm; `None` if they are all equal.
fn unit(values: impl Iterator<Item = f64>) -> Option<Vec<f64>> {
    let values: Vec<f64> = values.collect();
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let norm = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>().sqrt();
    (norm > 1e-12 * mean.abs().max(f64::MIN_POSITIVE))
        .then(|| values.into_iter().map(|value| (value - mean) / norm).collect())
}

/// The place with the greatest likelihood, if no place farther than one pixel from it has a chance.
fn best(patterns: &[Option<Vec<f64>>], photo: &[f64], size: Resolution, count: usize) -> Option<[f64; 2]> {
    let explained: Vec<f64> = patterns
        .iter()
        .map(|pattern| pattern.as_ref().map_or(0.0, |x| crate::krylov::dot(x, photo).max(0.0).powi(2)))
        .collect();
    let (top, most) = explained.iter().copied().enumerate().max_by(|a, b| a.1.total_cmp(&b.1))?;
    let power = 0.5 * (count as f64 - 2.0);
    // The floor is the error of a model of one pixel: neighbours and global light remain.
    let rest = |explained: f64| (1.0 - explained).max(1e-3);
    let chance = |explained: f64| (power * (rest(most).ln() - rest(explained).ln())).exp();
    let [x, y] = [top % size.width, top / size.width];
    let is_near = |i: usize| (i % size.width).abs_diff(x) <= 1 && (i / size.width).abs_diff(y) <= 1;
    let [near, far] = explained.iter().enumerate().fold([0.0; 2], |[near, far], (i, share)| {
        if is_near(i) { [near + chance(*share), far] } else { [near, far + chance(*share)] }
    });
    if far > DOUBT * near {
        return None;
    }
    // The centre of the light among the neighbours, above what the least of them explains.
    let around: Vec<usize> = (0..explained.len()).filter(|&i| is_near(i)).collect();
    let least = around.iter().map(|&i| explained[i]).fold(f64::INFINITY, f64::min);
    let mut sums = [0.0; 3];
    for i in around {
        let weight = (explained[i] - least).powi(2);
        sums[0] += weight;
        sums[1] += weight * (i % size.width) as f64;
        sums[2] += weight * (i / size.width) as f64;
    }
    let centre = if sums[0] > 0.0 { [sums[1] / sums[0], sums[2] / sums[0]] } else { [x as f64, y as f64] };
    Some(centre)
}

/// The homes of a coaxial rig, whose camera and projector see the same picture at any two resolutions.
pub fn coaxial_homes(camera: Resolution, projector: Resolution) -> Places {
    let scaled = |at: usize, from: usize, to: usize| (at as f64 + 0.5) * to as f64 / from as f64 - 0.5;
    let home = |pixel: usize| {
        let [x, y] = [pixel % camera.width, pixel / camera.width];
        Some([scaled(x, camera.width, projector.width), scaled(y, camera.height, projector.height)])
    };
    (0..camera.pixels()).map(home).collect()
}
