//! Disparity: the distance between the projector position that a camera pixel sees and the one that a common map predicts.

use crate::calibrate::{Decoded, Fit};
use crate::image::percentile;
use crate::measure::{LensMap, Match};

/// Side of a cell in projector pixels: small enough to have one depth, large enough to average out the rounding of the codes.
const SIDE: f64 = 4.0;

/// A cell is used if at least this share of its pixels is decoded.
const FILLED: f64 = 0.25;

/// Codes farther than this from their cell's median, in steps, are misread or of another depth; rounding alone moves none so far.
const APART: f64 = 0.75;

/// The least scatter that is assumed within a cell, in projector pixels.
const LEAST: f64 = 0.03;

/// A cell of the camera's raster.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cell {
    /// The cell's centre, in camera pixels from the top left corner.
    pub at: [f64; 2],
    /// The displacement of the projector light that the cell sees from where the map predicts it, in projector pixels, to the
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
    /// The 95th percentile of these lengths.
    pub upper: f64,
    /// The standard error of one cell's displacement along an axis.
    pub error: f64,
}

/// A cell of the camera's raster, with its displacement on the projector's raster.
struct Patch {
    /// The cell's centre in camera pixels.
    at: [f64; 2],
    /// The projector position that the map predicts for it.
    expected: [f64; 2],
    /// The mean displacement of its codes from there, and their standard deviation along an axis.
    off: [f64; 2],
    scatter: f64,
}

/// Compares the codes with the map, cell by cell.
pub(crate) fn disparity(decoded: &Decoded, fit: &Fit) -> Disparity {
    let (map, camera) = (&fit.map, fit.map.camera);
    let step = decoded.step as f64;
    let scale = photo_axes(map, [0.5 * camera.width as f64, 0.5 * camera.height as f64]).1;
    let side = ((SIDE * step / scale).ceil() as usize).clamp(2, camera.width.min(camera.height).max(2));
    let mut patches = patches(decoded, map, side);
    // The rounding of codes is the same along a projector line, and a cell covers `SIDE` lines.
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
    // Where there is only noise, it is the typical displacement: the median length of a two-dimensional Gaussian is 1.18 σ.
    let error = within.min(median / 1.18).hypot(fit_error);
    Disparity { side, median, upper, error, cells }
}

/// The usable cells of `side` × `side` camera pixels.
fn patches(decoded: &Decoded, map: &LensMap, side: usize) -> Vec<Patch> {
    let (camera, step) = (map.camera, decoded.step as f64);
    let field = [map.projector.width as f64, map.projector.height as f64];
    let (across, down) = (camera.width.div_ceil(side), camera.height.div_ceil(side));
    let mut members: Vec<Vec<[f64; 2]>> = vec![Vec::new(); across * down];
    for seen in decoded.all() {
        // A pixel that looks across the field's border is lit only in part, which shifts its centroid.
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

/// Refits the common map to the cells and updates their displacements: a map fitted to single codes, which are rounded to pixels,
/// may lie between two depths. Returns the map's standard error, or none where there are too few cells to fit one.
fn refine(patches: &mut [Patch], map: &LensMap, spread: f64) -> Option<f64> {
    let seen = |patch: &Patch| [patch.expected[0] + patch.off[0], patch.expected[1] + patch.off[1]];
    let matches: Vec<Match> =
        patches.iter().map(|patch| Match { camera: patch.expected, projector: seen(patch) }).collect();
    let fit = Fit::of(&matches, map.projector, map.projector, spread).ok()?;
    for patch in patches {
        let [seen, expected] = [seen(patch), fit.map.to_projector(patch.expected)];
        patch.off = [seen[0] - expected[0], seen[1] - expected[1]];
    }
    Some(fit.error)
}

/// The matrix that turns a displacement on the projector's raster to the photo's axes, and the projector pixels per camera pixel.
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
}
