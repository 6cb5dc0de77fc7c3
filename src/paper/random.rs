//! Random patterns at equal photos: what Krylov methods gain by making each pattern from the photos before.
//!
//! Two questions are asked of as many photos. *Which vector parts the sheets of the zigzag?* Random patterns `ω` give photos `y = N ω` that
//! span a space; an orthonormal basis `Q` of it is photographed in turn, and the leading eigenvector of `Qᵀ N Q` answers (Halko, Martinsson
//! and Tropp, doi:10.1137/090771806), two photos for each random pattern. *What makes the corner look like the picture?* The combination of
//! random patterns whose photos add up to the target's light with least squares.

use super::bench::Bench;
use super::check::Check;
use super::compensated::percent;
use super::contest::{Entry, TargetLight, clamped, enter, line, over_frames};
use super::figure::{Content, Figure, Panel, Plot, Reproduced};
use super::sketch::{fitted, graph, lanczos, sketch};
use super::stage::Set;
use super::target::picture;
use crate::analysis::low_rank::smooth_starts;
use crate::error::Result;
use crate::krylov::{Method, Start, dot, norm};
use crate::report::plot::Series;
use crate::transport::Part;

const SIDE: usize = 100;
const PHOTOS: usize = 50;
/// Photos of the compensation by a Krylov method.
const FEW: usize = 10;
/// Krylov methods need at most this share of the random patterns' photos.
const SHARE: f64 = 0.5;
const SEED: u64 = 7;

pub(super) fn reproduce(bench: &mut Bench) -> Result<Reproduced> {
    let side = bench.side(SIDE);
    let (parting, mut checks) = parted(bench, side)?;
    let (compensation, panels, stated) = compensated(bench, side)?;
    checks.extend(stated);
    Ok(Reproduced {
        setting: format!("zigzag and corner, {side}x{side}, {PHOTOS} photos of random patterns each"),
        checks,
        panels,
        plots: std::iter::once(parting).chain(compensation).collect(),
        photos: 4 * PHOTOS + FEW,
        ..Reproduced::of(Figure::Random, bench.rig())
    })
}

/// How far the vector that parts the sheets is from the true one, by random patterns and by Lanczos.
fn parted(bench: &mut Bench, side: usize) -> Result<(Plot, Vec<Check>)> {
    let stage = bench.stage(Set::Zigzag, side)?;
    let reference = {
        let mut light = bench.truth(&stage, Part::Global)?;
        let graph = graph(&mut light)?;
        let found = lanczos(&mut light, &graph, 8 * PHOTOS)?.pop().map(|(_, vector)| vector);
        found.unwrap_or_default()
    };
    // Rounding must not make it negative.
    let apart =
        |vector: &[f64]| (1.0 - dot(vector, &reference).abs() / (norm(vector) * norm(&reference))).max(0.0);
    let curve = |found: Vec<(f64, Vec<f64>)>| -> Vec<(f64, f64)> {
        found.into_iter().map(|(photos, vector)| (photos, apart(&vector))).collect()
    };
    let mut photos = bench.photos(&stage, Part::Global)?;
    let graph = graph(&mut photos)?;
    let krylov = curve(lanczos(&mut photos, &graph, PHOTOS)?);
    let n = stage.pixels();
    let signs = Start::Rademacher { seed: SEED }.block(n, PHOTOS / 2);
    let smooth = smooth_starts(stage.resolution, PHOTOS / 2, SEED);
    let signs = curve(sketch(&mut photos, &graph, &signs)?);
    let smooth = curve(sketch(&mut photos, &graph, &smooth)?);
    let best = |curve: &[(f64, f64)]| curve.iter().map(|(_, apart)| *apart).fold(f64::INFINITY, f64::min);
    let checks = vec![
        Check::at_most(
            format!("photos of Lanczos to part the sheets as {PHOTOS} of random signs do, over {PHOTOS}"),
            photos_to(&krylov, best(&signs)) / PHOTOS as f64,
            SHARE,
        ),
        Check::at_most(
            format!("the same for random smooth patterns, over {PHOTOS}"),
            photos_to(&krylov, best(&smooth)) / PHOTOS as f64,
            SHARE,
        ),
        Check::stated(format!("one less the overlap after {PHOTOS} photos, Lanczos"), best(&krylov)),
        Check::stated("the same by random signs", best(&signs)),
        Check::stated("the same by random smooth patterns", best(&smooth)),
    ];
    let plot = Plot::logarithmic(
        "How far the vector that parts the sheets of the zigzag is from the true one (one minus overlap), at equal photos. Half of the \
         photos of random patterns are those of an orthonormal basis of what the other half showed.",
        ["photos", "1 − overlap"],
        vec![
            Series { name: "Lanczos".into(), points: krylov },
            Series { name: "random signs".into(), points: signs },
            Series { name: "random smooth patterns".into(), points: smooth },
        ],
    );
    Ok((plot, checks))
}

