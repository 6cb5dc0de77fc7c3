//! Answers from photos of random patterns, and from as many of the Lanczos process.

use super::contest::{Entry, TargetLight, clamped};
use super::dense::spectrum_of_rows;
use super::stage::Stage;
use crate::analysis::segment::{Graph, NormalizedAdjacency};
use crate::error::Result;
use crate::krylov::{Factorization, Lanczos, Start, Which, dot, norm};
use crate::operator::{Adjoint, Operator, Recorded};

/// Runs of more photos than this are wanted at their end only.
const EACH: usize = 50;

/// A photo that depends on those before has some 1e-16 of its norm left once they are removed: less than this share is rounding.
const ROUNDING: f64 = 1e-10;

/// The graph of exchanged light, by one or two photos.
pub(super) fn graph(global: &mut dyn Operator) -> Result<Graph> {
    let ones = vec![1.0; global.cols()];
    let mut photo = |pattern: &[f64]| {
        let mut photo = vec![0.0; pattern.len()];
        global.apply(pattern, &mut photo)?;
        Ok(photo)
    };
    let white = photo(&ones)?;
    Graph::measure(&white, 0.01, 0.0, photo)
}

/// The second eigenvector of the normalized cut, on all pixels, after each of so many photos of the Lanczos process.
pub(super) fn lanczos(
    global: &mut dyn Operator,
    graph: &Graph,
    photos: usize,
) -> Result<Vec<(f64, Vec<f64>)>> {
    let known = NormalizedAdjacency::known_vector(graph);
    let mut process = Lanczos::new(&Start::default().vector(known.len()), &[known])?;
    let mut cut = NormalizedAdjacency::new(global, graph);
    let mut found = Vec::new();
    for photo in 1..=photos {
        process.expand(&mut cut)?;
        // The vectors of a long run are wanted at its end only.
        if (photos <= EACH || photo == photos)
            && let Some(pair) = process.ritz(Which::LargestAlgebraic, 1)?.first()
        {
            found.push((photo as f64, graph.scatter(&process.ritz_vector(pair), 0.0)));
        }
    }
    Ok(found)
}

/// The same by random patterns (on all pixels), after each two photos: that of a pattern, and that of what it adds to the basis.
pub(super) fn sketch(
    global: &mut dyn Operator,
    graph: &Graph,
    patterns: &[Vec<f64>],
) -> Result<Vec<(f64, Vec<f64>)>> {
    let known = NormalizedAdjacency::known_vector(graph);
    let length = norm(&known);
    let known: Vec<f64> = known.iter().map(|value| value / length).collect();
    let mut cut = NormalizedAdjacency::new(global, graph);
    // The vectors of an orthonormal basis. None has an image: a photo is taken of each once it is made.
    let mut basis = vec![[known, Vec::new()]];
    let mut products: Vec<Vec<f64>> = Vec::new();
    let mut found = Vec::new();
    for pattern in patterns {
        let pattern: Vec<f64> = graph.pixels().iter().map(|&pixel| pattern[pixel]).collect();
        let mut photo = vec![0.0; pattern.len()];
        let mut pattern = [pattern, Vec::new()];
        make_orthonormal(&mut pattern, &basis[..1]);
        cut.apply(&pattern[0], &mut photo)?;
        let before = norm(&photo);
        let mut photo = [photo, Vec::new()];
        if make_orthonormal(&mut photo, &basis) <= ROUNDING * before {
            continue;
        }
        let mut product = vec![0.0; photo[0].len()];
        cut.apply(&photo[0], &mut product)?;
        basis.push(photo);
        products.push(product);
        let rows: Vec<Vec<f64>> = basis[1..]
            .iter()
            .map(|[vector, _]| products.iter().map(|product| dot(vector, product)).collect())
            .collect();
        let leading = spectrum_of_rows(&rows)?.vectors.swap_remove(0);
        let mut vector = vec![0.0; graph.pixels().len()];
        for (share, [column, _]) in leading.iter().zip(&basis[1..]) {
            vector.iter_mut().zip(column).for_each(|(sum, value)| *sum += share * value);
        }
        found.push((2.0 * products.len() as f64, graph.scatter(&vector, 0.0)));
    }
    Ok(found)
}

/// Makes the first of two vectors orthogonal to the first ones of `known`, which are orthonormal, and scales it to norm 1. The second one, which is a
/// linear function of the first, is changed alike. Returns the norm of what was left of the first; where it is 0, nothing is scaled.
pub(super) fn make_orthonormal(pair: &mut [Vec<f64>; 2], known: &[[Vec<f64>; 2]]) -> f64 {
    let [vector, image] = pair;
    // Rounding leaves some of the basis the first time.
    for _ in 0..2 {
        for [of, image_of] in known {
            let share = dot(of, vector);
            vector.iter_mut().zip(of).for_each(|(value, of)| *value -= share * of);
            image.iter_mut().zip(image_of).for_each(|(value, of)| *value -= share * of);
        }
    }
    let left = norm(vector);
    if left > 0.0 {
        vector.iter_mut().chain(image).for_each(|value| *value /= left);
    }
    left
}

/// The least-squares combination of `patterns` after each of their photos.
pub(super) fn fitted(
    stage: &Stage,
    operator: &mut dyn Adjoint,
    target_light: &TargetLight,
    patterns: &[Vec<f64>],
) -> Result<Entry> {
    let mut recorded = Recorded::of_frames(operator);
    let mut left = target_light.wanted();
    let mut entry = Entry { pattern: vec![0.0; left.len()], ..Entry::default() };
    // Photos made orthonormal, and the same combinations of patterns.
    let mut known: Vec<[Vec<f64>; 2]> = Vec::new();
    for pattern in patterns {
        let mut pair = [vec![0.0; left.len()], pattern.clone()];
        recorded.apply(pattern, &mut pair[0])?;
        if make_orthonormal(&mut pair, &known) > 0.0 {
            let share = dot(&pair[0], &left);
            left.iter_mut().zip(&pair[0]).for_each(|(left, value)| *left -= share * value);
            entry.pattern.iter_mut().zip(&pair[1]).for_each(|(sum, value)| *sum += share * value);
            known.push(pair);
        }
        entry.answered.push(target_light.residual(stage, &entry.pattern));
        entry.displayed.push(target_light.residual(stage, &clamped(&entry.pattern)));
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
        // Two pairs of pixels that exchange light within each, and a little between them.
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
        // It is +½ on one pair and −½ on the other.
        assert!((a[0] - a[1]).abs() < 1e-10 && (a[0] + a[2]).abs() < 1e-10, "{a:?}");
        Ok(())
    }
}
