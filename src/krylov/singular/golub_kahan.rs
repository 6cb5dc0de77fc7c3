//! The Golub–Kahan process: two bases, and the coefficients of the products on these bases.

use faer::Mat;

use super::SingularOptions;
use crate::error::{Error, Result};
use crate::krylov::basis::{Basis, Removed, exceeds_rounding, norm, orthogonalize, orthogonalized};
use crate::krylov::completeness::Status;
use crate::krylov::factor::{MOST, PairStatus, point_upwards, temple_kato};
use crate::krylov::powers::finite_product;
use crate::krylov::start::{seed_of, seeded};
use crate::operator::vectors::accumulate;
use crate::operator::{Adjoint, Direction, Sums, Vectors};

/// One approximate singular triplet, in the coordinates of the two bases.
pub(super) struct Triplet {
    pub(super) value: f64,
    /// The coefficients of `u` on the left basis.
    p: Vec<f64>,
    /// The coefficients of `v` on the right basis.
    q: Vec<f64>,
    pub(super) residual: f64,
    /// The distance to the nearest other value, minus the residual of that other value.
    gap: f64,
    /// The standard errors of the residual (`noise`) and of the value (`standard_error`), due to the errors of the products.
    noise: f64,
    pub(super) standard_error: f64,
}

impl Triplet {
    pub(super) fn status(&self, wanted: f64) -> PairStatus {
        PairStatus::of(self.residual, self.noise, wanted)
    }
}

/// The columns of both bases, in the memory of the operator.
struct Resident {
    vectors: Box<dyn Vectors>,
    /// The largest number of columns.
    room: usize,
    /// The columns of each basis, in the order of the basis.
    columns: [Vec<usize>; 2],
}

/// The left basis, and the right basis, in lists of both.
const LEFT: usize = 0;
const RIGHT: usize = 1;

pub(super) struct GolubKahan {
    /// The left basis, and the right basis. The right basis begins with the known vectors.
    bases: [Basis; 2],
    /// The bases, while they are in the memory of the operator. Those of the host are then empty.
    resident: Option<Resident>,
    known: usize,
    /// `w`, which is the next right vector, times its norm, between two steps. It is out of date while the bases are in the memory of the
    /// operator, which has its own `w`.
    work: Vec<f64>,
    /// The norm of the next right vector; zero if there is no next vector.
    length: f64,
    /// The norm of the part of the last product with `Aᵀ` outside the right basis. It is 0 if the next right vector is random.
    beta: f64,
    /// The seed of the random vectors that continue the process if its subspace is invariant, and the number of vectors drawn.
    seed: u64,
    draws: u64,
    /// Column `j` of `R` has the coefficients of `A v_j` on the left basis. Row `i` of `L` has the coefficients of `Aᵀ u_i` on the right
    /// basis.
    forth: Vec<Vec<f64>>,
    back: Vec<Vec<f64>>,
    /// The stated errors of the products with `A` (`forth`) and with `Aᵀ` (`back`).
    forth_errors: Vec<f64>,
    back_errors: Vec<f64>,
    pub(super) products: usize,
    scale: f64,
}

impl GolubKahan {
    pub(super) fn new(rows: usize, cols: usize, options: &SingularOptions) -> Result<Self> {
        let next = options.start.vector(cols);
        Error::check_size("entries of the first vector", cols, next.len())?;
        let length = norm(&next);
        if !(length > 0.0 && length.is_finite()) {
            return Err(Error::Numerical("the first vector is zero, or holds a NaN or an infinity".into()));
        }
        let mut process = Self::empty(rows, cols, options.start.seed());
        (process.work, process.length) = (next, length);
        Ok(process)
    }

    /// Starts a process from a random vector of this seed, on the complement of orthonormal right vectors.
    pub(super) fn beside(rows: usize, known: &[Vec<f64>], seed: u64) -> Result<Self> {
        let mut process = Self::empty(rows, known.first().map_or(0, Vec::len), seed);
        known.iter().for_each(|vector| process.bases[RIGHT].push_scaled(vector, 1.0));
        process.known = known.len();
        process.draw()?;
        Ok(process)
    }

