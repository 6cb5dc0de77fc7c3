//! Disparity is the distance between the projector position that a camera pixel sees and the position that a common map predicts. The
//! camera's offset follows from the displaced cells.

use crate::calibrate::map_fit::fit;
use crate::calibrate::{Decoded, Fit};
use crate::image::percentile;
use crate::measure::{LensMap, Match};

/// The side of a cell in projector pixels: small enough for a single depth, and large enough to average out the rounding of the codes.
const SIDE: f64 = 4.0;

/// A cell is used if at least this fraction of its pixels is decoded.
const FILLED: f64 = 0.25;

/// Codes farther than this many steps from their cell's median are misread or belong to another depth. Rounding alone moves codes less.
const APART: f64 = 0.75;

/// The smallest assumed scatter within a cell, in projector pixels.
const LEAST: f64 = 0.03;

/// A cell of the camera's raster.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cell {
    /// The cell's centre, in camera pixels from the top left corner.
    pub at: [f64; 2],
    /// The projector position that the cell sees, minus the position that the map predicts. The displacement is in projector pixels, to the
    /// right and down *in the photo*. Nearer surfaces are displaced towards the camera's side.
    pub off: [f64; 2],
}

/// The disparity over the field of view.
#[derive(Clone, Debug, PartialEq)]
pub struct Disparity {
    /// The cells with enough decoded pixels.
    pub cells: Vec<Cell>,
    /// Side of a cell in camera pixels.
    pub side: usize,
    /// The median length of the cells' displacements, in projector pixels.
    pub median: f64,
    /// The 95th percentile of the lengths of the cells' displacements, in projector pixels.
    pub upper: f64,
    /// The standard error of the displacement of one cell along an axis.
    pub error: f64,
}

struct Patch {
    at: [f64; 2],
    /// The projector position that the map predicts for the cell's centre.
    expected: [f64; 2],
    /// The mean displacement of the cell's codes from `expected`. `scatter` is the standard deviation of the codes along an axis.
    off: [f64; 2],
    scatter: f64,
}

pub(crate) fn disparity(decoded: &Decoded, fit: &Fit) -> Disparity {
    let (map, camera) = (&fit.map, fit.map.camera);
    let step = decoded.step as f64;
    let scale = photo_axes(map, [0.5 * camera.width as f64, 0.5 * camera.height as f64]).1;
    let side = ((SIDE * step / scale).ceil() as usize).clamp(2, camera.width.min(camera.height).max(2));
    let mut patches = patches(decoded, map, side);
    // All pixels along a projector line have the same rounding error of codes, so a cell averages `SIDE` independent errors.
    let within = percentile(patches.iter().map(|patch| patch.scatter), 0.5) / SIDE.sqrt();
    let fit_error = refine(&mut patches, map, within.max(LEAST)).unwrap_or(fit.error);
    let cells: Vec<Cell> = patches
        .iter()
        .map(|patch| {
            let axes = photo_axes(map, patch.at).0;
            Cell { at: patch.at, off: axes.map(|row| row[0] * patch.off[0] + row[1] * patch.off[1]) }
        })
        .collect();
    let lengths = || cells.iter().map(|cell| cell.off[0].hypot(cell.off[1]));
    let (median, upper) = (percentile(lengths(), 0.5), percentile(lengths(), 0.95));
    // If all displacements are noise, their median length is 1.18 σ, as for a two-dimensional Gaussian.
    let error = within.min(median / 1.18).hypot(fit_error);
    Disparity { side, median, upper, error, cells }
}

