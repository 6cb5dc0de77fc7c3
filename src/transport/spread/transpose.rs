//! The transpose of a matrix that is spread over several processes: each process gets the rows of the pixels of the projector that it has.

use std::ops::Range;

use super::Spread;
use super::command::Command;
use crate::render::StartPixels;
use crate::team::Comm;
use crate::transport::TransportMatrix;
use crate::transport::layer::Layer;
use crate::transport::tiles::CompressedRows;
use crate::transport::wire;

impl Spread {
    /// Lets every process make its rows of the transpose.
    pub(super) fn transpose(&self, own: &TransportMatrix) {
        let turn = self.command(&Command::Transpose);
        transpose_part(turn.comm(), own, &self.0.pixels);
    }
}

/// Makes the rows of the transpose that this process has. Every process of the team must call it.
pub(super) fn transpose_part(comm: &dyn Comm, own: &TransportMatrix, pixels: &[StartPixels]) {
    for layer in &own.layers {
        let rows = layer.to_rows();
        let first = own.rows.start;
        let message = |to: &StartPixels| wire::rows_to_bytes(&columns(&rows, first, &to.projector));
        let received = comm.exchange(pixels.iter().map(message).collect());
        let mine = &pixels[comm.rank()].projector;
        // The rows of the matrix come by rank, and so in their order.
        let parts: Vec<CompressedRows> = received
            .iter()
            .map(|bytes| {
                let mut part = CompressedRows {
                    row_start: vec![0],
                    columns: Vec::new(),
                    weights: vec![Vec::new(); rows.weights.len()],
                };
                wire::append_rows(&mut part, bytes).expect("all processes run the same program");
                part
            })
            .collect();
        layer.keep_transpose(Layer::new(
            layer.bounces(),
            own.rig.camera.pixels(),
            vec![joined(&parts, mine.len())],
        ));
    }
}

/// The entries of these columns of `rows`, which begin with row `first` of the matrix: a row for each column, with the rows as columns.
fn columns(rows: &CompressedRows, first: usize, wanted: &Range<usize>) -> CompressedRows {
    let count = rows.row_start.len() - 1;
    // The entries of row `row` in these columns.
    let of_row = |row: usize| {
        let (start, end) = (rows.row_start[row], rows.row_start[row + 1]);
        let at = |column: usize| start + rows.columns[start..end].partition_point(|&c| (c as usize) < column);
        at(wanted.start)..at(wanted.end)
    };
    let place = |entry: usize| rows.columns[entry] as usize - wanted.start;
    let mut row_start = vec![0; wanted.len() + 1];
    (0..count).flat_map(of_row).for_each(|entry| row_start[place(entry) + 1] += 1);
    (0..wanted.len()).for_each(|row| row_start[row + 1] += row_start[row]);
    let mut next = row_start.clone();
    let entries = row_start[wanted.len()];
    let mut columns = vec![0; entries];
    let mut weights = vec![vec![0.0; entries]; rows.weights.len()];
    for row in 0..count {
        for entry in of_row(row) {
            let at = &mut next[place(entry)];
            columns[*at] = (first + row) as u32;
            weights.iter_mut().zip(&rows.weights).for_each(|(to, from)| to[*at] = from[entry]);
            *at += 1;
        }
    }
    CompressedRows { row_start, columns, weights }
}

/// Parts of the same rows, one after the other.
fn joined(parts: &[CompressedRows], rows: usize) -> CompressedRows {
    let channels = parts.first().map_or(0, |part| part.weights.len());
    let mut joined =
        CompressedRows { row_start: vec![0], columns: Vec::new(), weights: vec![Vec::new(); channels] };
    for row in 0..rows {
        for part in parts {
            let entries = part.row_start[row]..part.row_start[row + 1];
            joined.columns.extend_from_slice(&part.columns[entries.clone()]);
            for (to, from) in joined.weights.iter_mut().zip(&part.weights) {
                to.extend_from_slice(&from[entries.clone()]);
            }
        }
        joined.row_start.push(joined.columns.len());
    }
    joined
}
