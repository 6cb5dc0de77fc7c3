//! Products with patterns that are known beforehand.

use super::Operator;
use crate::error::Result;

/// Patterns that are announced together: what an operator may take at once, twice.
const TOGETHER: usize = 8;

/// Multiplies with each of `xs` (`cols` entries each), announced a few at a time, and hands `with` each and its product, in order.
///
/// # Errors
/// Whatever a product, or `with`, fails with; no further product is taken then.
pub fn each_product(
    operator: &mut dyn Operator,
    xs: impl IntoIterator<Item = Vec<f64>>,
    mut with: impl FnMut(&[f64], Vec<f64>) -> Result<()>,
) -> Result<()> {
    let mut xs = xs.into_iter();
    loop {
        let next: Vec<Vec<f64>> = xs.by_ref().take(TOGETHER).collect();
        if next.is_empty() {
            return Ok(());
        }
        operator.announce(&next);
        for x in next {
            let mut y = vec![0.0; operator.rows()];
            operator.apply(&x, &mut y)?;
            with(&x, y)?;
        }
    }
}
