//! Photos as products with the light transport matrix: `photo = A · pattern + ambient`.
//!
//! Light paths do not depend on the pattern, so [`assemble()`] traces them once and keeps them as a sparse matrix. Every later photo is a
//! product with it ([`Assembled`]). [`Retraced`] traces anew for each photo and keeps nothing, so it is a black box to check the matrix
//! against. For equal settings, both apply the same matrix `Â`, up to rounding. [`predict`] tells whether the matrix will fit into memory.
//!
//! While the paths arrive, their values are summed for each pair of pixels (`rows`). Memory therefore grows with the entries of the matrix,
//! not with the number of samples. Then these sums are merged into the rows of the matrix, block by block (`merging`), and the rows are cut
//! into `tiles` for fast products. For a coaxial rig, only the triangle on and above the diagonal is computed and then mirrored, so the
//! matrix is symmetric to the last bit. For any other rig, the matrix has a row for each camera pixel and a column for each projector
//! pixel, and its transpose is the matrix of the dual rig, in which camera and projector are exchanged. On a GPU with enough memory, the
//! matrix stays on the device, which then computes the products ([`Backend`]). The difference between two independent halves of the samples
//! gives the standard error of `Â` ([`Noise`]).
//!
//! Several machines can trace one matrix, with the same bits as the processor of a single machine. They either trace [`Shard`]s that are joined later, or
//! form a team of processes that each hold a part of the matrix ([`share_scene`]).

mod assembled;
mod contributions;
mod device;
mod estimated;
mod gpu_matrix;
mod journaled;
mod layer;
mod matrix;
mod merging;
mod noise;
mod retraced;
mod row_sums;
mod rows;
mod scaling;
mod shard;
mod spread;
#[cfg(test)]
mod tests;
mod tiles;
mod transpose;
mod wire;

pub use assembled::{Assembled, Backend, assemble, assemble_layers};
pub use estimated::{
    EstimatedOperator, EstimatedProduct, Question, Squares, with_fewer_samples, with_other_seed,
};
pub use gpu_matrix::GpuMatrix;
pub use journaled::JournaledOperator;
pub use layer::{Bounces, Layer};
pub use matrix::{MatrixOperator, Part, TransportMatrix};
pub use noise::{Noise, pooled};
pub use retraced::{Retraced, RetracedOperator};
pub use scaling::{Network, Prediction, Probe, Scaled, photo_bytes, predict};
pub use shard::{MOST_PARTS, Shard, ShardRecord, join_shards, trace_shard};
pub use spread::{SceneWorker, share_scene};
pub(crate) use tiles::{CompressedRows, Entries};

use crate::error::{Error, Result};
use crate::image::{Image, LUMINANCE, Resolution};
use crate::operator::Symmetry;
use crate::sparse::Csr;

/// A rig in front of a scene. It projects a pattern and takes a photo.
pub trait Transport {
    /// The resolution of the projector and of its patterns.
    fn pattern_resolution(&self) -> Resolution;

    /// The resolution of the camera and of its photos.
    fn photo_resolution(&self) -> Resolution;

    /// Whether photos are gray or in colour.
    fn channels(&self) -> Channels;

    /// The photo of `pattern`, including ambient light, in W/(m² sr). A pattern of one channel is used for all channels.
    ///
    /// # Errors
    /// [`Error::Dimension`] when the pattern does not have the rig's resolution or channels; any error that prevents the photo.
    fn photograph(&mut self, pattern: &Image) -> Result<Image>;
}

/// A rig of one channel whose matrix is given explicitly (from a file, or by the caller). Photo and pattern have the same number of pixels.
/// There is no ambient light.
#[derive(Clone, Debug)]
pub struct ExplicitMatrix {
    matrix: Csr,
    resolution: Resolution,
}

