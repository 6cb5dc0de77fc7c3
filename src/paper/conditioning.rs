//! Compares photos that are projected back unchanged with orthogonal patterns: how independent each set is, and the effect on errors.
//!
//! The vectors `x, N x, N² x, …` converge to the principal eigenvector. The condition number of the first `k` vectors grows by a factor
//! with each photo. A result that uses their differences multiplies the photos' errors by this number. The patterns of the Lanczos process
//! span the same space, and have the condition number 1.

use super::bench::{Bench, Set};
use super::check::Check;
use super::figure::{Content, Figure, Plot, Points, Reproduced, counted};
use super::random::graph;
use super::vectors::{add, conditions, make_orthonormal, product, spectrum_of_rows, unit};
use crate::analysis::segment::{Cut, CutMatrix, Graph};
use crate::error::Result;
use crate::krylov::{EigsOptions, Factorization, Start, dot, eigs};
use crate::operator::Operator;
use crate::transport::Part;

const SIDE: usize = 100;
const PHOTOS: usize = 30;
/// The number of photos at which the condition numbers are judged.
const JUDGED: usize = 20;
/// The required factor between the two condition numbers.
const WORSE: f64 = 100.0;

pub(super) fn reproduce(bench: &mut Bench) -> Result<Reproduced> {
    let stage = bench.stage(Set::Corner, bench.side(SIDE))?;
    let light = &mut bench.truth(&stage, Part::Global)?;
    let reference = second_eigenvalue(light)?;
    let photos = &mut bench.photos(&stage, Part::Global)?;
    let graph = graph(photos)?;
    let Bases { as_they_are, process, conditions: [power, photographed, orthogonal] } =
        Bases::of(photos, &graph)?;
    let truth = &mut bench.truth(&stage, Part::Global)?;
    let graph_of_light = self::graph(truth)?;
    let by_light = Bases::of(truth, &graph_of_light)?;

    let by_power = errors_by_power(&as_they_are, reference)?;
    let by_lanczos = errors_by_lanczos(&process, reference)?;
    let ratio = |[power, photographed, _]: &[Vec<f64>; 3]| at(power, JUDGED) / at(photographed, JUDGED);
    let measured = at(&power, JUDGED) / at(&photographed, JUDGED);
    let checks = vec![
        Check::of(format!(
            "condition number of {JUDGED} photos projected back as they are, over that of photos of orthogonal patterns"
        ))
        .at_least(measured, WORSE)
        .refutes("orthogonal patterns in their place", at(&orthogonal, JUDGED) / at(&photographed, JUDGED))
        .without("Without the devices, by the light itself,", ratio(&by_light.conditions)),
        Check::of(format!("condition number of {JUDGED} patterns, projected back as they are")).stated(at(&power, JUDGED)),
        Check::of(format!("condition number of {JUDGED} patterns that were made orthogonal")).stated(at(&orthogonal, JUDGED)),
        Check::of("condition number of the photos of these orthogonal patterns").stated(at(&photographed, JUDGED)),
        Check::of("second eigenvalue of the normalized cut by the light itself").stated(reference),
        Check::of(format!("error of that eigenvalue by {JUDGED} photos projected back as they are")).stated(by_power[JUDGED - 1].1),
        Check::of(format!("error of that eigenvalue by {JUDGED} photos of orthogonal patterns")).stated(by_lanczos[JUDGED - 1].1),
    ];
    let shown = |number: usize| {
        let values = graph.scatter(&as_they_are[number - 1][0], 0.0);
        let caption = format!("Photo {number} projected back as it is");
        stage.panel(format!("photo-{number}"), caption, Content::Signed(values))
    };
    let most = as_they_are.len();
    Ok(Reproduced {
        setting: format!(
            "corner, {}, {PHOTOS} photos of the normalized cut from random signs",
            stage.resolution
        ),
        checks,
        panels: [2, 5, 10, most - 1, most].map(shown).into(),
        plots: plots([power, photographed, orthogonal], by_power, by_lanczos),
        photos: 2 * PHOTOS,
        ..Reproduced::of(Figure::Conditioning, bench.rig())
    })
}

/// Two bases of the same Krylov subspace.
struct Bases {
    /// Patterns, of which each is the photo before it, and their photos.
    as_they_are: Vec<[Vec<f64>; 2]>,
    process: Factorization,
    /// Condition numbers of the first patterns as they are, of the photos of the orthogonal patterns, and of these patterns.
    conditions: [Vec<f64>; 3],
}

impl Bases {
    fn of(light: &mut dyn Operator, graph: &Graph) -> Result<Self> {
        let known = Cut::Normalized.known_vector(graph);
        let cut = &mut CutMatrix::new(light, graph, Cut::Normalized);
        let start = without(&known, Start::default().vector(known.len()));
        let as_they_are = projected_back(cut, &known, &start)?;
        let mut process = Factorization::lanczos(&start, std::slice::from_ref(&known))?;
        let mut made_orthogonal = Vec::new();
        for _ in 0..PHOTOS {
            let mut photo = vec![0.0; known.len()];
            process.expand(cut)?;
            // The photo of the last pattern follows from the stored coefficients of the process, without a product.
            let last = process.steps() - 1;
            for (row, vector) in process.basis().iter().chain(process.waiting()).enumerate() {
                add(&mut photo, process.entry(row, last), vector);
            }
            made_orthogonal.push(photo);
        }
        let patterns: Vec<Vec<f64>> = as_they_are.iter().map(|[pattern, _]| pattern.clone()).collect();
        let conditions =
            [conditions(&patterns)?, conditions(&made_orthogonal)?, conditions(process.basis())?];
        Ok(Self { as_they_are, process, conditions })
    }
}