    fn empty(rows: usize, cols: usize, seed: u64) -> Self {
        Self {
            bases: [Basis::new(rows), Basis::new(cols)],
            resident: None,
            known: 0,
            work: vec![0.0; cols],
            length: 0.0,
            beta: 0.0,
            seed,
            draws: 0,
            forth: Vec::new(),
            back: Vec::new(),
            forth_errors: Vec::new(),
            back_errors: Vec::new(),
            products: 0,
            scale: 0.0,
        }
    }

    /// Moves the bases to the memory of the operator, if it has one with room for this number of products. Fails as
    /// [`Operator::vectors`](crate::operator::Operator::vectors).
    pub(super) fn upload(&mut self, operator: &dyn Adjoint, products: usize) -> Result<()> {
        let [left, right] = [LEFT, RIGHT].map(|side| self.bases[side].len());
        // No basis has more vectors than entries.
        let room = left + right + products.min(self.rows(LEFT) + self.rows(RIGHT)) + 1;
        if room > MOST {
            return Ok(());
        }
        let Some(mut vectors) = operator.vectors(room, None)? else { return Ok(()) };
        for column in self.bases.iter().flat_map(Basis::columns) {
            vectors.load(column)?;
            vectors.push(1.0)?;
        }
        vectors.load(&self.work)?;
        let columns = [(0..left).collect(), (left..left + right).collect()];
        self.bases.iter_mut().for_each(Basis::clear);
        self.resident = Some(Resident { vectors, room, columns });
        Ok(())
    }

    /// Moves the bases to the host's memory.
    fn download(&mut self) -> Result<()> {
        let Some(Resident { vectors, columns, .. }) = self.resident.take() else { return Ok(()) };
        for (basis, columns) in self.bases.iter_mut().zip(columns) {
            columns.iter().try_for_each(|&column| {
                basis.push_scaled(&vectors.column(column)?, 1.0);
                Ok::<_, Error>(())
            })?;
        }
        self.work = vectors.work()?.into_owned();
        Ok(())
    }

    /// The number of vectors of a basis.
    fn len(&self, side: usize) -> usize {
        self.resident.as_ref().map_or(self.bases[side].len(), |resident| resident.columns[side].len())
    }

    fn rows(&self, side: usize) -> usize {
        self.bases[side].rows()
    }

    /// Adds `w/divisor` to a basis.
    fn push(&mut self, side: usize, divisor: f64) -> Result<()> {
        let Some(Resident { vectors, columns, .. }) = &mut self.resident else {
            self.bases[side].push_scaled(&self.work, divisor);
            return Ok(());
        };
        columns[side].push(vectors.columns());
        vectors.push(divisor)
    }

    /// Removes from `w` its part in the span of a basis. `start` has the inner products of `w` in the memory of the operator, if they are
    /// known.
    fn orthogonalize(&mut self, side: usize, start: Option<Sums>) -> Result<Removed> {
        let Some(Resident { vectors, columns, .. }) = &mut self.resident else {
            return Ok(orthogonalize(&self.bases[side], &mut self.work));
        };
        let (columns, total) = (&columns[side], vectors.columns());
        let of_side =
            |(sums, length): Sums| (columns.iter().map(|&column| sums[column]).collect::<Vec<f64>>(), length);
        let start = start.map_or_else(|| vectors.dots_and_norm(0), Ok)?;
        orthogonalized(of_side(start), |h| {
            let mut all = vec![0.0; total];
            columns.iter().zip(h).for_each(|(&column, h)| all[column] = *h);
            vectors.remove_and_dot(&all).map(of_side)
        })
    }

