//! One cycle of GMRES, between two restarts: the basis, and the small least-squares problem.

use super::super::super::basis::{Basis, norm};
use super::super::rotation::rotation;

/// A cycle from a first residual `r_0`: an orthonormal `V`, and `H = Qᵀ R` by Givens rotations.
#[derive(Clone)]
pub(super) struct Cycle {
    pub(super) basis: Basis,
    /// `M⁻¹ v_j` if flexible, `A v_j` if preconditioned from the left, else empty.
    pub(super) kept: Basis,
    /// The columns of `R`, upper triangular.
    triangle: Vec<Vec<f64>>,
    rotations: Vec<(f64, f64)>,
    /// `Q ‖r_0‖ e_1`: one entry more than `R` has columns.
    rotated: Vec<f64>,
}

impl Cycle {
    /// An empty cycle with memory for `steps` steps and `kept` kept vectors, so that no step allocates any.
    pub(super) fn new(n: usize, steps: usize, kept: usize) -> Self {
        let mut cycle = Self {
            basis: Basis::new(n),
            kept: Basis::new(n),
            triangle: Vec::new(),
            rotations: Vec::new(),
            rotated: Vec::new(),
        };
        cycle.basis.reserve(steps + 1);
        cycle.kept.reserve(kept);
        cycle
    }

    /// Starts from `r`, whose norm is `length`; memory is reused.
    pub(super) fn start(&mut self, r: &[f64], length: f64) {
        self.clear();
        self.rotated.push(length);
        if length > 0.0 {
            self.basis.push_scaled(r, length);
        }
    }

    /// Removes all columns.
    pub(super) fn clear(&mut self) {
        self.basis.clear();
        self.kept.clear();
        self.triangle.clear();
        self.rotations.clear();
        self.rotated.clear();
    }

    /// Columns of `H` so far.
    pub(super) fn len(&self) -> usize {
        self.triangle.len()
    }

    /// `‖r_0‖`, which rotations do not change.
    pub(super) fn first_residual(&self) -> f64 {
        norm(&self.rotated)
    }

    /// Appends a column of `H` with `below` under it, and returns the residual norm after it. Returns `None`,
    /// and appends nothing, when the diagonal entry of `R` would be no larger than `tiny`.
    pub(super) fn append(&mut self, mut column: Vec<f64>, below: f64, tiny: f64) -> Option<f64> {
        for (k, (c, s)) in self.rotations.iter().enumerate() {
            let (a, b) = (column[k], column[k + 1]);
            column[k] = c * a + s * b;
            column[k + 1] = c * b - s * a;
        }
        let last = column.len() - 1;
        let (c, s, diagonal) = rotation(column[last], below);
        if diagonal <= tiny {
            return None;
        }
        column[last] = diagonal;
        self.rotations.push((c, s));
        self.triangle.push(column);
        let top = self.rotated[last];
        self.rotated[last] = c * top;
        self.rotated.push(-s * top);
        Some((s * top).abs())
    }

    /// Removes the last column.
    pub(super) fn undo(&mut self) {
        let (Some((c, s)), Some(under)) = (self.rotations.pop(), self.rotated.pop()) else { return };
        self.triangle.pop();
        if let Some(top) = self.rotated.last_mut() {
            *top = c * *top - s * under;
        }
    }

    /// `y = R⁻¹ (Q ‖r_0‖ e_1)`, one coefficient for each column.
    pub(super) fn coefficients(&self) -> Vec<f64> {
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

    /// Adds `sign · Σ y_j v_j` to `sum`, over the basis vectors or the kept ones.
    pub(super) fn combine(&self, of_kept: bool, sign: f64, sum: &mut [f64]) {
        let columns = if of_kept { &self.kept } else { &self.basis };
        let mut y = self.coefficients();
        // The last basis vector has no coefficient yet.
        y.resize(columns.len(), 0.0);
        columns.accumulate(0, &y, sign, sum);
    }

    /// `r ← V Qᵀ (0 … 0, ρ)`, the residual of this cycle's iterate, by the inverse rotations from last to
    /// first.
    pub(super) fn residual(&self, r: &mut [f64]) {
        let count = self.triangle.len();
        let mut coordinates = vec![0.0; count + 1];
        coordinates[count] = self.rotated[count];
        for (k, (c, s)) in self.rotations.iter().enumerate().rev() {
            let below = coordinates[k + 1];
            coordinates[k] = -s * below;
            coordinates[k + 1] = c * below;
        }
        // An invariant space has no last vector, and no residual along it.
        coordinates.truncate(self.basis.len());
        r.fill(0.0);
        self.basis.accumulate(0, &coordinates, 1.0, r);
    }
}
