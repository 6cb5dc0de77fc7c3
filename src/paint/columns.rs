//! The light of single projector pixels: the columns of a matrix in memory.

use crate::sparse::Csr;

/// A matrix by its columns, one matrix for each channel: row `p` of each holds what projector pixel `p` lights.
#[derive(Clone, Debug)]
pub struct Columns {
    by_channel: Vec<Csr>,
}

impl Columns {
    /// The columns of these matrices, one for each channel. A symmetric matrix is not transposed, since its rows are its columns.
    pub(super) fn new(matrices: Vec<Csr>) -> Self {
        let columns = |matrix: Csr| if matrix.is_symmetric() { matrix } else { matrix.transposed() };
        Self { by_channel: matrices.into_iter().map(columns).collect() }
    }

    /// The matrices, whose rows are the columns.
    pub(super) fn channels(&self) -> &[Csr] {
        &self.by_channel
    }

    /// Entries of one channel.
    pub(super) fn nonzeros(&self) -> usize {
        self.by_channel.first().map_or(0, |matrix| matrix.weights().len())
    }

    /// Adds `change` times the light of a projector pixel to a photo.
    pub(super) fn add(&self, channel: usize, pixel: usize, change: f64, photo: &mut [f64]) {
        let (places, values) = self.by_channel[channel].row(pixel);
        for (&place, &value) in places.iter().zip(values) {
            photo[place as usize] += change * value;
        }
    }

    /// Adds the light of a whole pattern to a photo.
    pub(super) fn multiply(&self, channel: usize, pattern: &[f64], photo: &mut [f64]) {
        let lit = pattern.iter().enumerate().filter(|(_, value)| **value != 0.0);
        lit.for_each(|(pixel, &value)| self.add(channel, pixel, value, photo));
    }

    /// How much each projector pixel lights one camera pixel: a row of the matrix, added to `pattern`.
    pub(super) fn add_row(&self, channel: usize, pixel: usize, pattern: &mut [f64]) {
        let matrix = &self.by_channel[channel];
        for (projector, found) in pattern.iter_mut().enumerate() {
            let (places, values) = matrix.row(projector);
            if let Ok(at) = places.binary_search(&(pixel as u32)) {
                *found += values[at];
            }
        }
    }
}
