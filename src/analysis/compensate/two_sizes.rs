//! Compensation where photos and patterns have different sizes. Each method solves a square system in place of the rectangular one.

use std::cell::RefCell;
use std::ops::ControlFlow;

use super::run::{Kept, Run, kept};
use crate::error::{Error, Result};
use crate::krylov::{Constraint, Method, SolveOptions, SolveRow, Status, norm};
use crate::observer::{Observer, Step};
use crate::operator::{Adjoint, Operator, Relayed, Symmetry, delegate};
use crate::sparse::Csr;

/// The number of photos of patterns, one after the other, that leave a larger residual than the best one before. The method then ends.
const RISES: usize = 2;

/// Solves `A x = b` for one channel, with `A` of `m × n`, inside the box. A method that takes products with `Aᵀ` solves the least-squares
/// problem itself. Any other method solves `W A x = W b` with the map `W` from camera to projector. That solution is not the least-squares
/// optimum, so the method ends when `‖b − A x‖` rises, and the best pattern of all that were photographed is returned.
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

/// The least-squares problem itself, padded with zeros to a square one.
fn by_transpose(
    run: &mut Run<'_>,
    operator: &mut dyn Adjoint,
    channel: usize,
    method: Method,
    mut options: SolveOptions,
    keep: bool,
) -> Result<Kept> {
    let (columns, size) = (operator.cols(), operator.rows().max(operator.cols()));
    let b = padded(&run.b[channel], size);
    let mut square = Padded { operator, size };
    if method == Method::Fista {
        // For A ≥ 0, AᵀA ≤ diag(AᵀA 1). FISTA bounds the curvature by the largest entry L of a diagonal D, with AᵀA ≤ L D. Both hold for
        // this D, whose largest entry is the root of that of AᵀA 1.
        let [mut sums, mut start] = [vec![0.0; size], vec![0.0; size]];
        square
            .apply_adjoint_block(&[&padded(&run.white[channel], size), &b], &mut [&mut sums, &mut start])?;
        run.preparation = 3;
        let root = sums.iter().copied().fold(0.0, f64::max).sqrt();
        if root > 0.0 {
            start.iter_mut().zip(&sums).for_each(|(x, sum)| *x = if *sum > 0.0 { *x / sum } else { 0.0 });
            sums.iter_mut().for_each(|sum| *sum /= root);
            options.diagonal = Some(sums);
            options.x0 = Some(start);
        }
    }
    let mut found = kept(method, &mut square, &b, &options, keep)?;
    found.0.x.truncate(columns);
    found.1.iter_mut().for_each(|answer| answer.truncate(columns));
    Ok(found)
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
    if method.facts().constraint != Constraint::None {
        options.diagonal = Some(map.times(&run.white[channel]));
    }
    let target = &run.b[channel];
    let [lower, upper] = [options.lower, options.upper];
    let seen = RefCell::new(Seen { target, lower, upper, best: None, rises: 0, rows: Vec::new() });
    let mut square = Mapped { operator, map, seen: &seen };
    let b = map.times(target);
    let mut watched = Relayed::new(&mut square, |observer: &dyn Observer, step: &Step<'_>| {
        let flow = observer.step(step);
        if seen.borrow().rises < RISES { flow } else { ControlFlow::Break(()) }
    });
    let mut found = kept(method, &mut watched, &b, &options, keep)?;
    let seen = seen.into_inner();
    let solution = &mut found.0;
    if solution.stats.status == Status::ConstrainedOptimum || seen.rises >= RISES {
        solution.stats.status = Status::Stalled;
    }
    solution.history = seen.rows;
    if let Some((residual, pattern)) = seen.best {
        (solution.residual, solution.x) = (residual, pattern);
    }
    Ok(found)
}

/// A vector of `size` entries: the given ones, and zeros.
fn padded(values: &[f64], size: usize) -> Vec<f64> {
    let mut padded = values.to_vec();
    padded.resize(size, 0.0);
    padded
}

/// A rectangular operator with rows or columns of zeros, so that it is square.
struct Padded<'a> {
    operator: &'a mut dyn Adjoint,
    size: usize,
}

impl Padded<'_> {
    fn products(
        &mut self,
        from: &[&[f64]],
        to: &mut [&mut [f64]],
        [cols, rows]: [usize; 2],
        apply: fn(&mut dyn Adjoint, &[&[f64]], &mut [&mut [f64]]) -> Result<()>,
    ) -> Result<()> {
        let from: Vec<&[f64]> = from.iter().map(|x| &x[..cols]).collect();
        let (mut heads, mut tails): (Vec<_>, Vec<_>) = to.iter_mut().map(|y| y.split_at_mut(rows)).unzip();
        tails.iter_mut().for_each(|tail| tail.fill(0.0));
        apply(self.operator, &from, &mut heads)
    }
}

impl Operator for Padded<'_> {
    delegate!(operator: block_size, observer, standard_errors, common_error, frames, confirming);

    fn rows(&self) -> usize {
        self.size
    }

    fn cols(&self) -> usize {
        self.size
    }

    fn symmetry(&self) -> Symmetry {
        Symmetry::General
    }

    fn apply_block(&mut self, xs: &[&[f64]], ys: &mut [&mut [f64]]) -> Result<()> {
        let shape = [self.operator.cols(), self.operator.rows()];
        self.products(xs, ys, shape, |operator, xs, ys| operator.apply_block(xs, ys))
    }
}

impl Adjoint for Padded<'_> {
    fn apply_adjoint_block(&mut self, ys: &[&[f64]], xs: &mut [&mut [f64]]) -> Result<()> {
        let shape = [self.operator.rows(), self.operator.cols()];
        self.products(ys, xs, shape, |operator, ys, xs| operator.apply_adjoint_block(ys, xs))
    }
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

/// `W A`, which also keeps the best pattern that was photographed.
struct Mapped<'a, 'b> {
    operator: &'a mut dyn Adjoint,
    map: &'a Csr,
    seen: &'a RefCell<Seen<'b>>,
}

impl Operator for Mapped<'_, '_> {
    delegate!(operator: observer, frames, confirming);

    fn rows(&self) -> usize {
        self.map.rows()
    }

    fn cols(&self) -> usize {
        self.operator.cols()
    }

    fn symmetry(&self) -> Symmetry {
        Symmetry::General
    }

    fn apply(&mut self, x: &[f64], y: &mut [f64]) -> Result<()> {
        let mut photo = vec![0.0; self.operator.rows()];
        self.operator.apply(x, &mut photo)?;
        self.seen.borrow_mut().look(x, &photo);
        y.copy_from_slice(&self.map.times(&photo));
        Ok(())
    }
}

impl Adjoint for Mapped<'_, '_> {
    fn apply_adjoint(&mut self, _: &[f64], _: &mut [f64]) -> Result<()> {
        Err(Error::Numerical("a product with the transpose was asked of a method that takes none".into()))
    }
}
