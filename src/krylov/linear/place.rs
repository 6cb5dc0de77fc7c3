//! The vectors of a short recurrence, in the host's memory or in that of the operator.

use super::system::System;
use crate::error::Result;
use crate::krylov::basis::{dot, norm, norm_of_square, update, update2};
use crate::operator::vectors::can_combine;
use crate::operator::{Adjoint, Direction, Sums, Vectors};

/// A vector of a short recurrence.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum At {
    /// `w`, which products and combinations overwrite.
    Work,
    /// The iterate.
    X,
    /// The iterate with the smallest residual.
    Best,
    /// The residual.
    R,
    /// A vector of the method.
    Own(usize),
    /// A constant vector that only the memory of the operator holds.
    Constant(usize),
}

/// Inner products with `w`.
pub(crate) struct Dots<const K: usize> {
    /// `vᵀ w` for the vectors that were asked for.
    pub(crate) with: [f64; K],
    /// `wᵀ w`.
    pub(crate) square: f64,
    /// `‖w‖`.
    pub(crate) norm: f64,
}

/// The vectors of a method.
pub(super) enum Place {
    /// Each vector is in the host's memory. It is empty until the first step.
    Host(Vec<Vec<f64>>),
    /// All vectors are in the memory of the operator. The second field holds the columns of `x`, the best `x`, `r` and the method's own
    /// vectors. The columns of constants follow. The system holds `x` and `r` as they were at the first step.
    Resident(Box<dyn Vectors>, Vec<usize>),
}

/// The number of vectors that every method has in the memory of the operator.
const COMMON: usize = 3;

/// `M⁻¹` for a diagonal `M`, and the place of a vector that is kept meanwhile.
const INVERSE: At = At::Constant(0);
const SPARE: At = At::Constant(1);

/// The place of a vector in the list of columns, or `None` for `w` and for constants.
fn slot(at: At) -> Option<usize> {
    match at {
        At::Work | At::Constant(_) => None,
        At::X => Some(0),
        At::Best => Some(1),
        At::R => Some(2),
        At::Own(index) => Some(COMMON + index),
    }
}

/// The column of a vector, or `None` for `w`.
fn column(columns: &[usize], at: At) -> Option<usize> {
    match at {
        At::Constant(index) => Some(columns.len() + index),
        _ => slot(at).map(|slot| columns[slot]),
    }
}

fn picked<const K: usize>(columns: &[usize], (sums, norm): &Sums, with: [At; K]) -> Dots<K> {
    let square = norm * norm;
    let with = with.map(|at| column(columns, at).map_or(square, |column| sums[column]));
    Dots { with, square, norm: *norm }
}

/// The vectors of the short recurrences.
impl System {
    /// Takes the residual of the first iterate if it is not known yet: one product. Returns true if this call took the residual. Otherwise
    /// makes the vectors of the method, unless it has them: first `left` vectors as long as `b`, then `right` vectors as long as `x`. They
    /// are in the memory of the operator if there is one. A preconditioner that is not diagonal works on the host, and its vectors are
    /// there.
    pub(super) fn begin(&mut self, operator: &mut dyn Adjoint, own: [usize; 2]) -> Result<bool> {
        self.begin_with(operator, own, |system| {
            let inverse = system.inverse.diagonal();
            inverse.map_or_else(Vec::new, |inverse| vec![inverse.clone(), inverse])
        })
    }

    /// As [`System::begin`], with the constants that the method needs in the memory of the operator.
    pub(crate) fn begin_with(
        &mut self,
        operator: &mut dyn Adjoint,
        [left, right]: [usize; 2],
        constants: impl FnOnce(&Self) -> Vec<Vec<f64>>,
    ) -> Result<bool> {
        if self.open(operator)? {
            return Ok(true);
        }
        if !matches!(&self.place, Place::Host(vectors) if vectors.is_empty()) {
            return Ok(false);
        }
        let is_ordinary = self.tally.operator_power.unwrap_or(0) == 0;
        let is_simple = self.inverse.is_identity() || self.inverse.is_diagonal();
        if !self.has_left && is_ordinary && is_simple {
            self.has_left = true;
            if let Some(vectors) = self.upload(operator, left + right, &constants(self))? {
                self.place = Place::Resident(vectors, (0..COMMON + left + right).collect());
                return Ok(false);
            }
        }
        let mut own = vec![vec![0.0; self.b.len()]; left];
        own.resize(left + right, vec![0.0; self.x.len()]);
        self.place = Place::Host(own);
        Ok(false)
    }

