//! Least squares inside a box, `min ‖b − A x‖₂` over `lower ≤ x ≤ upper`. The box is needed because a projector shows values in [0, 1].
//!
//! An unconstrained solution that is clamped afterwards can be worse than no solution, so each method here respects bounds.
//! [`ProjectedJacobi`] is the baseline and costs one product per iteration. [`Fista`] is the accelerated projected gradient and costs two
//! products per iteration, because the gradient is `Aᵀ(A x − b)`. [`KrylovBox`] learns a model of the operator from all products so far.
//! [`Mrnsd`] and [`Multiplicative`] only keep `x ≥ 0`, and serve for comparison.

mod baselines;
mod box_problem;
mod fista;
mod krylov_box;
mod model;
mod resident;
mod sweep;

use super::basis::{dot, update, update2};
use super::linear::{At, SolveOptions, System};
use super::powers::{exponent, power, scale, scaled};
use crate::error::{Error, Result};
use crate::operator::Adjoint;

pub use baselines::{Mrnsd, Multiplicative, ProjectedJacobi};
pub use fista::Fista;
pub use krylov_box::KrylovBox;
pub use model::Surrogate;

/// The bounds `[lower, upper]` of each entry.
#[derive(Clone, Copy)]
struct Bounds {
    lower: f64,
    upper: f64,
}

impl Bounds {
    fn clip(self, value: f64) -> f64 {
        value.max(self.lower).min(self.upper)
    }
}

/// A diagonal entry below this share of the largest entry belongs to a pixel without light. The entry is raised to this share, because
/// steps would otherwise be unbounded at this pixel.
const DARK: f64 = 1e-3;

/// The largest allowed ratio, as a power of two, of the right-hand side to the products of patterns in the box. At ratios far below this
/// limit already, products are too small to change a residual.
const REACH: i32 = 200;

/// `b`, `1/D` and a vector of ones, which only the memory of an operator needs.
const RHS: At = At::Constant(0);
const INVERSE: At = At::Constant(1);
const ONES: At = At::Constant(2);

/// The box of a least-squares problem, and the diagonal `D`. The first iterate is `clip(x0)`, or `clip(b / D)` without an `x0`.
struct Boxed {
    bounds: Bounds,
    /// `D`, with small entries raised; empty until it is known.
    diagonal: Vec<f64>,
    given_start: bool,
}

impl Boxed {
    fn new(method: &str, cols: usize, b: &[f64], options: &SolveOptions) -> Result<(System, Self)> {
        if options.preconditioner.is_some() {
            return Err(Error::option("--precondition", format!("{method} takes no preconditioner"))
                .help("give it a diagonal instead"));
        }
        let mut system = System::new(cols, b, options)?;
        let bounds = Bounds { lower: options.lower, upper: options.upper };
        system.pending = true;
        system.tally.residual = f64::INFINITY;
        system.tally.best = f64::INFINITY;
        let mut boxed = Self { bounds, diagonal: Vec::new(), given_start: options.x0.is_some() };
        if let Some(diagonal) = &options.diagonal {
            Error::check_size("the diagonal's length", cols, diagonal.len())?;
            let mut diagonal = diagonal.clone();
            let largest = diagonal.iter().fold(0.0_f64, |largest, d| largest.max(d.abs()));
            let operator_power = power(exponent(largest));
            system.tally.operator_power = (largest > 0.0).then_some(operator_power);
            scale(&mut diagonal, -operator_power);
            boxed.set_diagonal(&mut system, diagonal)?;
        } else {
            boxed.start(&mut system);
        }
        Ok((system, boxed))
    }

    /// Takes the white photo if `D` is not known yet: one product. Returns true if this call took the photo, which is then in
    /// `system.work`.
    fn take_diagonal(&mut self, system: &mut System, operator: &mut dyn Adjoint) -> Result<bool> {
        if !self.diagonal.is_empty() {
            return Ok(false);
        }
        let ones = vec![1.0; system.b.len()];
        system.tally.product(operator, &ones, &mut system.work)?;
        self.set_diagonal(system, system.work.clone())?;
        Ok(true)
    }

    /// Takes the white photo, and then the residual of the first iterate, unless they are known: one product. Returns true if this call took
    /// one. Otherwise the vectors are in their place, as after [`System::begin_with`].
    fn begin(&mut self, system: &mut System, operator: &mut dyn Adjoint, own: [usize; 2]) -> Result<bool> {
        if self.take_diagonal(system, operator)? {
            return Ok(true);
        }
        system.begin_with(operator, own, |System { b, .. }| {
            let inverse = self.diagonal.iter().map(|d| d.recip()).collect();
            vec![b.clone(), inverse, vec![1.0; b.len()]]
        })
    }

