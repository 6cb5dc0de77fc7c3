//! Thick restart, and the residuals of Ritz vectors.

use super::super::basis::norm;
use super::Expansion;

impl Expansion {
    /// Thick restart: `V ← V S` for orthonormal eigenvectors `S` of the symmetric part of `H`, with their values; the waiting
    /// vectors are kept. `H` becomes `diag(values)` with the couplings to the waiting vectors below.
    pub(super) fn restart(&mut self, kept: &[(f64, &[f64])]) {
        self.settle();
        let (m, pending) = (self.steps(), self.pending());
        let asymmetric = self.asymmetric_part();
        let parts: Vec<Outside> = kept.iter().map(|(_, s)| self.outside(s, &asymmetric)).collect();
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

    /// `H − T` with `T` the symmetric part of the upper `m × m` of `H`, column by column, for [`Expansion::outside`].
    pub(super) fn asymmetric_part(&self) -> Vec<f64> {
        let m = self.steps();
        (0..m * m).map(|at| (at % m, at / m)).map(|(i, j)| self.entry(i, j) - self.symmetric(i, j)).collect()
    }

    /// The components of `A V s − V T s` for `s` of norm 1, with `T` the symmetric part of `H`, and `asymmetric` the other part
    /// ([`Expansion::asymmetric_part`]).
    pub(super) fn outside(&self, s: &[f64], asymmetric: &[f64]) -> Outside {
        let mut inside = vec![0.0; self.steps()];
        for (apart, s) in asymmetric.chunks_exact(self.steps().max(1)).zip(s) {
            inside.iter_mut().zip(apart).for_each(|(sum, apart)| *sum += apart * s);
        }
        let [known, waiting] = self.beyond(s);
        Outside { known, waiting, asymmetric: norm(&inside) + self.leak }
    }

    /// The components of `A V s` along the known vectors, and along the waiting ones.
    pub(super) fn beyond(&self, s: &[f64]) -> [Vec<f64>; 2] {
        let mut known = vec![0.0; self.known];
        let mut waiting = vec![0.0; self.pending()];
        for (column, s) in self.columns.iter().zip(s) {
            known.iter_mut().zip(column).for_each(|(sum, entry)| *sum += entry * s);
            let below = column.iter().skip(self.known + self.steps());
            waiting.iter_mut().zip(below).for_each(|(sum, entry)| *sum += entry * s);
        }
        [known, waiting]
    }

    /// The norm of what is outside of the subspace, without the noise of the products that it comes from. The waiting vectors come from the last
    /// few products, so that the noise of these alone is in it.
    pub(super) fn unresolved(&self, outside: &Outside, s: &[f64]) -> f64 {
        let inside = self.known + self.steps();
        let tells = |column: &Vec<f64>| column.iter().skip(inside).any(|&entry| entry != 0.0);
        let last = self.columns.iter().zip(&self.errors).zip(s).filter(|((column, _), _)| tells(column));
        let noise: f64 = last.map(|((_, error), s)| (error * s).powi(2)).sum();
        let square = norm(&outside.known).powi(2) + norm(&outside.waiting).powi(2);
        (square - noise).max(0.0).sqrt()
    }

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