/// The first number of photos from which on a curve is down to `wanted`; infinite if it is not at its end.
fn photos_to(curve: &[(f64, f64)], wanted: f64) -> f64 {
    let from = curve.iter().rposition(|&(_, apart)| apart.is_nan() || apart > wanted).map_or(0, |at| at + 1);
    curve.get(from).map_or(f64::INFINITY, |&(photos, _)| photos)
}

/// Compensation of the corner by random patterns and by MINRES.
fn compensated(bench: &mut Bench, side: usize) -> Result<(Vec<Plot>, Vec<Panel>, Vec<Check>)> {
    let stage = bench.stage(Set::Corner, side)?;
    let mut photos = bench.photos(&stage, Part::Full)?;
    let target_light = TargetLight::new(&stage, &mut photos, &picture(side))?;
    let minres = enter(&stage, &mut photos, &target_light, (Method::Minres, false), FEW)?;
    let signs = Start::Rademacher { seed: SEED }.block(stage.pixels(), PHOTOS);
    let signs = fitted(&stage, &mut photos, &target_light, &signs)?;
    let smooth = smooth_starts(stage.resolution, PHOTOS, SEED);
    let smooth = fitted(&stage, &mut photos, &target_light, &smooth)?;
    let points = |entry: &Entry| -> Vec<(f64, f64)> { line("", &entry.answered).points };
    let checks = vec![
        Check::at_most(
            format!("photos of MINRES to compensate as {PHOTOS} of random signs do, over {PHOTOS}"),
            photos_to(&points(&minres), signs.least_answered()) / PHOTOS as f64,
            SHARE,
        ),
        Check::at_most(
            format!("the same for random smooth patterns, over {PHOTOS}"),
            photos_to(&points(&minres), smooth.least_answered()) / PHOTOS as f64,
            SHARE,
        ),
        Check::stated(
            format!("residual without a box, {FEW} photos of MINRES, %"),
            percent(minres.answered_at(FEW)),
        ),
        Check::stated(
            format!("the same by {PHOTOS} photos of random signs, %"),
            percent(signs.answered_at(PHOTOS)),
        ),
        Check::stated("by random smooth patterns, %", percent(smooth.answered_at(PHOTOS))),
    ];
    let entries = [("MINRES", &minres), ("random signs", &signs), ("random smooth patterns", &smooth)];
    let lines = entries.iter().map(|(name, entry)| line(name, &entry.answered)).collect();
    let mut plots = vec![Plot::logarithmic(
        "Relative residual of the compensation of the corner by the light itself, answers not clamped, at equal photos.",
        ["photos", "relative residual"],
        lines,
    )];
    let frames = over_frames(&entries);
    if !frames.is_empty() {
        let caption = "The same, clamped to what can be displayed, at equal frames.";
        plots.push(Plot::logarithmic(caption, ["frames", "relative residual"], frames));
    }
    let seen = |name: &str, caption: &str, entry: &Entry| {
        let values = stage.photo(&clamped(&entry.pattern));
        stage.panel(name, caption, Content::Light { values, white: Some(target_light.peak) })
    };
    let panels = vec![
        seen("minres", "Compensated by 10 photos of MINRES, clamped", &minres),
        seen("signs", "By 50 photos of random signs, clamped", &signs),
        seen("smooth", "By 50 photos of random smooth patterns, clamped", &smooth),
    ];
    Ok((plots, panels, checks))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn photos_until_as_good_are_counted_from_the_last_that_was_worse() {
        let curve = [(1.0, 0.5), (2.0, 0.1), (3.0, 0.2), (4.0, 0.05)];
        assert_eq!(photos_to(&curve, 0.15), 4.0);
        assert_eq!(photos_to(&curve, 0.6), 1.0);
        assert_eq!(photos_to(&curve, 0.01), f64::INFINITY);
    }
}
