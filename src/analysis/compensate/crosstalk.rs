//! Crosstalk of colours: each camera channel also sees the projector's other colours.
//!
//! Let `M_cp` be the response of camera channel `c` to projector colour `p`. A colour photo is then `y_c = A_c Σ_p M_cp x_p`: three
//! transport matrices behind one 3×3 mixing matrix. There are two ways to solve for the pattern. The first way solves all three colours as
//! one system, inside the box of the projector's colours. The second way solves each channel alone for `x'_c = Σ_p M_cp x_p`, and un-mixes
//! the result. The second way is as good if the un-mixed pattern stays inside the box, and worse if it must be clipped.

use crate::error::{Error, Result};
use crate::observer::Observer;
use crate::operator::{Adjoint, Operator, Symmetry};

/// The crosstalk between projector and camera: a mixing matrix, and the way in which the system is solved.
#[derive(Clone, Debug, PartialEq)]
pub struct Crosstalk {
    matrix: [[f64; 3]; 3],
    inverse: [[f64; 3]; 3],
    /// True if all three colours are solved as one system. Otherwise each channel is solved alone, and the result is un-mixed.
    pub coupled: bool,
}

impl Crosstalk {
    /// Makes the crosstalk of the matrix `M`, one row per camera channel, to be solved as one system. Fails with [`Error::Option`] naming
    /// `--crosstalk` if an entry is negative or not finite, or if the matrix cannot be inverted.
    pub fn new(matrix: [[f64; 3]; 3]) -> Result<Self> {
        let refuse = |fault: &str, help: &str| Err(Error::option("--crosstalk", fault).help(help));
        if matrix.iter().flatten().any(|entry| !(*entry >= 0.0 && entry.is_finite())) {
            return refuse(
                "an entry is negative or no number",
                "light can only be added: give nine numbers from 0 on",
            );
        }
        let Some(inverse) = inverse(&matrix) else {
            return refuse(
                "the matrix cannot be inverted",
                "each of the projector's colours must look different to the camera",
            );
        };
        Ok(Self { matrix, inverse, coupled: true })
    }

    /// Estimates the matrix from one photo each of a red, a green and a blue pattern (three channels of `n` pixels each). A channel's
    /// response to its own colour is part of `A_c` and counts as 1. The other entries are least-squares ratios over all pixels.
    ///
    /// # Errors
    /// The errors of [`Crosstalk::new`]; [`Error::Numerical`] if a channel does not see its own colour.
    pub fn measured(photos: &[[Vec<f64>; 3]; 3]) -> Result<Self> {
        let dot = |a: &[f64], b: &[f64]| -> f64 { a.iter().zip(b).map(|(a, b)| a * b).sum() };
        let mut matrix = [[0.0; 3]; 3];
        for (channel, row) in matrix.iter_mut().enumerate() {
            let own = &photos[channel][channel];
            let square = dot(own, own);
            if !(square > 0.0 && square.is_finite()) {
                return Err(Error::Numerical(format!(
                    "camera channel {channel} sees nothing of projector colour {channel}: no crosstalk can be told"
                )));
            }
            for (primary, entry) in row.iter_mut().enumerate() {
                // Noise may make a ratio negative where there is no crosstalk.
                *entry = (dot(&photos[primary][channel], own) / square).max(0.0);
            }
        }
        Self::new(matrix)
    }

    /// Scales the rows of the matrix so that each adds up to 1. This is needed if the products of the channels were measured with gray
    /// patterns, because `A_c` then already contains the whole response to white.
    pub fn relative_to_white(self) -> Result<Self> {
        let matrix = self.matrix.map(|row| {
            let white: f64 = row.iter().sum();
            row.map(|entry| entry / white)
        });
        Ok(Self { coupled: self.coupled, ..Self::new(matrix)? })
    }

    /// The matrix `M`, row by row.
    pub fn matrix(&self) -> &[[f64; 3]; 3] {
        &self.matrix
    }

    /// Each channel's response to white, which is the sum of its row.
    pub(super) fn white(&self) -> [f64; 3] {
        self.matrix.map(|row| row.iter().sum())
    }

    /// `x' = M x`, pixel by pixel.
    pub(super) fn mix(&self, patterns: &[Vec<f64>]) -> Vec<Vec<f64>> {
        product(&self.matrix, patterns)
    }

    /// `x = M⁻¹ x'`.
    pub(super) fn unmix(&self, mixed: &[Vec<f64>]) -> Vec<Vec<f64>> {
        product(&self.inverse, mixed)
    }

    fn transposed(&self) -> [[f64; 3]; 3] {
        std::array::from_fn(|row| std::array::from_fn(|column| self.matrix[column][row]))
    }
}

fn product(matrix: &[[f64; 3]; 3], planes: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let row = |row: &[f64; 3]| -> Vec<f64> {
        (0..planes[0].len())
            .map(|pixel| row.iter().zip(planes).map(|(m, plane)| m * plane[pixel]).sum())
            .collect()
    };
    matrix.iter().map(row).collect()
}