    /// `w ←` a random vector without its part in the span of a basis. Returns the norms of both vectors.
    fn draw_beside(&mut self, side: usize) -> Result<[f64; 2]> {
        let seed = seed_of(self.seed, self.draws);
        self.draws += 1;
        self.work = seeded(self.rows(side), !seed);
        if let Some(resident) = &mut self.resident {
            resident.vectors.load(&self.work)?;
        }
        let before = norm(&self.work);
        Ok([before, self.orthogonalize(side, None)?.norm])
    }

    /// Continues from a random vector orthogonal to the right basis, if there is such a vector.
    fn draw(&mut self) -> Result<()> {
        (self.length, self.beta) = (0.0, 0.0);
        let n = self.rows(RIGHT);
        // In a space of few dimensions a random vector may lie almost in the span, so several are tried.
        for _ in 0..8 {
            if self.len(RIGHT) >= n {
                break;
            }
            let [before, rest] = self.draw_beside(RIGHT)?;
            if exceeds_rounding(rest, before, n) {
                self.length = rest;
                break;
            }
        }
        Ok(())
    }

    /// Returns true if the products determine the whole matrix on the complement of the known vectors. This holds if the right basis spans
    /// all patterns. It also holds if the left basis spans all photos, and their products with `Aᵀ` lie within the right basis.
    pub(super) fn is_exhausted(&self) -> bool {
        self.length == 0.0 || (self.len(LEFT) == self.rows(LEFT) && self.beta == 0.0)
    }

    /// Returns true if random vectors have continued the process.
    pub(super) fn broke_down(&self) -> bool {
        self.draws > 0
    }

    /// The number of right vectors (patterns) of the process, without known vectors.
    pub(super) fn steps(&self) -> usize {
        self.len(RIGHT) - self.known
    }

    /// The largest error that the operator stated for a product, or 0 if the operator states no errors.
    pub(super) fn largest_error(&self) -> f64 {
        self.forth_errors.iter().chain(&self.back_errors).copied().fold(0.0, f64::max)
    }

    /// `w ←` the product with the last vector of the basis `from`, without its part in the span of the other basis.
    fn multiply(&mut self, operator: &mut dyn Adjoint, from: usize) -> Result<Removed> {
        let (to, direction) =
            if from == RIGHT { (LEFT, Direction::Forward) } else { (RIGHT, Direction::Adjoint) };
        let (length, start) = match &mut self.resident {
            Some(Resident { vectors, .. }) => {
                let count = vectors.columns();
                operator.apply_within(&mut **vectors, count - 1, direction)?;
                let start = vectors.dots_and_norm(0)?;
                (finite_product(&[start.1])?, Some(start))
            }
            None => {
                self.work.resize(self.bases[to].rows(), 0.0);
                let vector = &self.bases[from].columns()[self.bases[from].len() - 1];
                operator.products(direction, &[vector], &mut [&mut self.work])?;
                (finite_product(&self.work)?, None)
            }
        };
        let errors = if from == RIGHT { &mut self.forth_errors } else { &mut self.back_errors };
        errors.push(operator.standard_error());
        self.products += 1;
        self.scale = self.scale.max(length);
        self.orthogonalize(to, start)
    }

    /// Takes a product with `A`, and also a product with `Aᵀ` if the first product is not in the span of the left basis. The process must
    /// not be exhausted.
    pub(super) fn step(&mut self, operator: &mut dyn Adjoint) -> Result<()> {
        if self.resident.as_ref().is_some_and(|resident| resident.room < resident.vectors.columns() + 2) {
            self.download()?;
        }
        self.push(RIGHT, self.length)?;
        let mut removed = self.multiply(operator, RIGHT)?;
        let is_new = exceeds_rounding(removed.norm, self.scale, self.rows(LEFT));
        if is_new {
            self.push(LEFT, removed.norm)?;
            removed.coefficients.push(removed.norm);
        }
        self.forth.push(removed.coefficients);
        if !is_new {
            return self.draw();
        }
        let mut removed = self.multiply(operator, LEFT)?;
        let is_new = exceeds_rounding(removed.norm, self.scale, self.rows(RIGHT));
        if is_new {
            (self.length, self.beta) = (removed.norm, removed.norm);
            removed.coefficients.push(self.beta);
        } else {
            self.draw()?;
        }
        self.back.push(removed.coefficients);
        Ok(())
    }

