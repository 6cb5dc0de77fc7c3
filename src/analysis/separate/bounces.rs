//! The light of each bounce of a known matrix.

use crate::analysis::planes::Planes;
use crate::error::Result;
use crate::transport::{Bounces, TransportMatrix};

/// The light of two bounces, and of three and more, under white, from a matrix that stores them as separate layers.
///
/// # Errors
/// None for a well-formed matrix in one process; those of [`TransportMatrix::layers`].
pub fn second_and_rest(matrix: &TransportMatrix) -> Result<[Planes; 2]> {
    let (rows, count) = (matrix.resolution().pixels(), matrix.channels().count());
    let mut found = [Bounces::Two, Bounces::Rest].map(|_| vec![vec![0.0; rows]; count]);
    for layer in &*matrix.layers()? {
        let planes = match layer.bounces() {
            Bounces::Two => &mut found[0],
            Bounces::Rest => &mut found[1],
            Bounces::One | Bounces::Global => continue,
        };
        for (channel, plane) in planes.iter_mut().enumerate() {
            layer.to_csr(channel)?.entries().for_each(|(row, _, weight)| plane[row] += weight);
        }
    }
    Ok(found)
}
