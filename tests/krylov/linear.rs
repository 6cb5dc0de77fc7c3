//! Solvers of linear systems on the named gallery, against dense solutions; what each costs, and what it survives.
#![allow(clippy::unwrap_used, clippy::panic, reason = "in a test a panic is the report")]

use std::ops::ControlFlow;
use std::sync::Arc;

use crate::comb::Comb;
use crate::krylov_gallery::{Dense, Named, diagonal, gallery, light_like, misfit, named, random, turned};
use krylux::krylov::{
    Constraint, Diagonal, METHODS, Method, Multiscale, Preconditioner, Side, Solution, SolveOptions, Status,
    UserPreconditioner, dot, norm, solve, solve_adjoint, solve_from,
};
use krylux::observer::{Estimate, OnStep, Step};
use krylux::operator::{Observed, Operator, Symmetry};
use krylux::{Error, Result};

const LINEAR: [Method; 8] = [
    Method::Minres,
    Method::Gmres,
    Method::Fgmres,
    Method::Cg,
    Method::Cgs,
    Method::BiCgStab,
    Method::Lsqr,
    Method::Lsmr,
];

fn fits(method: Method, system: &Named) -> bool {
    let facts = method.facts();
    (system.square() || facts.needs_transpose) && (system.symmetric() || !facts.needs_symmetry)
}

fn run(method: Method, system: &Named, options: &SolveOptions) -> Solution {
    let mut matrix = system.matrix.clone();
    let found = solve_adjoint(method, &mut matrix, &system.b, options)
        .unwrap_or_else(|error| panic!("{method:?} on {}: {error}", system.name));
    let what = format!("{method:?} on {}: {}", system.name, found.stats.status);
    assert_eq!(found.stats.products, matrix.products(), "{what}: products reported and taken");
    assert!(matrix.products() <= options.products, "{what}: the budget holds");
    assert_eq!(found.history.len(), matrix.products(), "{what}: a row for each product");
    assert!(method.facts().needs_transpose || matrix.adjoint == 0, "{what}: no transposed product");
    found
}

fn accurate() -> SolveOptions {
    SolveOptions { products: 200, rtol: 1e-10, ..SolveOptions::default() }
}

/// Whether theory promises the solution within 200 products: a condition number that the method bears, and for the
/// two without a minimization property systems known to be harmless.
fn must_solve(method: Method, system: &Named) -> bool {
    match method {
        Method::Cg => system.positive_definite && system.condition < 1e4,
        Method::Cgs | Method::BiCgStab => [
            "spd_well",
            "repeated_eigenvalues",
            "identity",
            "light_like",
            "nonsymmetric_mild",
            "tiny_1",
            "tiny_2",
            "arrow",
            "negative_definite",
        ]
        .contains(&system.name),
        // Their condition is the square.
        Method::Lsqr | Method::Lsmr => system.condition < 1e2,
        Method::Minres => system.condition < 1e4,
        // Full orthogonality: at most n products, whatever the condition. A singular system that has no solution is
        // a breakdown by name.
        _ => system.consistent() && system.condition < 1e6,
    }
}

#[test]
fn every_method_agrees_with_the_dense_solution_or_says_why_not() {
    for system in gallery() {
        for method in LINEAR.into_iter().filter(|method| fits(*method, &system)) {
            let found = run(method, &system, &accurate());
            let size = norm(&system.b);
            let what = format!("{method:?} on {}: {:?} {:e}", system.name, found.stats, found.residual);
            assert!(found.x.iter().all(|x| x.is_finite()), "{what}");
            let truth = misfit(&system.matrix, &found.x, &system.b);
            let reported = found.residual * if size > 0.0 { size } else { 1.0 };
            // The recurrences drift from the truth by rounding, ε ‖A‖ times the largest iterate on the way
            // (Greenbaum 1997, doi:10.1137/S0895479895284944): CGS and BiCGStab pass very large ones.
            assert!((truth - reported).abs() <= 1e-8 * size, "{what}: {truth:e} in truth");
            assert!(truth <= size * (1.0 + 1e-12), "{what}: never worse than zero");
            assert!(truth >= system.residual - 1e-12 * size, "{what}: no better than the best");
            if found.stats.status == Status::ReachedTolerance {
                assert!(truth <= 1.001e-10 * size, "{what}: {truth:e} in truth");
            }
            if found.stats.status == Status::LeastSquares {
                assert!(truth - system.residual <= 1e-9 * size, "{what}: {truth:e}, {:e}", system.residual);
            }
            if must_solve(method, &system) {
                assert!(
                    matches!(found.stats.status, Status::ReachedTolerance | Status::LeastSquares),
                    "{what}: must be solved"
                );
                let error: Vec<f64> = found.x.iter().zip(&system.solution).map(|(a, b)| a - b).collect();
                // Singular systems have many solutions: from zero, all find the one nearest to it where there is an
                // exact one, and LSQR and LSMR in any case. The error is at most κ times that of the residual, or of
                // the gradient.
                let nearest = system.consistent() || method.facts().needs_transpose;
                let bound = 1e-9 * system.condition.powi(2) * norm(&system.solution).max(1e-300);
                assert!(!nearest || norm(&error) <= bound, "{what}: {:e} off", norm(&error));
            }
        }
    }
}

