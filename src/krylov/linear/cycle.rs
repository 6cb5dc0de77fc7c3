//! A cycle of GMRES: a basis, and the factors of its Hessenberg matrix.

use super::system::rotation;
use crate::krylov::basis::{Basis, norm};

/// A cycle that starts from a residual `r_0`. It has an orthonormal basis `V`, and factors `H = Qᵀ R` by Givens rotations.
pub(super) struct Cycle {
    /// Empty if the basis is in the memory of the operator.
    pub(super) basis: Basis,
    /// The number of columns of the basis.
    pub(super) width: usize,
    /// The largest number of steps.
    pub(super) steps: usize,
    /// The vectors `M⁻¹ v_j` if flexible, the products `A v_j` if preconditioned on the left, and otherwise empty.
    pub(super) kept: Basis,
    /// The columns of `R`, upper triangular.
    triangle: Vec<Vec<f64>>,
    rotations: Vec<(f64, f64)>,
    /// `Q ‖r_0‖ e_1`. It has one entry more than `R` has columns.
    rotated: Vec<f64>,
}

impl Cycle {
    /// Makes an empty cycle for at most `steps` steps and `kept` vectors to keep. No step allocates long vectors.
    pub(super) fn new(n: usize, steps: usize, kept: usize) -> Self {
        let mut cycle = Self {
            basis: Basis::new(n),
            width: 0,
            steps,
            kept: Basis::new(n),
            triangle: Vec::new(),
            rotations: Vec::new(),
            rotated: Vec::new(),
        };
        cycle.kept.reserve(kept);
        cycle
    }

    /// Starts from `r`, whose norm is `length`. The memory is reused.
    pub(super) fn start(&mut self, r: &[f64], length: f64, is_resident: bool) {
        self.clear();
        self.rotated.push(length);
        if length == 0.0 {
            return;
        }
        self.width = 1;
        if !is_resident {
            self.basis.reserve(self.steps + 1);
            self.basis.push_scaled(r, length);
        }
    }

    fn clear(&mut self) {
        self.basis.clear();
        self.width = 0;
        self.kept.clear();
        self.triangle.clear();
        self.rotations.clear();
        self.rotated.clear();
    }

    pub(super) fn len(&self) -> usize {
        self.triangle.len()
    }

    /// `‖r_0‖`, which rotations do not change.
    pub(super) fn first_residual(&self) -> f64 {
        norm(&self.rotated)
    }

    /// Appends a column of `H`, with the entry `below` under it, and returns the new residual norm. If the diagonal entry of `R` would not
    /// exceed `tiny`, appends nothing and returns `None`.
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

    /// Adds `sign · Σ y_j w_j` to `sum`, over the kept vectors `w`.
    pub(super) fn combine_kept(&self, sign: f64, sum: &mut [f64]) {
        let mut y = self.coefficients();
        y.resize(self.kept.len(), 0.0);
        self.kept.accumulate(0, &y, sign, sum);
    }

    /// `Qᵀ (0 … 0, ρ)`, the residual of this cycle's iterate on the basis. The inverse rotations are applied from last to first.
    pub(super) fn residual(&self) -> Vec<f64> {
        let count = self.triangle.len();
        let mut coordinates = vec![0.0; count + 1];
        coordinates[count] = self.rotated[count];
        for (k, (c, s)) in self.rotations.iter().enumerate().rev() {
            let below = coordinates[k + 1];
            coordinates[k] = -s * below;
            coordinates[k + 1] = c * below;
        }
        // If the space is invariant, there is no last basis vector, and the residual has no component along it.
        coordinates.truncate(self.width);
        coordinates
    }
}
