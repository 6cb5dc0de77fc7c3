//! The choice of the prior by photos that are left out, and the error of such photos.

use rayon::prelude::*;

use super::{Pairs, Posterior, Prior};
use crate::error::{Error, Result};

/// The prediction of photos that neither the choice of the prior nor the fit has seen.
#[derive(Clone, Debug, PartialEq)]
pub struct LeftOut {
    /// The places of these photos in the list of pairs.
    pub photos: Vec<usize>,
    /// The photos as predicted from the others (`m` values each).
    pub predicted: Vec<Vec<f64>>,
    /// The stated standard error of each predicted value, with the noise of the photo (`m` values each).
    pub stated: Vec<Vec<f64>>,
    /// The root mean square of the differences between predicted and taken photos.
    pub error: f64,
    /// The root mean square of the photos.
    pub light: f64,
    /// The root mean square of the differences between the photos and a matrix whose rows are constant: the average entry of each row.
    pub by_mean: f64,
    /// The root mean square of the photos' noise.
    pub noise: f64,
    /// The root mean square of the differences over their stated errors: 1 if the stated errors are right.
    pub z: f64,
}

/// One photo in this number is left out.
const ONE_OF: usize = 5;

/// The largest number of camera pixels on which the scales are chosen.
const PIXELS: usize = 256;

/// The fewest photos from which a model is made.
const FEWEST: usize = 3;

/// Chooses the scales of the prior: those under which the photos that are left out, one after another, have the greatest likelihood. One
/// photo of five takes no part in this. It is predicted at the end. The scales are not chosen again with it.
///
/// # Errors
/// [`Error::Numerical`] for fewer than 3 photos, or if a value is not finite.
pub fn choose(pairs: &Pairs) -> Result<(Prior, LeftOut)> {
    let count = pairs.patterns.len();
    if count < FEWEST {
        return Err(Error::Numerical(format!(
            "{count} photos with light make no model: {FEWEST} are needed"
        )));
    }
    let step = ONE_OF.min(count);
    let (kept, photos): (Vec<usize>, Vec<usize>) = (0..count).partition(|k| k % step != step / 2);
    let known = pairs.only(&kept);
    let pixels = some_pixels(&known);
    let start = Prior::start(pairs.projector, pairs.noise.is_some());
    let mut posterior = Posterior::new(&known, start)?;
    let mut best = doubt(&posterior, &known, &pixels)?;
    for factor in [4.0, 2.0, 1.4, 1.2] {
        search(&known, &pixels, &mut posterior, &mut best, factor)?;
    }
    let scale = calibration(&posterior, &known, &pixels)?.max(1.0);
    let prior = Prior { scale, ..posterior.state().prior }.rounded();
    let left_out = predicted(pairs, &known, prior, photos)?;
    Ok((prior, left_out))
}

/// Multiplies and divides each scale by the factor for as long as the doubt falls.
fn search(
    pairs: &Pairs,
    pixels: &[usize],
    posterior: &mut Posterior,
    best: &mut f64,
    factor: f64,
) -> Result<()> {
    let [has_homes, is_known] = [!pairs.homes.is_empty(), pairs.noise.is_some()];
    let scales = posterior.state().prior.clone().scales(has_homes, is_known).len();
    for _ in 0..4 {
        let before = *best;
        for scale in 0..scales {
            for step in [factor, 1.0 / factor] {
                loop {
                    let prior = posterior.state().prior;
                    let mut next = prior;
                    if let Some((value, [low, high])) =
                        next.scales(has_homes, is_known).into_iter().nth(scale)
                    {
                        *value = (*value * step).clamp(low, high);
                    }
                    if next == prior {
                        break;
                    }
                    let next = posterior.under(pairs, next)?;
                    let found = doubt(&next, pairs, pixels)?;
                    if found >= *best {
                        break;
                    }
                    (*posterior, *best) = (next, found);
                }
            }
        }
        if *best >= before - 1e-3 {
            break;
        }
    }
    Ok(())
}