/// The inverse by cofactors; `None` for a matrix that is singular up to rounding.
fn inverse(m: &[[f64; 3]; 3]) -> Option<[[f64; 3]; 3]> {
    let minor = |row: usize, column: usize| {
        let [a, b] = [(row + 1) % 3, (row + 2) % 3];
        let [c, d] = [(column + 1) % 3, (column + 2) % 3];
        m[a][c] * m[b][d] - m[a][d] * m[b][c]
    };
    let determinant: f64 = (0..3).map(|column| m[0][column] * minor(0, column)).sum();
    let size = m.iter().flatten().copied().fold(0.0, f64::max);
    let regular = determinant.abs() > 1e-9 * size * size * size;
    regular.then(|| std::array::from_fn(|row| std::array::from_fn(|column| minor(column, row) / determinant)))
}

/// All three colours as one operator (`3n × 3n`): `diag(A_c) (M ⊗ I)`. A vector holds the channels one after the other.
pub(super) struct Mixed<'a, O> {
    pub(super) channels: &'a mut [O],
    pub(super) crosstalk: &'a Crosstalk,
}

impl<O: Adjoint> Mixed<'_, O> {
    fn pixels(&self) -> usize {
        self.channels.first().map_or(0, |operator| operator.cols())
    }
}

pub(super) fn planes(vector: &[f64], count: usize) -> Vec<Vec<f64>> {
    vector.chunks(vector.len() / count.max(1)).map(<[f64]>::to_vec).collect()
}

impl<O: Adjoint> Operator for Mixed<'_, O> {
    fn rows(&self) -> usize {
        3 * self.pixels()
    }

    fn cols(&self) -> usize {
        3 * self.pixels()
    }

    fn symmetry(&self) -> Symmetry {
        // The operator is symmetric only if the mixing commutes with the albedos of the channels.
        Symmetry::General
    }

    fn apply(&mut self, x: &[f64], y: &mut [f64]) -> Result<()> {
        let mixed = self.crosstalk.mix(&planes(x, 3));
        let pixels = self.pixels();
        for ((operator, plane), y) in self.channels.iter_mut().zip(&mixed).zip(y.chunks_mut(pixels)) {
            operator.apply(plane, y)?;
        }
        Ok(())
    }

    /// All channels belong to one rig, so the first channel states the frames of the whole rig.
    fn frames(&self) -> Option<u64> {
        self.channels.first().and_then(|channel| channel.frames())
    }

    // Products are taken one vector at a time, because a journal depends on the order of the channels' products.

    fn observer(&self) -> &dyn Observer {
        self.channels.first().map_or(&(), |operator| operator.observer())
    }
}

impl<O: Adjoint> Adjoint for Mixed<'_, O> {
    fn apply_adjoint(&mut self, y: &[f64], x: &mut [f64]) -> Result<()> {
        let pixels = self.pixels();
        let mut back = vec![vec![0.0; pixels]; 3];
        for ((operator, y), plane) in self.channels.iter_mut().zip(y.chunks(pixels)).zip(&mut back) {
            operator.apply_adjoint(y, plane)?;
        }
        x.copy_from_slice(&product(&self.crosstalk.transposed(), &back).concat());
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unmixing_undoes_mixing_and_three_photos_tell_the_matrix() -> Result<()> {
        let matrix = [[1.0, 0.2, 0.05], [0.1, 1.0, 0.3], [0.0, 0.15, 1.0]];
        let crosstalk = Crosstalk::new(matrix)?;
        let patterns: Vec<Vec<f64>> =
            (0..3).map(|c| vec![0.1 * f64::from(c), 0.7, 1.0 - 0.3 * f64::from(c)]).collect();
        let back = crosstalk.unmix(&crosstalk.mix(&patterns));
        for (a, b) in back.concat().iter().zip(patterns.concat()) {
            assert!((a - b).abs() < 1e-15 * 8.0, "{a} {b}");
        }
        // The albedo of the wall differs between channels and pixels, but the ratios between the primaries do not.
        let albedo = |channel: usize, pixel: usize| 0.2 + 0.1 * channel as f64 + 0.05 * pixel as f64;
        let photos: [[Vec<f64>; 3]; 3] = std::array::from_fn(|primary| {
            std::array::from_fn(|channel| {
                (0..4).map(|pixel| matrix[channel][primary] * albedo(channel, pixel)).collect()
            })
        });
        let measured = Crosstalk::measured(&photos)?;
        for (a, b) in measured.matrix().iter().flatten().zip(matrix.iter().flatten()) {
            assert!((a - b).abs() < 1e-14, "{a} {b}");
        }
        assert!(Crosstalk::new([[1.0; 3]; 3]).is_err() && Crosstalk::new([[-1.0; 3]; 3]).is_err());
        Ok(())
    }
}