#[test]
fn gallery_is_named_once_each_and_long_enough() {
    let systems = gallery();
    let mut names: Vec<&str> = systems.iter().map(|system| system.name).collect();
    names.sort_unstable();
    names.dedup();
    assert_eq!(names.len(), systems.len());
    assert!(names.len() >= 25, "{}", names.len());
}

#[test]
fn residuals_fall_monotonically_where_that_is_promised() {
    for system in gallery() {
        for method in [Method::Minres, Method::Gmres, Method::Fgmres, Method::Lsqr, Method::Lsmr] {
            if !fits(method, &system) {
                continue;
            }
            let found = run(method, &system, &SolveOptions { restart: Some(7), ..accurate() });
            for pair in found.history.windows(2) {
                // Rounding of norms, at the size of the right-hand side.
                let allowed = pair[0].residual * (1.0 + 1e-10) + 1e-13;
                assert!(pair[1].residual <= allowed, "{method:?} on {}: {pair:?}", system.name);
            }
        }
    }
}

#[test]
fn table_is_in_the_order_of_the_methods_and_names_find_them() {
    for facts in METHODS {
        assert_eq!(facts.method.facts(), facts);
        assert_eq!(Method::from_name(facts.name).unwrap(), facts.method);
    }
    assert!(Method::from_name("sor").unwrap_err().to_string().contains("krylov-box"));
}

#[test]
fn products_per_iteration_are_those_of_the_table() {
    for facts in METHODS {
        let mut matrix = light_like(6, 0.4);
        let b: Vec<f64> = random(36, 3).iter().map(|x| 0.05 + 0.02 * x.abs()).collect();
        let boxed = facts.constraint != Constraint::None;
        let options = SolveOptions {
            products: 14,
            rtol: 0.0,
            diagonal: boxed.then(|| matrix.times(&[1.0; 36])),
            ..SolveOptions::default()
        };
        let found = solve_adjoint(facts.method, &mut matrix, &b, &options).unwrap();
        let mut moves = Vec::new();
        let mut residual = f64::INFINITY;
        for row in &found.history {
            if row.residual != residual && (row.residual < 1.0 || boxed) {
                moves.push(row.products);
            }
            residual = row.residual;
        }
        // BiCGStab moves with both products of an iteration; krylov-box may look at a residual in between.
        let stride = match facts.method {
            Method::BiCgStab => 1,
            _ => facts.products_per_iteration,
        };
        assert!(
            moves[0] <= facts.products_to_start + facts.products_per_iteration,
            "{}: {moves:?}",
            facts.name
        );
        let regular = moves.windows(2).filter(|pair| pair[1] - pair[0] == stride).count();
        let wanted = if facts.method == Method::KrylovBox { 2 } else { moves.len() - 1 };
        // A residual below 1e-13 may no longer change.
        assert!(regular >= wanted && wanted >= 2, "{}: {moves:?}", facts.name);
        assert!(facts.needs_transpose || matrix.adjoint == 0, "{}: took a transposed product", facts.name);
        assert!(!facts.needs_transpose || matrix.adjoint > 0, "{}: took no transposed product", facts.name);
    }
}