/// Camera pixels that are spread over the picture.
fn some_pixels(pairs: &Pairs) -> Vec<usize> {
    let count = pairs.pixels();
    // The step has no common factor with the width of usual pictures, so that columns differ.
    let step = (count / PIXELS).max(1) | 1;
    (0..count).step_by(step).collect()
}

/// The mean negative logarithm of the likelihood of photos that are left out, one after another.
fn doubt(posterior: &Posterior, pairs: &Pairs, pixels: &[usize]) -> Result<f64> {
    let of = |&pixel: &usize| -> Result<[f64; 2]> {
        let left = posterior.left_out(&pairs.photos, pixel)?;
        let level = posterior.state().levels[pixel].ln();
        let seen = left.iter().filter(|[difference, _]| !difference.is_nan());
        Ok(seen.fold([0.0; 2], |[sum, count], [difference, error]| {
            [sum + error.ln() - level + 0.5 * (difference / error).powi(2), count + 1.0]
        }))
    };
    let sums: Vec<[f64; 2]> = pixels.par_iter().map(of).collect::<Result<_>>()?;
    let [sum, count] = sums.iter().fold([0.0; 2], |[a, b], [sum, count]| [a + sum, b + count]);
    let doubt = sum / count.max(1.0);
    Ok(if doubt.is_nan() { f64::INFINITY } else { doubt })
}

/// The root mean square of the differences of photos that are left out, over their stated errors.
fn calibration(posterior: &Posterior, pairs: &Pairs, pixels: &[usize]) -> Result<f64> {
    let left: Vec<_> =
        pixels.par_iter().map(|&j| posterior.left_out(&pairs.photos, j)).collect::<Result<_>>()?;
    let squares = left.iter().flatten().map(|[difference, error]| (difference / error).powi(2));
    Ok(mean_of(squares).sqrt())
}

/// Predicts the photos that were left out from the known ones.
fn predicted(pairs: &Pairs, known: &Pairs, prior: Prior, photos: Vec<usize>) -> Result<LeftOut> {
    let posterior = Posterior::new(known, prior)?;
    let model = posterior.model(known)?;
    let found: Vec<Vec<f64>> = photos.iter().map(|&k| model.relight(&pairs.patterns[k])).collect();
    let stated = |&k: &usize| -> Vec<f64> {
        let errors = posterior.errors(&pairs.patterns[k]);
        errors.iter().zip(posterior.noise()).map(|(error, noise)| error.hypot(*noise)).collect()
    };
    let stated: Vec<Vec<f64>> = photos.iter().map(stated).collect();
    let each = || {
        let rows = photos.iter().zip(&found).zip(&stated);
        rows.flat_map(|((&k, found), stated)| {
            let values = pairs.photos[k].iter().zip(found).zip(stated);
            values.map(|((&photo, &found), &stated)| [photo, found, stated])
        })
    };
    let root = |of: &dyn Fn([f64; 3]) -> f64| mean_of(each().map(of)).sqrt();
    let from_mean = |&k: &usize| {
        let light: f64 = pairs.patterns[k].iter().sum();
        let levels = posterior.state().levels.iter();
        levels.zip(&pairs.photos[k]).map(move |(level, photo)| (photo - level * light).powi(2))
    };
    let by_mean = mean_of(photos.iter().flat_map(from_mean)).sqrt();
    Ok(LeftOut {
        error: root(&|[photo, found, _]| (photo - found).powi(2)),
        light: root(&|[photo, ..]| photo.powi(2)),
        by_mean,
        noise: mean_of(posterior.noise().iter().map(|noise| noise.powi(2))).sqrt(),
        z: root(&|[photo, found, stated]| ((photo - found) / stated).powi(2)),
        photos,
        predicted: found,
        stated,
    })
}

/// The mean of the values that are not NaN.
fn mean_of(values: impl Iterator<Item = f64>) -> f64 {
    let [sum, count] = values
        .filter(|value| !value.is_nan())
        .fold([0.0; 2], |[sum, count], value| [sum + value, count + 1.0]);
    if count > 0.0 { sum / count } else { f64::NAN }
}
