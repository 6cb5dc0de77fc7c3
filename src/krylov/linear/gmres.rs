//! The generalized minimal residual method, and its flexible form.

use std::sync::Arc;

use super::super::basis::{Basis, norm};
use super::super::orthogonalize::orthogonalize;
use super::super::precondition::Preconditioner;
use super::super::stats::Status;
use super::super::vectors::axpy;
use super::rotation::rotation;
use super::system::{System, Tally, square};
use super::{Advance, Side, SolveOptions, Solver, precondition, refuse_left};
use crate::error::Result;
use crate::operator::Adjoint;

/// GMRES(m): `min ‖b − A x‖₂` over the Krylov space, for any square `A` of `n × n`.
///
/// Preconditioned from the right, `A M⁻¹ u = b`, it minimizes the true residual. From the left, `M⁻¹ A x = M⁻¹ b`, it
/// minimizes `‖M⁻¹ r‖`; the products are then kept beside the basis, so that the true residual is reported all the
/// same, at no product. *Flexible* ([`Gmres::flexible`], FGMRES) it keeps each preconditioned vector, and `M` may
/// differ from step to step.
///
/// # Properties
/// `‖r‖` (on the left `‖M⁻¹ r‖`) falls monotonically, through restarts too. No transpose. One product a step; a
/// restart takes none. The basis is orthonormal to working precision. Ends with a sentence when the Krylov space is
/// invariant and holds no solution (a singular `A`). Stores after `k` steps since the last restart `k + 1` basis
/// vectors and, from the left or flexible, `k` more, and `b, x, r` and three to work in.
///
/// # References
/// Saad and Schultz (1986), doi:10.1137/0907058; flexible: Saad (1993), doi:10.1137/0914028.
#[derive(Clone)]
pub struct Gmres {
    system: System,
    preconditioner: Option<Arc<dyn Preconditioner>>,
    side: Side,
    flexible: bool,
    restart: usize,
    basis: Basis,
    /// Flexible: `M⁻¹ v_j`. From the left: `A v_j`.
    kept: Basis,
    /// The columns of `R`, upper triangular.
    triangle: Vec<Vec<f64>>,
    rotations: Vec<(f64, f64)>,
    /// `Qᵀ ‖r_0‖ e_1`: one entry more than there are columns.
    rotated: Vec<f64>,
    hat: Vec<f64>,
    /// The largest `‖A M⁻¹ v‖` so far.
    scale: f64,
    started: bool,
}

const SINGULAR: Status =
    Status::Breakdown("the Krylov space is used up and holds no solution: the operator is singular");

/// A correction whose rounding errors are this share of the first residual is none: the true residual would no longer
/// be the one reported.
const MEANINGLESS: f64 = 1e-9;

impl Gmres {
    /// For `b` of length `n`. Looks at `x0`, `preconditioner`, `side` and `restart` of the options.
    ///
    /// # Errors
    /// As [`Cg::new`](super::Cg::new), except that any preconditioner will do.
    pub fn new(b: &[f64], options: &SolveOptions) -> Result<Self> {
        Self::build(b, options, false)
    }

    /// FGMRES, preconditioned from the right by an `M` that may change.
    ///
    /// # Errors
    /// As [`Gmres::new`]; a preconditioner on the left is refused.
    pub fn flexible(b: &[f64], options: &SolveOptions) -> Result<Self> {
        refuse_left("FGMRES", options)?;
        Self::build(b, options, options.preconditioner.is_some())
    }

    fn build(b: &[f64], options: &SolveOptions, flexible: bool) -> Result<Self> {
        let system = System::new(b.len(), b, options)?;
        let side = if options.preconditioner.is_some() { options.side } else { Side::Right };
        let restart = options.restart.unwrap_or(usize::MAX);
        let (mut basis, mut kept) = (Basis::new(b.len()), Basis::new(b.len()));
        // Memory for all steps, so that none asks for it.
        let steps = options.products.min(restart).min(b.len());
        basis.reserve(steps + 1);
        if flexible || side == Side::Left {
            kept.reserve(steps);
        }
        Ok(Self {
            system,
            preconditioner: options.preconditioner.clone(),
            side,
            flexible,
            restart,
            basis,
            kept,
            triangle: Vec::new(),
            rotations: Vec::new(),
            rotated: Vec::new(),
            hat: vec![0.0; b.len()],
            scale: 0.0,
            started: false,
        })
    }