fn patches(decoded: &Decoded, map: &LensMap, side: usize) -> Vec<Patch> {
    let (camera, step) = (map.camera, decoded.step as f64);
    let field = [map.projector.width as f64, map.projector.height as f64];
    let (across, down) = (camera.width.div_ceil(side), camera.height.div_ceil(side));
    let mut members: Vec<Vec<[f64; 2]>> = vec![Vec::new(); across * down];
    for seen in decoded.all() {
        // A pixel across the field's border is only partly lit, which shifts its centroid.
        if (0..2).any(|axis| seen.at[axis] < step || seen.at[axis] > field[axis] - step) {
            continue;
        }
        let (x, y) = (seen.pixel % camera.width, seen.pixel / camera.width);
        let expected = map.to_projector([x as f64 + 0.5, y as f64 + 0.5]);
        members[y / side * across + x / side].push([seen.fine[0] - expected[0], seen.fine[1] - expected[1]]);
    }
    let patch = |(number, members): (usize, &Vec<[f64; 2]>)| {
        let middle = [0, 1].map(|axis| percentile(members.iter().map(|off| off[axis]), 0.5));
        let near = |off: &&[f64; 2]| (off[0] - middle[0]).hypot(off[1] - middle[1]) <= APART * step;
        let kept: Vec<[f64; 2]> = members.iter().filter(near).copied().collect();
        let count = kept.len() as f64;
        if count < (FILLED * (side * side) as f64).max(2.0) {
            return None;
        }
        let off = [0, 1].map(|axis| kept.iter().map(|off| off[axis]).sum::<f64>() / count);
        let squares: f64 = kept.iter().map(|at| (at[0] - off[0]).powi(2) + (at[1] - off[1]).powi(2)).sum();
        let corner = [number % across * side, number / across * side];
        let end = [(corner[0] + side).min(camera.width), (corner[1] + side).min(camera.height)];
        let at = [0, 1].map(|axis| 0.5 * (corner[axis] + end[axis]) as f64);
        Some(Patch {
            at,
            expected: map.to_projector(at),
            off,
            scatter: (squares / (2.0 * (count - 1.0))).sqrt(),
        })
    };
    members.iter().enumerate().filter_map(patch).collect()
}

/// Refits the common map to the cells and updates their displacements. The original map was fitted to single codes, which are rounded to
/// pixels, so it may lie between two depths. Returns the map's standard error, or `None` when there are too few cells to fit a map.
fn refine(patches: &mut [Patch], map: &LensMap, spread: f64) -> Option<f64> {
    let seen = |patch: &Patch| [patch.expected[0] + patch.off[0], patch.expected[1] + patch.off[1]];
    let matches: Vec<Match> =
        patches.iter().map(|patch| Match { camera: patch.expected, projector: seen(patch) }).collect();
    let refitted = fit(&matches, map.projector, map.projector, spread).ok()?;
    for patch in patches {
        let [seen, expected] = [seen(patch), refitted.map.to_projector(patch.expected)];
        patch.off = [seen[0] - expected[0], seen[1] - expected[1]];
    }
    Some(refitted.error)
}

/// The matrix that converts displacements from the projector's to the photo's axes, and the number of projector pixels per camera pixel.
fn photo_axes(map: &LensMap, [x, y]: [f64; 2]) -> ([[f64; 2]; 2], f64) {
    let [west, east] = [-0.5, 0.5].map(|by| map.to_projector([x + by, y]));
    let [north, south] = [-0.5, 0.5].map(|by| map.to_projector([x, y + by]));
    let [[a, c], [b, d]] =
        [[east[0] - west[0], east[1] - west[1]], [south[0] - north[0], south[1] - north[1]]];
    let determinant = a * d - b * c;
    let scale = determinant.abs().sqrt().max(f64::MIN_POSITIVE);
    let by = scale / determinant;
    ([[d * by, -b * by], [-c * by, a * by]], scale)
}

/// A cell counts as displaced if its displacement exceeds this many standard errors and also [`LEAST_OFF`].
const SIGMAS: f64 = 4.0;

/// The smallest displacement of a displaced cell, in projector pixels. Calibration promises this accuracy for a map. Indirect light shifts
/// codes by up to 0.07 pixels where surfaces meet, even in an aligned rig.
const LEAST_OFF: f64 = 0.1;