#[test]
fn needs_of_the_table_are_enforced() {
    let system = named("nonsymmetric_mild");
    for facts in METHODS {
        let mut matrix = system.matrix.clone();
        let options = SolveOptions { products: 6, ..SolveOptions::default() };
        let outcome = solve(facts.method, &mut matrix, &system.b, &options);
        assert_eq!(
            outcome.is_err(),
            facts.needs_transpose || facts.needs_symmetry,
            "{}: {outcome:?}",
            facts.name
        );
        if facts.needs_symmetry {
            assert_eq!(matrix.products(), 0, "{}: refused before the first product", facts.name);
        }
        if let Err(error) = outcome {
            assert!(error.to_string().contains("GMRES"), "says what to use instead: {error}");
        }
    }
}

#[test]
fn one_photo_measures_the_gains_of_an_operator_that_is_a_gain_for_each_scale() {
    let (width, height) = (32, 24);
    let d: Vec<f64> = (0..width * height).map(|i| 0.2 + (i % 11) as f64 / 10.0).collect();
    let inverse = d.iter().map(|d| 1.0 / d).collect();
    let shares = [0.25, 0.4, 1.0];
    let operator = Multiscale::new(width, height, shares.to_vec()).unwrap().scaled_by(inverse).unwrap();
    let probe = krylux::krylov::Start::default().vector(width * height);
    let mut photo = vec![0.0; width * height];
    operator.apply(&probe, &mut photo).unwrap();
    let measured = Multiscale::measured(width, height, d.clone(), &probe, &photo).unwrap();
    // One band is measured: blocks of 4×4 pixels are 48, too few.
    assert_eq!(measured.gains().len(), 2);
    // Bands are orthogonal: rounding of sums of 768 numbers.
    assert!((measured.gains()[0] - 1.0 / shares[0]).abs() < 1e-12, "{:?}", measured.gains());
    assert_eq!(measured.gains()[1], 1.0);
    // Nothing is raised more than tenfold, and nothing lowered.
    let dark = Multiscale::measured(width, height, d.clone(), &probe, &vec![0.0; width * height]).unwrap();
    assert!(dark.gains().iter().all(|gain| (1.0..=10.0).contains(gain)), "{:?}", dark.gains());
    assert!(Multiscale::measured(width, height, d, &probe, &[0.0; 3]).is_err());
}

#[test]
fn zero_right_hand_side_and_exact_first_iterates_take_no_product_to_spare() {
    for method in LINEAR {
        let system = named("zero_rhs");
        let found = run(method, &system, &accurate());
        assert_eq!((found.stats.products, found.stats.status), (0, Status::ReachedTolerance), "{method:?}");
        let system = named("spd_well");
        let options = SolveOptions { x0: Some(system.solution.clone()), ..accurate() };
        let found = run(method, &system, &options);
        assert_eq!((found.stats.products, found.stats.status), (1, Status::ReachedTolerance), "{method:?}");
    }
}

#[test]
fn first_iterates_that_are_given_are_improved_on() {
    let system = named("spd_well");
    let x0: Vec<f64> = system.solution.iter().zip(random(40, 9)).map(|(x, e)| x + 1e-3 * e).collect();
    for method in LINEAR {
        let found = run(method, &system, &SolveOptions { x0: Some(x0.clone()), ..accurate() });
        assert_eq!(found.stats.status, Status::ReachedTolerance, "{method:?}");
        let first = misfit(&system.matrix, &x0, &system.b) / norm(&system.b);
        assert!(
            (found.history[0].residual - first).abs() < 1e-12,
            "{method:?}: one product for its residual"
        );
        let fresh = run(method, &system, &accurate());
        assert!(
            found.stats.products <= fresh.stats.products + 1,
            "{method:?}: no more than from zero, and that one"
        );
    }
}

#[test]
fn repeated_eigenvalues_take_one_product_each() {
    let system = named("repeated_eigenvalues");
    for method in [Method::Minres, Method::Gmres, Method::Cg] {
        assert_eq!(run(method, &system, &accurate()).stats.products, 3, "{method:?}");
    }
}

