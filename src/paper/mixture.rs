//! Appendix B: power iteration where the largest eigenvalue is not distinct.
//!
//! The two sheets of the zigzag exchange no light, so the matrix `D^-½ G D^-½` of the normalized cut has the eigenvalue 1 once for each of
//! them. The principal eigenvectors are `D^½` on one sheet and 0 on the other, which are not negative (appendix A). Power iteration from `b`
//! converges to the part of `b` in their span: a mixture that depends on where it starts.

use super::bench::{Bench, Set, Stage};
use super::check::Check;
use super::figure::{Content, Figure, Panel, Plot, Reproduced, counted};
use super::random::graph;
use super::vectors::{add, dot, outside, overlap, product, unit};
use crate::analysis::segment::{Cut, CutMatrix, Graph};
use crate::error::Result;
use crate::krylov::Start;
use crate::operator::Operator;
use crate::transport::Part;

const SIDE: usize = 100;
const PHOTOS: usize = 20;
const ALIKE: f64 = 0.999;

pub(super) fn reproduce(bench: &mut Bench) -> Result<Reproduced> {
    let stage = bench.stage(Set::Zigzag, bench.side(SIDE))?;
    let sheets = {
        let light = &mut bench.truth(&stage, Part::Global)?;
        principal(&graph(light)?, &stage)
    };
    let photos = &mut bench.photos(&stage, Part::Global)?;
    let graph = graph(photos)?;
    let on_graph = |all: Vec<f64>| -> Vec<f64> { graph.pixels().iter().map(|&pixel| all[pixel]).collect() };
    let width = stage.resolution.width;
    let left_half = |pixel: usize| f64::from(u8::from(2 * (pixel % width) < width));
    let starts = [
        ("white", vec![1.0; stage.pixels()]),
        ("a brighter left half", (0..stage.pixels()).map(|pixel| 1.0 + 3.0 * left_half(pixel)).collect()),
        ("random signs", Start::default().vector(stage.pixels())),
    ];
    let starts = starts.map(|(name, all)| (name, on_graph(all)));
    let mut cut = CutMatrix::new(photos, &graph, Cut::Normalized);
    let mut runs = Vec::new();
    for (_, start) in &starts {
        runs.push(power_iteration(&mut cut, start)?);
    }
    let sheets = sheets.map(on_graph);
    let mixtures: Vec<Vec<f64>> = starts.iter().map(|(_, start)| mixture(start, &sheets)).collect();
    let last = |run: usize| runs[run].last().map_or(&[][..], Vec::as_slice);
    let mut checks: Vec<Check> = (0..starts.len())
        .map(|run| {
            let other = &mixtures[(run + 1) % mixtures.len()];
            Check::of(format!(
                "overlap of {PHOTOS} photos from {} with the mixture that follows from it",
                starts[run].0
            ))
            .at_least(overlap(last(run), &mixtures[run]), ALIKE)
            .refutes("the mixture of another start", overlap(last(run), other))
        })
        .collect();
    checks.extend([
        Check::of("part of the last photos outside the two principal eigenvectors, the largest")
            .at_most((0..runs.len()).map(|run| outside(last(run), &sheets)).fold(0.0, f64::max), 0.05)
            .refutes("the first pattern of random signs", outside(&starts[2].1, &sheets)),
        Check::of("overlap of the last photos from white and from random signs")
            .stated(overlap(last(0), last(2))),
    ]);
    let lines = starts.iter().zip(&runs).map(|((name, _), run)| {
        let apart: Vec<f64> = run.iter().map(|x| outside(x, &sheets)).collect();
        (*name, counted(&apart))
    });
    let shown = |(run, (name, _)): (usize, &(&str, Vec<f64>))| -> Panel {
        let caption = format!("After {PHOTOS} photos from {name}");
        stage.panel(format!("from-{}", run + 1), caption, Content::Signed(graph.scatter(last(run), 0.0)))
    };
    Ok(Reproduced {
        setting: format!(
            "the normalized cut of zigzag, {}, {PHOTOS} photos from each of three patterns",
            stage.resolution
        ),
        checks,
        panels: starts.iter().enumerate().map(shown).collect(),
        plots: vec![Plot::logarithmic(
            "The part of the pattern outside the span of the two principal eigenvectors. All starts lead into the span, each to another vector of it.",
            ["photos", "part outside"],
            lines,
        )],
        photos: 1 + 3 * PHOTOS,
        ..Reproduced::of(Figure::Mixture, bench.rig())
    })
}

/// The two principal eigenvectors of the normalized cut, on all pixels: `D^½` on one of the true sheets, 0 elsewhere, of norm 1.
fn principal(graph: &Graph, stage: &Stage) -> [Vec<f64>; 2] {
    let known = graph.scatter(&Cut::Normalized.known_vector(graph), 0.0);
    [0, 1].map(|sheet| {
        unit(
            known
                .iter()
                .zip(&stage.truth)
                .map(|(value, of)| if *of == sheet { *value } else { 0.0 })
                .collect(),
        )
    })
}

/// The part of `start` in the span of two orthonormal vectors, the limit of power iteration.
fn mixture(start: &[f64], sheets: &[Vec<f64>; 2]) -> Vec<f64> {
    let mut mixture = vec![0.0; start.len()];
    sheets.iter().for_each(|sheet| add(&mut mixture, dot(sheet, start), sheet));
    mixture
}

fn power_iteration(operator: &mut dyn Operator, start: &[f64]) -> Result<Vec<Vec<f64>>> {
    let mut patterns = vec![unit(start.to_vec())];
    for photo in 0..PHOTOS {
        patterns.push(unit(product(operator, &patterns[photo])?));
    }
    Ok(patterns.split_off(1))
}
