//! Systems and operators are divided by powers of two, so that no square and no product of a few of their numbers overflows or underflows.
//!
//! Division by a power of two is exact. A result therefore equals, to rounding, the result of the same problem at ordinary size. Numbers of
//! ordinary size are unchanged.

use super::basis::norm;
use super::eigen::{Eigs, HistoryRow};
use super::singular::Singular;
use crate::error::{Error, Result};
use crate::operator::{Adjoint, Direction, Operator, Selection, Vectors, delegate};

/// Numbers from `2^-SAFE` to `2^SAFE` are of ordinary size: a product of ten of them is far from `2^±1022`, the limits of double precision.
const SAFE: i32 = 96;

/// The exponent of the largest power of two not above a number. For zero, the result is far below the exponents of all other numbers; for
/// an infinity, far above.
pub(super) fn exponent(size: f64) -> i32 {
    match size {
        0.0 => -1_000_000,
        _ if size.is_finite() => size.abs().log2().floor() as i32,
        _ => 1_000_000,
    }
}

/// The `p` for which numbers of this exponent are scaled by `2^-p`. It is 0 for numbers of ordinary size, for zero and for infinity.
pub(super) fn power(exponent: i32) -> i32 {
    if (SAFE + 1..10_000).contains(&exponent.abs()) { exponent } else { 0 }
}

/// `value · 2^power`.
pub(super) fn scaled(mut value: f64, mut power: i32) -> f64 {
    while power != 0 && value != 0.0 && value.is_finite() {
        let step = power.clamp(-1000, 1000);
        // These are the bits of 2^step.
        value *= f64::from_bits(((1023 + step) as u64) << 52);
        power -= step;
    }
    value
}

pub(super) fn scale(values: &mut [f64], power: i32) {
    if power != 0 {
        values.iter_mut().for_each(|value| *value = scaled(*value, power));
    }
}

/// Computes the length of a vector. Fails with [`Error::Numerical`] if it is not finite. The message begins with `what` and names the
/// cause.
pub(super) fn finite_norm(what: &str, vector: &[f64]) -> Result<f64> {
    let length = norm(vector);
    if length.is_finite() {
        return Ok(length);
    }
    Err(Error::Numerical(if vector.iter().any(|value| value.is_nan()) {
        format!("{what} holds a NaN")
    } else {
        format!(
            "{what} holds numbers too large for double precision, which ends at 1.8e308: divide them by a power of ten"
        )
    }))
}

/// Computes the length of a product. Fails with [`Error::Numerical`] if the length is not finite.
pub(super) fn finite_product(product: &[f64]) -> Result<f64> {
    let length = norm(product);
    if length.is_finite() {
        return Ok(length);
    }
    Err(Error::Numerical("a product with the operator holds a NaN or an infinity".into()))
}

/// An operator divided by a power of two. The power is chosen at the first product that is not zero. If the power is not 1, this product
/// fails, and the caller converts all quantities that are in the operator's original unit and begins again.
pub(super) struct Rescaled<'a, O: ?Sized> {
    operator: &'a mut O,
    power: Option<i32>,
    begins: bool,
    /// The vectors and products of the first attempt. The second attempt reuses these products.
    taken: Vec<[Vec<f64>; 2]>,
}

impl<'a, O: Operator + ?Sized> Rescaled<'a, O> {
    pub(super) fn new(operator: &'a mut O) -> Self {
        Self { operator, power: None, begins: true, taken: Vec::new() }
    }

    /// The exponent of the power of two for the second attempt, if the first product was not of ordinary size.
    pub(super) fn begins_again(&mut self) -> Option<i32> {
        let begun = std::mem::replace(&mut self.begins, false);
        self.power.filter(|&power| begun && power != 0)
    }

    /// Writes the products with `xs` to `ys` if the first attempt took them.
    fn recall(&mut self, xs: &[&[f64]], ys: &mut [&mut [f64]]) -> bool {
        let taken = std::mem::take(&mut self.taken);
        let is_same = taken.len() == xs.len() && taken.iter().zip(xs).all(|([of, _], x)| of == x);
        if is_same {
            ys.iter_mut().zip(&taken).for_each(|(y, [_, product])| y.copy_from_slice(product));
        }
        is_same
    }

