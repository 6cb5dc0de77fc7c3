//! A rig that is not exactly coaxial: the remaining disparity, and its effect on methods for symmetric matrices.
//!
//! The devices are calibrated while they share one viewpoint. Then the projector is moved to the right, and turned back to the point of the
//! corner's edge at which the camera looks. Surfaces in front of that point are then displaced in the projector's view, relative to the
//! camera's view. For a corner whose walls are at the depth `z = d/(1 + |x|/z)`, the displacement follows from geometry alone. The camera
//! measures it by structured light, and the direct light of the matrix shows it, too.
//!
//! The disparity is not corrected. MINRES and Lanczos treat the matrix as symmetric, as on a coaxial rig. They are compared with GMRES,
//! which does not rely on symmetry, and with their own results without disparity. MINRES ends when its products are less symmetric than
//! their stated errors allow. On an ideal rig, whose products have no errors, it ends at once.

use std::collections::BTreeMap;

use glam::Vec3;

use super::bench::{Bench, EDGE, Set, Stage};
use super::check::Check;
use super::contest::{MethodRun, TargetLight, percent};
use super::figure::{Content, Figure, Panel, Plot, Points, Reproduced, Rig};
use crate::calibrate::StructuredLight;
use crate::error::{Error, Result};
use crate::image::percentile;
use crate::krylov::{EigsOptions, Method, Start, eigs};
use crate::lab::LabOperator;
use crate::operator::{Adjoint, Operator, Symmetry, delegate};
use crate::transport::Part;

const SIDE: usize = 100;
/// The distances of the projector to the right of the camera, in tenths of a millimetre.
const BESIDE: [u32; 6] = [0, 10, 50, 100, 200, 500];
/// The number of photos of a compensation besides the white photo, and the number of photos for eigenvalues.
const PHOTOS: usize = 10;
const OF_EIGENVALUES: usize = 20;
/// The largest allowed difference between measured and geometric disparity, in pixels: the accuracy that calibration promises for a map.
const AGREE: f64 = 0.1;
/// A method counts as unaffected if its residual is at most this many times the residual without disparity, or below a tenth of a per cent.
const AS_GOOD: f64 = 1.5;
const SMALL: f64 = 1e-3;
/// The side of a cell of projector pixels, and the smallest number of codes in a cell. Codes are averaged over cells, since single codes
/// are rounded.
const CELL: f64 = 4.0;
const CODES: usize = 12;

struct Row {
    millimetres: f64,
    /// The median and the 95th percentile of the displacement over the picture in pixels, first by geometry and then as measured.
    derived: [f64; 2],
    measured: [f64; 2],
    /// The asymmetry `‖H − Hᵀ‖/‖H‖` of the projected matrix `H` in Lanczos.
    asymmetry: f64,
    /// The residuals of the compensation, by MINRES and by GMRES.
    minres: MethodRun,
    gmres: MethodRun,
}

pub(super) fn reproduce(bench: &mut Bench) -> Result<Reproduced> {
    let side = bench.side(SIDE);
    let mut rows = Vec::new();
    for tenths in BESIDE {
        let stage = bench.stage(Set::Beside(tenths), side)?;
        rows.push(row(bench, &stage, tenths)?);
    }
    let stage = bench.stage(Set::Beside(BESIDE[BESIDE.len() - 1]), side)?;
    Ok(Reproduced {
        setting: format!(
            "corner, {}, the projector moved by up to {:.0} mm after calibration and turned to the edge at {EDGE} m, {PHOTOS} photos of each \
             compensation and {OF_EIGENVALUES} of eigenvalues",
            stage.resolution,
            rows[rows.len() - 1].millimetres,
        ),
        checks: checks(&rows),
        panels: vec![map(&stage)],
        plots: plots(&rows),
        photos: BESIDE.len() * (1 + 2 * PHOTOS + OF_EIGENVALUES),
        ..Reproduced::of(Figure::Disparity, bench.rig())
    })
}

fn row(bench: &mut Bench, stage: &Stage, tenths: u32) -> Result<Row> {
    let millimetres = 0.1 * f64::from(tenths);
    let measured = match bench.rig() {
        Rig::Ideal => of_matrix(bench, stage)?,
        Rig::Virtual => of_codes(bench, stage)?,
    };
    let mut rig = AsIfCoaxial(bench.photos(stage, Part::Full)?);
    let options = EigsOptions {
        count: 1,
        products: OF_EIGENVALUES,
        tolerance: 0.0,
        start: Start::default(),
        ..EigsOptions::default()
    };
    let asymmetry = eigs(&mut rig, &options)?.asymmetry;
    let target = TargetLight::new(stage, &mut rig, 0.0)?;
    let minres = target.run(&mut rig, (Method::Minres, true), PHOTOS)?;
    let gmres = target.run(&mut rig.0, (Method::Gmres, true), PHOTOS)?;
    let derived = spread(derived(stage, 1e-3 * millimetres).into_iter().map(|[x, y]| x.hypot(y)));
    Ok(Row { millimetres, derived, measured: spread(measured), asymmetry, minres, gmres })
}

