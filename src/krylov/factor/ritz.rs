//! The Rayleigh–Ritz method: approximate eigenpairs from a subspace, their order and their error bounds. The method takes no product.

use faer::linalg::solvers::DenseSolveCore;
use faer::{Mat, Side, c64};

use super::Factorization;
use crate::error::{Error, Result};
use crate::krylov::basis::norm;

/// The part of the spectrum that is wanted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Which {
    /// LA, LR: the largest values (or largest real parts), +∞ first.
    #[default]
    LargestAlgebraic,
    /// SA, SR: the smallest values (or smallest real parts), −∞ first.
    SmallestAlgebraic,
    /// LM: the largest absolute values.
    LargestMagnitude,
    /// SM: the smallest absolute values. Unless these values are at an end of the spectrum, they converge late or never: a Krylov space
    /// approximates the ends first, and photos cannot invert the operator.
    SmallestMagnitude,
    /// BE: values from both ends: the largest, the smallest, the second largest, and so on.
    BothEnds,
    /// LI: the largest absolute values of the imaginary part, for operators that are not symmetric.
    LargestImaginary,
}

impl Which {
    /// Orders the indices of `values` (real and imaginary part), the most wanted first. In a tie (a complex pair), the value with the
    /// larger imaginary part comes first, then the value with the lower index.
    pub(in crate::krylov) fn order(self, values: &[(f64, f64)]) -> Vec<usize> {
        let mut order: Vec<usize> = (0..values.len()).collect();
        let key = |index: usize| {
            let (re, im) = values[index];
            match self {
                Self::LargestAlgebraic | Self::BothEnds => -re,
                Self::SmallestAlgebraic => re,
                Self::LargestMagnitude => -re.hypot(im),
                Self::SmallestMagnitude => re.hypot(im),
                Self::LargestImaginary => -im.abs(),
            }
        };
        order.sort_by(|&i, &j| key(i).total_cmp(&key(j)).then(values[j].1.total_cmp(&values[i].1)));
        if self == Self::BothEnds {
            let (mut first, mut last) = (0, order.len());
            let sorted = order.clone();
            for (turn, slot) in order.iter_mut().enumerate() {
                if turn % 2 == 0 {
                    *slot = sorted[first];
                    first += 1;
                } else {
                    last -= 1;
                    *slot = sorted[last];
                }
            }
        }
        order
    }
}

/// The status of an approximate eigenpair.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum PairStatus {
    /// The residual and the noise of the products are both within the tolerance.
    Converged,
    /// The residual is within the noise of the products, which is above the tolerance. Only products with less noise would help.
    LimitedByNoise,
    /// More products would improve the pair.
    NotResolved,
}

impl PairStatus {
    /// Finds the status of a residual that should be at most `wanted`, for products with the error `noise`.
    pub(crate) fn of(residual: f64, noise: f64, wanted: f64) -> Self {
        if residual <= wanted && noise <= wanted {
            Self::Converged
        } else if residual <= noise {
            Self::LimitedByNoise
        } else {
            Self::NotResolved
        }
    }
}

/// A Ritz pair `(θ, y = V s)`: the Rayleigh–Ritz approximation of an eigenpair from the subspace.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RitzPair {
    /// `θ` (its real part), approximating an eigenvalue.
    pub value: f64,
    /// The imaginary part of `θ`; 0 for a symmetric operator.
    pub imaginary: f64,
    /// `‖A y − θ y‖₂` for `‖y‖ = 1`, from the products already taken. It is `|β_m s_m|` (symmetric) or `|h_{m+1,m} s_m|` (general
    /// operator).
    pub residual: f64,
    /// The distance from `θ` to the nearest other Ritz value, minus the residual of that Ritz value. It estimates the gap between `θ` and
    /// the other eigenvalues, as far as the subspace shows them. It is infinite if there is no other Ritz value, and 0 for a general
    /// operator.
    pub gap: f64,
    /// The condition number of `θ` as an eigenvalue of `H`: 1 for a symmetric operator, infinite for a defective `θ`.
    pub condition: f64,
    /// An allowance for rounding errors in `θ`, a small multiple of `ε ‖A‖`.
    pub rounding: f64,
    /// The standard error `‖E s‖` of `A y`, from the stated errors of the products
    /// ([`Operator::standard_errors`](crate::operator::Operator::standard_errors)). It is 0 if no errors are stated.
    pub noise: f64,
    /// The part of `‖(H − T) s‖` that the stated errors of the products do not explain. `T` is the symmetric part of `H`. The asymmetry
    /// reveals a part of the operator's systematic errors. The value is 0 for a general operator, and for an operator that states no
    /// errors.
    pub asymmetric: f64,
    /// The part of the residual that lies outside the subspace, and that the errors of the products causing it do not explain. It limits
    /// how far `θ` may change with more products.
    pub unresolved: f64,
    /// `s` (its real part), of length `m`. The real and imaginary parts together have norm 1.
    pub coefficients: Vec<f64>,
    /// The imaginary part of `s`; empty for a real pair.
    pub imaginary_coefficients: Vec<f64>,
}

