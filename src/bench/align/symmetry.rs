//! The symmetry score of a round, from all pairs of random patterns.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use super::AlignOptions;
use crate::bench::audit::{Seen, symmetry as score};
use crate::calibrate::{Decoded, Fit, StructuredLight};
use crate::error::Result;
use crate::finding::Finding;
use crate::measure::Registration;

/// The score from patterns whose pixels are fully lit or dark, so that the projector's response need not be known. Photos are
/// resampled by the round's own map. None where fewer than two projector pixels are seen.
pub(crate) fn symmetry(
    observer: &mut StructuredLight<'_>,
    decoded: &Decoded,
    fit: &Fit,
    options: &AlignOptions,
) -> Result<Option<Finding>> {
    let used: Vec<bool> =
        decoded.lit.iter().zip(&decoded.saturated).map(|(lit, over)| *lit && !over).collect();
    let map = fit.footprints(&used);
    let mask = map.seen();
    if mask.iter().filter(|&&seen| seen).count() < 2 {
        return Ok(None);
    }
    let width = map.projector.width;
    let black = decoded.black.as_slice();
    let shoot = |observer: &mut StructuredLight<'_>, pattern: &[f64]| {
        observer.photograph(|x, y| pattern[y * width + x] > 0.0)
    };
    let whole: Vec<f64> = mask.iter().map(|&seen| f64::from(u8::from(seen))).collect();
    let white = shoot(observer, &whole)?;
    let mut random = Pcg64::seed_from_u64(0);
    let (mut patterns, mut photos) = (Vec::new(), Vec::new());
    for _ in 0..options.patterns {
        let pattern: Vec<f64> =
            mask.iter().map(|&seen| f64::from(u8::from(seen && random.random::<bool>()))).collect();
        let photo = shoot(observer, &pattern)?;
        photos.push(resampled(&map, &photo, black, |light| observer.variance(light)));
        patterns.push(pattern);
    }
    // The black photo is subtracted from all photos, so `2 photo − white` contains it once: its noise is added to white's.
    let white = resampled(&map, &white, black, |light| observer.variance(light));
    let dark = resampled(&map, black, black, |light| observer.variance(light));
    let variance = white.variance.iter().zip(&dark.variance).map(|(white, black)| white + black).collect();
    let white = Seen { variance, ..white };
    Ok(Some(score(&patterns, &photos, &white, &mask, options.asymmetry)))
}

/// A photo minus black, resampled to the projector's pixels, with the photo's own noise.
fn resampled(map: &Registration, photo: &[f64], black: &[f64], variance: impl Fn(f64) -> f64) -> Seen {
    let row = |pixel: usize, of: &dyn Fn(usize, f64) -> f64| -> f64 {
        map.row(pixel).map(|(camera, weight)| of(camera, weight)).sum()
    };
    let pixels = 0..map.projector.pixels();
    Seen {
        values: pixels.clone().map(|i| row(i, &|at, weight| weight * (photo[at] - black[at]))).collect(),
        variance: pixels.map(|i| row(i, &|at, weight| weight * weight * variance(photo[at]))).collect(),
    }
}