impl ExplicitMatrix {
    /// A rig for `matrix`, which must have a row and a column for each pixel. Another shape gives [`Error::Dimension`].
    pub fn new(matrix: Csr, resolution: Resolution) -> Result<Self> {
        let pixels = resolution.pixels();
        if (matrix.rows(), matrix.cols()) != (pixels, pixels) {
            return Err(Error::dimension(
                "rows and columns of the light transport matrix",
                format!("{pixels} each, for {resolution} pixels,"),
                format!("{}x{}", matrix.rows(), matrix.cols()),
            ));
        }
        Ok(Self { matrix, resolution })
    }

    /// The matrix.
    pub fn matrix(&self) -> &Csr {
        &self.matrix
    }

    /// One part of a square matrix. The diagonal is the direct light, as for a coaxial rig, and all other entries are the global light. A
    /// well-formed matrix causes no error.
    pub fn part_of(matrix: &Csr, part: Part) -> Result<Csr> {
        if part == Part::Full {
            return Ok(matrix.clone());
        }
        let direct = matrix.only_diagonal()?;
        if part == Part::Direct { Ok(direct) } else { Csr::sum(&[(1.0, matrix), (-1.0, &direct)]) }
    }
}

impl Transport for ExplicitMatrix {
    fn pattern_resolution(&self) -> Resolution {
        self.resolution
    }

    fn photo_resolution(&self) -> Resolution {
        self.resolution
    }

    fn channels(&self) -> Channels {
        Channels::Luma
    }

    fn photograph(&mut self, pattern: &Image) -> Result<Image> {
        let planes = planes(pattern, self.resolution, Channels::Luma)?;
        let pattern = &planes[0];
        let row = |row| {
            let (columns, weights) = self.matrix.row(row);
            columns.iter().zip(weights).map(|(&column, weight)| weight * pattern[column as usize]).sum()
        };
        Image::from_planes(self.resolution, &[(0..self.matrix.rows()).map(row).collect()])
    }
}

/// The shape of a rig's matrix.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct RigShape {
    /// The camera's resolution; each pixel is a row.
    pub camera: Resolution,
    /// The projector's resolution; each pixel is a column.
    pub projector: Resolution,
    /// Whether the rig is coaxial, so that `A = Aᵀ`.
    pub symmetric: bool,
}

impl RigShape {
    fn symmetry(self) -> Symmetry {
        if self.symmetric { Symmetry::Symmetric } else { Symmetry::General }
    }
}

/// The colour channels in which light transport is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Channels {
    /// One channel: a gray pattern, and a photo weighted by luminance (Rec. 709).
    #[value(help = "One gray pattern, one photo weighted by luminance")]
    Luma,
    /// Red, green and blue. They are three independent systems, because no surface here changes the colour of light (fluorescence).
    #[value(help = "Red, green and blue, each a separate system")]
    Rgb,
}

impl Channels {
    /// The channels of an image with `count` channels. A single channel is luminance.
    pub(crate) fn of(count: usize) -> Self {
        if count == 1 { Self::Luma } else { Self::Rgb }
    }

    /// The number of channels: 1 or 3.
    pub fn count(self) -> usize {
        match self {
            Self::Luma => 1,
            Self::Rgb => 3,
        }
    }
}

/// The relative luminance of a linear Rec. 709 colour.
pub(crate) fn luminance([red, green, blue]: [f32; 3]) -> f32 {
    const SHARES: [f32; 3] = [LUMINANCE[0] as f32, LUMINANCE[1] as f32, LUMINANCE[2] as f32];
    red * SHARES[0] + green * SHARES[1] + blue * SHARES[2]
}

/// Converts a colour to channels: its luminance alone, or all three channels.
fn project<const C: usize>(rgb: [f32; 3]) -> [f32; C] {
    std::array::from_fn(|channel| if C == 1 { luminance(rgb) } else { rgb[channel] })
}

fn planes(pattern: &Image, resolution: Resolution, channels: Channels) -> Result<Vec<Vec<f64>>> {
    Error::check_size("pixels of the pattern", resolution, pattern.resolution())?;
    if pattern.channels() > channels.count() {
        return Err(Error::dimension("channels of the pattern", "1, for a gray photo", pattern.channels()));
    }
    Ok((0..channels.count()).map(|channel| pattern.plane(channel.min(pattern.channels() - 1))).collect())
}
