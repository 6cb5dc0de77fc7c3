//! Solvers inside the box [0, 1]: the true optimum, at a stated number of photos, never outside, never worse than
//! doing nothing.
#![allow(clippy::unwrap_used, clippy::panic, reason = "in a test a panic is the report")]

use std::sync::Arc;

use crate::krylov_gallery::{Dense, defocused, diagonal, light_like, misfit, random, turned};
use krylux::Error;
use krylux::krylov::{
    Constraint, METHODS, Method, Solution, SolveOptions, Status, Surrogate, norm, solve, solve_adjoint,
    solve_from,
};
use krylux::operator::Symmetry;

const BOXED: [Method; 3] = [Method::Jacobi, Method::Fista, Method::KrylovBox];
const SIDE: usize = 10;
const N: usize = SIDE * SIDE;

/// The target on the scene: a picture with black and bright parts, at half of the scene's direct light.
fn wanted(scale: f64) -> Vec<f64> {
    (0..N)
        .map(|i| {
            let (x, y) = ((i % SIDE) as f64 / SIDE as f64, (i / SIDE) as f64 / SIDE as f64);
            let inside = (x - 0.5).powi(2) + (y - 0.4).powi(2) < 0.1;
            if inside { scale * (0.5 + 0.5 * x) } else { 0.15 * scale * y }
        })
        .collect()
}

