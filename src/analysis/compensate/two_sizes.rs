//! Compensation where photos and patterns have different sizes. Each method solves a square system in place of the rectangular one.

use std::cell::RefCell;
use std::ops::ControlFlow;

use super::run::{Kept, Run, kept};
use crate::error::{Error, Result};
use crate::krylov::{Constraint, ForwardOnly, Method, SolveOptions, SolveRow, Status, norm};
use crate::observer::{Observer, Step};
use crate::operator::{Adjoint, Operator, Relayed, delegate};
use crate::sparse::Mapped;

/// The number of photos of patterns, one after the other, that leave a larger residual than the best one before. The method then ends.
const RISES: usize = 2;

/// Solves `A x = b` for one channel, with `A` of `m × n`, inside the box. A method that takes products with `Aᵀ` solves the least-squares
/// problem itself. Any other method solves `W A x = W b` with the map `W` from camera to projector. That solution is not the least-squares
/// optimum, so a method whose patterns stay inside the box ends when `‖b − A x‖` rises, and returns the best pattern that was photographed.
pub(super) fn solve(
    run: &mut Run<'_>,
    operator: &mut dyn Adjoint,
    channel: usize,
    method: Method,
    photos: usize,
    keep: bool,
) -> Result<Kept> {
    let facts = method.facts();
    if facts.needs_symmetry || matches!(method, Method::Mrnsd | Method::Multiplicative) {
        let fault = format!(
            "{} is for photos and patterns of one size, and these have {} and {} pixels",
            facts.name,
            operator.rows(),
            operator.cols()
        );
        return Err(
            Error::option("--method", fault).help("use fista, or krylov-box, which takes no transpose")
        );
    }
    let options = SolveOptions {
        products: photos,
        rtol: run.options.rtol,
        lower: run.options.floor,
        upper: 1.0,
        ..SolveOptions::default()
    };
    match facts.needs_transpose {
        true => by_transpose(run, operator, channel, method, options, keep),
        false => by_map(run, operator, channel, method, options, keep),
    }
}

/// The least-squares problem itself.
fn by_transpose(
    run: &mut Run<'_>,
    operator: &mut dyn Adjoint,
    channel: usize,
    method: Method,
    mut options: SolveOptions,
    keep: bool,
) -> Result<Kept> {
    let (white, b) = (&run.white[channel], &run.b[channel]);
    if method == Method::Fista {
        let [mut sums, mut start] = [(); 2].map(|()| vec![0.0; operator.cols()]);
        operator.apply_adjoint_block(&[white, b], &mut [&mut sums, &mut start])?;
        run.preparation = 3;
        if white.iter().chain(&sums).any(|value| *value < 0.0) {
            // The matrix has negative entries, so the sums of its entries say nothing of single columns. This even value is at most the
            // largest eigenvalue of AᵀA, and FISTA raises it where that is too little.
            let even = norm(&sums) / (sums.len() as f64).sqrt();
            sums.fill(even);
        }
        // For A ≥ 0, AᵀA ≤ diag(AᵀA 1). FISTA bounds the curvature by the largest entry L of a diagonal D, with AᵀA ≤ L D. Both hold for
        // this D, whose largest entry is the root of that of AᵀA 1.
        let root = sums.iter().copied().fold(0.0, f64::max).sqrt();
        start.iter_mut().zip(&sums).for_each(|(x, sum)| *x = if *sum > 0.0 { *x / sum } else { 0.0 });
        if root > 0.0 {
            sums.iter_mut().for_each(|sum| *sum /= root);
        }
        options.diagonal = Some(sums);
        options.x0 = Some(start);
    }
    kept(method, operator, b, &options, keep)
}