fn checks(rows: &[Row]) -> Vec<Check> {
    let off = |row: &Row| (0..2).map(|k| (row.measured[k] - row.derived[k]).abs()).fold(0.0, f64::max);
    let mut checks = vec![
        Check::of(
            "disparity measured less that by geometry, median and 95 % of the pixels, the worst, in pixels",
        )
        .at_most(rows.iter().map(off).fold(0.0, f64::max), AGREE)
        .refutes("no disparity at all", rows.iter().map(|row| row.derived[1]).fold(0.0, f64::max)),
    ];
    let mut still = [0.0_f64; 2];
    let methods: [fn(&Row) -> &MethodRun; 2] = [|row| &row.minres, |row| &row.gmres];
    for (which, of) in methods.iter().enumerate() {
        for row in rows {
            if of(row).least_answered() > (AS_GOOD * of(&rows[0]).least_answered()).max(SMALL) {
                break;
            }
            still[which] = row.derived[1];
        }
    }
    checks.extend([
        Check::of(format!("largest disparity, 95 % of the pixels, at which {PHOTOS} photos of MINRES are within {AS_GOOD} times the residual without, in pixels")).stated(still[0]),
        Check::of("such a largest disparity of GMRES, which does not rely on symmetry, in pixels").stated(still[1]),
    ]);
    for row in rows {
        let beside = format!("{:.0} mm aside", row.millimetres);
        checks.extend([
            Check::of(format!("{beside}: disparity measured, 95 % of the pixels within, in pixels"))
                .stated(row.measured[1]),
            Check::of(format!("{beside}: asymmetry that Lanczos reports, %")).stated(percent(row.asymmetry)),
            Check::of(format!("{beside}: least residual within {PHOTOS} photos of MINRES, %"))
                .stated(percent(row.minres.least_answered())),
            Check::of(format!("{beside}: least residual within {PHOTOS} photos of GMRES, %"))
                .stated(percent(row.gmres.least_answered())),
            Check::of(format!("{beside}: photos until MINRES ends, of {PHOTOS}"))
                .stated(row.minres.answered.len() as f64),
        ]);
    }
    checks
}

/// An operator that declares itself symmetric, as on a coaxial rig.
struct AsIfCoaxial(LabOperator);

impl Operator for AsIfCoaxial {
    delegate!(0: rows, cols, apply, block_size, observer, standard_errors, frames);

    fn symmetry(&self) -> Symmetry {
        Symmetry::Symmetric
    }
}

impl Adjoint for AsIfCoaxial {
    fn apply_adjoint(&mut self, y: &[f64], x: &mut [f64]) -> Result<()> {
        self.apply(y, x)
    }
}

/// The displacement at each pixel of the camera. A pixel sees a point of the scene. The displacement is the position of this point in the
/// raster of the moved and turned projector, minus the pixel's own position.
fn derived(stage: &Stage, beside: f64) -> Vec<[f64; 2]> {
    let side = stage.resolution.width as f64;
    let scene = Set::Corner.scene();
    let tan_half = f64::from(scene.camera.tan_half_fov);
    let moved = stage.set.scene().projector.unwrap_or(scene.camera);
    debug_assert!((f64::from(moved.position.x) - beside).abs() < 1e-6);
    let along = |axis: Vec3, at: [f64; 3]| -> f64 {
        axis.to_array()
            .iter()
            .zip(at)
            .zip(moved.position.to_array())
            .map(|((a, x), o)| f64::from(*a) * (x - f64::from(o)))
            .sum()
    };
    let pixels =
        (0..stage.pixels()).map(|pixel| (pixel % stage.resolution.width, pixel / stage.resolution.width));
    pixels
        .map(|(column, row)| {
            let [u, v] = [column, row].map(|at| at as f64 + 0.5);
            let [x, y] = [(2.0 * u / side - 1.0) * tan_half, (1.0 - 2.0 * v / side) * tan_half];
            // A ray (x, y, −1) meets the wall at |X| = d − Z.
            let depth = f64::from(EDGE) / (1.0 + x.abs());
            let at = [x * depth, y * depth, -depth];
            let [right, up, ahead] = [moved.right, moved.up, moved.forward].map(|axis| along(axis, at));
            let seen = [right / ahead / tan_half, -up / ahead / tan_half].map(|t| 0.5 * side * (1.0 + t));
            [seen[0] - u, seen[1] - v]
        })
        .collect()
}