/// In focus with much indirect light; nearly all of it indirect; and out of focus.
pub fn scenes() -> [(&'static str, Dense, Vec<f64>); 3] {
    [
        ("direct", light_like(SIDE, 0.4), wanted(0.15)),
        ("indirect", light_like(SIDE, 4.0), wanted(0.4)),
        ("defocused", defocused(&light_like(SIDE, 0.4), SIDE, 1.5), wanted(0.15)),
    ]
}

fn white(matrix: &Dense) -> Vec<f64> {
    matrix.times(&vec![1.0; matrix.cols])
}

fn run(method: Method, matrix: &Dense, b: &[f64], products: usize) -> Solution {
    let mut matrix = matrix.clone();
    let options =
        SolveOptions { products, rtol: 0.0, diagonal: Some(white(&matrix)), ..SolveOptions::default() };
    let found = solve(method, &mut matrix, b, &options).unwrap();
    assert_eq!(found.stats.products, matrix.products(), "{method:?}: products reported and taken");
    assert!(matrix.products() <= products && found.history.len() == matrix.products());
    found
}

fn inside(x: &[f64], lower: f64, upper: f64) -> bool {
    x.iter().all(|x| (lower..=upper).contains(x))
}

/// The optimum by coordinate descent on the dense normal equations: another method, on other data.
fn optimum(matrix: &Dense, b: &[f64], lower: f64, upper: f64) -> (Vec<f64>, f64) {
    let n = matrix.cols;
    let columns: Vec<Vec<f64>> =
        (0..n).map(|j| (0..matrix.rows).map(|i| matrix.entries[i * n + j]).collect()).collect();
    let mut x = vec![lower.max(0.0).min(upper); n];
    let mut r: Vec<f64> = matrix.times(&x).iter().zip(b).map(|(y, b)| b - y).collect();
    for _ in 0..20_000 {
        let mut moved = 0.0_f64;
        for (j, column) in columns.iter().enumerate() {
            let square = krylux::krylov::dot(column, column);
            let next = (x[j] + krylux::krylov::dot(column, &r) / square).clamp(lower, upper);
            let step = next - x[j];
            x[j] = next;
            moved = moved.max(step.abs());
            r.iter_mut().zip(column).for_each(|(r, a)| *r -= step * a);
        }
        if moved < 1e-9 {
            break;
        }
    }
    let residual = misfit(matrix, &x, b) / norm(b);
    (x, residual)
}

#[test]
fn fista_and_krylov_box_find_the_true_optimum() {
    for (name, matrix, b) in scenes() {
        let (_, best) = optimum(&matrix, &b, 0.0, 1.0);
        assert!(best > 1e-3, "{name}: the box binds, or there is nothing to test: {best}");
        for (method, products) in [(Method::Fista, 2000), (Method::KrylovBox, 60)] {
            let found = run(method, &matrix, &b, products);
            assert!(inside(&found.x, 0.0, 1.0), "{name}, {method:?}");
            // Coordinate descent stops at moves of 1e-9, and cannot be beaten by more than what that leaves.
            assert!(found.residual >= best * (1.0 - 1e-6), "{name}, {method:?}: {} {best}", found.residual);
            assert!(found.residual <= best * 1.001, "{name}, {method:?}: {} {best}", found.residual);
        }
    }
}

#[test]
fn krylov_box_is_near_the_optimum_after_few_photos_and_ahead_of_the_others() {
    for (name, matrix, b) in scenes() {
        let (_, best) = optimum(&matrix, &b, 0.0, 1.0);
        let ours = run(Method::KrylovBox, &matrix, &b, 15);
        let at = |photos: usize| ours.history[..photos].last().unwrap().best / best;
        // The figures promised for a corner in focus and for strong defocus, on these synthetic scenes.
        if name == "direct" {
            assert!(at(3) < 1.02, "{name}: {} after 3 photos", at(3));
        }
        assert!(at(12) < 1.05, "{name}: {} after 12 photos", at(12));
        if name == "direct" {
            assert!(at(15) < 1.005, "{name}: {} after 15 photos", at(15));
        }
        for method in [Method::Jacobi, Method::Fista] {
            let other = run(method, &matrix, &b, 15);
            assert!(ours.residual <= other.residual * 1.0001, "{name}: {method:?} has {}", other.residual);
        }
    }
}

#[test]
fn inside_the_box_is_never_worse_than_not_compensating_at_all() {
    for (name, matrix, b) in scenes() {
        // Not compensating: the wanted picture itself as the pattern, as bright as the white photo allows.
        let d = white(&matrix);
        let naive: Vec<f64> = b.iter().zip(&d).map(|(b, d)| (b / d).clamp(0.0, 1.0)).collect();
        let uncompensated = misfit(&matrix, &naive, &b) / norm(&b);
        for method in BOXED {
            for photos in 1..=12 {
                let found = run(method, &matrix, &b, photos);
                assert!(
                    found.residual <= uncompensated * (1.0 + 1e-12),
                    "{name}, {method:?}, {photos} photos"
                );
            }
        }
    }
}

#[test]
fn residuals_that_are_reported_are_true_and_patterns_stay_inside() {
    for (name, matrix, b) in scenes() {
        for facts in METHODS.iter().filter(|facts| facts.constraint != Constraint::None) {
            let found = run(facts.method, &matrix, &b, 25);
            let truth = misfit(&matrix, &found.x, &b) / norm(&b);
            // krylov-box and MRNSD update the residual by linearity: rounding of 25 updates.
            assert!((truth - found.residual).abs() < 1e-12, "{name}, {}: {truth}", facts.name);
            let upper = if facts.constraint == Constraint::Box { 1.0 } else { f64::INFINITY };
            assert!(inside(&found.x, 0.0, upper), "{name}, {}", facts.name);
        }
    }
}

#[test]
fn descent_methods_never_rise() {
    for (name, matrix, b) in scenes() {
        for method in [Method::KrylovBox, Method::Mrnsd, Method::Multiplicative] {
            let found = run(method, &matrix, &b, 30);
            for pair in found.history.windows(2) {
                assert!(pair[1].residual <= pair[0].residual * (1.0 + 1e-12), "{name}, {method:?}: {pair:?}");
            }
            assert!(
                found.history[29].residual < 0.95 * found.history[0].residual.min(1.0),
                "{name}, {method:?}"
            );
        }
    }
}

#[test]
fn floor_of_the_box_is_kept() {
    let (_, matrix, b) = scenes().into_iter().next().unwrap();
    let (_, best) = optimum(&matrix, &b, 0.2, 0.7);
    for method in BOXED {
        let mut matrix = matrix.clone();
        let options =
            SolveOptions { lower: 0.2, upper: 0.7, products: 40, rtol: 0.0, ..SolveOptions::default() };
        let found = solve(method, &mut matrix, &b, &options).unwrap();
        assert!(inside(&found.x, 0.2, 0.7), "{method:?}");
        // Jacobi's fixed point is another than the optimum; it is near.
        let within = if method == Method::Jacobi { 1.1 } else { 1.01 };
        assert!(found.residual < best * within, "{method:?}: {} {best}", found.residual);
    }
}

#[test]
fn white_photo_is_taken_once_and_counted_when_it_is_not_given() {
    let (_, matrix, b) = scenes().into_iter().next().unwrap();
    for facts in METHODS.iter().filter(|facts| facts.constraint != Constraint::None) {
        let given = run(facts.method, &matrix, &b, 9);
        let mut counted = matrix.clone();
        let options = SolveOptions { products: 10, rtol: 0.0, ..SolveOptions::default() };
        let found = solve(facts.method, &mut counted, &b, &options).unwrap();
        assert_eq!((found.stats.products, counted.products()), (10, 10), "{}", facts.name);
        assert!(found.history[0].residual.is_infinite(), "{}: no residual is known yet", facts.name);
        assert_eq!(found.x, given.x, "{}: one photo later, the same", facts.name);
    }
}

#[test]
fn reachable_pictures_are_reached_to_the_tolerance() {
    let matrix = light_like(SIDE, 0.4);
    let pattern: Vec<f64> = (0..N).map(|i| 0.5 + 0.4 * (i as f64).sin()).collect();
    let b = matrix.times(&pattern);
    for method in BOXED {
        let options = SolveOptions { products: 2000, rtol: 1e-6, ..SolveOptions::default() };
        let found = solve(method, &mut matrix.clone(), &b, &options).unwrap();
        assert_eq!(found.stats.status, Status::ReachedTolerance, "{method:?}: {found:?}");
        assert!(misfit(&matrix, &found.x, &b) <= 1.001e-6 * norm(&b), "{method:?}");
    }
}

#[test]
fn krylov_box_knows_when_it_is_at_the_optimum() {
    let (_, matrix, b) = scenes().into_iter().next().unwrap();
    let (_, best) = optimum(&matrix, &b, 0.0, 1.0);
    let options = SolveOptions { products: 200, rtol: 1e-5, ..SolveOptions::default() };
    let found = solve(Method::KrylovBox, &mut matrix.clone(), &b, &options).unwrap();
    assert_eq!(found.stats.status, Status::ConstrainedOptimum, "{:?}", found.stats);
    // A predicted gain of at most 1e-5, by a model with the true gradient.
    assert!(found.residual <= best * 1.001, "{} {best}", found.residual);
    let mut general = matrix.clone();
    general.symmetry = Symmetry::General;
    let found = solve(Method::KrylovBox, &mut general, &b, &options).unwrap();
    assert_ne!(found.stats.status, Status::ConstrainedOptimum, "without symmetry it cannot know");
    assert!(found.residual <= best * 1.05, "Broyden's model is good, too: {} {best}", found.residual);
}

/// Products with a given matrix, both ways.
struct Known(Dense);

impl Surrogate for Known {
    fn size(&self) -> usize {
        self.0.rows
    }
    fn fitted(&self, patterns: &[Vec<f64>], products: &[Vec<f64>]) -> Arc<dyn Surrogate> {
        assert!(patterns.len() == products.len() && patterns.iter().all(|pattern| pattern.len() == N));
        Arc::new(Self(self.0.clone()))
    }
    fn apply(&self, x: &[f64], y: &mut [f64]) {
        y.copy_from_slice(&self.0.times(x));
    }
    fn apply_adjoint(&self, y: &[f64], x: &mut [f64]) {
        x.copy_from_slice(&self.0.transposed_times(y));
    }
}

#[test]
fn a_surrogate_with_its_transpose_brings_an_unsymmetric_operator_to_the_optimum() {
    // Only the projector is out of focus: rows are scaled by another albedo than columns are.
    let sharp = light_like(SIDE, 0.4);
    let blurred = defocused(&sharp, SIDE, 1.2);
    let scaled = |factor: f64| {
        let entry = |i: usize, j: usize| {
            let albedo = 1.0 + 0.5 * ((i * i) as f64).sin();
            // The part that the surrogate does not know looks like nothing in particular.
            albedo * blurred.entries[i * N + j] * (1.0 + factor * ((i * 31 + j * 17) as f64).sin())
        };
        Dense::new(N, N, entry)
    };
    let (matrix, b) = (scaled(0.05), wanted(0.15));
    let (_, best) = optimum(&matrix, &b, 0.0, 1.0);
    let solve_with = |surrogate: Option<Arc<dyn Surrogate>>| {
        let diagonal = Some(white(&matrix));
        let options =
            SolveOptions { products: 12, rtol: 0.0, diagonal, surrogate, ..SolveOptions::default() };
        solve(Method::KrylovBox, &mut matrix.clone(), &b, &options).unwrap()
    };
    let (without, with) = (solve_with(None), solve_with(Some(Arc::new(Known(scaled(0.0))))));
    println!("over the optimum: {:.4} without, {:.4} with", without.residual / best, with.residual / best);
    assert!(with.residual <= 1.01 * best, "{} {best}", with.residual);
    assert!(with.residual < without.residual && inside(&with.x, 0.0, 1.0), "{}", without.residual);
    let truth = misfit(&matrix, &with.x, &b) / norm(&b);
    assert!((truth - with.residual).abs() < 1e-12, "what is reported is true: {truth}");
    let options =
        SolveOptions { surrogate: Some(Arc::new(Known(light_like(3, 0.4)))), ..SolveOptions::default() };
    let error = solve(Method::KrylovBox, &mut matrix.clone(), &b, &options).unwrap_err();
    assert!(error.to_string().contains("surrogate"), "{error}");
}

#[test]
fn the_first_photo_tells_how_bright_the_pattern_has_to_be() {
    for (name, matrix, b) in scenes() {
        let found = run(Method::KrylovBox, &matrix, &b, 1);
        let x: Vec<f64> = b.iter().zip(white(&matrix)).map(|(b, d)| (b / d).clamp(0.0, 1.0)).collect();
        let most = 1.0 / x.iter().copied().fold(0.0, f64::max);
        let at = |t: f64| misfit(&matrix, &x.iter().map(|x| t * x).collect::<Vec<_>>(), &b) / norm(&b);
        // A fine search over all brightnesses that can be shown finds none better.
        let best = (0..=2000).map(|k| at(most * f64::from(k) / 2000.0)).fold(f64::INFINITY, f64::min);
        assert!(found.residual <= best * (1.0 + 1e-12), "{name}: {} {best}", found.residual);
    }
}

#[test]
fn fista_notices_when_its_step_is_too_long() {
    // Signed entries: A 1 says nothing of the norm, and the first steps would diverge.
    let matrix = turned(&(0..40).map(|k| 1.0 + f64::from(k) / 10.0).collect::<Vec<_>>());
    let b = random(40, 8);
    let (_, best) = optimum(&matrix, &b, 0.0, 1.0);
    let mut counted = matrix.clone();
    let options =
        SolveOptions { products: 2000, rtol: 0.0, diagonal: Some(vec![0.1; 40]), ..SolveOptions::default() };
    let found = solve_adjoint(Method::Fista, &mut counted, &b, &options).unwrap();
    assert!((found.residual / best - 1.0).abs() < 1e-5, "{} {best}", found.residual);
}

#[test]
fn failed_product_is_taken_again_to_the_same_bits() {
    let (_, matrix, b) = scenes().into_iter().next().unwrap();
    let options = SolveOptions { products: 10, rtol: 0.0, ..SolveOptions::default() };
    for facts in METHODS.iter().filter(|facts| facts.constraint != Constraint::None) {
        let whole = solve_adjoint(facts.method, &mut matrix.clone(), &b, &options).unwrap();
        for fault in 1..=10 {
            let mut failing = matrix.clone();
            failing.fail_at = Some(fault);
            let mut solver = facts.method.solver(N, &b, &options).unwrap();
            let error = solve_from(&mut solver, &mut failing, &options).unwrap_err();
            assert!(matches!(error, Error::Interrupted));
            assert_eq!(solver.tally().products, fault - 1, "{}", facts.name);
            let resumed = solve_from(&mut solver, &mut failing, &options).unwrap();
            assert_eq!(resumed.x, whole.x, "{}, product {fault}", facts.name);
            assert_eq!(resumed.history, whole.history[fault - 1..], "{}, product {fault}", facts.name);
        }
    }
}

#[test]
fn dark_pixels_and_dark_scenes_are_survived() {
    let mut dark = light_like(SIDE, 0.4);
    for k in 0..N {
        for pixel in [0, 37] {
            dark.entries[pixel * N + k] = 0.0;
            dark.entries[k * N + pixel] = 0.0;
        }
    }
    let lit = run(Method::KrylovBox, &light_like(SIDE, 0.4), &wanted(0.15), 8);
    for method in BOXED {
        let found = run(method, &dark, &wanted(0.15), 30);
        assert!(inside(&found.x, 0.0, 1.0), "{method:?}");
        assert!(found.residual < 4.0 * lit.residual + 0.1, "{method:?}: {} {}", found.residual, lit.residual);
        let found = run(method, &diagonal(&[0.0; 9]), &[1.0; 9], 10);
        assert!((found.residual - 1.0).abs() < 1e-15, "{method:?}: nothing can be done in the dark");
        assert!(found.stats.products <= 10 && inside(&found.x, 0.0, 1.0), "{method:?}");
    }
}

#[test]
fn impossible_boxes_and_preconditioners_are_refused() {
    let matrix = light_like(3, 0.4);
    for (options, named) in [
        (SolveOptions { lower: 0.5, upper: 0.5, ..SolveOptions::default() }, "--floor"),
        (SolveOptions { lower: f64::NAN, ..SolveOptions::default() }, "--floor"),
        (SolveOptions { diagonal: Some(vec![1.0; 4]), ..SolveOptions::default() }, "diagonal"),
        (SolveOptions { diagonal: Some(vec![f64::NAN; 9]), ..SolveOptions::default() }, "diagonal"),
        (
            SolveOptions {
                preconditioner: Some(Arc::new(krylux::krylov::Diagonal::new(vec![1.0; 9]).unwrap())),
                ..SolveOptions::default()
            },
            "--precondition",
        ),
    ] {
        for method in BOXED {
            let mut counted = matrix.clone();
            let error = solve(method, &mut counted, &[0.1; 9], &options).unwrap_err();
            assert!(error.to_string().contains(named), "{named}: {error}");
            assert_eq!(counted.products(), 0);
        }
    }
}
