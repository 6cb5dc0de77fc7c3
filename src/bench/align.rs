//! The check of coaxial alignment: whether camera and projector share one centre of projection, and otherwise where the camera must move.
//!
//! A round of structured light finds the point of the projector's raster that each camera pixel sees. If both devices share one centre, a
//! single map relates their rasters for every scene. Otherwise, near surfaces are displaced relative to far ones:
//!
//! | figure | source |
//! |---|---|
//! | disparity | codes compared with the single map that fits most of them |
//! | camera offset | blocks of camera pixels (cells) that are displaced from that map, and are assumed to see nearer surfaces |
//! | shadow | camera pixels that see the scene, but no light straight from the projector |
//! | symmetry | `yᵀ A x` compared with `xᵀ A y`, as in [`crate::bench::audit`] |
//!
//! **These figures cannot distinguish near from far**: a bump seen from the left has the same codes and shadows as a dent seen from the
//! right (relief reversal). The larger part of the view is therefore assumed to be the background, and displaced parts are assumed to be
//! objects in front of it. To align the devices, hang a small object in front of the background. On a flat scene all figures are 0.

mod disparity;

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

pub use super::align::disparity::{CameraOffset, Cell, Disparity};
use super::audit::symmetry as score;
use crate::calibrate::{Decoded, Fit, StructuredLight};
use crate::error::{Error, Result};
use crate::finding::{Finding, Grade};
use crate::image::{Resolution, percentile};
use crate::io::raster::{Raster, encode_srgb, percentile as nearest_rank};
use crate::measure::footprint::by_overlap;
use crate::measure::{LensMap, Plane, Registration};

/// The options of an alignment round.
#[derive(Clone, Debug, PartialEq)]
pub struct AlignOptions {
    /// Number of random patterns. Symmetry is judged from all pairs of patterns, and is not judged with fewer than two patterns.
    pub patterns: usize,
    /// The largest `‖A − Aᵀ‖/‖A‖` (Frobenius) that passes.
    pub asymmetry: f64,
    /// The largest fraction of pixels in shadow that passes.
    pub share: f64,
}

impl Default for AlignOptions {
    fn default() -> Self {
        Self { patterns: 6, asymmetry: 0.1, share: 0.01 }
    }
}

/// Colour of shadows: pixels that see the scene but receive no direct light from the projector.
pub const SHADOW: [u8; 3] = [0xe0, 0x20, 0x18];

/// Colour of pixels that see no light.
pub const DARK: [u8; 3] = [0x48, 0x20, 0x60];

/// Colour of the arrows. It differs clearly from grays and from the two colours above.
pub const ARROW: [u8; 3] = [0x00, 0x70, 0xff];

/// The picture is enlarged by the largest integer factor that keeps its longer side within this many pixels, so that arrows are visible.
const LARGE: usize = 640;

/// The length of an arrow at the 95th percentile of the cells' displacements, in cells.
const LENGTH: f64 = 1.5;

/// The result of an alignment round.
#[derive(Clone, Debug)]
pub struct Alignment {
    /// The camera's resolution.
    pub camera: Resolution,
    /// Each camera pixel's light under white, in linear digital numbers (DN).
    pub white: Vec<f64>,
    /// The class of each camera pixel.
    pub sights: Vec<Sight>,
    /// The number of pixels in shadow divided by the number of pixels that see the scene.
    pub shadow: f64,
    /// The fraction of the projector's field where the camera sees no light: a black surface, or a shadow without any light.
    pub dark: f64,
    /// The displacements of the cells from the common map.
    pub disparity: Disparity,
    /// The camera offset. `None` if too few cells are displaced from the map.
    pub stand: Option<CameraOffset>,
    /// The symmetry score. `None` if symmetry is not judged.
    pub symmetry: Option<Finding>,
}

/// The result of a round, or the reason that the round has no result.
#[derive(Clone, Debug)]
pub enum Round {
    /// The round succeeded.
    Found(Box<Alignment>),
    /// No map could be fitted.
    Lost {
        /// The fault of the rig that prevented the fit.
        fault: String,
        /// The remedy.
        help: String,
    },
}

impl Alignment {
    /// The smallest displacement that counts as different from the map, in projector pixels.
    pub fn least(&self) -> f64 {
        disparity::least(&self.disparity)
    }

    /// The findings: displacement from the common map and shadow, and also symmetry if it is judged.
    pub fn findings(&self, options: &AlignOptions) -> Vec<Finding> {
        let (disparity, least) = (&self.disparity, self.least());
        let [size, error] =
            self.stand.map_or([disparity.upper, disparity.error], |stand| [stand.size, stand.error]);
        let displaced = self.stand.map_or(0.0, |stand| 100.0 * stand.share);
        let found = format!("{displaced:.0} % of the field is displaced from one map, by {size:.3} pixels");
        let help = "move the camera to the projector's centre of projection";
        // The grade depends on the number of displaced cells, and not only on the size of their displacement.
        let grade = if self.stand.is_none() { Grade::Ok } else { Grade::Fails };
        let disparity =
            Finding::graded("disparity", grade, found, format!("at most {least:.3} pixels"), help);
        let percent = 100.0 * self.shadow;
        let found =
            format!("{percent:.1} % of what the camera sees gets no light straight from the projector");
        let expected = format!("at most {:.1} %", 100.0 * options.share);
        let within = [self.shadow, 0.0, options.share];
        let shadow = Finding::at_most("shadow", within, Grade::Fails, found, expected, help);
        [disparity.measured(size, error, least), shadow].into_iter().chain(self.symmetry.clone()).collect()
    }

    /// Whether no finding contradicts a common centre of projection.
    pub fn is_aligned(&self, options: &AlignOptions) -> bool {
        self.findings(options).iter().all(|found| found.grade == Grade::Ok)
    }