    /// Basis vectors and kept ones at this moment, of length `n` each.
    pub fn stored(&self) -> usize {
        self.basis.len() + self.kept.len()
    }

    /// A cycle starts from the residual.
    fn start(&mut self) -> Result<bool> {
        if self.side == Side::Left {
            precondition(self.preconditioner.as_ref(), &self.system.r, &mut self.hat)?;
        } else {
            self.hat.copy_from_slice(&self.system.r);
        }
        let length = norm(&self.hat);
        self.basis.clear();
        self.kept.clear();
        self.triangle.clear();
        self.rotations.clear();
        self.rotated = vec![length];
        if length > 0.0 {
            self.basis.push_scaled(&self.hat, length);
            self.started = true;
        }
        Ok(length > 0.0)
    }

    /// `‖r_0‖` of this cycle, which rotations leave as it is.
    fn rotated_norm(&self) -> f64 {
        norm(&self.rotated)
    }

    /// `y = R⁻¹ (Qᵀ ‖r_0‖ e_1)`.
    fn coefficients(&self) -> Vec<f64> {
        let count = self.triangle.len();
        let mut y = self.rotated[..count.min(self.rotated.len())].to_vec();
        for column in (0..count).rev() {
            y[column] /= self.triangle[column][column];
            let value = y[column];
            for (row, entry) in self.triangle[column][..column].iter().enumerate() {
                y[row] -= value * entry;
            }
        }
        y
    }

    /// This cycle's `V y` added to `sum`; flexible, `Σ y_j M⁻¹ v_j`.
    fn combine(&self, sum: &mut [f64]) {
        let mut y = self.coefficients();
        let columns = if self.flexible { &self.kept } else { &self.basis };
        // The last basis vector has no coefficient yet.
        y.resize(columns.len(), 0.0);
        columns.accumulate(0, &y, 1.0, sum);
    }

    /// Whether `V y` has to be preconditioned to be a correction of `x`.
    fn is_hatted(&self) -> bool {
        !self.flexible && self.side == Side::Right && self.preconditioner.is_some()
    }

    /// The true residual of this cycle's iterate, from what is stored, in the place of the cycle's first residual.
    fn residual(&self, r: &mut [f64]) {
        if self.side == Side::Left {
            let mut y = self.coefficients();
            y.resize(self.kept.len(), 0.0);
            self.kept.accumulate(0, &y, -1.0, r);
            return;
        }
        // r = V Qᵀ (0 … 0, ρ): the rotations undone, last to first.
        let count = self.triangle.len();
        let mut coordinates = vec![0.0; count + 1];
        coordinates[count] = self.rotated[count];
        for (k, (c, s)) in self.rotations.iter().enumerate().rev() {
            let below = coordinates[k + 1];
            coordinates[k] = -s * below;
            coordinates[k + 1] = c * below;
        }
        // An invariant space has no last vector, and leaves no residual along it.
        coordinates.truncate(self.basis.len());
        r.fill(0.0);
        self.basis.accumulate(0, &coordinates, 1.0, r);
    }

    /// Ends the cycle: `x` and `r` are brought up to date, at no product.
    fn close(&mut self) -> Result<()> {
        let mut sum = std::mem::take(&mut self.hat);
        sum.fill(0.0);
        self.combine(&mut sum);
        let hatted = self.is_hatted();
        let mut made = Ok(());
        if hatted {
            made = precondition(self.preconditioner.as_ref(), &sum, &mut self.system.work);
        }
        if made.is_ok() {
            axpy(1.0, if hatted { &self.system.work } else { &sum }, &mut self.system.x);
            let mut r = std::mem::take(&mut self.system.r);
            self.residual(&mut r);
            self.system.r = r;
            self.started = false;
            self.triangle.clear();
        }
        self.hat = sum;
        made
    }
}

