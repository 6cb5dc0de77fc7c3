//! A layer: the light of a certain number of bounces, as a sparse matrix.

use std::sync::{Arc, OnceLock};

use super::gpu_matrix::DeviceLayer;
use super::tiles::{CompressedRows, Tiles};
use crate::error::Result;
use crate::sparse::Csr;

/// The numbers of bounces of the light in a [`Layer`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Bounces {
    /// One bounce.
    One,
    /// Two bounces.
    Two,
    /// Three and more bounces.
    Rest,
    /// Two and more bounces.
    Global,
}

/// The part of the transport matrix that has the light of some numbers of bounces. It is sparse, with one `f32` weight per entry and
/// channel.
#[derive(Clone, Debug)]
pub struct Layer {
    bounces: Bounces,
    /// The entries. If a device has made them, they are read from there at first use.
    tiles: OnceLock<Tiles>,
    resident: Option<Arc<DeviceLayer>>,
    /// The transpose, which is computed at first use.
    transpose: OnceLock<Box<Layer>>,
}

/// Two layers are equal if their entries are equal to the last bit. Cached transposes are not compared.
impl PartialEq for Layer {
    fn eq(&self, other: &Self) -> bool {
        (self.bounces, self.tiles()) == (other.bounces, other.tiles())
    }
}

pub(super) fn square(value: f32) -> f64 {
    f64::from(value) * f64::from(value)
}

impl Layer {
    /// A layer of `cols` columns. Its rows are the concatenated rows of `pieces`.
    pub(crate) fn new(bounces: Bounces, cols: usize, pieces: Vec<CompressedRows>) -> Self {
        Self::of_tiles(bounces, Tiles::new(cols, pieces))
    }

    /// A symmetric layer. The concatenated rows of `pieces` have its entries on and above the diagonal.
    pub(crate) fn symmetric(bounces: Bounces, pieces: Vec<CompressedRows>) -> Self {
        Self::of_tiles(bounces, Tiles::symmetric(pieces))
    }

    pub(super) fn of_tiles(bounces: Bounces, tiles: Tiles) -> Self {
        Self { bounces, tiles: OnceLock::from(tiles), resident: None, transpose: OnceLock::new() }
    }

    /// A layer that a device has made. Its entries stay there until they are needed here.
    pub(super) fn on_device(layer: Arc<DeviceLayer>) -> Self {
        let (bounces, tiles, transpose) = (layer.bounces, OnceLock::new(), OnceLock::new());
        Self { bounces, tiles, resident: Some(layer), transpose }
    }

    /// The layer on the device that has made it.
    pub(super) fn resident(&self) -> Option<&Arc<DeviceLayer>> {
        self.resident.as_ref()
    }

    /// Reads the entries from the device that has made them, unless they are here already. Fails with [`crate::Error::Device`] if the
    /// device fails.
    pub(super) fn fetch(&self) -> Result<&Tiles> {
        if let (None, Some(resident)) = (self.tiles.get(), &self.resident) {
            // If another thread was faster, its entries are the same.
            let _ = self.tiles.set(resident.tiles()?);
        }
        Ok(self.tiles())
    }

    /// Frees the device's memory, once the entries are here.
    pub(super) fn leave_device(&mut self) -> Result<()> {
        self.fetch()?;
        self.resident = None;
        Ok(())
    }

    /// The numbers of bounces that this layer covers.
    pub fn bounces(&self) -> Bounces {
        self.bounces
    }

    /// The number of stored entries.
    pub fn nonzeros(&self) -> usize {
        self.resident.as_ref().map_or_else(|| self.tiles().nonzeros(), |resident| resident.entries)
    }

    /// The size in memory in bytes, without the transpose.
    pub fn bytes(&self) -> usize {
        match (self.tiles.get(), &self.resident) {
            (None, Some(resident)) => resident.bytes(),
            _ => self.tiles().bytes(),
        }
    }

    /// One channel as a compressed sparse matrix. The call fails if a device has made the layer and fails, or if
    /// [`Csr`] rejects the layer's arrays.
    pub fn to_csr(&self, channel: usize) -> Result<Csr> {
        let CompressedRows { row_start, columns, weights } = self.fetch()?.to_rows();
        let weights = weights[channel].iter().map(|&weight| f64::from(weight)).collect();
        Csr::new(self.tiles().cols(), row_start, columns, weights)
    }

    /// The squares of all weights of a channel, added to `sum`.
    pub(super) fn squares(&self, channel: usize, sum: f64) -> f64 {
        match &self.resident {
            Some(resident) => sum + resident.squares[channel],
            None => self.tiles().squares(channel, sum),
        }
    }

    pub(crate) fn to_rows(&self) -> CompressedRows {
        self.tiles().to_rows()
    }

    /// The entries. If only a device has them, they must be fetched first where its failure is to be an error: here it is a panic.
    pub(crate) fn tiles(&self) -> &Tiles {
        self.tiles.get_or_init(|| {
            let resident = self.resident.as_ref().expect("a layer has its entries here or on a device");
            resident.tiles().expect("the device that has made the matrix still works")
        })
    }

    pub(super) fn transpose(&self) -> &Self {
        self.transpose.get_or_init(|| {
            let rows = self.to_rows();
            let transpose = rows.transposed(&(0..self.tiles().cols()), 0);
            Box::new(Self::new(self.bounces, rows.rows(), vec![transpose]))
        })
    }

    /// Stores the rows of the transpose that this process holds, if the matrix is spread over several processes.
    pub(super) fn keep_transpose(&self, transpose: Self) {
        // If a transpose is already stored, it is equal to this one.
        let _ = self.transpose.set(Box::new(transpose));
    }
}