impl RitzPair {
    /// Returns true if `θ` and `y` are real.
    pub fn is_real(&self) -> bool {
        self.imaginary_coefficients.is_empty()
    }

    /// Returns true if `‖A y − θ y‖ ≤ tolerance · scale`, with `scale` of the size of `‖A‖`. An eigenvalue then lies within the distance
    /// `tolerance · scale` of `θ` (Weyl's bound). The error of the vector depends on the gap to the other eigenvalues (Davis–Kahan).
    pub fn is_resolved(&self, tolerance: f64, scale: f64) -> bool {
        self.residual <= tolerance * scale
    }

    /// Finds the status for a residual that should be at most `wanted`. `noise` is the norm of the error of a product with a unit vector.
    /// If the errors of the products are independent, `‖E s‖` is about `noise` for any `s` of norm 1. If the operator states a larger
    /// error, the stated error counts.
    pub fn status(&self, wanted: f64, noise: f64) -> PairStatus {
        PairStatus::of(self.residual, noise.max(self.noise), wanted)
    }

    /// The standard error of `θ` due to noise. For measured products, it also includes systematic errors that are common to all products,
    /// and the change that more products would cause.
    ///
    /// Each product with a unit vector has an error of norm `noise`, or the error that the operator states, whichever is larger. `θ`
    /// changes by `yᵀ E s`. If an error of norm `‖E s‖` is spread evenly over the `n` entries, its component along `y` is `‖E s‖/√n`.
    ///
    /// A systematic error that is common to all products, such as a projector that is less even than its calibration says, never averages
    /// out. The symmetric part of this error changes `θ` but cannot be detected. The asymmetric part can be detected, as
    /// [`RitzPair::asymmetric`]. Both parts have the same size if projector and camera have similar errors, so the detected part stands for
    /// both.
    ///
    /// More products would change `θ` by at most [`RitzPair::unresolved`], or by its square over the gap ([`temple_kato`]). If eigenvalues
    /// are dense, as in direct light, this change is still larger than the noise after a few dozen products. If only a bound `a` on an
    /// error is known, the error counts as uniform between `±a`, with the standard error `a/√3` (*Guide to the expression of uncertainty in
    /// measurement*, 4.3.7). Without noise, this term is left out, and [`RitzPair::bound`] covers the change.
    pub fn standard_error(&self, noise: f64, n: usize) -> f64 {
        let noise = noise.max(self.noise);
        if noise == 0.0 {
            return self.asymmetric;
        }
        let unresolved = temple_kato(self.unresolved, self.gap) / 3.0_f64.sqrt();
        evenly(noise, n).hypot(self.asymmetric).hypot(unresolved)
    }

    /// A limit for the residual of the true operator. It includes the noise along one direction only, and combines two terms: the part of
    /// the residual that the stated errors of the products do not explain, and the component of these errors along any one direction of the
    /// space. If no errors are stated, the limit is the residual itself.
    pub fn beyond_noise(&self, n: usize) -> f64 {
        let unexplained = (self.residual * self.residual - self.noise * self.noise).max(0.0);
        (unexplained + evenly(self.noise, n).powi(2)).sqrt()
    }

    /// Returns true if more products would not improve the pair. The residual must be within the noise of the products (`noise` for each
    /// product with a unit vector, or the error that the operator states). In addition, the possible change of `θ` must be less than the
    /// standard error of `θ` due to this noise. An eigenvalue averages over all `n` entries, so its error is far below the error of the
    /// vector, and it can still improve when the residual is within the noise.
    pub(in crate::krylov) fn is_settled(&self, noise: f64, n: usize) -> bool {
        let noise = noise.max(self.noise);
        self.residual <= noise && temple_kato(self.residual, self.gap) <= evenly(noise, n)
    }

