//! Compares random patterns with Krylov methods, which make each pattern from the earlier photos, after equal numbers of photos.
//!
//! There are two problems. *Which vector separates the sheets of the zigzag?* Random patterns `ω` give photos `y = N ω`, which span a
//! subspace. Then an orthonormal basis `Q` of this subspace is photographed. The leading eigenvector of `Qᵀ N Q` gives the solution (Halko,
//! Martinsson and Tropp, doi:10.1137/090771806). Each random pattern costs two photos. *Which pattern makes the corner look like the
//! picture?* The solution is the combination of random patterns whose photos best approximate the target's light by least squares.

use super::bench::{Bench, Set};
use super::check::Check;
use super::contest::{MethodRun, TargetLight, clamped, over_frames, percent};
use super::figure::{Content, Figure, Panel, Plot, Points, Reproduced, counted, good_from};
use super::vectors::{add, make_orthonormal, overlap, product, spectrum_of_rows, unit};
use crate::analysis::low_rank::smooth_starts;
use crate::analysis::segment::{Cut, CutMatrix, Graph};
use crate::error::Result;
use crate::krylov::{Factorization, Method, Start, Which, dot, norm};
use crate::operator::{Adjoint, Operator, Recorded};
use crate::transport::Part;

const SIDE: usize = 100;
const PHOTOS: usize = 50;
/// The number of photos of the compensation by a Krylov method.
const FEW: usize = 10;
/// A Krylov method must need at most this fraction of the photos that random patterns need.
const SHARE: f64 = 0.5;
const SEED: u64 = 7;

pub(super) fn reproduce(bench: &mut Bench) -> Result<Reproduced> {
    let side = bench.side(SIDE);
    let (parting, mut checks) = parted(bench, side)?;
    let (plots, panels, stated) = compensation(bench, side)?;
    checks.extend(stated);
    Ok(Reproduced {
        setting: format!("zigzag and corner, {side}x{side}, {PHOTOS} photos of random patterns each"),
        checks,
        panels,
        plots: std::iter::once(parting).chain(plots).collect(),
        photos: 4 * PHOTOS + FEW,
        ..Reproduced::of(Figure::Random, bench.rig())
    })
}

/// The error of the vector that separates the sheets, by random patterns and by Lanczos.
fn parted(bench: &mut Bench, side: usize) -> Result<(Plot, Vec<Check>)> {
    let stage = bench.stage(Set::Zigzag, side)?;
    let reference = {
        let mut light = bench.truth(&stage, Part::Global)?;
        let graph = graph(&mut light)?;
        let found = lanczos(&mut light, &graph, 8 * PHOTOS)?.pop().map(|(_, vector)| vector);
        found.unwrap_or_default()
    };
    // The maximum avoids negative values due to rounding.
    let apart = |vector: &[f64]| (1.0 - overlap(vector, &reference)).max(0.0);
    let curve = |found: Vec<(f64, Vec<f64>)>| -> Points {
        found.into_iter().map(|(photos, vector)| (photos, apart(&vector))).collect()
    };
    let mut photos = bench.photos(&stage, Part::Global)?;
    let graph = graph(&mut photos)?;
    let krylov = curve(lanczos(&mut photos, &graph, PHOTOS)?);
    let n = stage.pixels();
    let signs = Start::Rademacher { seed: SEED }.block(n, PHOTOS / 2);
    let smooth = smooth_starts(stage.resolution, 0..PHOTOS / 2, SEED);
    let signs = curve(sketch(&mut photos, &graph, &signs)?);
    let smooth = curve(sketch(&mut photos, &graph, &smooth)?);
    let at_end = |curve: &[(f64, f64)]| curve.last().map_or(f64::NAN, |(_, apart)| *apart);
    let share_to =
        |curve: &Points, of: &Points| good_from(curve, |apart| apart <= at_end(of)) / PHOTOS as f64;
    let checks = vec![
        Check::of(format!(
            "photos that Lanczos needs to part the sheets as {PHOTOS} of random smooth patterns do, over {PHOTOS}"
        ))
        .at_most(share_to(&krylov, &smooth), SHARE)
        .refutes("random smooth patterns themselves", share_to(&smooth, &smooth)),
        Check::of(format!("photos that Lanczos needs to part the sheets as {PHOTOS} of random signs do, over {PHOTOS}"))
            .stated(share_to(&krylov, &signs)),
        Check::of(format!("one minus the overlap after {PHOTOS} photos, Lanczos")).stated(at_end(&krylov)),
        Check::of(format!("one minus the overlap after {PHOTOS} photos, random signs")).stated(at_end(&signs)),
        Check::of(format!("one minus the overlap after {PHOTOS} photos, random smooth patterns")).stated(at_end(&smooth)),
    ];
    let plot = Plot::logarithmic(
        "How far the vector that parts the sheets of the zigzag is from the true one (one minus overlap), at equal photos. Half of the \
         photos of random patterns are those of an orthonormal basis of what the other half showed.",
        ["photos", "1 − overlap"],
        [("Lanczos", krylov), ("random signs", signs), ("random smooth patterns", smooth)],
    );
    Ok((plot, checks))
}