#[test]
fn gmres_is_minres_for_symmetric_systems_and_restarts_cost_no_product() {
    for name in ["indefinite", "light_like", "arrow"] {
        let system = named(name);
        let options = SolveOptions { products: 12, rtol: 1e-9, ..SolveOptions::default() };
        let minres = run(Method::Minres, &system, &options);
        let gmres = run(Method::Gmres, &system, &options);
        for (a, b) in minres.history.iter().zip(&gmres.history) {
            // Lanczos vectors lose orthogonality slowly; within 12 steps of these spectra by less than this.
            assert!((a.residual - b.residual).abs() < 1e-9, "{name}: {a:?} {b:?}");
        }
        let restarted = run(Method::Gmres, &system, &SolveOptions { restart: Some(3), ..options });
        assert!(restarted.residual >= gmres.residual * (1.0 - 1e-9), "{name}: full GMRES is optimal");
        assert_eq!(restarted.history[..3], gmres.history[..3], "{name}: the same before the first restart");
    }
}

#[test]
fn breakdowns_end_in_a_sentence() {
    for (method, name, sentence) in [
        (Method::Cgs, "quarter_turn", "shadow"),
        (Method::BiCgStab, "quarter_turn", "shadow"),
        (Method::Cgs, "skew", "shadow"),
        (Method::Cg, "traceless", "positive definite"),
        (Method::Cg, "negative_definite", "positive definite"),
        (Method::Gmres, "zero_matrix", "singular"),
    ] {
        let found = run(method, &named(name), &accurate());
        let said = found.stats.status.to_string();
        assert!(said.starts_with("breakdown") && said.contains(sentence), "{method:?} on {name}: {said}");
    }
}

#[test]
fn operators_that_only_claim_symmetry_are_found_out() {
    for method in [Method::Minres, Method::Cg] {
        let mut system = named("nonsymmetric_mild");
        system.matrix.symmetry = Symmetry::Symmetric;
        let found = run(method, &system, &accurate());
        assert_eq!(found.stats.status, Status::NotSymmetric, "{method:?}");
        assert!(found.stats.products <= 3, "{method:?}: {}", found.stats.products);
        assert_eq!(found.stats.status.to_string(), "the operator is not symmetric");
    }
}

#[test]
fn noise_floor_stops_where_noise_would_be_fitted() {
    let system = named("spd_well");
    for method in LINEAR {
        let options = SolveOptions { noise: 0.01, ..accurate() };
        let found = run(method, &system, &options);
        assert_eq!(found.stats.status, Status::NoiseFloor, "{method:?}");
        assert!(found.residual <= 0.01);
        let before = found.history.iter().rev().nth(1).unwrap();
        assert!(before.best > 0.01, "{method:?}: not a product later than that");
    }
}

/// Adds to each product noise of a relative size that is set from outside.
struct Noisy<'a> {
    matrix: Dense,
    noise: &'a std::cell::Cell<f64>,
    seed: u64,
    /// Whether it states the errors of its products.
    states: bool,
    error: f64,
}

impl Operator for Noisy<'_> {
    fn rows(&self) -> usize {
        self.matrix.rows
    }
    fn cols(&self) -> usize {
        self.matrix.cols
    }
    fn symmetry(&self) -> Symmetry {
        self.matrix.symmetry
    }
    fn apply(&mut self, x: &[f64], y: &mut [f64]) -> Result<()> {
        self.matrix.apply(x, y)?;
        self.seed += 1;
        let error = random(y.len(), self.seed);
        self.error = self.noise.get() * norm(y);
        let share = self.error / norm(&error);
        y.iter_mut().zip(&error).for_each(|(y, e)| *y += share * e);
        Ok(())
    }
    fn standard_errors(&self) -> Vec<f64> {
        if self.states { vec![self.error] } else { Vec::new() }
    }
}

#[test]
fn with_noisy_products_the_residual_at_the_noise_floor_is_true_to_the_noise() {
    let system = named("spd_well");
    let noise = std::cell::Cell::new(1e-3);
    for method in [Method::Minres, Method::Gmres, Method::Cg, Method::BiCgStab] {
        let mut noisy =
            Noisy { matrix: system.matrix.clone(), noise: &noise, seed: 100, states: false, error: 0.0 };
        let options = SolveOptions { noise: 1e-3, rtol: 1e-9, ..SolveOptions::default() };
        let found = solve(method, &mut noisy, &system.b, &options).unwrap();
        assert_eq!(found.stats.status, Status::NoiseFloor, "{method:?}");
        let truth = misfit(&system.matrix, &found.x, &system.b) / norm(&system.b);
        // Errors of up to ten products, each at most 1e-3 of κ = 3 times ‖b‖, add up at random: √10 · 3 and the floor.
        assert!(truth < 1e-3 * (1.0 + 9.5), "{method:?}: {truth:e}");
    }
}