/// An offset requires at least this number of displaced cells, and at least this fraction of all cells.
const CELLS: (usize, f64) = (3, 0.01);

/// The camera's side is certain if at least this fraction of the cells' total displacement points to it.
const ONE_SIDED: f64 = 0.8;

/// `tan 22.5°`. A component of a direction is not mentioned if it is smaller than the other component times this factor.
const ASIDE: f64 = 0.414;

/// The camera's offset as seen from the projector.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct CameraOffset {
    /// The direction as a vector of length 1, to the right and down in the photo.
    pub toward: [f64; 2],
    /// The typical displacement of the displaced cells, in projector pixels.
    pub size: f64,
    /// The standard error of `size`.
    pub error: f64,
    /// Whether the side is certain. If not, the camera may be on the opposite side.
    pub is_certain: bool,
    /// The fraction of cells in the field that are displaced.
    pub share: f64,
}

/// The smallest displacement that counts as different from the map, in projector pixels.
pub(crate) fn least(disparity: &Disparity) -> f64 {
    (SIGMAS * disparity.error).max(LEAST_OFF)
}

/// Computes the offset from the displaced cells. Returns `None` when there are too few displaced cells.
pub(crate) fn stand(disparity: &Disparity) -> Option<CameraOffset> {
    let least = least(disparity);
    let out: Vec<&Cell> =
        disparity.cells.iter().filter(|cell| cell.off[0].hypot(cell.off[1]) > least).collect();
    let share = out.len() as f64 / disparity.cells.len().max(1) as f64;
    if out.len() < CELLS.0 || share < CELLS.1 {
        return None;
    }
    let sum = |of: &dyn Fn(&Cell) -> f64| out.iter().map(|cell| of(cell)).sum::<f64>();
    let [xx, xy, yy] = [
        sum(&|cell| cell.off[0].powi(2)),
        sum(&|cell| cell.off[0] * cell.off[1]),
        sum(&|cell| cell.off[1].powi(2)),
    ];
    // The principal axis of the second moments.
    let angle = 0.5 * (2.0 * xy).atan2(xx - yy);
    let axis = [angle.cos(), angle.sin()];
    let along = |cell: &Cell| cell.off[0] * axis[0] + cell.off[1] * axis[1];
    let (net, total) = (sum(&along), sum(&|cell| along(cell).abs()));
    let side = if net < 0.0 { -1.0 } else { 1.0 };
    let ahead: Vec<f64> = out.iter().map(|cell| side * along(cell)).filter(|&off| off > 0.0).collect();
    Some(CameraOffset {
        toward: axis.map(|part| side * part),
        size: middle(ahead),
        // The rounding of codes is the same in many cells, so it does not average out.
        error: disparity.error,
        is_certain: 0.5 * (1.0 + net.abs() / total) >= ONE_SIDED,
        share,
    })
}

/// The displacement at which the cumulative sum of the sorted displacements reaches half. Cells at an object's border have smaller
/// displacements, and so little weight.
fn middle(mut displacements: Vec<f64>) -> f64 {
    displacements.sort_by(f64::total_cmp);
    let half = 0.5 * displacements.iter().sum::<f64>();
    let mut below = 0.0;
    let found = displacements.iter().find(|&&displacement| {
        below += displacement;
        below >= half
    });
    found.copied().unwrap_or(0.0)
}

impl CameraOffset {
    /// The camera's position in words, such as `to the right of the projector and above it`.
    pub fn place(&self) -> String {
        let [right, down] = self.parts();
        let sideways = right.map(|is_right| if is_right { "to the right of" } else { "to the left of" });
        let upright = down.map(|is_down| if is_down { "below" } else { "above" });
        match (sideways, upright) {
            (Some(sideways), Some(upright)) => format!("{sideways} the projector and {upright} it"),
            (Some(one), None) | (None, Some(one)) => format!("{one} the projector"),
            // This case does not occur, because a direction of length 1 has a large component along at least one axis.
            (None, None) => "beside the projector".into(),
        }
    }