fn compensation(bench: &mut Bench, side: usize) -> Result<(Vec<Plot>, Vec<Panel>, Vec<Check>)> {
    let stage = bench.stage(Set::Corner, side)?;
    let mut photos = bench.photos(&stage, Part::Full)?;
    let target_light = TargetLight::new(&stage, &mut photos, 0.0)?;
    let minres = target_light.run(&mut photos, (Method::Minres, false), FEW)?;
    let signs = Start::Rademacher { seed: SEED }.block(stage.pixels(), PHOTOS);
    let signs = fitted(&mut photos, &target_light, &signs)?;
    let smooth = smooth_starts(stage.resolution, 0..PHOTOS, SEED);
    let smooth = fitted(&mut photos, &target_light, &smooth)?;
    let share_to = |run: &MethodRun, of: &MethodRun| {
        good_from(&counted(&run.answered), |residual| residual <= of.answered_at(PHOTOS)) / PHOTOS as f64
    };
    let checks = vec![
        Check::of(format!(
            "photos that MINRES needs to compensate as {PHOTOS} of random smooth patterns do, over {PHOTOS}"
        ))
        .at_most(share_to(&minres, &smooth), SHARE)
        .refutes("random smooth patterns themselves", share_to(&smooth, &smooth)),
        Check::of(format!(
            "photos that MINRES needs to compensate as {PHOTOS} of random signs do, over {PHOTOS}"
        ))
        .stated(share_to(&minres, &signs)),
        Check::of(format!("residual before clamping, {FEW} photos of MINRES, %"))
            .stated(percent(minres.answered_at(FEW))),
        Check::of(format!("residual before clamping, {PHOTOS} photos of random signs, %"))
            .stated(percent(signs.answered_at(PHOTOS))),
        Check::of(format!("residual before clamping, {PHOTOS} photos of random smooth patterns, %"))
            .stated(percent(smooth.answered_at(PHOTOS))),
    ];
    let entries = [("MINRES", &minres), ("random signs", &signs), ("random smooth patterns", &smooth)];
    let lines = entries.map(|(name, entry)| (name, counted(&entry.answered)));
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
    let seen = |name: &str, caption: &str, entry: &MethodRun| {
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

/// Runs with more photos than this are evaluated only at the end.
const EACH: usize = 50;

/// A photo is new if at least this fraction of its norm remains after its components along the earlier photos are removed. A photo that
/// depends linearly on the earlier photos keeps about 1e-16 of its norm, which is rounding.
const ROUNDING: f64 = 1e-10;

/// The graph of exchanged light, from one or two photos.
pub(super) fn graph(global: &mut dyn Operator) -> Result<Graph> {
    let white = vec![1.0; global.cols()];
    let white = product(global, &white)?;
    Graph::measure(&white, 0.01, 0.0, |pattern| product(global, pattern))
}

/// The second eigenvector of the normalized cut, on all pixels, after each photo of a Lanczos process with `photos` photos.
pub(super) fn lanczos(
    global: &mut dyn Operator,
    graph: &Graph,
    photos: usize,
) -> Result<Vec<(f64, Vec<f64>)>> {
    let known = Cut::Normalized.known_vector(graph);
    let mut process = Factorization::lanczos(&Start::default().vector(known.len()), &[known])?;
    let mut cut = CutMatrix::new(global, graph, Cut::Normalized);
    let mut found = Vec::new();
    for photo in 1..=photos {
        process.expand(&mut cut)?;
        // For a long run, only the vector at its end is needed.
        if (photos <= EACH || photo == photos)
            && let Some(pair) = process.ritz(Which::LargestAlgebraic, 1)?.first()
        {
            found.push((photo as f64, graph.scatter(&process.ritz_vector(pair), 0.0)));
        }
    }
    Ok(found)
}

/// The second eigenvector by random patterns, on all pixels, after every two photos: a pattern's photo, and its new basis vector's photo.
fn sketch(global: &mut dyn Operator, graph: &Graph, patterns: &[Vec<f64>]) -> Result<Vec<(f64, Vec<f64>)>> {
    let known = unit(Cut::Normalized.known_vector(graph));
    let mut cut = CutMatrix::new(global, graph, Cut::Normalized);
    // The vectors of an orthonormal basis, each with its photo. The photo is empty until the vector is complete.
    let mut basis = vec![[known, Vec::new()]];
    let mut products: Vec<Vec<f64>> = Vec::new();
    let mut found = Vec::new();
    for pattern in patterns {
        let mut pattern = [graph.pixels().iter().map(|&pixel| pattern[pixel]).collect(), Vec::new()];
        make_orthonormal(&mut pattern, &basis[..1]);
        let mut photo = [product(&mut cut, &pattern[0])?, Vec::new()];
        let before = norm(&photo[0]);
        if make_orthonormal(&mut photo, &basis) <= ROUNDING * before {
            continue;
        }
        products.push(product(&mut cut, &photo[0])?);
        basis.push(photo);
        let row = |[vector, _]: &[Vec<f64>; 2]| products.iter().map(|product| dot(vector, product)).collect();
        let rows: Vec<Vec<f64>> = basis[1..].iter().map(row).collect();
        let leading = spectrum_of_rows(&rows)?.vectors.swap_remove(0);
        let mut vector = vec![0.0; graph.pixels().len()];
        leading.iter().zip(&basis[1..]).for_each(|(share, [column, _])| add(&mut vector, *share, column));
        found.push((2.0 * products.len() as f64, graph.scatter(&vector, 0.0)));
    }
    Ok(found)
}

/// The least-squares combination of `patterns` after each photo.
fn fitted(
    operator: &mut dyn Adjoint,
    target_light: &TargetLight<'_>,
    patterns: &[Vec<f64>],
) -> Result<MethodRun> {
    let mut recorded = Recorded::of_frames(operator);
    let mut left = target_light.wanted();
    let mut entry = MethodRun { pattern: vec![0.0; left.len()], ..MethodRun::default() };
    // Each entry has a photo, made orthonormal to the others, and the same linear combination of patterns.
    let mut known: Vec<[Vec<f64>; 2]> = Vec::new();
    for pattern in patterns {
        let mut pair = [product(&mut recorded, pattern)?, pattern.clone()];
        if make_orthonormal(&mut pair, &known) > 0.0 {
            let share = dot(&pair[0], &left);
            add(&mut left, -share, &pair[0]);
            add(&mut entry.pattern, share, &pair[1]);
            known.push(pair);
        }
        let answer = entry.pattern.clone();
        target_light.record(&answer, &mut entry);
    }
    entry.frames = recorded.frames;
    Ok(entry)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::operator::{Closure, Symmetry};

    #[test]
    fn a_sketch_of_all_directions_finds_what_lanczos_does() -> Result<()> {
        // There are two pairs of pixels. They exchange light within each pair, and a little between the pairs.
        let mut light = Closure::new(4, 4, Symmetry::Symmetric, |x: &[f64], y: &mut [f64]| {
            let pairs = [1, 0, 3, 2];
            let far = [2, 3, 0, 1];
            (0..4).for_each(|at| y[at] = x[pairs[at]] + 0.1 * x[far[at]]);
            Ok(())
        });
        let graph = graph(&mut light)?;
        let patterns = Start::Rademacher { seed: 3 }.block(4, 8);
        let by_sketch = sketch(&mut light, &graph, &patterns)?.pop();
        let by_lanczos = lanczos(&mut light, &graph, 3)?.pop();
        let (Some((_, a)), Some((_, b))) = (by_sketch, by_lanczos) else {
            unreachable!("patterns are given")
        };
        assert!((dot(&a, &b).abs() - 1.0).abs() < 1e-10, "rounding: {a:?} {b:?}");
        // The vector is +½ on one pair and −½ on the other.
        assert!((a[0] - a[1]).abs() < 1e-10 && (a[0] + a[2]).abs() < 1e-10, "{a:?}");
        Ok(())
    }
}