fn preconditioners(n: usize, matrix: &Dense) -> Vec<(&'static str, Arc<dyn Preconditioner>)> {
    let main: Vec<f64> = (0..n).map(|i| matrix.entries[i * n + i]).collect();
    let side = (n as f64).sqrt() as usize;
    let rough = turned(&vec![0.7; n]);
    vec![
        ("diagonal", Arc::new(Diagonal::new(main.clone()).unwrap())),
        (
            "multiscale",
            Arc::new(Multiscale::new(side, side, vec![1.0, 0.8, 0.6]).unwrap().scaled_by(main).unwrap()),
        ),
        ("operator", Arc::new(UserPreconditioner::operator(true, rough).unwrap())),
        (
            "closure",
            Arc::new(UserPreconditioner::closure(true, |r, z| {
                z.iter_mut().zip(r).for_each(|(z, r)| *z = 3.0 * r);
                Ok(())
            })),
        ),
    ]
}

#[test]
fn preconditioned_methods_reach_the_same_solution_on_every_side() {
    let system = named("light_like");
    for (name, preconditioner) in preconditioners(36, &system.matrix) {
        for method in LINEAR {
            for side in [Side::Right, Side::Left] {
                if side == Side::Left && method != Method::Gmres {
                    continue;
                }
                let options =
                    SolveOptions { preconditioner: Some(preconditioner.clone()), side, ..accurate() };
                let found = run(method, &system, &options);
                let what = format!("{method:?} with {name}, {side:?}");
                assert_eq!(found.stats.status, Status::ReachedTolerance, "{what}");
                let truth = misfit(&system.matrix, &found.x, &system.b) / norm(&system.b);
                assert!((truth - found.residual).abs() < 1e-12 && truth < 1.01e-10, "{what}: {truth:e}");
                let options = SolveOptions { restart: Some(4), ..options };
                if matches!(method, Method::Gmres | Method::Fgmres) {
                    assert_eq!(
                        run(method, &system, &options).stats.status,
                        Status::ReachedTolerance,
                        "{what}"
                    );
                }
            }
        }
    }
}

#[test]
fn preconditioned_least_squares_keeps_to_the_true_residual_whatever_the_shape() {
    for name in ["tall_inconsistent", "tall_consistent", "wide", "nonsymmetric_mild", "rank_deficient"] {
        let system = named(name);
        let d: Vec<f64> = (0..system.n()).map(|j| 1.0 + (j % 7) as f64).collect();
        for method in [Method::Lsqr, Method::Lsmr] {
            let preconditioner: Option<Arc<dyn Preconditioner>> =
                Some(Arc::new(Diagonal::new(d.clone()).unwrap()));
            let found = run(method, &system, &SolveOptions { preconditioner, ..accurate() });
            let what = format!("{method:?} on {name}: {:?}", found.stats);
            let size = norm(&system.b);
            let truth = misfit(&system.matrix, &found.x, &system.b);
            // The residual follows by recurrence, LSMR's by one of scalars: rounding of some dozen products.
            assert!((truth - found.residual * size).abs() <= 1e-9 * size, "{what}");
            assert!(truth <= system.residual + 1e-9 * size, "{what}: {truth:e} {:e}", system.residual);
            assert!(matches!(found.stats.status, Status::ReachedTolerance | Status::LeastSquares), "{what}");
            // The solution whose `M x` is shortest: `M² x` is then a combination of rows.
            let by_hand = Dense::new(system.matrix.rows, system.n(), |i, j| {
                system.matrix.entries[i * system.n() + j] / d[j]
            });
            let mut scaled = by_hand.clone();
            let plain = solve_adjoint(method, &mut scaled, &system.b, &accurate()).unwrap();
            for ((x, u), d) in found.x.iter().zip(&plain.x).zip(&d) {
                // Both are within 1e-10 times the condition of the scaled matrix, some hundreds.
                assert!((x - u / d).abs() < 1e-6, "{what}: {x} is not {}", u / d);
            }
        }
    }
}