    /// The direction in which the camera must move to reach the projector, such as `left and down`.
    pub fn remedy(&self) -> String {
        let [right, down] = self.parts();
        let ways = [
            right.map(|is_right| if is_right { "left" } else { "right" }),
            down.map(|is_down| if is_down { "up" } else { "down" }),
        ];
        ways.into_iter().flatten().collect::<Vec<_>>().join(" and ")
    }

    /// Whether the camera is to the right of the projector, and whether it is below the projector. `None` for a component too small to be
    /// mentioned.
    fn parts(&self) -> [Option<bool>; 2] {
        let [x, y] = self.toward;
        [(x.abs() > ASIDE * y.abs()).then_some(x > 0.0), (y.abs() > ASIDE * x.abs()).then_some(y > 0.0)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Resolution;

    #[test]
    fn a_displacement_keeps_its_length_and_turns_with_the_camera() {
        // The camera is mounted upside down and has twice as many pixels.
        let map = LensMap {
            camera: Resolution::new(80, 60),
            projector: Resolution::new(40, 30),
            homography: [-1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0],
            distortion: [0.0; 2],
        };
        let (axes, scale) = photo_axes(&map, [10.0, 20.0]);
        assert!((scale - 0.5).abs() < 1e-9);
        for (row, expected) in axes.iter().zip([[-1.0, 0.0], [0.0, -1.0]]) {
            assert!(
                row.iter().zip(expected).all(|(found, expected)| (found - expected).abs() < 1e-9),
                "{axes:?}"
            );
        }
    }

    /// Cells with noise of 0.01. Every tenth cell is also displaced by `off`.
    fn disparity(off: impl Fn(usize) -> [f64; 2]) -> Disparity {
        let cell = |number: usize| {
            let noise = 0.01 * [1.0, -1.0][number % 2];
            let off = if number.is_multiple_of(10) { off(number) } else { [0.0; 2] };
            Cell { at: [0.0; 2], off: [off[0] + noise, off[1] - noise] }
        };
        Disparity { cells: (0..400).map(cell).collect(), side: 4, median: 0.01, upper: 0.01, error: 0.01 }
    }

    #[test]
    fn what_is_displaced_to_one_side_tells_where_the_camera_stands() {
        for (off, place, remedy) in [
            ([1.0, 0.1], "to the right of the projector", "left"),
            ([-0.3, 0.0], "to the left of the projector", "right"),
            ([0.0, 2.0], "below the projector", "up"),
            ([-0.5, -0.6], "to the left of the projector and above it", "right and down"),
        ] {
            let found = stand(&disparity(|_| off)).expect("it stands out");
            assert!(found.is_certain && (found.share - 0.1).abs() < 1e-9);
            assert_eq!((found.place(), found.remedy()), (place.to_owned(), remedy.to_owned()));
            assert!((found.size - f64::hypot(off[0], off[1])).abs() < 0.02, "{found:?}");
        }
    }

    #[test]
    fn what_is_displaced_in_part_does_not_count_like_the_whole() {
        assert_eq!(middle(vec![0.25, 2.0, 0.25, 2.0, 0.25, 2.0, 0.25, 0.25]), 2.0);
        assert_eq!(middle(Vec::new()), 0.0);
    }

    #[test]
    fn noise_alone_stands_out_nowhere_and_both_sides_tell_none() {
        assert_eq!(stand(&disparity(|_| [0.0; 2])), None);
        let both = stand(&disparity(|number| [if number.is_multiple_of(20) { 1.0 } else { -1.0 }, 0.0]));
        let found = both.expect("it stands out");
        assert!(!found.is_certain && found.toward[0].abs() > 0.99, "{found:?}");
    }
}
