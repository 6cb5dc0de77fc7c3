//! Thick restart, and the residuals of Ritz vectors.

use super::super::basis::norm;
use super::Expansion;

impl Expansion {
    /// Thick restart: `V ← V S` for orthonormal eigenvectors `S` of the symmetric part of `H`, with their values; the waiting
    /// vectors are kept. `H` becomes `diag(values)` with the couplings to the waiting vectors below.
    pub(super) fn restart(&mut self, kept: &[(f64, &[f64])]) {
        self.settle();
        let (m, pending) = (self.steps(), self.pending());
        let parts: Vec<Outside> = kept.iter().map(|(_, s)| self.outside(s)).collect();
        // Each part includes what earlier restarts discarded; count it once.
        let lost: Vec<f64> = parts.iter().map(|part| part.asymmetric - self.leak).collect();
        self.leak += norm(&lost);
        self.errors = kept.iter().map(|(_, s)| self.noise(s, &[])).collect();
        let vectors: Vec<&[f64]> = kept.iter().map(|(_, s)| *s).collect();
        self.basis.rotate(self.known, self.known + m, &vectors);
        self.columns.clear();
        for (index, ((value, _), part)) in kept.iter().zip(parts).enumerate() {
            let mut column = part.known;
            column.resize(self.known + kept.len(), 0.0);
            column[self.known + index] = *value;
            column.extend_from_slice(&part.waiting[..pending]);
            self.columns.push(column);
        }
    }

    /// The components of `A V s − V T s` for `s` of norm 1, with `T` the symmetric part of `H`.
    pub(super) fn outside(&self, s: &[f64]) -> Outside {
        let m = self.steps();
        let mut known = vec![0.0; self.known];
        let mut inside = vec![0.0; m];
        let mut waiting = vec![0.0; self.pending()];
        for (j, column) in self.columns.iter().enumerate() {
            for (sum, entry) in known.iter_mut().zip(column) {
                *sum += entry * s[j];
            }
            for (i, sum) in inside.iter_mut().enumerate() {
                *sum += (self.entry(i, j) - self.symmetric(i, j)) * s[j];
            }
            for (sum, entry) in waiting.iter_mut().zip(column.iter().skip(self.known + m)) {
                *sum += entry * s[j];
            }
        }
        Outside { known, waiting, asymmetric: norm(&inside) + self.leak }
    }
}

impl Expansion {
    /// The part of `‖(H − T) s‖` that independent errors of the products do not explain; 0 where none are stated.
    ///
    /// Errors of norm `e_i` and `e_j`, which are spread evenly over `n` entries, make the difference of `H_ij` and `H_ji` have the variance
    /// `(e_i² + e_j²)/n`, and each differs from their mean by half of it.
    pub(super) fn beyond_errors(&self, asymmetric: f64, s: &[f64]) -> f64 {
        let squares: Vec<f64> = self.errors.iter().map(|error| error * error).collect();
        let all: f64 = squares.iter().sum();
        if all == 0.0 {
            return 0.0;
        }
        let (m, n) = (squares.len() as f64, self.n() as f64);
        let of_column = |(square, s): (&f64, &f64)| s * s * (all + (m - 2.0) * square) / (4.0 * n);
        let explained: f64 = squares.iter().zip(s).map(of_column).sum();
        (asymmetric * asymmetric - explained).max(0.0).sqrt()
    }
}

/// The components of `A V s − V T s`.
pub(super) struct Outside {
    /// Along `Q`: zero to rounding where the known vectors are eigenvectors of a symmetric `A`.
    pub(super) known: Vec<f64>,
    /// Along the waiting vectors.
    pub(super) waiting: Vec<f64>,
    /// The norm of `V (H − T) s` plus a bound on what restarts discarded: zero to rounding where `A` is
    /// symmetric.
    pub(super) asymmetric: f64,
}