/// `W A x = W b`.
fn by_map(
    run: &Run<'_>,
    operator: &mut dyn Adjoint,
    channel: usize,
    method: Method,
    mut options: SolveOptions,
    keep: bool,
) -> Result<Kept> {
    let Some(map) = run.prior.map.get(channel) else {
        let fault = format!(
            "{} takes no transpose, and for photos and patterns of different sizes it needs the map from camera to projector, which is not known",
            method.facts().name
        );
        return Err(Error::option("--method", fault)
            .help("use fista, or give a scene, or a matrix that holds its direct light separately"));
    };
    // Other methods photograph directions, which are no patterns.
    let (is_boxed, rtol) = (method.facts().constraint == Constraint::Box, options.rtol);
    if is_boxed {
        options.diagonal = Some(map.times(&run.white[channel]));
        // The method would compare what the map makes of the light with the tolerance, but only the photo counts.
        options.rtol = 0.0;
    }
    let target = &run.b[channel];
    let [lower, upper] = [options.lower, options.upper];
    let seen = RefCell::new(Seen { target, lower, upper, best: None, rises: 0, rows: Vec::new() });
    let mut square = Mapped { operator: &mut LookedAt { operator, seen: &seen }, map };
    let b = map.times(target);
    let mut forward = ForwardOnly(&mut square);
    let has_ended = |seen: &Seen<'_>| is_boxed && (seen.rises >= RISES || seen.is_within(rtol));
    let mut watched = Relayed::new(&mut forward, |observer: &dyn Observer, step: &Step<'_>| {
        let flow = observer.step(step);
        if has_ended(&seen.borrow()) { ControlFlow::Break(()) } else { flow }
    });
    let mut found = kept(method, &mut watched, &b, &options, keep)?;
    if !is_boxed {
        return Ok(found);
    }
    let seen = seen.into_inner();
    let solution = &mut found.solution;
    let claims = [Status::ReachedTolerance, Status::ConstrainedOptimum];
    if seen.is_within(rtol) {
        solution.stats.status = Status::ReachedTolerance;
    } else if seen.rises >= RISES || claims.contains(&solution.stats.status) {
        solution.stats.status = Status::Stalled;
    }
    if let Some((residual, pattern)) = seen.best {
        (solution.residual, solution.x) = (residual, pattern);
    }
    solution.history = seen.rows;
    Ok(found)
}

/// The patterns inside the box that were photographed.
struct Seen<'a> {
    target: &'a [f64],
    lower: f64,
    upper: f64,
    /// The smallest residual `‖b − A x‖ / ‖b‖`, and its pattern.
    best: Option<(f64, Vec<f64>)>,
    /// The number of photos since the best one.
    rises: usize,
    rows: Vec<SolveRow>,
}

impl Seen<'_> {
    fn is_within(&self, rtol: f64) -> bool {
        self.best.as_ref().is_some_and(|(residual, _)| *residual <= rtol)
    }

    fn look(&mut self, pattern: &[f64], photo: &[f64]) {
        let is_inside = pattern.iter().all(|value| (self.lower..=self.upper).contains(value));
        let misfit: Vec<f64> = self.target.iter().zip(photo).map(|(b, y)| b - y).collect();
        let residual = if is_inside { norm(&misfit) / norm(self.target) } else { f64::INFINITY };
        if is_inside && self.best.as_ref().is_none_or(|(best, _)| residual < *best) {
            self.best = Some((residual, pattern.to_vec()));
            self.rises = 0;
        } else if is_inside {
            self.rises += 1;
        }
        let best = self.best.as_ref().map_or(f64::INFINITY, |(best, _)| *best);
        self.rows.push(SolveRow { products: self.rows.len() + 1, residual, best });
    }
}

/// An operator whose photos are looked at.
struct LookedAt<'a, 'b> {
    operator: &'a mut dyn Adjoint,
    seen: &'a RefCell<Seen<'b>>,
}

impl Operator for LookedAt<'_, '_> {
    delegate!(operator: rows, cols, symmetry, observer, frames, confirming);

    fn apply(&mut self, x: &[f64], y: &mut [f64]) -> Result<()> {
        self.operator.apply(x, y)?;
        self.seen.borrow_mut().look(x, y);
        Ok(())
    }
}