    /// A bound on the residual norm of the true operator: `‖A y − θ y‖ + ‖E s‖`. If every product with a unit vector has an error of norm
    /// at most `noise`, then `‖E s‖ ≤ noise · ‖s‖₁` (Simoncini and Szyld, doi:10.1137/S1064827502406415). Errors that the operator states
    /// are standard errors of independent products, and two standard errors are added for them.
    pub fn true_residual(&self, noise: f64) -> f64 {
        let parts =
            self.coefficients.iter().zip(self.imaginary_coefficients.iter().chain(std::iter::repeat(&0.0)));
        let sum: f64 = parts.map(|(re, im)| re.hypot(*im)).sum();
        self.residual + noise * sum + 2.0 * self.noise
    }

    /// A bound on the distance from `θ` to the nearest eigenvalue. For a symmetric operator, the bound is rigorous: an eigenvalue lies
    /// within the residual norm (Weyl; Parlett, theorem 4.5.1). For a general operator, it is the first-order estimate condition ×
    /// (residual + rounding).
    pub fn bound(&self, noise: f64) -> f64 {
        self.condition * (self.true_residual(noise) + self.rounding)
    }

    /// The Temple–Kato bound `ρ²/gap` on the distance from `θ` to the nearest eigenvalue, or [`RitzPair::bound`] if that is smaller. The
    /// Temple–Kato bound holds only if the subspace has missed no eigenvalue within the gap, and only knowledge of the problem can
    /// guarantee this (Kato, doi:10.1143/JPSJ.4.334; Parlett, theorem 11.7.1).
    pub fn gap_bound(&self, noise: f64) -> f64 {
        let residual = self.true_residual(noise);
        if self.gap > residual {
            (residual * residual / self.gap + self.rounding).min(self.bound(noise))
        } else {
            self.bound(noise)
        }
    }
}

/// Bounds the distance of a Ritz value from an eigenvalue. The bound is the smaller of the residual and, by Temple and Kato, the square of
/// the residual over the gap to the other eigenvalues (see [`RitzPair::gap_bound`]).
pub fn temple_kato(residual: f64, gap: f64) -> f64 {
    if gap > residual { residual * (residual / gap) } else { residual }
}

/// The component, along any one direction, of an error of norm `norm` that is spread evenly over `n` entries.
fn evenly(norm: f64, n: usize) -> f64 {
    norm / (n.max(1) as f64).sqrt()
}

impl Factorization {
    /// Computes the wanted Ritz pairs of the symmetric part `T` of `H = Vᵀ A V` ([`Factorization::symmetric`]). The asymmetric part comes
    /// from noise and from asymmetries of a rig, and counts in the residuals. Both triangles of `H` measure the same numbers, and their
    /// mean has less noise than either triangle.
    pub(super) fn ritz_of_symmetric(&self, which: Which, count: usize) -> Result<Vec<RitzPair>> {
        let mut pairs = self.all_of_symmetric(which)?;
        let residuals: Vec<(f64, f64)> = pairs.iter().map(|pair| (pair.value, pair.residual)).collect();
        pairs.truncate(count);
        for (index, pair) in pairs.iter_mut().enumerate() {
            let others = residuals.iter().enumerate().filter(|(other, _)| *other != index);
            pair.gap = others.fold(f64::INFINITY, |gap, (_, (value, residual))| {
                gap.min((value - pair.value).abs() - residual)
            });
        }
        Ok(pairs)
    }

    pub(super) fn all_of_symmetric(&self, which: Which) -> Result<Vec<RitzPair>> {
        let m = self.steps();
        if which == Which::LargestImaginary {
            return Err(Error::option(
                "--which",
                "the eigenvalues of a symmetric operator have no imaginary part",
            )
            .help("use the Arnoldi method, or ask for another end of the spectrum"));
        }
        if m == 0 {
            return Ok(Vec::new());
        }
        let projected = Mat::from_fn(m, m, |i, j| self.symmetric(i, j));
        let decomposition = projected.self_adjoint_eigen(Side::Lower).map_err(|_| {
            Error::Numerical(format!("the dense eigensolver failed on a {m}x{m} symmetric matrix"))
        })?;
        let values: Vec<(f64, f64)> =
            decomposition.S().column_vector().iter().map(|value| (*value, 0.0)).collect();
        let (rounding, asymmetric) = (self.rounding(), self.asymmetric_part());
        Ok(which
            .order(&values)
            .into_iter()
            .map(|k| {
                let coefficients: Vec<f64> = decomposition.U().col(k).iter().copied().collect();
                let outside = self.outside(&coefficients, &asymmetric);
                let residual = norm(&outside.known).hypot(norm(&outside.waiting)).hypot(outside.asymmetric);
                RitzPair {
                    value: values[k].0,
                    residual,
                    gap: f64::INFINITY,
                    condition: 1.0,
                    rounding,
                    noise: self.noise(&coefficients, &[]),
                    unresolved: self.unresolved(&outside, &coefficients),
                    asymmetric: self.beyond_errors(outside.asymmetric, &coefficients),
                    coefficients,
                    ..RitzPair::default()
                }
            })
            .collect())
    }

