//! Products with a traced matrix: on the processor, or on the backend of a traced scene.

use std::fmt::Debug;

use super::{Assembled, Part, TransportMatrix};
use crate::error::Result;

/// Products with a traced matrix. On each backend they repeat to the bit; between backends they differ by the
/// rounding of sums only.
pub trait Products: Debug + Sync {
    /// The matrix.
    fn frozen(&self) -> &TransportMatrix;

    /// `y ← P x` for the `part` `P` of one channel; `x` has an entry for each projector pixel, `y` one for
    /// each of the camera's.
    ///
    /// # Errors
    /// [`crate::Error::Device`] when products are taken on a device that failed.
    fn product(&self, part: Part, channel: usize, x: &[f64], y: &mut [f64]) -> Result<()>;

    /// `x ← Pᵀ y`.
    ///
    /// # Errors
    /// As [`Products::product`].
    fn transposed_product(&self, part: Part, channel: usize, y: &[f64], x: &mut [f64]) -> Result<()>;

    /// The matrix, where products are taken on the processor. A block of products is faster there than single
    /// ones ([`TransportMatrix::apply_block`]).
    fn on_processor(&self) -> Option<&TransportMatrix>;
}

impl Products for TransportMatrix {
    fn frozen(&self) -> &TransportMatrix {
        self
    }

    fn product(&self, part: Part, channel: usize, x: &[f64], y: &mut [f64]) -> Result<()> {
        self.apply(part, channel, x, y);
        Ok(())
    }

    fn transposed_product(&self, part: Part, channel: usize, y: &[f64], x: &mut [f64]) -> Result<()> {
        self.apply_transpose(part, channel, y, x);
        Ok(())
    }

    fn on_processor(&self) -> Option<&TransportMatrix> {
        Some(self)
    }
}

impl Products for Assembled {
    fn frozen(&self) -> &TransportMatrix {
        &self.matrix
    }

    fn product(&self, part: Part, channel: usize, x: &[f64], y: &mut [f64]) -> Result<()> {
        match &self.gpu_matrix {
            Some(gpu_matrix) => gpu_matrix.apply(part, channel, x, y),
            None => self.matrix.product(part, channel, x, y),
        }
    }

    fn transposed_product(&self, part: Part, channel: usize, y: &[f64], x: &mut [f64]) -> Result<()> {
        match &self.gpu_matrix {
            Some(gpu_matrix) => gpu_matrix.apply_transpose(&self.matrix, part, channel, y, x),
            None => self.matrix.transposed_product(part, channel, y, x),
        }
    }

    fn on_processor(&self) -> Option<&TransportMatrix> {
        self.gpu_matrix.is_none().then_some(&self.matrix)
    }
}
