//! Products with vectors that are known beforehand.

use super::{Operator, block, block_mut};
use crate::error::Result;

/// The largest block that is asked for at once, so that few vectors are in memory at the same time.
const LARGEST_BLOCK: usize = 8;

/// Multiplies with each of `xs` (`cols` entries each), in blocks of [`Operator::block_size`], and hands `with` each vector and its
/// product, in order.
///
/// # Errors
/// The error of the first product, or call of `with`, that fails; no further block is taken then.
pub fn each_product(
    operator: &mut dyn Operator,
    xs: impl IntoIterator<Item = Vec<f64>>,
    mut with: impl FnMut(&[f64], Vec<f64>) -> Result<()>,
) -> Result<()> {
    let (rows, size) = (operator.rows(), operator.block_size().clamp(1, LARGEST_BLOCK));
    let mut xs = xs.into_iter();
    loop {
        let next: Vec<Vec<f64>> = xs.by_ref().take(size).collect();
        if next.is_empty() {
            return Ok(());
        }
        let mut products = vec![vec![0.0; rows]; next.len()];
        operator.apply_block(&block(&next), &mut block_mut(&mut products))?;
        next.iter().zip(products).try_for_each(|(x, y)| with(x, y))?;
    }
}