    /// Bounds the rounding of products of `n` terms, of orthogonalization, and of the dense eigensolver on `m × m`.
    fn rounding(&self) -> f64 {
        let terms = 10.0 + (self.n() as f64).sqrt() + self.steps() as f64;
        f64::EPSILON * self.scale() * terms
    }

    /// Computes the wanted eigenpairs of `H`. A complex pair counts as two eigenpairs, and the eigenpair with positive imaginary part comes
    /// first. If `count` ends between the two, only the first is returned.
    pub(super) fn ritz_of_general(&self, which: Which, count: usize) -> Result<Vec<RitzPair>> {
        let m = self.steps();
        if m == 0 || count == 0 {
            return Ok(Vec::new());
        }
        let projected = Mat::from_fn(m, m, |i, j| self.entry(i, j));
        let decomposition = projected.eigen().map_err(|_| {
            Error::Numerical(format!("the dense eigensolver failed on a {m}x{m} Hessenberg matrix"))
        })?;
        let values: Vec<(f64, f64)> =
            decomposition.S().column_vector().iter().map(|value| (value.re, value.im)).collect();
        let right = decomposition.U();
        let left = right.to_owned().partial_piv_lu().inverse();
        let rounding = self.rounding();
        Ok(which
            .order(&values)
            .into_iter()
            .take(count)
            .map(|k| {
                let (value, imaginary) = values[k];
                let column: Vec<c64> = right.col(k).iter().copied().collect();
                let length = length_of(&column);
                let condition = length * length_of(&(0..m).map(|j| left[(k, j)]).collect::<Vec<c64>>());
                // With the phase `unit`, the entry of largest magnitude is real and positive.
                let largest =
                    column.iter().fold(c64::new(0.0, 0.0), |a, &b| if size(b) > size(a) { b } else { a });
                let unit = c64::new(largest.re / size(largest), -largest.im / size(largest));
                let turned = column.iter().map(|&entry| {
                    let turned = entry * unit;
                    (turned.re / length, turned.im / length)
                });
                let (coefficients, mut imaginary_coefficients): (Vec<f64>, Vec<f64>) = turned.unzip();
                if imaginary == 0.0 {
                    imaginary_coefficients.clear();
                }
                let residual = self.outside_of_general(&coefficients).hypot(if imaginary == 0.0 {
                    0.0
                } else {
                    self.outside_of_general(&imaginary_coefficients)
                });
                RitzPair {
                    value,
                    imaginary,
                    residual,
                    condition: if condition.is_finite() { condition.max(1.0) } else { f64::INFINITY },
                    rounding,
                    noise: self.noise(&coefficients, &imaginary_coefficients),
                    coefficients,
                    imaginary_coefficients,
                    ..RitzPair::default()
                }
            })
            .collect())
    }

    /// `‖A V s − V H s‖`.
    fn outside_of_general(&self, s: &[f64]) -> f64 {
        let [known, waiting] = self.beyond(s);
        norm(&known).hypot(norm(&waiting))
    }
}

fn length_of(column: &[c64]) -> f64 {
    column.iter().map(|entry| entry.re * entry.re + entry.im * entry.im).sum::<f64>().sqrt()
}

fn size(entry: c64) -> f64 {
    entry.re.hypot(entry.im)
}

