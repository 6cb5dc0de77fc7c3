//! A copy of a symmetric model in the memory of the operator, where its box problems are solved.
//!
//! An iteration of a box problem reads all patterns and products of the model, here four times. The memory of a device is many times as
//! fast as that of the host, and only coefficients move.

use super::Bounds;
use super::box_problem::{Finish, Iterates};
use super::model::SecantModel;
use super::sweep::{Coordinates, Swept};
use crate::error::{Error, Result};
use crate::krylov::factor::MOST;
use crate::operator::vectors::can_combine;
use crate::operator::{Adjoint, Vectors};

/// The number of vectors beside the patterns and products, whose columns follow in pairs.
const OTHERS: usize = 9;

// The columns of the other vectors. U, BEFORE and DOMINANT exchange their columns.
const U: usize = 0;
const BEFORE: usize = 1;
/// The dominant eigenvector of `(D^½ M̂)ᵀ D^½ M̂`, approximately.
const DOMINANT: usize = 2;
const Y: usize = 3;
const PRODUCT: usize = 4;
/// `M̂ D^½ b`.
const CONSTANT: usize = 5;
/// `D^½`, `D` and `b`.
const ROOT: usize = 6;
const DIAGONAL: usize = 7;
const RHS: usize = 8;

/// The memory of the operator, as long as it serves.
pub(super) struct Resident {
    may_reside: bool,
    copy: Option<Copied>,
}

impl Resident {
    pub(super) fn new(may_reside: bool) -> Self {
        Self { may_reside, copy: None }
    }

    /// `x ← argmin ‖M x − b‖` over the box, starting from `x`. Returns `‖M x − b‖`, or `None` with the same `x` if the operator has no
    /// memory of its own, or if that memory lacks room, cannot combine vectors, or fails. Fails with the other errors of
    /// [`Operator::vectors`](crate::operator::Operator::vectors).
    pub(super) fn minimize(
        &mut self,
        operator: &dyn Adjoint,
        model: &SecantModel,
        (b, bounds): (&[f64], Bounds),
        x: &mut [f64],
    ) -> Result<Option<f64>> {
        if !self.may_reside {
            return Ok(None);
        }
        let known = model.patterns.len();
        if self.copy.as_ref().is_none_or(|copy| copy.room < known) {
            self.copy = None;
            self.copy = or_none(Copied::new(operator, &model.root, b, (2 * known).max(FEWEST)))?.flatten();
        }
        let found = self.copy.as_mut().map(|copy| or_none(copy.minimize(model, bounds, x))).transpose()?;
        self.may_reside = found.flatten().is_some();
        if !self.may_reside {
            self.copy = None;
        }
        Ok(found.flatten())
    }
}

/// The fewest products for which there is room.
const FEWEST: usize = 16;

/// Makes `None` of an error of the memory.
fn or_none<T>(found: Result<T>) -> Result<Option<T>> {
    match found {
        Ok(found) => Ok(Some(found)),
        Err(Error::Device { .. }) => Ok(None),
        Err(other) => Err(other),
    }
}

struct Copied {
    vectors: Box<dyn Vectors>,
    /// The columns of `U`, `BEFORE` and `DOMINANT`.
    moving: [usize; 3],
    /// The number of patterns that have been copied, and the largest number.
    known: usize,
    room: usize,
}

impl Copied {
    /// Copies the parts of a model that stay the same, with room for this number of products. Returns `None` if the operator has no memory
    /// of its own, or one that lacks room or cannot combine vectors. Fails with the errors of
    /// [`Operator::vectors`](crate::operator::Operator::vectors).
    fn new(operator: &dyn Adjoint, root: &[f64], b: &[f64], products: usize) -> Result<Option<Self>> {
        let room = products.min(root.len());
        let columns = OTHERS + 2 * room;
        if columns > MOST {
            return Ok(None);
        }
        let Some(mut vectors) = operator.vectors(columns, None)? else { return Ok(None) };
        vectors.load(&vec![0.0; root.len()])?;
        (0..ROOT).try_for_each(|_| vectors.push(1.0))?;
        let diagonal: Vec<f64> = root.iter().map(|s| s * s).collect();
        for vector in [root, &diagonal, b] {
            vectors.load(vector)?;
            vectors.push(1.0)?;
        }
        let combines = can_combine(&mut *vectors, OTHERS - 1)?;
        Ok(combines.then_some(Self { vectors, moving: [U, BEFORE, DOMINANT], known: 0, room }))
    }

    /// `x ← argmin ‖M x − b‖` over the box, starting from `x`. Returns `‖M x − b‖`. After an error of the memory, `x` is as before.
    fn minimize(&mut self, model: &SecantModel, bounds: Bounds, x: &mut [f64]) -> Result<f64> {
        self.catch_up(model)?;
        let lipschitz = self.lipschitz(model)?;
        // M̂ D^½ b
        self.copy(RHS, None)?;
        self.vectors.scale_by(ROOT)?;
        let (c, d) = along(&self.vectors.dots_and_norm(OTHERS)?.0);
        self.multiply(model, &c, &model.along_patterns(&c, &d))?;
        self.vectors.keep(CONSTANT)?;

        let scaled: Vec<f64> = x.iter().zip(&model.root).map(|(x, s)| x * s).collect();
        self.vectors.load(&scaled)?;
        self.vectors.keep(self.moving[U])?;
        self.vectors.keep(self.moving[BEFORE])?;
        let (mut of_u, norm) = self.coordinates()?;
        if lipschitz > 0.0 {
            let mut pair = Pair { norm, copy: self, u: U, v: BEFORE };
            of_u = model.descend(&mut pair, of_u, lipschitz, bounds)?;
        }
        // ‖M x − b‖
        self.copy(self.moving[U], None)?;
        self.multiply(model, &of_u.c, &model.along_patterns(&of_u.c, &of_u.d))?;
        self.vectors.scale_by(ROOT)?;
        self.vectors.combine(None, &[(1.0, None), (-1.0, Some(RHS))], 1.0)?;
        let (_, predicted) = self.vectors.dots_and_norm(OTHERS)?;
        let u = self.vectors.column(self.moving[U])?;
        for ((x, u), s) in x.iter_mut().zip(&*u).zip(&model.root) {
            *x = bounds.clip(u / s);
        }
        Ok(predicted)
    }

