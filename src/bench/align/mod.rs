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
mod offset;
mod shadow;
mod symmetry;

pub use disparity::{Cell, Disparity};
pub use offset::CameraOffset;
pub use shadow::Sight;

use crate::calibrate::StructuredLight;
use crate::error::{Error, Result};
use crate::finding::{Finding, Grade};
use crate::image::Resolution;

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
        offset::least(&self.disparity)
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