fn at(values: &[f64], photos: usize) -> f64 {
    values.get(photos - 1).copied().unwrap_or(f64::NAN)
}

/// The second eigenvalue of the normalized cut, computed with the light transport itself.
fn second_eigenvalue(light: &mut dyn Operator) -> Result<f64> {
    let graph = graph(light)?;
    let options = EigsOptions {
        count: 1,
        products: 300,
        tolerance: 1e-12,
        deflate: vec![Cut::Normalized.known_vector(&graph)],
        ..EigsOptions::default()
    };
    let found = eigs(&mut CutMatrix::new(light, &graph, Cut::Normalized), &options)?;
    Ok(found.values.first().copied().unwrap_or(f64::NAN))
}

/// `vector` without its component along `known`, scaled to norm 1.
fn without(known: &[f64], mut vector: Vec<f64>) -> Vec<f64> {
    let share = dot(known, &vector) / dot(known, known);
    vector.iter_mut().zip(known).for_each(|(value, known)| *value -= share * known);
    unit(vector)
}

/// Patterns of norm 1 and their photos. Each pattern is the previous photo without the known vector.
fn projected_back(operator: &mut dyn Operator, known: &[f64], start: &[f64]) -> Result<Vec<[Vec<f64>; 2]>> {
    let mut pairs = Vec::new();
    let mut pattern = start.to_vec();
    for _ in 0..PHOTOS {
        let photo = product(operator, &pattern)?;
        let next = without(known, photo.clone());
        pairs.push([std::mem::replace(&mut pattern, next), photo]);
    }
    Ok(pairs)
}

/// The error of the largest Ritz value in the span of the first `k` patterns, for each `k`. With `X = Q R`, the photos of `Q` are the
/// photos of `X` times `R⁻¹`. The errors of these photos are transformed in the same way.
fn errors_by_power(pairs: &[[Vec<f64>; 2]], reference: f64) -> Result<Points> {
    let mut basis: Vec<[Vec<f64>; 2]> = Vec::new();
    let mut found = Vec::new();
    for pair in pairs {
        let mut pair = pair.clone();
        make_orthonormal(&mut pair, &basis);
        basis.push(pair);
        let row = |[vector, _]: &[Vec<f64>; 2]| basis.iter().map(|[_, photo]| dot(vector, photo)).collect();
        let value = spectrum_of_rows(&basis.iter().map(row).collect::<Vec<_>>())?.values[0];
        found.push((found.len() as f64 + 1.0, (value - reference).abs() / reference));
    }
    Ok(found)
}

/// The errors as in [`errors_by_power`], but for the patterns of the Lanczos process.
fn errors_by_lanczos(process: &Factorization, reference: f64) -> Result<Points> {
    let error = |steps: usize| {
        let row = |i: usize| (0..steps).map(|j| process.entry(i, j)).collect();
        let value = spectrum_of_rows(&(0..steps).map(row).collect::<Vec<_>>())?.values[0];
        Ok((steps as f64, (value - reference).abs() / reference))
    };
    (1..=process.steps()).map(error).collect()
}

fn plots(conditions: [Vec<f64>; 3], by_power: Points, by_lanczos: Points) -> Vec<Plot> {
    let names = ["photos projected back as they are", "photos of orthogonal patterns", "orthogonal patterns"];
    vec![
        Plot::logarithmic(
            "Condition number of the first k vectors, each of norm 1. Where noise is in the photos, the first line stops near the inverse of \
             their relative noise: what differs then is noise.",
            ["photos", "condition number"],
            names.into_iter().zip(conditions.iter().map(|values| counted(values))),
        ),
        Plot::logarithmic(
            "Relative error of the second eigenvalue of the normalized cut, from the same space by either basis. An error of the photos grows \
             by the condition number of the basis.",
            ["photos", "relative error"],
            [("photos projected back as they are", by_power), ("orthogonal patterns", by_lanczos)],
        ),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::operator::{Closure, Symmetry};

    #[test]
    fn both_bases_find_the_eigenvalue_where_photos_are_exact() -> Result<()> {
        let n = 40;
        let mut light = Closure::new(n, n, Symmetry::Symmetric, |x: &[f64], y: &mut [f64]| {
            y.iter_mut().zip(x).enumerate().for_each(|(i, (y, x))| *y = 0.7_f64.powi(i as i32) * x);
            Ok(())
        });
        // The known vector is the first eigenvector, and 0.7 is the second eigenvalue.
        let known: Vec<f64> = (0..n).map(|i| f64::from(u8::from(i == 0))).collect();
        let start = without(&known, vec![1.0; n]);
        let pairs = projected_back(&mut light, &known, &start)?;
        let mut process = Factorization::lanczos(&start, std::slice::from_ref(&known))?;
        for _ in 0..8 {
            process.expand(&mut light)?;
        }
        let [power, lanczos] = [errors_by_power(&pairs, 0.7)?, errors_by_lanczos(&process, 0.7)?];
        // Three exact photos give the same error for both bases. The rounding error is 1e-16 times a small condition number.
        assert!((power[2].1 - lanczos[2].1).abs() < 1e-10, "{:?} {:?}", power[2], lanczos[2]);
        assert!(lanczos[7].1 < 1e-6, "eight photos of a geometric spectrum: {lanczos:?}");
        Ok(())
    }
}