    fn divide(&mut self, xs: &[&[f64]], ys: &mut [&mut [f64]]) -> Result<()> {
        for (x, y) in xs.iter().zip(&*ys) {
            let length = finite_norm("a product with the operator", y)?;
            self.learn(length, || norm(x));
        }
        let power = self.power.unwrap_or(0);
        if self.begins && power != 0 {
            self.taken = xs.iter().zip(&*ys).map(|(x, y)| [x.to_vec(), y.to_vec()]).collect();
            return Err(of_order(power));
        }
        ys.iter_mut().for_each(|y| scale(y, -power));
        Ok(())
    }

    /// Chooses the power by the lengths of the first product that is not zero, and of its vector.
    fn learn(&mut self, length: f64, of: impl FnOnce() -> f64) {
        if length > 0.0 {
            self.power.get_or_insert_with(|| power(exponent(length) - exponent(of())));
        }
    }
}

fn of_order(power: i32) -> Error {
    Error::Numerical(format!("the operator is of the order of 2^{power}"))
}

impl<O: Operator + ?Sized> Operator for Rescaled<'_, O> {
    delegate!(operator: rows, cols, symmetry, block_size, observer, frames, confirming);

    /// Products that are scaled are taken from the host's memory.
    fn vectors(&self, columns: usize, selection: Option<Selection<'_>>) -> Result<Option<Box<dyn Vectors>>> {
        if self.power.unwrap_or(0) == 0 { self.operator.vectors(columns, selection) } else { Ok(None) }
    }

    /// The columns have norm 1.
    fn apply_within(&mut self, vectors: &mut dyn Vectors, column: usize, direction: Direction) -> Result<()> {
        self.operator.apply_within(vectors, column, direction)?;
        if self.power.is_none() {
            let (_, length) = vectors.dots_and_norm(vectors.columns())?;
            self.learn(length, || 1.0);
        }
        match self.power.unwrap_or(0) {
            0 => Ok(()),
            power => {
                self.taken = vec![[vectors.column(column)?.into_owned(), vectors.work()?.into_owned()]];
                Err(of_order(power))
            }
        }
    }

    fn apply_block(&mut self, xs: &[&[f64]], ys: &mut [&mut [f64]]) -> Result<()> {
        if !self.recall(xs, ys) {
            self.operator.apply_block(xs, ys)?;
        }
        self.divide(xs, ys)
    }
    fn standard_errors(&self) -> Vec<f64> {
        let mut errors = self.operator.standard_errors();
        scale(&mut errors, -self.power.unwrap_or(0));
        errors
    }
    fn common_error(&mut self, x: &[f64]) -> Result<f64> {
        Ok(scaled(self.operator.common_error(x)?, -self.power.unwrap_or(0)))
    }
}

impl<O: Adjoint + ?Sized> Adjoint for Rescaled<'_, O> {
    fn apply_adjoint_block(&mut self, ys: &[&[f64]], xs: &mut [&mut [f64]]) -> Result<()> {
        self.operator.apply_adjoint_block(ys, xs)?;
        self.divide(ys, xs)
    }
}

/// Multiplies the eigenvalues, and all quantities in the same unit, by `2^power`.
pub(super) fn multiply_eigs(found: &mut Eigs, power: i32) -> Result<()> {
    found.completeness.multiply(power);
    let Eigs { values, imaginary_values, residuals, standard_errors, bounds, gap_bounds, history, .. } =
        found;
    for numbers in [&mut *imaginary_values, residuals, standard_errors, bounds, gap_bounds] {
        scale(numbers, power);
    }
    multiply(values, history, power)
}

/// Multiplies the singular values, and all quantities in the same unit, by `2^power`.
pub(super) fn multiply_singular(found: &mut Singular, power: i32) -> Result<()> {
    scale(&mut found.residuals, power);
    scale(&mut found.standard_errors, power);
    found.completeness.multiply(power);
    multiply(&mut found.values, &mut found.history, power)
}

fn multiply(values: &mut [f64], history: &mut [HistoryRow], power: i32) -> Result<()> {
    for row in history {
        scale(&mut row.values, power);
        scale(&mut row.residuals, power);
    }
    scale(values, power);
    finite_norm("the answer", values).map(|_| ())
}