    /// Adds left vectors beyond the range of an exhausted process, so that singular values of zero also have left vectors.
    pub(super) fn complete(&mut self) -> Result<()> {
        // The memory of the operator has no room for these vectors.
        self.download()?;
        let rows = self.rows(LEFT);
        while self.len(LEFT) < self.steps().min(rows) {
            let [before, rest] = self.draw_beside(LEFT)?;
            if exceeds_rounding(rest, before, rows) {
                self.push(LEFT, rest)?;
            }
        }
        Ok(())
    }

    /// `R` and `L`, with one row for each left vector and one column for each right vector.
    fn both(&self) -> [Mat<f64>; 2] {
        let (rows, cols) = (self.len(LEFT), self.steps());
        let entry = |list: &[Vec<f64>], at: usize, of: usize| {
            list.get(at).and_then(|list| list.get(of)).copied().unwrap_or(0.0)
        };
        [
            Mat::from_fn(rows, cols, |i, j| entry(&self.forth, j, i)),
            Mat::from_fn(rows, cols, |i, j| entry(&self.back, i, self.known + j)),
        ]
    }

    pub(super) fn triplets(&self, options: &SingularOptions) -> Result<Vec<Triplet>> {
        let [forth, back] = self.both();
        let (rows, cols) = (self.len(LEFT), self.steps());
        let mean = Mat::from_fn(rows, cols, |i, j| 0.5 * (forth[(i, j)] + back[(i, j)]));
        let svd = mean.thin_svd().map_err(|_| {
            Error::Numerical(format!(
                "the dense singular value decomposition of a {rows}x{cols} matrix failed"
            ))
        })?;
        let values: Vec<f64> = svd.S().column_vector().iter().copied().collect();
        // The norm of the last product's part along the next right vector, which is not in the right basis yet.
        let waiting = self.beta;
        let mut found = Vec::new();
        for (k, &value) in values.iter().enumerate() {
            let p: Vec<f64> = svd.U().col(k).iter().copied().collect();
            let q: Vec<f64> = svd.V().col(k).iter().copied().collect();
            let off_forth =
                (0..rows).map(|i| (0..cols).map(|j| forth[(i, j)] * q[j]).sum::<f64>() - value * p[i]);
            let off_back =
                (0..cols).map(|j| (0..rows).map(|i| back[(i, j)] * p[i]).sum::<f64>() - value * q[j]);
            let along = |known: usize| self.back.iter().zip(&p).map(|(row, p)| row[known] * p).sum::<f64>();
            let squares: f64 =
                off_forth.chain(off_back).chain((0..self.known).map(along)).map(|off| off * off).sum();
            let outside = waiting * p.last().copied().unwrap_or(0.0);
            let [there, here] =
                [self.error(&self.forth_errors, &q, options), self.error(&self.back_errors, &p, options)];
            let along = [(there, self.rows(LEFT)), (here, self.rows(RIGHT))];
            let along = along.map(|(error, n)| error / (n as f64).sqrt());
            found.push(Triplet {
                value,
                residual: ((squares + outside * outside) / 2.0).sqrt(),
                gap: f64::INFINITY,
                noise: there.hypot(here) / std::f64::consts::SQRT_2,
                standard_error: 0.5 * along[0].hypot(along[1]),
                p,
                q,
            });
        }
        let known: Vec<(f64, f64)> = found.iter().map(|triplet| (triplet.value, triplet.residual)).collect();
        for (k, triplet) in found.iter_mut().enumerate() {
            let others = known.iter().enumerate().filter(|(at, _)| *at != k);
            let gaps = others.map(|(_, (value, residual))| (value - known[k].0).abs() - residual);
            triplet.gap = gaps.fold(f64::INFINITY, f64::min);
        }
        found.truncate(options.count);
        Ok(found)
    }