impl Solver for Gmres {
    fn step(&mut self, operator: &mut dyn Adjoint) -> Result<Advance> {
        self.system.fits(operator)?;
        square(self.system.b.len(), self.system.x.len())?;
        if self.system.pending {
            self.system.first_residual(operator)?;
            return Ok(Advance::Continuing);
        }
        if self.started && self.triangle.len() >= self.restart {
            self.close()?;
        }
        if !self.started && !self.start()? {
            return Ok(Advance::Ended(Status::ReachedTolerance));
        }
        let Some(v) = self.basis.columns().last() else {
            return Ok(Advance::Ended(Status::SpaceExhausted));
        };
        let right = self.side == Side::Right;
        if right {
            precondition(self.preconditioner.as_ref(), v, &mut self.hat)?;
        } else {
            self.hat.copy_from_slice(v);
        }
        self.system.tally.product(operator, &self.hat, &mut self.system.work)?;
        // The new direction takes the product's place; from the left that of the basis vector, as the product is kept.
        let w = if right {
            &mut self.system.work
        } else {
            precondition(self.preconditioner.as_ref(), &self.system.work, &mut self.hat)?;
            &mut self.hat
        };
        let length = norm(w);
        let removed = orthogonalize(&self.basis, w, 0);
        let mut column = removed.coefficients;
        for (k, (c, s)) in self.rotations.iter().enumerate() {
            let (a, b) = (column[k], column[k + 1]);
            column[k] = c * a + s * b;
            column[k + 1] = c * b - s * a;
        }
        // What orthogonalization leaves of a vector in the span is rounding.
        let invariant = removed.norm <= 10.0 * f64::EPSILON * length;
        let below = if invariant { 0.0 } else { removed.norm };
        let last = column.len() - 1;
        let (c, s, diagonal) = rotation(column[last], below);
        if diagonal <= 10.0 * f64::EPSILON * length {
            return Ok(Advance::Ended(SINGULAR));
        }
        column[last] = diagonal;
        self.rotations.push((c, s));
        self.triangle.push(column);
        let top = self.rotated[last];
        self.rotated[last] = c * top;
        self.rotated.push(-s * top);
        self.scale = self.scale.max(length);
        if norm(&self.coefficients()) * self.scale * f64::EPSILON > MEANINGLESS * self.rotated_norm() {
            // Rounding errors of such a correction would be larger than what it corrects.
            self.rotations.pop();
            self.triangle.pop();
            self.rotated.pop();
            self.rotated[last] = top;
            return Ok(Advance::Ended(SINGULAR));
        }
        if self.flexible {
            self.kept.push_scaled(&self.hat, 1.0);
        } else if !right {
            self.kept.push_scaled(&self.system.work, 1.0);
        }
        if !invariant {
            self.basis.push_scaled(if right { &self.system.work } else { &self.hat }, removed.norm);
        }
        let residual = if right {
            (s * top).abs()
        } else {
            let mut r = std::mem::take(&mut self.hat);
            r.copy_from_slice(&self.system.r);
            self.residual(&mut r);
            self.hat = r;
            norm(&self.hat)
        };
        self.system.tally.residual = residual;
        self.system.tally.best = residual;
        Ok(if invariant { Advance::Ended(Status::SpaceExhausted) } else { Advance::Continuing })
    }

    fn tally(&self) -> Tally {
        self.system.tally
    }

    fn solution(&self) -> Vec<f64> {
        let mut x = self.system.x.clone();
        if !self.started {
            return x;
        }
        if !self.is_hatted() {
            self.combine(&mut x);
            return x;
        }
        let (mut sum, mut hat) = (vec![0.0; x.len()], vec![0.0; x.len()]);
        self.combine(&mut sum);
        // Should the preconditioner fail, the iterate of the last restart is what there is.
        if precondition(self.preconditioner.as_ref(), &sum, &mut hat).is_ok() {
            axpy(1.0, &hat, &mut x);
        }
        x
    }
}