impl Factorization {
    /// Thick restart: `V ← V S`, where the columns of `S` are the coefficients of the kept pairs, eigenvectors of the symmetric part of
    /// `H`. The waiting vectors are kept. `H` becomes `diag(values)` with the couplings to the waiting vectors below.
    pub(super) fn restart(&mut self, kept: &[RitzPair]) {
        self.settle();
        let (m, pending) = (self.steps(), self.pending());
        let asymmetric = self.asymmetric_part();
        let parts: Vec<Outside> =
            kept.iter().map(|pair| self.outside(&pair.coefficients, &asymmetric)).collect();
        // Each value includes the loss of earlier restarts, which must be counted only once.
        let lost: Vec<f64> = parts.iter().map(|part| part.asymmetric - self.leak).collect();
        self.leak += norm(&lost);
        self.errors = kept.iter().map(|pair| self.noise(&pair.coefficients, &[])).collect();
        let vectors: Vec<&[f64]> = kept.iter().map(|pair| &pair.coefficients[..]).collect();
        self.host.basis.rotate(self.known, self.known + m, &vectors);
        self.columns.clear();
        for (index, (pair, part)) in kept.iter().zip(parts).enumerate() {
            let mut column = part.known;
            column.resize(self.known + kept.len(), 0.0);
            column[self.known + index] = pair.value;
            column.extend_from_slice(&part.waiting[..pending]);
            self.columns.push(column);
        }
    }

    /// `H − T`, column by column, for [`Factorization::outside`]. `T` is the symmetric part of the upper `m × m` of `H`.
    fn asymmetric_part(&self) -> Vec<f64> {
        let m = self.steps();
        (0..m * m).map(|at| (at % m, at / m)).map(|(i, j)| self.entry(i, j) - self.symmetric(i, j)).collect()
    }

    /// The components of `A V s − V T s` for `s` of norm 1. `T` is the symmetric part of `H`, and `asymmetric` is `H − T`
    /// ([`Factorization::asymmetric_part`]).
    fn outside(&self, s: &[f64], asymmetric: &[f64]) -> Outside {
        let mut inside = vec![0.0; self.steps()];
        for (apart, s) in asymmetric.chunks_exact(self.steps().max(1)).zip(s) {
            inside.iter_mut().zip(apart).for_each(|(sum, apart)| *sum += apart * s);
        }
        let [known, waiting] = self.beyond(s);
        Outside { known, waiting, asymmetric: norm(&inside) + self.leak }
    }

    /// The components of `A V s` along the known vectors, and along the waiting vectors.
    fn beyond(&self, s: &[f64]) -> [Vec<f64>; 2] {
        let mut known = vec![0.0; self.known];
        let mut waiting = vec![0.0; self.pending()];
        for (column, s) in self.columns.iter().zip(s) {
            known.iter_mut().zip(column).for_each(|(sum, entry)| *sum += entry * s);
            let below = column.iter().skip(self.known + self.steps());
            waiting.iter_mut().zip(below).for_each(|(sum, entry)| *sum += entry * s);
        }
        [known, waiting]
    }

    /// The norm of the residual's part outside the subspace, minus the noise of the products that cause this part. Only the last few
    /// products have parts along the waiting vectors, so only their noise counts.
    fn unresolved(&self, outside: &Outside, s: &[f64]) -> f64 {
        let inside = self.known + self.steps();
        let tells = |column: &Vec<f64>| column.iter().skip(inside).any(|&entry| entry != 0.0);
        let last = self.columns.iter().zip(&self.errors).zip(s).filter(|((column, _), _)| tells(column));
        let noise: f64 = last.map(|((_, error), s)| (error * s).powi(2)).sum();
        let square = norm(&outside.known).powi(2) + norm(&outside.waiting).powi(2);
        (square - noise).max(0.0).sqrt()
    }

    /// The part of `‖(H − T) s‖` that independent errors of the products do not explain; 0 if no errors are stated.
    ///
    /// If errors of norm `e_i` and `e_j` are spread evenly over `n` entries, the difference of `H_ij` and `H_ji` has the variance
    /// `(e_i² + e_j²)/n`. Both entries differ from their mean by half of this difference.
    fn beyond_errors(&self, asymmetric: f64, s: &[f64]) -> f64 {
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
struct Outside {
    /// The components along `Q`. They are zero to rounding if the known vectors are eigenvectors of a symmetric `A`.
    known: Vec<f64>,
    /// The components along the waiting vectors.
    waiting: Vec<f64>,
    /// The norm of `V (H − T) s`, plus a bound on the part that restarts discarded. It is zero to rounding if `A` is symmetric.
    asymmetric: f64,
}