    /// `r ← b − A x`, for the product `A x` in `w`. Records its norm.
    fn settle(system: &mut System) -> Result<()> {
        if !system.is_resident() {
            system.settle();
            return Ok(());
        }
        system.combine(At::Work, &[(1.0, RHS), (-1.0, At::Work)], 1.0)?;
        let residual = system.dots([])?.norm;
        system.keep(At::R)?;
        system.note_within(residual)
    }

    /// `to ← clip(v + w/(c D))`.
    fn step(&self, system: &mut System, to: At, v: At, c: f64) -> Result<()> {
        let mut share = 1.0;
        if system.is_resident() {
            system.scale_by(INVERSE)?;
            share /= c;
        } else {
            update(&mut system.work, &self.diagonal, |w, d| w / (c * d));
        }
        system.combine(At::Work, &[(share, At::Work), (1.0, v)], 1.0)?;
        system.clip(ONES, (self.bounds.lower, self.bounds.upper))?;
        system.keep(to)
    }

    /// Sets `D`, which must be divided by the same power of two as the products.
    fn set_diagonal(&mut self, system: &mut System, mut diagonal: Vec<f64>) -> Result<()> {
        let largest = diagonal.iter().fold(0.0_f64, |largest, d| largest.max(d.abs()));
        if !largest.is_finite() || diagonal.iter().any(|d| d.is_nan()) {
            return Err(Error::Numerical("the diagonal holds a NaN or an infinity".into()));
        }
        // If the operator is zero, any scale is valid, because nothing moves.
        let floor = if largest > 0.0 { DARK * largest } else { 1.0 };
        for d in &mut diagonal {
            *d = d.abs().max(floor);
        }
        self.diagonal = diagonal;
        self.divide(system, exponent(largest), largest > 0.0)?;
        self.start(system);
        Ok(())
    }

    /// Divides the right-hand side, the bounds and the first iterate so that products of patterns in the box are of ordinary size.
    /// `largest` is the exponent of the largest entry of `D`, and `is_light` is true if this entry is positive.
    fn divide(&mut self, system: &mut System, largest: i32, is_light: bool) -> Result<()> {
        let operator_power = system.tally.operator_power.unwrap_or(0);
        let image = |bound: f64| largest + operator_power + exponent(bound);
        let Bounds { lower, upper } = self.bounds;
        // The smallest and the largest magnitude of the values in the box.
        let (least, most) = (lower.max(0.0).max(-upper), lower.abs().max(upper));
        let rhs = exponent(system.tally.rhs_norm) + system.rhs_power;
        let products = image(least).max(rhs.min(image(most)));
        let rhs_power = power(products);
        if is_light && rhs - rhs_power > REACH {
            return Err(Error::Numerical(format!(
                "the right-hand side is about 2^{} times as large as all that patterns inside the bounds give: lower it, or raise the upper bound",
                rhs - products
            )));
        }
        system.multiply_rhs(system.rhs_power - rhs_power);
        let shift = system.divide()?;
        self.bounds = Bounds { lower: scaled(lower, shift), upper: scaled(upper, shift) };
        Ok(())
    }

    /// `x ← clip(x0)`, or `clip(b / D)` without an `x0`.
    fn start(&self, System { x, b, .. }: &mut System) {
        let bounds = self.bounds;
        if self.given_start {
            x.iter_mut().for_each(|x| *x = bounds.clip(*x));
        } else if self.diagonal.is_empty() {
            x.fill(bounds.clip(0.0));
        } else {
            update2(x, b, &self.diagonal, |_, b, d| bounds.clip(b / d));
        }
    }

    /// `x ← t x` with the best `t` that keeps `x` inside the box. By linearity, the product `A x` in `system.work` is also multiplied by
    /// `t`.
    fn brighten(&self, System { x, b, work, .. }: &mut System) {
        let Bounds { lower, upper } = self.bounds;
        let square = dot(work, work);
        if square == 0.0 {
            return;
        }
        let (mut least, mut most) = (0.0_f64, f64::INFINITY);
        for &value in x.iter() {
            // The two values of t for which t · value is at a bound, in ascending order.
            let [first, last] =
                if value > 0.0 { [lower / value, upper / value] } else { [upper / value, lower / value] };
            if value != 0.0 {
                (least, most) = (least.max(first), most.min(last));
            }
        }
        // The vector x is inside the box, so t = 1 is always allowed, despite rounding.
        let t = (dot(b, work) / square).clamp(least.min(1.0), most.max(1.0));
        let bounds = self.bounds;
        x.iter_mut().for_each(|value| *value = bounds.clip(t * *value));
        work.iter_mut().for_each(|value| *value *= t);
    }
}