#[test]
fn symmetric_scaling_tames_a_badly_scaled_system() {
    let system = named("badly_scaled");
    let main: Vec<f64> = (0..40).map(|i| system.matrix.entries[i * 40 + i]).collect();
    for (method, products) in
        [(Method::Minres, 12), (Method::Cg, 12), (Method::Gmres, 12), (Method::Lsqr, 40), (Method::Lsmr, 40)]
    {
        let plain = run(method, &system, &SolveOptions { products, ..accurate() });
        assert_eq!(plain.stats.status, Status::BudgetSpent, "{method:?}");
        let preconditioner: Option<Arc<dyn Preconditioner>> =
            Some(Arc::new(Diagonal::new(main.clone()).unwrap()));
        let scaled = run(method, &system, &SolveOptions { products, preconditioner, ..accurate() });
        assert_eq!(scaled.stats.status, Status::ReachedTolerance, "{method:?}: {scaled:?}");
    }
}

#[test]
fn minres_with_preconditioner_is_minres_on_the_split_operator() {
    let system = named("indefinite");
    let d: Vec<f64> = (0..40).map(|i| 1.0 + f64::from(i % 5)).collect();
    let split = Dense::new(40, 40, |i, j| {
        let (i, j) = (i.min(j), i.max(j));
        system.matrix.entries[i * 40 + j] / (d[i] * d[j]).sqrt()
    });
    let b: Vec<f64> = system.b.iter().zip(&d).map(|(b, d)| b / d.sqrt()).collect();
    let options = SolveOptions { products: 10, rtol: 0.0, ..SolveOptions::default() };
    // The driver keeps the best in the 2-norm, so compare the iterates themselves: step by step, one budget each.
    let mut same = 0;
    for products in 1..=10 {
        let options = SolveOptions { products, ..options.clone() };
        let by_hand = solve(Method::Minres, &mut split.clone(), &b, &options).unwrap();
        let x: Vec<f64> = by_hand.x.iter().zip(&d).map(|(x, d)| x / d.sqrt()).collect();
        let preconditioner: Option<Arc<dyn Preconditioner>> =
            Some(Arc::new(Diagonal::new(d.clone()).unwrap()));
        let found = run(Method::Minres, &system, &SolveOptions { preconditioner, ..options });
        let last = found.history.last().unwrap();
        if last.residual == last.best {
            same += 1;
            for (a, b) in found.x.iter().zip(&x) {
                // Ten steps of rounding on entries of size 1.
                assert!((a - b).abs() < 1e-10, "{a} {b} after {products}");
            }
        }
    }
    assert!(same >= 5, "most steps are comparable: {same}");
}

#[test]
fn flexible_gmres_bears_a_preconditioner_that_changes() {
    let system = named("light_like");
    let calls = std::sync::atomic::AtomicUsize::new(0);
    let changing = UserPreconditioner::closure(false, move |r: &[f64], z: &mut [f64]| {
        let factor = 1.0 + (calls.fetch_add(1, std::sync::atomic::Ordering::Relaxed) % 3) as f64;
        for (i, (z, r)) in z.iter_mut().zip(r).enumerate() {
            *z = factor * r * (1.0 + 0.1 * factor * (i % 2) as f64);
        }
        Ok(())
    });
    let options = SolveOptions { preconditioner: Some(Arc::new(changing)), ..accurate() };
    let found = run(Method::Fgmres, &system, &options);
    assert_eq!(found.stats.status, Status::ReachedTolerance);
    let truth = misfit(&system.matrix, &found.x, &system.b) / norm(&system.b);
    assert!(truth < 1.01e-10, "its recurrence stays true: {truth:e}");
}

#[test]
fn multiscale_preconditioner_is_symmetric_and_positive_definite() {
    for (width, height) in [(7, 5), (1, 1), (8, 8)] {
        let n = width * height;
        let d: Vec<f64> = (0..n).map(|i| 0.5 + (i % 3) as f64).collect();
        let m = Multiscale::new(width, height, vec![1.0, 3.0, 0.2, 5.0]).unwrap().scaled_by(d).unwrap();
        let (a, b) = (random(n, 1), random(n, 2));
        let (mut ma, mut mb) = (vec![0.0; n], vec![0.0; n]);
        m.apply(&a, &mut ma).unwrap();
        m.apply(&b, &mut mb).unwrap();
        assert!((dot(&a, &mb) - dot(&b, &ma)).abs() < 1e-12 * n as f64, "{width}x{height}");
        assert!(dot(&a, &ma) > 0.0);
    }
    // A constant image lives on the coarsest scale only.
    let m = Multiscale::new(4, 4, vec![1.0, 2.0, 7.0]).unwrap();
    let mut z = vec![0.0; 16];
    m.apply(&[1.0; 16], &mut z).unwrap();
    assert!(z.iter().all(|z| (z - 7.0).abs() < 1e-14), "{z:?}");
}

