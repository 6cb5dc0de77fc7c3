//! The shadow image: what the camera sees but the projector does not light.

use crate::calibrate::Decoded;
use crate::image::percentile;
use crate::measure::LensMap;

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
