//! Photos as products with an explicit matrix.

use super::{Channels, Part, Transport};
use crate::error::{Error, Result};
use crate::image::{Image, Resolution};
use crate::sparse::Csr;

/// An explicit matrix (from a file, or made by the caller) as a rig of one channel. Photo and pattern have the same number
/// of pixels. There is no ambient light.
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

    /// One part of a square matrix. Its diagonal is the direct light, as for a coaxial rig, and all else is the global
    /// light. A well-formed matrix causes no error.
    pub fn part_of(matrix: &Csr, part: Part) -> Result<Csr> {
        if part == Part::Full {
            return Ok(matrix.clone());
        }
        let (mut row_start, mut columns, mut weights) = (vec![0], Vec::new(), Vec::new());
        for row in 0..matrix.rows() {
            let (of_row, values) = matrix.row(row);
            for (&column, &weight) in of_row.iter().zip(values) {
                if (column as usize == row) == (part == Part::Direct) {
                    columns.push(column);
                    weights.push(weight);
                }
            }
            row_start.push(columns.len());
        }
        Csr::new(matrix.cols(), row_start, columns, weights)
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
        let planes = super::planes(pattern, self.resolution, Channels::Luma)?;
        let pattern = &planes[0];
        let row = |row| {
            let (columns, weights) = self.matrix.row(row);
            columns.iter().zip(weights).map(|(&column, weight)| weight * pattern[column as usize]).sum()
        };
        super::from_planes(self.resolution, &[(0..self.matrix.rows()).map(row).collect()])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_photo_is_the_product_with_the_explicit_matrix() {
        let matrix = Csr::new(2, vec![0, 2, 3], vec![0, 1, 0], vec![1.0, 0.5, 0.25]);
        let mut explicit =
            ExplicitMatrix::new(matrix.expect("well formed"), Resolution::new(2, 1)).expect("of two pixels");
        let pattern = Image::new(Resolution::new(2, 1), 1, vec![2.0, 4.0]).expect("two samples");
        assert_eq!(explicit.photograph(&pattern).expect("it fits").samples(), [4.0, 0.5]);
        assert!(ExplicitMatrix::new(explicit.matrix.clone(), Resolution::new(2, 2)).is_err());
    }

    #[test]
    fn direct_and_global_light_of_an_explicit_matrix_add_up_to_it() {
        let matrix =
            Csr::new(2, vec![0, 2, 4], vec![0, 1, 0, 1], vec![4.0, 1.0, 2.0, 8.0]).expect("well formed");
        let weights = |part| ExplicitMatrix::part_of(&matrix, part).expect("well formed").weights().to_vec();
        assert_eq!([weights(Part::Direct), weights(Part::Global)], [vec![4.0, 8.0], vec![1.0, 2.0]]);
    }
}
