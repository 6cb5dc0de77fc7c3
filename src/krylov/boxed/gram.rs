//! Inner products of a model's vectors in the metric of `D`. With them, the coordinates of `M̂ D M̂ u` follow from those of `u`.

use super::super::basis::dot;
use super::coordinates::Coordinates;

/// `VᵀDV`, `VᵀDW` and `WᵀDW`, row by row, for the patterns `V` and the products `W` of a
/// [`Model`](super::model::Model).
#[derive(Clone, Default)]
pub(super) struct Gram {
    vv: Vec<Vec<f64>>,
    vw: Vec<Vec<f64>>,
    ww: Vec<Vec<f64>>,
}

impl Gram {
    /// Adds the last pattern and the last product, which have these coordinates.
    pub(super) fn extend(&mut self, of_v: Coordinates, of_w: Coordinates) {
        append(&mut self.vv, of_v.c_weighted, None);
        append(&mut self.ww, of_w.d_weighted, None);
        append(&mut self.vw, of_w.c_weighted, Some(of_v.d_weighted));
    }

    /// `(VᵀDW c + VᵀDV e, WᵀDW c + WᵀDV e)`.
    pub(super) fn apply(&self, c: &[f64], e: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let of_patterns = self.vw.iter().zip(&self.vv).map(|(vw, vv)| dot(vw, c) + dot(vv, e));
        let of_products = self.ww.iter().enumerate().map(|(j, ww)| {
            let transposed: f64 = self.vw.iter().zip(e).map(|(vw, e)| vw[j] * e).sum();
            dot(ww, c) + transposed
        });
        (of_patterns.collect(), of_products.collect())
    }
}

/// Appends a column at the right and a row below. The row is `row`, whose last entry is the corner, or equal
/// to the column.
fn append(matrix: &mut Vec<Vec<f64>>, column: Vec<f64>, row: Option<Vec<f64>>) {
    for (row, entry) in matrix.iter_mut().zip(&column) {
        row.push(*entry);
    }
    matrix.push(row.unwrap_or(column));
}