    /// Copies the patterns and products that the model has learned since the last call.
    fn catch_up(&mut self, model: &SecantModel) -> Result<()> {
        for (v, w) in model.patterns.columns().iter().zip(model.products.columns()).skip(self.known) {
            for vector in [v, w] {
                self.vectors.load(vector)?;
                self.vectors.push(1.0)?;
            }
            self.known += 1;
        }
        Ok(())
    }

    /// The same bound as that of the host.
    fn lipschitz(&mut self, model: &SecantModel) -> Result<f64> {
        self.copy(self.moving[DOMINANT], None)?;
        let (mut of_u, mut norm) = self.coordinates()?;
        if norm == 0.0 {
            self.copy(ROOT, Some(self.moving[DOMINANT]))?;
            self.copy(ROOT, None)?;
            (of_u, norm) = self.coordinates()?;
        }
        model.growth(&mut Pair { norm, copy: self, u: DOMINANT, v: BEFORE }, of_u, norm)
    }

    fn copy(&mut self, from: usize, to: Option<usize>) -> Result<()> {
        self.vectors.combine(to, &[(1.0, Some(from))], 1.0)
    }

    /// The coordinates of `w`, and `‖w‖`. Overwrites `w`.
    fn coordinates(&mut self) -> Result<(Coordinates, f64)> {
        let (plain, norm) = self.vectors.dots_and_norm(OTHERS)?;
        self.weighted(along(&plain), norm)
    }

    /// Adds the inner products with `D w` to those with `w`.
    fn weighted(&mut self, (c, d): (Vec<f64>, Vec<f64>), norm: f64) -> Result<(Coordinates, f64)> {
        self.vectors.scale_by(DIAGONAL)?;
        let (c_weighted, d_weighted) = along(&self.vectors.dots_and_norm(OTHERS)?.0);
        Ok((Coordinates { c, d, c_weighted, d_weighted }, norm))
    }

    /// `w ← θ w + W c + V e`, which is `M̂ w` for the right coefficients.
    fn multiply(&mut self, model: &SecantModel, c: &[f64], e: &[f64]) -> Result<()> {
        let mut coefficients = vec![0.0; OTHERS];
        coefficients.extend(e.iter().zip(c).flat_map(|(e, c)| [-e, -c]));
        self.vectors.combine(None, &[(model.theta, None)], 1.0)?;
        self.vectors.remove(&coefficients)
    }
}

/// The inner products with patterns and with products.
fn along(sums: &[f64]) -> (Vec<f64>, Vec<f64>) {
    sums.as_chunks::<2>().0.iter().map(|[c, d]| (c, d)).unzip()
}

/// Two iterates: the names of their columns, and the norm of `u`.
struct Pair<'a> {
    copy: &'a mut Copied,
    u: usize,
    v: usize,
    norm: f64,
}

impl Iterates for Pair<'_> {
    fn sweep(
        &mut self,
        model: &SecantModel,
        (a, b): (f64, f64),
        [of_u, of_y]: [&Coordinates; 2],
        finish: Finish,
    ) -> Result<Swept> {
        let copy = &mut *self.copy;
        let [u, v] = [self.u, self.v].map(|name| copy.moving[name]);
        let of = model.coefficients(of_y);
        let terms = [(a, Some(u)), (b, Some(v))];
        copy.vectors.combine(None, if b == 0.0 { &terms[..1] } else { &terms }, 1.0)?;
        copy.vectors.keep(Y)?;
        copy.multiply(model, &of.c, &of.e)?;
        copy.vectors.scale_by(DIAGONAL)?;
        copy.multiply(model, &of.c_next, &of.e_next)?;
        let swept = match finish {
            Finish::Product => {
                copy.vectors.keep(v)?;
                let (coordinates, norm) = copy.coordinates()?;
                Swept { coordinates, slope: 0.0, step: 0.0, norm }
            }
            Finish::Step { lipschitz, bounds } => {
                copy.vectors.keep(PRODUCT)?;
                let share = lipschitz.recip();
                let terms = [(1.0, Some(Y)), (-share, Some(PRODUCT)), (share, Some(CONSTANT))];
                copy.vectors.combine(None, &terms, 1.0)?;
                copy.vectors.clip_by(ROOT, (bounds.lower, bounds.upper))?;
                copy.vectors.keep(v)?;
                // The step becomes small, and sums with it have errors relative to the step.
                copy.vectors.combine(None, &[(1.0, None), (-1.0, Some(u))], 1.0)?;
                let (sums, step) = copy.vectors.dots_and_norm(0)?;
                let square = self.norm * self.norm + 2.0 * sums[u] + step * step;
                let (of_step, _) = copy.weighted(along(&sums[OTHERS..]), step)?;
                Swept {
                    coordinates: of_u.combined(1.0, &of_step, 1.0),
                    slope: sums[PRODUCT] - sums[CONSTANT],
                    step,
                    norm: square.max(0.0).sqrt(),
                }
            }
        };
        copy.moving.swap(self.u, self.v);
        self.norm = swept.norm;
        Ok(swept)
    }
}
