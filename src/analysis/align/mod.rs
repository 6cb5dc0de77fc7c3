//! Coaxial alignment: do camera and projector look from one point, and if not, which way must the camera go?
//!
//! A round of structured light tells where each camera pixel looks on the projector's raster. Two devices at one point are joined by
//! one map, whatever stands before them; where they are apart, what is nearer is displaced against what is farther:
//!
//! | figure | from | file |
//! |---|---|---|
//! | disparity | codes against the one map that most of them agree on | `disparity` |
//! | where the camera stands | what stands out from that map, taken for nearer | `stand` |
//! | shadow | camera pixels that see the scene, but no light that comes straight from the projector | `shadow` |
//! | symmetry | `yᵀ A x` against `xᵀ A y` | [`crate::analysis::audit`] |
//!
//! **Near and far cannot be told apart by these figures**: a bump before a wall, seen from the left, has the codes and shadows of a dent,
//! seen from the right (relief reversal). So the larger part of what is seen is taken for the background, and what stands out from
//! its map for something before it: a small thing is hung there to align by. A flat scene tells nothing, and all of it is 0.

mod disparity;
mod offset;
mod shadow;
mod symmetry;

pub use disparity::{Cell, Disparity};
pub use offset::CameraOffset;
pub use shadow::Sight;

use crate::analysis::audit::Check;
use crate::error::{Error, Result};
use crate::image::Resolution;
use crate::measure::calibrate::StructuredLight;

/// How a round is made.
#[derive(Clone, Debug, PartialEq)]
pub struct AlignOptions {
    /// Random patterns; symmetry is judged by all pairs of them. Fewer than two: it is not judged.
    pub patterns: usize,
    /// `‖A − Aᵀ‖/‖A‖` (Frobenius) that passes.
    pub asymmetry: f64,
    /// Share of pixels in shadow that passes.
    pub share: f64,
}

impl Default for AlignOptions {
    fn default() -> Self {
        Self { patterns: 6, asymmetry: 0.1, share: 0.01 }
    }
}

/// What a round found.
#[derive(Clone, Debug)]
pub struct Alignment {
    /// The camera's pixels.
    pub camera: Resolution,
    /// Each camera pixel's light under white, in linear DN.
    pub white: Vec<f64>,
    /// What each camera pixel sees.
    pub sights: Vec<Sight>,
    /// Share of the pixels that see the scene in shadow.
    pub shadow: f64,
    /// Share of the projector's field where nothing is seen: something black, or a shadow that no light falls into.
    pub dark: f64,
    /// What a common map does not explain.
    pub disparity: Disparity,
    /// Where the camera stands; none where nothing stands out from the map.
    pub stand: Option<CameraOffset>,
    /// The symmetry score; none where it is not judged.
    pub symmetry: Option<Check>,
}

/// A round: what was found, or why nothing could be.
#[derive(Clone, Debug)]
pub enum Round {
    /// It tells.
    Found(Box<Alignment>),
    /// No map could be told: what the rig shows instead, and what to do.
    Lost {
        /// What is seen.
        fault: String,
        /// What to do.
        help: String,
    },
}

impl Alignment {
    /// What a cell must be displaced by to stand out, in projector pixels.
    pub fn least(&self) -> f64 {
        offset::least(&self.disparity)
    }

    /// Whether nothing speaks against the two being at one point.
    pub fn is_aligned(&self, options: &AlignOptions) -> bool {
        use crate::analysis::audit::Verdict;
        let is_symmetric = self.symmetry.as_ref().is_none_or(|check| check.verdict != Verdict::Fails);
        self.stand.is_none() && self.shadow <= options.share && is_symmetric
    }
}

/// Takes a round.
///
/// # Errors
/// Whatever keeps frames from being taken.
pub fn align(observer: &mut StructuredLight<'_>, options: &AlignOptions) -> Result<Round> {
    let decoded = observer.codes()?;
    let fit = match observer.fit(&decoded) {
        Ok(fit) => fit,
        Err(Error::Rig { fault, help, .. }) => return Ok(Round::Lost { fault, help }),
        Err(error) => return Err(error),
    };
    let disparity = disparity::disparity(&decoded, &fit);
    let sights = shadow::sights(&decoded, &fit.map, disparity.upper);
    let count = |of: Sight| sights.iter().filter(|&&sight| sight == of).count() as f64;
    let [lit, shadow, dark] = [Sight::Lit, Sight::Shadow, Sight::Dark].map(count);
    let symmetry = match options.patterns {
        0 | 1 => None,
        _ => symmetry::symmetry(observer, &decoded, &fit, options)?,
    };
    Ok(Round::Found(Box::new(Alignment {
        camera: observer.camera(),
        white: decoded.white,
        sights,
        shadow: shadow / (lit + shadow).max(1.0),
        dark: dark / (lit + shadow + dark).max(1.0),
        stand: offset::stand(&disparity),
        disparity,
        symmetry,
    })))
}