    /// Copies the vectors and these constants to the memory of the operator, if it has one that can combine them.
    fn upload(
        &self,
        operator: &dyn Adjoint,
        own: usize,
        constants: &[Vec<f64>],
    ) -> Result<Option<Box<dyn Vectors>>> {
        let columns = COMMON + own + constants.len();
        let Some(mut vectors) = operator.vectors(columns, None)? else { return Ok(None) };
        vectors.load(&self.x)?;
        vectors.push(1.0)?;
        vectors.push(1.0)?;
        vectors.load(&self.r)?;
        vectors.push(1.0)?;
        vectors.load(&vec![0.0; self.x.len()])?;
        (0..own).try_for_each(|_| vectors.push(1.0))?;
        for constant in constants {
            vectors.load(constant)?;
            vectors.push(1.0)?;
        }
        Ok(can_combine(&mut *vectors, columns - 1)?.then_some(vectors))
    }

    /// Gives up the memory of the operator. The iterate and the residual are those of the first step. Returns true if the vectors were
    /// there.
    pub(crate) fn leave(&mut self) -> bool {
        let is_resident = self.is_resident();
        if is_resident {
            self.place = Place::Host(Vec::new());
            self.best.copy_from_slice(&self.x);
            self.tally.residual = norm(&self.r);
            self.tally.best = self.tally.residual;
        }
        is_resident
    }

    /// Whether the vectors are in the memory of the operator.
    pub(crate) fn is_resident(&self) -> bool {
        matches!(self.place, Place::Resident(..))
    }

    /// A vector in the host's memory. Only the method's own vectors are elsewhere if the vectors are in the memory of the operator.
    pub(super) fn host(&self, at: At) -> &[f64] {
        match (at, &self.place) {
            (At::X, _) => &self.x,
            (At::Best, _) => &self.best,
            (At::R, _) => &self.r,
            (At::Own(index), Place::Host(own)) => &own[index],
            _ => &self.work,
        }
    }

    /// The memory of a vector, as [`System::host`].
    fn host_mut(&mut self, at: At) -> &mut Vec<f64> {
        match (at, &mut self.place) {
            (At::X, _) => &mut self.x,
            (At::Best, _) => &mut self.best,
            (At::R, _) => &mut self.r,
            (At::Own(index), Place::Host(own)) => &mut own[index],
            _ => &mut self.work,
        }
    }

    /// `w ← A v`, for a vector `v` of about this length, which counts only until the size of the operator is known. Returns the inner
    /// products with `w`.
    pub(crate) fn multiply<const K: usize>(
        &mut self,
        operator: &mut dyn Adjoint,
        of: (At, f64),
        with: [At; K],
    ) -> Result<Dots<K>> {
        self.multiply_in(Direction::Forward, operator, of, with)
    }

    /// `w ← Aᵀ u`, for a vector `u` of about length 1, unless the size of the operator is known.
    pub(crate) fn multiply_adjoint(&mut self, operator: &mut dyn Adjoint, u: At) -> Result<()> {
        self.multiply_in(Direction::Adjoint, operator, (u, 1.0), []).map(drop)
    }

    fn multiply_in<const K: usize>(
        &mut self,
        direction: Direction,
        operator: &mut dyn Adjoint,
        (of, length): (At, f64),
        with: [At; K],
    ) -> Result<Dots<K>> {
        if let Place::Resident(vectors, columns) = &mut self.place
            && let Some(of) = column(columns, of)
        {
            let sums = self.tally.product_within(operator, &mut **vectors, (of, direction, length))?;
            return Ok(picked(columns, &sums, with));
        }
        let vector = std::mem::take(self.host_mut(of));
        let taken = match direction {
            Direction::Forward => {
                self.work.resize(self.b.len(), 0.0);
                self.tally.product(operator, &vector, &mut self.work)
            }
            Direction::Adjoint => {
                self.work.resize(self.x.len(), 0.0);
                self.tally.adjoint(operator, &vector, &mut self.work)
            }
        };
        *self.host_mut(of) = vector;
        taken.and_then(|()| self.dots(with))
    }