/// The lengths of the displacements, from the matrix's direct light. Each displacement is from a camera pixel to the centroid of the
/// projector pixels whose light it receives.
fn of_matrix(bench: &mut Bench, stage: &Stage) -> Result<Vec<f64>> {
    let matrix = bench.lab(stage)?.matrix(Part::Direct, 0)?;
    let width = stage.resolution.width;
    let mut sums = vec![[0.0; 3]; stage.pixels()];
    matrix.entries().for_each(|(row, column, weight)| {
        let [x, y] = [column % width, column / width].map(|at| at as f64);
        let own = [row % width, row / width].map(|at| at as f64);
        let sum = &mut sums[row];
        *sum = [sum[0] + weight, sum[1] + weight * (x - own[0]), sum[2] + weight * (y - own[1])];
    });
    Ok(sums.iter().filter(|sum| sum[0] > 0.0).map(|sum| (sum[1] / sum[0]).hypot(sum[2] / sum[0])).collect())
}

/// The lengths of the displacements by structured light, relative to the calibrated map.
fn of_codes(bench: &mut Bench, stage: &Stage) -> Result<Vec<f64>> {
    let lab = bench.devices(stage)?;
    let missing = || Error::Numerical("the virtual devices have no calibrated map of the lens".into());
    let rig = lab.rig().ok_or_else(missing)?;
    let map = rig.calibration.registration.lens.clone().ok_or_else(missing)?;
    let mut frames = rig.opener()(None)?;
    let decoded = StructuredLight::new(&mut *frames, Some(&rig.calibration.camera), None)?.codes()?;
    let border = decoded.step as f64;
    let side = stage.resolution.width as f64;
    let far = |seen: &[f64; 2]| seen.iter().all(|&at| at > border && at < side - border);
    // The displacement is averaged over each cell. Pixels at the border of the lit area are left out: partial light shifts their centroids.
    let mut cells: BTreeMap<[u64; 2], (usize, [f64; 2])> = BTreeMap::new();
    for seen in decoded.all().filter(|seen| far(&seen.at)) {
        let at = [seen.pixel % map.camera.width, seen.pixel / map.camera.width].map(|at| at as f64 + 0.5);
        let expected = map.to_projector(at);
        let (count, sum) = cells.entry(expected.map(|at| (at / CELL) as u64)).or_default();
        *count += 1;
        *sum = [0, 1].map(|axis| sum[axis] + seen.fine[axis] - expected[axis]);
    }
    let whole = cells.into_values().filter(|(count, _)| *count >= CODES);
    Ok(whole.map(|(count, sum)| sum[0].hypot(sum[1]) / count as f64).collect())
}

/// The median and the 95th percentile; NaN without values.
fn spread(lengths: impl IntoIterator<Item = f64>) -> [f64; 2] {
    let lengths: Vec<f64> = lengths.into_iter().collect();
    let at =
        |rank: f64| if lengths.is_empty() { f64::NAN } else { percentile(lengths.iter().copied(), rank) };
    [0.5, 0.95].map(at)
}

fn map(stage: &Stage) -> Panel {
    let beside = stage.set.scene().projector.map_or(0.0, |projector| f64::from(projector.position.x));
    let lengths = derived(stage, beside).into_iter().map(|[x, y]| x.hypot(y)).collect();
    let caption = format!("Disparity by geometry, the projector {:.0} mm aside, pixels", 1e3 * beside);
    stage.panel("disparity", caption, Content::Amounts(lengths))
}

fn plots(rows: &[Row]) -> Vec<Plot> {
    let line =
        |of: &dyn Fn(&Row) -> f64| -> Points { rows.iter().map(|row| (row.derived[1], of(row))).collect() };
    let axis = "disparity of 95 % of the pixels, at most";
    let residuals = [
        ("MINRES", line(&|row| row.minres.least_answered())),
        ("GMRES", line(&|row| row.gmres.least_answered())),
    ];
    let measured = [("measured", line(&|row| row.measured[1])), ("by geometry", line(&|row| row.derived[1]))];
    vec![
        Plot::logarithmic(
            format!(
                "The least residual within {PHOTOS} photos, not clamped: MINRES takes the matrix for symmetric."
            ),
            [axis, "relative residual"],
            residuals,
        ),
        Plot::linear(
            "The disparity as measured, against that by geometry; pixels.",
            [axis, "measured"],
            measured,
        ),
    ]
}
