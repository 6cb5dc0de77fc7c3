//! A copy of a symmetric model in the memory of the operator, where its box problems are solved.
//!
//! An iteration of a box problem reads all patterns and products of the model. The memory of a device is many times as fast as that of the
//! host, and only coefficients move.

use super::Bounds;
use super::box_problem::{Finish, Iterates};
use super::model::SecantModel;
use super::sweep::{Coordinates, Swept};
use crate::error::Result;
use crate::operator::{Operator, Vectors};

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

pub(super) struct Resident {
    vectors: Box<dyn Vectors>,
    /// The columns of `U`, `BEFORE` and `DOMINANT`.
    moving: [usize; 3],
    has_dominant: bool,
    /// The number of patterns that have been copied.
    known: usize,
}

impl Resident {
    /// Copies the parts of a model that stay the same. Returns `None` if the operator has no memory of its own, or not enough for this
    /// number of products. Fails with the errors of [`Operator::vectors`].
    pub(super) fn new(
        operator: &dyn Operator,
        root: &[f64],
        b: &[f64],
        products: usize,
    ) -> Result<Option<Self>> {
        let Some(mut vectors) = operator.vectors(OTHERS + 2 * products, None)? else { return Ok(None) };
        vectors.load(&vec![0.0; root.len()])?;
        (0..ROOT).try_for_each(|_| vectors.push(1.0))?;
        let diagonal: Vec<f64> = root.iter().map(|s| s * s).collect();
        for vector in [root, &diagonal, b] {
            vectors.load(vector)?;
            vectors.push(1.0)?;
        }
        // Not every device can combine this many vectors.
        let combines = vectors.combine(&[(1.0, Some(OTHERS - 1))], 1.0).is_ok();
        let resident = Self { vectors, moving: [U, BEFORE, DOMINANT], has_dominant: false, known: 0 };
        Ok(combines.then_some(resident))
    }

    /// `x ← argmin ‖M x − b‖` over the box, starting from `x`. Returns `‖M x − b‖`. After an error of the memory, `x` is as before.
    pub(super) fn minimize(&mut self, model: &SecantModel, bounds: Bounds, x: &mut [f64]) -> Result<f64> {
        self.catch_up(model)?;
        let lipschitz = self.lipschitz(model)?;
        // M̂ D^½ b
        self.copy(RHS)?;
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
            let mut pair = Pair { of_u: of_u.clone(), norm, resident: self, v: BEFORE, u: U };
            of_u = model.descend(&mut pair, of_u, lipschitz, bounds)?;
        }
        // ‖M x − b‖
        self.copy(self.moving[U])?;
        self.multiply(model, &of_u.c, &model.along_patterns(&of_u.c, &of_u.d))?;
        self.vectors.scale_by(ROOT)?;
        self.vectors.combine(&[(1.0, None), (-1.0, Some(RHS))], 1.0)?;
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

    fn lipschitz(&mut self, model: &SecantModel) -> Result<f64> {
        if !self.has_dominant {
            self.copy(ROOT)?;
            self.vectors.keep(self.moving[DOMINANT])?;
        }
        self.has_dominant = true;
        self.copy(self.moving[DOMINANT])?;
        let (of_u, norm) = self.coordinates()?;
        let mut pair = Pair { of_u: of_u.clone(), norm, resident: self, v: BEFORE, u: DOMINANT };
        model.growth(&mut pair, of_u, norm)
    }

    fn copy(&mut self, column: usize) -> Result<()> {
        self.vectors.combine(&[(1.0, Some(column))], 1.0)
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
        self.vectors.combine(&[(model.theta, None)], 1.0)?;
        self.vectors.remove(&coefficients)
    }
}

/// The inner products with patterns and with products.
fn along(sums: &[f64]) -> (Vec<f64>, Vec<f64>) {
    sums.as_chunks::<2>().0.iter().map(|[c, d]| (c, d)).unzip()
}

/// Two iterates: the names of their columns, and the coordinates and norm of `u`.
struct Pair<'a> {
    resident: &'a mut Resident,
    u: usize,
    v: usize,
    of_u: Coordinates,
    norm: f64,
}

impl Iterates for Pair<'_> {
    fn sweep(
        &mut self,
        model: &SecantModel,
        (a, b): (f64, f64),
        of_y: &Coordinates,
        finish: Finish,
    ) -> Result<Swept> {
        let resident = &mut *self.resident;
        let [u, v] = [self.u, self.v].map(|name| resident.moving[name]);
        let of = model.coefficients(of_y);
        resident.vectors.combine(&[(a, Some(u)), (b, Some(v))], 1.0)?;
        resident.vectors.keep(Y)?;
        resident.multiply(model, &of.c, &of.e)?;
        resident.vectors.scale_by(DIAGONAL)?;
        resident.multiply(model, &of.c_next, &of.e_next)?;
        let swept = match finish {
            Finish::Product => {
                resident.vectors.keep(v)?;
                let (coordinates, norm) = resident.coordinates()?;
                Swept { coordinates, slope: 0.0, step: 0.0, norm }
            }
            Finish::Step { lipschitz, bounds } => {
                resident.vectors.keep(PRODUCT)?;
                let share = lipschitz.recip();
                let terms = [(1.0, Some(Y)), (-share, Some(PRODUCT)), (share, Some(CONSTANT))];
                resident.vectors.combine(&terms, 1.0)?;
                resident.vectors.clip_by(ROOT, (bounds.lower, bounds.upper))?;
                resident.vectors.keep(v)?;
                // Sums with the step, which becomes small, are exact relative to the step.
                resident.vectors.combine(&[(1.0, None), (-1.0, Some(u))], 1.0)?;
                let (sums, step) = resident.vectors.dots_and_norm(0)?;
                let square = self.norm * self.norm + 2.0 * sums[u] + step * step;
                let (of_step, _) = resident.weighted(along(&sums[OTHERS..]), step)?;
                Swept {
                    coordinates: self.of_u.combined(1.0, &of_step, 1.0),
                    slope: sums[PRODUCT] - sums[CONSTANT],
                    step,
                    norm: square.max(0.0).sqrt(),
                }
            }
        };
        resident.moving.swap(self.u, self.v);
        (self.of_u, self.norm) = (swept.coordinates.clone(), swept.norm);
        Ok(swept)
    }
}
