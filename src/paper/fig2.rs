//! Figure 2: the principal eigenvector by optical power iteration.

use super::bench::Bench;
use super::check::Check;
use super::dense;
use super::figure::{Content, Figure, Panel, Plot, Reproduced};
use super::stage::{Set, Stage};
use crate::error::Result;
use crate::krylov::{EigsMethod, EigsOptions, Which, dot, eigs, norm};
use crate::operator::{Adjoint, Operator, Recorded};
use crate::report::plot::{LinePlot, Series};
use crate::transport::Part;

const SIDE: usize = 100;
/// Pixels per side for the dense eigensolver: 1024 unknowns.
const DENSE_SIDE: usize = 32;
const PHOTOS: usize = 50;

pub(super) fn reproduce(bench: &mut Bench) -> Result<Reproduced> {
    let small = bench.stage(Set::Room, DENSE_SIDE.min(bench.side(SIDE)))?;
    let (_, exact) = dense::principal(&small.traced.matrix.to_csr(Part::Full, 0)?)?;
    let from_small = iterate(&mut bench.photos(&small, Part::Full)?)?;
    let dense_overlap = overlap(&from_small.vector, &exact);

    let side = bench.side(SIDE);
    let stage = bench.stage(Set::Room, side)?;
    let reference = reference(&mut bench.truth(&stage, Part::Full)?)?;
    let found = iterate(&mut bench.photos(&stage, Part::Full)?)?;
    let least = found.vector.iter().copied().fold(f64::INFINITY, f64::min);
    let most = found.vector.iter().copied().fold(0.0, f64::max);
    let checks = vec![
        Check::at_least(
            format!("overlap with the dense eigenvector, {}", small.resolution),
            dense_overlap,
            0.999,
        ),
        Check::at_least(
            format!("overlap with the eigenvector by 400 Lanczos steps, {}", stage.resolution),
            overlap(&found.vector, &reference),
            0.999,
        ),
        Check::at_least("least entry, relative to the greatest", least / most, 0.0),
    ];
    let points =
        found.patterns.iter().enumerate().map(|(k, x)| (k as f64 + 1.0, 1.0 - overlap(x, &reference)));
    let curve = Series { name: "power iteration".into(), points: points.collect() };
    Ok(Reproduced {
        setting: format!("a white room, {}, {PHOTOS} photos from white", stage.resolution),
        checks,
        panels: panels(&stage, &found.vector, &reference),
        plots: vec![Plot {
            caption: "How far the pattern is from the principal eigenvector (one minus overlap).".into(),
            lines: LinePlot {
                x_label: "photos".into(),
                y_label: "1 − overlap".into(),
                logarithmic: true,
                series: vec![curve],
                marks: vec![(1e-3, "wanted".into())],
            },
        }],
        photos: PHOTOS,
        ..Reproduced::of(Figure::Fig2, bench.rig())
    })
}

struct Iterated {
    vector: Vec<f64>,
    patterns: Vec<Vec<f64>>,
}

/// The paper's Algorithm 1 from a white pattern: photos of nonnegative patterns are nonnegative.
fn iterate(operator: &mut dyn Adjoint) -> Result<Iterated> {
    let n = operator.cols();
    let mut recorded = Recorded::new(operator);
    let options = EigsOptions {
        count: 1,
        which: Which::LargestMagnitude,
        products: PHOTOS,
        tolerance: 0.0,
        method: EigsMethod::Power,
        start: crate::krylov::Start::Given(vec![1.0; n]),
        ..EigsOptions::default()
    };
    let found = eigs(&mut recorded, &options)?;
    let patterns = recorded.products.into_iter().map(|product| product.from).collect();
    Ok(Iterated { vector: found.vectors.into_iter().next().unwrap_or_default(), patterns })
}

/// The reference by Lanczos on the matrix itself, run to convergence.
fn reference(operator: &mut dyn Operator) -> Result<Vec<f64>> {
    let options = EigsOptions { count: 1, products: 400, tolerance: 1e-12, ..EigsOptions::default() };
    let found = eigs(operator, &options)?;
    Ok(found.vectors.into_iter().next().unwrap_or_default())
}

/// `|xᵀ y| / (‖x‖ ‖y‖)`, the absolute cosine of the angle between two vectors.
fn overlap(x: &[f64], y: &[f64]) -> f64 {
    dot(x, y).abs() / (norm(x) * norm(y))
}

fn panels(stage: &Stage, vector: &[f64], reference: &[f64]) -> Vec<Panel> {
    let difference: Vec<f64> = vector.iter().zip(reference).map(|(a, b)| a - b).collect();
    vec![
        stage.panel(
            "white",
            "The photo under white, W/(m² sr)",
            Content::Light { values: stage.white(), white: None },
        ),
        stage.panel("power", "The pattern after 50 photos, of norm 1", Content::Amounts(vector.to_vec())),
        stage.panel("reference", "The principal eigenvector", Content::Amounts(reference.to_vec())),
        stage.panel("difference", "Their difference", Content::Signed(difference)),
    ]
}