    /// The inner products with `w`.
    pub(crate) fn dots<const K: usize>(&mut self, with: [At; K]) -> Result<Dots<K>> {
        if let Place::Resident(vectors, columns) = &mut self.place {
            let first = if K == 0 { vectors.columns() } else { 0 };
            return Ok(picked(columns, &vectors.dots_and_norm(first)?, with));
        }
        let w = &self.work;
        let square = dot(w, w);
        let with = with.map(|at| if at == At::Work { square } else { dot(self.host(at), w) });
        Ok(Dots { with, square, norm: norm_of_square(square, w) })
    }

    /// `to ← (Σ c v)/divisor`, for one to three terms `(c, v)` in the order of the sum. If there are three, only the first can be `w`.
    /// Afterwards, `w` is unspecified unless it is `to`.
    pub(crate) fn combine(&mut self, to: At, terms: &[(f64, At)], divisor: f64) -> Result<()> {
        if let Place::Resident(vectors, columns) = &mut self.place {
            let terms: Vec<_> = terms.iter().map(|&(c, at)| (c, column(columns, at))).collect();
            return vectors.combine(column(columns, to), &terms, divisor);
        }
        let mut w = std::mem::take(&mut self.work);
        let mut others = terms.to_vec();
        let mut of_w = others.iter().position(|(_, at)| *at == At::Work).map(|index| others.remove(index).0);
        if of_w.is_none() {
            w.resize(self.host(others[0].1).len(), 0.0);
        }
        if of_w.is_none() && others.len() > 2 {
            let (c, first) = others.remove(0);
            update(&mut w, self.host(first), |_, v| v);
            of_w = Some(c);
        }
        let vectors: Vec<(f64, &[f64])> = others.iter().map(|&(c, at)| (c, self.host(at))).collect();
        match (of_w, &vectors[..]) {
            (Some(a), &[]) => {
                let as_long = if w.len() == self.b.len() { &self.b } else { &self.x };
                // A vector that vanishes has zeros without a sign.
                update(&mut w, as_long, |w, _| if a == 0.0 { 0.0 } else { a * w / divisor });
            }
            (None, &[(c, v)]) => update(&mut w, v, |_, v| c * v / divisor),
            (None, &[(c, u), (d, v)]) => update2(&mut w, u, v, |_, u, v| (c * u + d * v) / divisor),
            (Some(a), &[(c, v)]) => update(&mut w, v, |w, v| (a * w + c * v) / divisor),
            (Some(a), &[(c, u), (d, v)]) => {
                update2(&mut w, u, v, |w, u, v| (a * w + c * u + d * v) / divisor);
            }
            _ => debug_assert!(false, "one to three terms"),
        }
        if to == At::Work {
            self.work = w;
        } else {
            self.work = std::mem::replace(self.host_mut(to), w);
        }
        Ok(())
    }

    /// `v ← w`. Afterwards, `w` is unspecified.
    pub(crate) fn keep(&mut self, at: At) -> Result<()> {
        if let Place::Resident(vectors, columns) = &mut self.place {
            return column(columns, at).map_or(Ok(()), |column| vectors.keep(column));
        }
        self.exchange(at, At::Work);
        Ok(())
    }

    /// `v ← x`, for numbers of the host. Overwrites `w`.
    pub(crate) fn set(&mut self, v: At, x: Vec<f64>) -> Result<()> {
        match &mut self.place {
            Place::Resident(vectors, _) => vectors.load(&x)?,
            Place::Host(_) => self.work = x,
        }
        self.keep(v)
    }

    /// `wᵢ ← vᵢ wᵢ`.
    pub(crate) fn scale_by(&mut self, at: At) -> Result<()> {
        if let Place::Resident(vectors, columns) = &mut self.place {
            return column(columns, at).map_or(Ok(()), |column| vectors.scale_by(column));
        }
        let mut w = std::mem::take(&mut self.work);
        update(&mut w, self.host(at), |w, v| w * v);
        self.work = w;
        Ok(())
    }