    /// The standard error `‖E s‖` of a combination `s` of products with these stated errors, or with the noise of the options if it is
    /// larger.
    fn error(&self, stated: &[f64], s: &[f64], options: &SingularOptions) -> f64 {
        let squares = stated.iter().zip(s).map(|(error, s)| (error.max(options.noise) * s).powi(2));
        squares.sum::<f64>().sqrt()
    }

    /// Returns the status to end with if these triplets need no further product, and `None` otherwise.
    pub(super) fn good_enough(&self, triplets: &[Triplet], options: &SingularOptions) -> Option<Status> {
        if triplets.len() < options.count || options.tolerance <= 0.0 {
            return None;
        }
        let wanted = options.tolerance * triplets[0].value;
        if triplets.iter().all(|triplet| triplet.status(wanted) == PairStatus::Converged) {
            return Some(Status::ReachedTolerance);
        }
        let is_settled = |triplet: &Triplet| {
            triplet.residual <= triplet.noise
                && temple_kato(triplet.residual, triplet.gap) <= triplet.standard_error
        };
        triplets.iter().all(is_settled).then_some(Status::NoiseFloor)
    }

    pub(super) fn spent(&self, triplets: &[Triplet], options: &SingularOptions) -> Status {
        let wanted = options.tolerance * triplets.first().map_or(0.0, |triplet| triplet.value);
        let limited = |triplet: &Triplet| triplet.status(wanted) != PairStatus::NotResolved;
        if triplets.len() >= options.count && triplets.iter().all(limited) {
            Status::NoiseFloor
        } else {
            Status::BudgetSpent
        }
    }

    /// The photo and the pattern of a triplet. The entry of largest magnitude of the pattern is positive. Overwrites `w`, so that the
    /// process takes no further step. Fails with the error of the memory of the operator.
    pub(super) fn vectors(&mut self, triplet: &Triplet) -> Result<[Vec<f64>; 2]> {
        let mut photo = self.combine(LEFT, &triplet.p)?;
        let mut pattern = self.combine(RIGHT, &triplet.q)?;
        if point_upwards(&mut pattern) {
            photo.iter_mut().for_each(|value| *value = -*value);
        }
        Ok([photo, pattern])
    }

    /// The combination `s` of the last vectors of a basis.
    fn combine(&mut self, side: usize, s: &[f64]) -> Result<Vec<f64>> {
        let mut sum = vec![0.0; self.rows(side)];
        let first = self.len(side) - s.len();
        let Some(Resident { vectors, columns, .. }) = &mut self.resident else {
            self.bases[side].accumulate(first, s, 1.0, &mut sum);
            return Ok(sum);
        };
        let mut all = vec![0.0; vectors.columns()];
        columns[side][first..].iter().zip(s).for_each(|(&column, s)| all[column] = *s);
        accumulate(&mut **vectors, 0, &all, &mut sum)?;
        Ok(sum)
    }

    /// `‖R − L‖_F / ‖R‖_F` (see `Singular::disagreement`).
    pub(super) fn disagreement(&self) -> f64 {
        let [forth, back] = self.both();
        let norm = forth.norm_l2();
        if norm > 0.0 { (&forth - &back).norm_l2() / norm } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_triplet_is_limited_by_noise_where_its_residual_is_no_larger_than_that() {
        let status = |residual: f64, noise: f64| {
            let (p, q) = (Vec::new(), Vec::new());
            Triplet { value: 1.0, p, q, residual, gap: 1.0, noise, standard_error: 0.0 }.status(0.1)
        };
        assert!(matches!(status(0.1, 0.1), PairStatus::Converged));
        assert!(matches!(status(0.05, 0.2), PairStatus::LimitedByNoise));
        assert!(matches!(status(0.2, 0.2), PairStatus::LimitedByNoise));
        assert!(matches!(status(0.3, 0.2), PairStatus::NotResolved));
        assert!(matches!(status(0.3, 0.05), PairStatus::NotResolved));
    }
}