#[test]
fn failed_product_is_taken_again_to_the_same_bits() {
    let system = named("spd_well");
    let options = SolveOptions { products: 11, rtol: 0.0, ..SolveOptions::default() };
    for method in LINEAR {
        let whole = run(method, &system, &options);
        for fault in [1, 2, 5, 6] {
            let mut failing = system.matrix.clone();
            failing.fail_at = Some(fault);
            let mut solver = method.solver(40, &system.b, &options).unwrap();
            let error = solve_from(&mut solver, &mut failing, &options).unwrap_err();
            assert!(matches!(error, Error::Interrupted), "the operator's own error comes through");
            assert_eq!(
                solver.tally().products,
                fault - 1,
                "{method:?}: everything before the failure is there"
            );
            let kept = misfit(&system.matrix, &solver.solution(), &system.b);
            assert!((kept - solver.tally().best).abs() < 1e-12 * norm(&system.b), "{method:?}: and of use");
            let resumed = solve_from(&mut solver, &mut failing, &options).unwrap();
            assert_eq!(resumed.x, whole.x, "{method:?}, product {fault}");
            assert_eq!(resumed.history, whole.history[fault - 1..], "{method:?}, product {fault}");
        }
    }
}

#[test]
fn nan_in_a_product_is_an_error_that_names_it() {
    let system = named("spd_well");
    for method in LINEAR {
        let mut matrix = system.matrix.clone();
        matrix.spoil_at = Some(3);
        let mut solver = method.solver(40, &system.b, &accurate()).unwrap();
        let error = solve_from(&mut solver, &mut matrix, &accurate()).unwrap_err();
        assert!(error.to_string().contains("product 3"), "{method:?}: {error}");
        let found = solve_from(&mut solver, &mut matrix, &accurate()).unwrap();
        assert_eq!(found.stats.status, Status::ReachedTolerance, "{method:?}: and can be taken again");
    }
}