    /// Moves each entry of `w`, which is as long as `x`, into an interval. In the memory of the operator, `ones` is a vector of ones.
    pub(crate) fn clip(&mut self, ones: At, (lower, upper): (f64, f64)) -> Result<()> {
        if let Place::Resident(vectors, columns) = &mut self.place {
            return column(columns, ones).map_or(Ok(()), |column| vectors.clip_by(column, (lower, upper)));
        }
        let mut w = std::mem::take(&mut self.work);
        update(&mut w, &self.x, |w, _| w.max(lower).min(upper));
        self.work = w;
        Ok(())
    }

    /// Exchanges two different vectors. In the memory of the operator, neither may be `w`.
    pub(crate) fn exchange(&mut self, a: At, b: At) {
        debug_assert_ne!(a, b);
        if let Place::Resident(_, columns) = &mut self.place {
            if let (Some(a), Some(b)) = (slot(a), slot(b)) {
                columns.swap(a, b);
            }
            return;
        }
        let mut vector = std::mem::take(self.host_mut(a));
        std::mem::swap(self.host_mut(b), &mut vector);
        *self.host_mut(a) = vector;
    }

    /// `x ← x + c v`, an iterate whose residual has this norm. Keeps it also as the best iterate if it is. Afterwards, `w` is unspecified.
    pub(super) fn accept(&mut self, (c, v): (f64, At), residual: f64) -> Result<()> {
        self.combine(At::X, &[(1.0, At::X), (c, v)], 1.0)?;
        self.note_within(residual)
    }

    /// Records the residual norm of the current iterate, and keeps the iterate if it is the best so far. Overwrites `w`.
    pub(crate) fn note_within(&mut self, residual: f64) -> Result<()> {
        if self.tally.note(residual) {
            self.combine(At::Best, &[(1.0, At::X)], 1.0)?;
        }
        Ok(())
    }

    /// `‖u − v‖`. Overwrites `w`.
    pub(crate) fn distance(&mut self, u: At, v: At) -> Result<f64> {
        self.combine(At::Work, &[(1.0, u), (-1.0, v)], 1.0)?;
        Ok(self.dots([])?.norm)
    }

    /// `uᵀ v`. Overwrites `w` if the vectors are in the memory of the operator.
    pub(super) fn inner(&mut self, u: At, v: At) -> Result<f64> {
        if !self.is_resident() {
            return Ok(dot(self.host(u), self.host(v)));
        }
        self.combine(At::Work, &[(1.0, u)], 1.0)?;
        Ok(self.dots([v])?.with[0])
    }

    /// `‖v‖`. Overwrites `w`.
    pub(super) fn length(&mut self, v: At) -> Result<f64> {
        self.combine(At::Work, &[(1.0, v)], 1.0)?;
        Ok(self.dots([])?.norm)
    }

    /// Returns the place of `M⁻¹ v`: `to`, or `v` itself if there is no preconditioner. Overwrites `w` if the vectors are in the memory of
    /// the operator, unless `v` is `w`.
    pub(super) fn preconditioned(&mut self, v: At, to: At) -> Result<At> {
        if self.inverse.is_identity() {
            return Ok(v);
        }
        if self.is_resident() {
            match v {
                At::Work => self.keep(SPARE)?,
                v => self.combine(At::Work, &[(1.0, v)], 1.0)?,
            }
            self.scale_by(INVERSE)?;
            self.keep(to)?;
            if v == At::Work {
                self.combine(At::Work, &[(1.0, SPARE)], 1.0)?;
            }
            return Ok(to);
        }
        let mut image = std::mem::take(self.host_mut(to));
        let applied = self.inverse.apply(self.host(v), &mut image);
        *self.host_mut(to) = image;
        applied.map(|()| to)
    }

    /// A copy of the best iterate.
    pub(super) fn best_iterate(&self) -> Result<Vec<f64>> {
        match &self.place {
            Place::Resident(vectors, columns) => Ok(vectors.column(columns[1])?.into_owned()),
            Place::Host(_) => Ok(self.best.clone()),
        }
    }
}