    /// Draws the photo in gray, shadows in red, dark pixels in violet, and an arrow along each cell's displacement if it exceeds
    /// [`Self::least`]. One factor scales all arrows.
    pub fn picture(&self) -> Raster {
        let lit: Vec<f64> = self.white.iter().copied().filter(|&light| light > 0.0).collect();
        let bright = nearest_rank(lit, 0.98).unwrap_or(1.0);
        let pixels = self.sights.iter().zip(&self.white).map(|(sight, light)| match sight {
            Sight::Shadow => SHADOW,
            Sight::Dark => DARK,
            Sight::Lit | Sight::Outside => [encode_srgb((light / bright).clamp(0.0, 1.0) as f32); 3],
        });
        let factor = (LARGE / self.camera.width.max(self.camera.height)).max(1);
        let photo = Raster::from_pixels(self.camera, pixels).enlarged(factor);
        let (size, mut pixels) = (photo.resolution(), photo.bytes().as_chunks::<3>().0.to_vec());
        let (disparity, least) = (&self.disparity, self.least());
        let longest = disparity.upper.max(least).max(f64::MIN_POSITIVE);
        let unit = LENGTH * (disparity.side * factor) as f64 / longest;
        for cell in disparity.cells.iter().filter(|cell| cell.off[0].hypot(cell.off[1]) > least) {
            let ([x, y], [right, down]) =
                (cell.at.map(|at| at * factor as f64), cell.off.map(|off| off * unit));
            let tip = [x + right, y + down];
            draw_line(&mut pixels, size, [x, y], tip);
            for side in [-1.0, 1.0] {
                // The head of the arrow extends backwards by 0.3 of the arrow's length, and sideways by half of that.
                let head =
                    [tip[0] - 0.3 * (right - side * 0.5 * down), tip[1] - 0.3 * (down + side * 0.5 * right)];
                draw_line(&mut pixels, size, tip, head);
            }
        }
        Raster::from_pixels(size, pixels)
    }
}

/// Draws a line that is two pixels wide. Parts outside the picture are not drawn.
fn draw_line(pixels: &mut [[u8; 3]], size: Resolution, from: [f64; 2], to: [f64; 2]) {
    let steps = (to[0] - from[0]).abs().max((to[1] - from[1]).abs()).ceil().clamp(1.0, 1e4);
    for step in 0..=steps as usize {
        let share = step as f64 / steps;
        let [x, y] = [0, 1].map(|axis| from[axis] + share * (to[axis] - from[axis]));
        if x < 0.0 || y < 0.0 {
            continue;
        }
        for (right, down) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
            let [x, y] = [x as usize + right, y as usize + down];
            if x < size.width && y < size.height {
                pixels[y * size.width + x] = ARROW;
            }
        }
    }
}

/// Takes and evaluates a round of structured light.
///
/// # Errors
/// Any error of taking frames. An [`Error::Rig`] of the fit is returned as [`Round::Lost`].
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

/// Pixels whose direct light is below this fraction of the median direct light may be in shadow.
const UNLIT: f64 = 0.05;

/// Pixels are in shadow only if direct light is at most this fraction of their light under white.
const INDIRECT: f64 = 0.25;

/// A pixel sees the scene if its light exceeds this many standard deviations of the noise and also [`GLIMMER`].
const SIGMAS: f64 = 5.0;

/// The least light of a pixel that sees the scene, relative to the median direct light. Less light is negligible.
const GLIMMER: f64 = 0.01;

/// The class of a camera pixel, by the light that it sees.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sight {
    /// A surface that receives light straight from the projector.
    Lit,
    /// A surface that receives only indirect or ambient light.
    Shadow,
    /// No light: a black surface, or a shadow without any light.
    Dark,
    /// A surface outside the projector's field.
    Outside,
}

/// Classifies each camera pixel. Pixels within `margin` projector pixels of the field's border count as outside unless they are lit.
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

/// The symmetry score from patterns of fully lit and dark pixels, so that the projector's response need not be known. Photos are resampled
/// with the map of this round. Returns `None` when fewer than two projector pixels are seen.
pub(crate) fn symmetry(
    observer: &mut StructuredLight<'_>,
    decoded: &Decoded,
    fit: &Fit,
    options: &AlignOptions,
) -> Result<Option<Finding>> {
    let used: Vec<bool> =
        decoded.lit.iter().zip(&decoded.saturated).map(|(lit, over)| *lit && !over).collect();
    let map = by_overlap(&fit.map, &used);
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
    // The black photo is subtracted from every photo, so `2 photo − white` contains the black photo once. The noise of black is therefore
    // added to the noise of white.
    let white = resampled(&map, &white, black, |light| observer.variance(light));
    let dark = resampled(&map, black, black, |light| observer.variance(light));
    let variance = white.variance.iter().zip(&dark.variance).map(|(white, black)| white + black).collect();
    let white = Plane { variance, ..white };
    Ok(Some(score(&patterns, &photos, &white, &mask, options.asymmetry)))
}

/// A photo minus black, resampled to the projector's pixels, with the noise of the photo.
fn resampled(map: &Registration, photo: &[f64], black: &[f64], variance: impl Fn(f64) -> f64) -> Plane {
    let row = |pixel: usize, of: &dyn Fn(usize, f64) -> f64| -> f64 {
        map.row(pixel).map(|(camera, weight)| of(camera, weight)).sum()
    };
    let pixels = 0..map.projector.pixels();
    Plane {
        values: pixels.clone().map(|i| row(i, &|at, weight| weight * (photo[at] - black[at]))).collect(),
        variance: pixels.map(|i| row(i, &|at, weight| weight * weight * variance(photo[at]))).collect(),
    }
}
