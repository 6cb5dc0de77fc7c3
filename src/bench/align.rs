//! Coaxial alignment: whether camera and projector share one centre of projection, and if not, which way the camera must move.
//!
//! A round of structured light finds where each camera pixel looks on the projector's raster. If both devices share one centre,
//! one map joins their rasters whatever the scene. If they do not, near surfaces are displaced against far ones:
//!
//! | figure | from | file |
//! |---|---|---|
//! | disparity | codes against the one map that fits most of them | `disparity` |
//! | camera offset | the cells displaced from that map, which are assumed to be nearer | `offset` |
//! | shadow | camera pixels that see the scene, but no light straight from the projector | `shadow` |
//! | symmetry | `yᵀ A x` against `xᵀ A y` | [`crate::bench::audit`] |
//!
//! **These figures cannot distinguish near from far**: a bump seen from the left has the same codes and shadows as a dent seen
//! from the right (relief reversal). So the larger part of the view is taken as the background, and whatever is displaced from
//! its map as an object in front of it: hang a small object there to align by. On a flat scene all figures are 0.

mod disparity;

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

pub use super::align::disparity::{CameraOffset, Cell, Disparity};
use super::audit::{Seen, symmetry as score};
use crate::calibrate::{Decoded, Fit, StructuredLight};
use crate::error::{Error, Result};
use crate::finding::{Finding, Grade};
use crate::image::{Resolution, percentile};
use crate::measure::{LensMap, Registration};

/// The options of an alignment round.
#[derive(Clone, Debug, PartialEq)]
pub struct AlignOptions {
    /// Number of random patterns; symmetry is judged from all pairs of them, and not at all with fewer than two.
    pub patterns: usize,
    /// The largest `‖A − Aᵀ‖/‖A‖` (Frobenius) that passes.
    pub asymmetry: f64,
    /// The largest share of pixels in shadow that passes.
    pub share: f64,
}

impl Default for AlignOptions {
    fn default() -> Self {
        Self { patterns: 6, asymmetry: 0.1, share: 0.01 }
    }
}

/// The result of an alignment round.
#[derive(Clone, Debug)]
pub struct Alignment {
    /// The camera's resolution.
    pub camera: Resolution,
    /// Each camera pixel's light under white, in linear digital numbers (DN).
    pub white: Vec<f64>,
    /// What each camera pixel sees.
    pub sights: Vec<Sight>,
    /// The share of shadow among the pixels that see the scene.
    pub shadow: f64,
    /// The share of the projector's field where the camera sees nothing: a black surface, or a shadow without any light.
    pub dark: f64,
    /// The displacements that a common map does not explain.
    pub disparity: Disparity,
    /// The camera offset; none if no cells are displaced from the map.
    pub stand: Option<CameraOffset>,
    /// The symmetry score; none if it is not judged.
    pub symmetry: Option<Finding>,
}

/// A round: its result, or why there is none.
#[derive(Clone, Debug)]
pub enum Round {
    /// The round succeeded.
    Found(Box<Alignment>),
    /// No map could be fitted.
    Lost {
        /// What the rig shows instead.
        fault: String,
        /// What to do.
        help: String,
    },
}

impl Alignment {
    /// The least displacement, in projector pixels, that counts as different from the map.
    pub fn least(&self) -> f64 {
        disparity::least(&self.disparity)
    }

    /// Whether no figure contradicts a common centre of projection.
    pub fn is_aligned(&self, options: &AlignOptions) -> bool {
        let is_symmetric = self.symmetry.as_ref().is_none_or(|found| found.grade == Grade::Ok);
        self.stand.is_none() && self.shadow <= options.share && is_symmetric
    }
}

/// Takes a round.
///
/// # Errors
/// Any error of taking frames; an [`Error::Rig`] of the fit is returned as [`Round::Lost`].
pub fn align(observer: &mut StructuredLight<'_>, options: &AlignOptions) -> Result<Round> {
    let decoded = observer.codes()?;
    let fit = match observer.fit(&decoded) {
        Ok(fit) => fit,
        Err(Error::Rig { fault, help, .. }) => return Ok(Round::Lost { fault, help }),
        Err(error) => return Err(error),
    };
    let disparity = disparity::disparity(&decoded, &fit);
    let sights = sights(&decoded, &fit.map, disparity.upper);
    let count = |of: Sight| sights.iter().filter(|&&sight| sight == of).count() as f64;
    let [lit, shadow, dark] = [Sight::Lit, Sight::Shadow, Sight::Dark].map(count);
    let symmetry = match options.patterns {
        0 | 1 => None,
        _ => symmetry(observer, &decoded, &fit, options)?,
    };
    Ok(Round::Found(Box::new(Alignment {
        camera: observer.camera(),
        white: decoded.white,
        sights,
        shadow: shadow / (lit + shadow).max(1.0),
        dark: dark / (lit + shadow + dark).max(1.0),
        stand: disparity::stand(&disparity),
        disparity,
        symmetry,
    })))
}

// The shadow image: what the camera sees but the projector does not light.

/// A pixel with less than this share of the median direct light is not lit, …
const UNLIT: f64 = 0.05;

/// … and at most this share of its light under white is direct.
const INDIRECT: f64 = 0.25;

/// A pixel sees the scene if its light exceeds this many standard deviations of the noise, …
const SIGMAS: f64 = 5.0;

/// … and this share of the median direct light; less is negligible.
const GLIMMER: f64 = 0.01;

/// What a camera pixel sees.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sight {
    /// Light straight from the projector.
    Lit,
    /// The scene by indirect or ambient light, but no light straight from the projector.
    Shadow,
    /// Nothing: a black surface, or a shadow without any light.
    Dark,
    /// A place outside the projector's field.
    Outside,
}

/// Classifies each camera pixel. Within `margin` projector pixels of the field's border, pixels are outside unless they are lit.
pub(crate) fn sights(decoded: &Decoded, map: &LensMap, margin: f64) -> Vec<Sight> {
    let usual = percentile(decoded.seen.iter().map(|seen| decoded.direct[seen.pixel]), 0.5);
    let margin = margin.max(1.0) + decoded.step as f64;
    let field = [map.projector.width as f64, map.projector.height as f64];
    (0..decoded.white.len())
        .map(|pixel| {
            let [white, direct, noise] = [decoded.white[pixel], decoded.direct[pixel], decoded.noise[pixel]];
            let seen = |light: f64| light > SIGMAS * noise && light > GLIMMER * usual;
            if direct >= UNLIT * usual && direct > noise {
                return Sight::Lit;
            }
            let at = [pixel % map.camera.width, pixel / map.camera.width].map(|at| at as f64 + 0.5);
            let to = map.to_projector(at);
            if (0..2).any(|axis| to[axis] < margin || to[axis] > field[axis] - margin) {
                return Sight::Outside;
            }
            match (seen(white), seen(decoded.black[pixel])) {
                (true, _) if direct > INDIRECT * white => Sight::Lit,
                (true, _) | (false, true) => Sight::Shadow,
                (false, false) => Sight::Dark,
            }
        })
        .collect()
}

// The symmetry score of a round, from all pairs of random patterns.

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