#[test]
fn the_observer_sees_every_product_with_its_iterate_and_can_stop() {
    let system = named("spd_well");
    for method in LINEAR {
        let mut seen = Vec::new();
        let mut matrix = system.matrix.clone();
        let observer = OnStep::new(|step: &Step<'_>| {
            seen.push(step.done);
            let Estimate::Solution { best, iterate, .. } = step.estimate else { panic!("{step:?}") };
            let truth = misfit(&system.matrix, &iterate(), &system.b) / norm(&system.b);
            assert!((truth - best).abs() < 1e-12, "{method:?}: {truth} {best}");
            if step.done == 5 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        let mut observed = Observed::new(&mut matrix, &observer);
        let found = solve_adjoint(method, &mut observed, &system.b, &accurate()).unwrap();
        assert_eq!(seen, [1, 2, 3, 4, 5], "{method:?}");
        assert_eq!((found.stats.status, matrix.products()), (Status::Stopped, 5), "{method:?}");
    }
}

#[test]
fn impossible_requests_are_refused_without_a_product() {
    let system = named("spd_well");
    let indefinite: Option<Arc<dyn Preconditioner>> =
        Some(Arc::new(UserPreconditioner::closure(false, |r, z| {
            z.copy_from_slice(r);
            Ok(())
        })));
    let small: Option<Arc<dyn Preconditioner>> = Some(Arc::new(Diagonal::new(vec![1.0; 3]).unwrap()));
    let default = SolveOptions::default;
    for (method, options, named) in [
        (Method::Cg, SolveOptions { products: 0, ..default() }, "--photos"),
        (Method::Cg, SolveOptions { rtol: f64::NAN, ..default() }, "rtol"),
        (Method::Gmres, SolveOptions { restart: Some(0), ..default() }, "restart"),
        (Method::Gmres, SolveOptions { x0: Some(vec![0.0; 3]), ..default() }, "first iterate"),
        (Method::Gmres, SolveOptions { x0: Some(vec![f64::NAN; 40]), ..default() }, "first iterate"),
        (
            Method::Minres,
            SolveOptions { preconditioner: indefinite.clone(), ..default() },
            "positive definite",
        ),
        (Method::Lsqr, SolveOptions { preconditioner: indefinite.clone(), ..default() }, "LSQR"),
        (Method::Cgs, SolveOptions { preconditioner: indefinite, side: Side::Left, ..default() }, "side"),
        (Method::Gmres, SolveOptions { preconditioner: small, ..default() }, "preconditioner"),
    ] {
        let mut matrix = system.matrix.clone();
        let error = solve(method, &mut matrix, &system.b, &options).unwrap_err();
        assert!(error.to_string().contains(named), "{named}: {error}");
        assert_eq!(matrix.products(), 0);
    }
    for bad in [vec![f64::INFINITY; 40], vec![1.0; 39]] {
        assert!(solve(Method::Gmres, &mut system.matrix.clone(), &bad, &default()).is_err());
    }
    assert!(Diagonal::new(vec![1.0, -1.0]).is_err() && Diagonal::new(vec![0.0; 4]).is_err());
    assert!(Multiscale::new(4, 4, vec![1.0, 0.0]).is_err() && Multiscale::new(0, 4, vec![1.0]).is_err());
    assert!(UserPreconditioner::operator(true, named_rectangle()).is_err());
    // An operator knows its size before it is asked for a product; a closure does not.
    let of_six = UserPreconditioner::operator(true, diagonal(&[1.0; 6])).unwrap();
    assert_eq!((of_six.size(), UserPreconditioner::closure(true, |_, _| Ok(())).size()), (Some(6), None));
    assert!(diagonal(&[1.0]).symmetry() == Symmetry::Symmetric);
}

fn named_rectangle() -> Dense {
    named("tall_consistent").matrix
}

#[test]
fn results_do_not_depend_on_the_number_of_threads() {
    let n = 40_001;
    let b: Vec<f64> = (0..n).map(|i| (i as f64 * 0.7).sin().abs()).collect();
    for facts in METHODS {
        let with = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let options = SolveOptions { products: 9, rtol: 0.0, ..SolveOptions::default() };
                let found = solve(facts.method, &mut Comb::definite(n), &b, &options).unwrap();
                (found.x, found.history)
            })
        };
        assert!(with(1) == with(4), "{}", facts.name);
    }
}

#[test]
fn an_operator_that_states_its_errors_is_not_taken_for_one_without_symmetry() {
    let system = named("spd_well");
    let noise = std::cell::Cell::new(1e-3);
    for method in [Method::Minres, Method::Cg] {
        let options = SolveOptions { rtol: 1e-9, ..SolveOptions::default() };
        let mut silent =
            Noisy { matrix: system.matrix.clone(), noise: &noise, seed: 100, states: false, error: 0.0 };
        let found = solve(method, &mut silent, &system.b, &options).unwrap();
        assert_eq!(found.stats.status, Status::NotSymmetric, "{method:?}: its noise is not known");
        let mut stating =
            Noisy { matrix: system.matrix.clone(), noise: &noise, seed: 100, states: true, error: 0.0 };
        let found = solve(method, &mut stating, &system.b, &options).unwrap();
        assert_eq!(found.stats.status, Status::NoiseFloor, "{method:?}");
        let truth = misfit(&system.matrix, &found.x, &system.b) / norm(&system.b);
        // The bound is that of the test before: the floor, and the errors of up to ten products.
        assert!(truth < 1e-3 * (1.0 + 9.5), "{method:?}: {truth:e}");
        // A tolerance of zero asks for the whole budget.
        let whole = SolveOptions { rtol: 0.0, products: 12, ..SolveOptions::default() };
        let mut stating =
            Noisy { matrix: system.matrix.clone(), noise: &noise, seed: 100, states: true, error: 0.0 };
        let found = solve(method, &mut stating, &system.b, &whole).unwrap();
        assert_ne!(found.stats.status, Status::NoiseFloor, "{method:?}");
    }
}
