//! Masks of probing: which pairs of a camera pixel and a projector pixel let their light through.
//!
//! A mask is a matrix `Π` (`m × n`). It is kept as `W L` or as `1 − W L`. `L` divides the projector into parts, for example into its rows,
//! and `W` weights each part for each camera pixel. If `p_k` is the pattern of part `k` and `m_k` is column `k` of `W`, then
//! `Π = Σ m_k p_kᵀ`.

use std::collections::HashMap;

use super::Homes;
use crate::error::{Error, Result};
use crate::image::Resolution;
use crate::sparse::Csr;

/// The most weights that are kept: 1.5 GiB.
const MOST_WEIGHTS: usize = 1 << 27;

/// A probing matrix `Π` (`m × n`) for `m` camera pixels and `n` projector pixels.
#[derive(Clone, Debug, PartialEq)]
pub struct Mask {
    parts: Parts,
    /// The weight of each part for each camera pixel (`m × parts`).
    weights: Csr,
    /// Whether the mask is one minus these weights.
    is_complement: bool,
}

/// The patterns of the parts.
#[derive(Clone, Debug, PartialEq)]
enum Parts {
    /// The part of each projector pixel (`n`). A pixel without a part has the weight 0 everywhere.
    Labels(Vec<Option<u32>>),
    /// The pattern of each part (`parts × n`).
    Patterns(Vec<Vec<f64>>),
}

impl Mask {
    /// Lets the light through that comes from the projector row of the camera pixel's home. `size` is that of patterns. Without `homes`,
    /// photos have the pixels of patterns, and each is its own home. A camera pixel without a home lets nothing through.
    ///
    /// # Errors
    /// [`Error::Option`] naming `--mask` if the mask has too many weights. This holds for all masks below.
    pub fn row(size: Resolution, homes: Option<&Homes>) -> Result<Self> {
        let row = |pixel: usize| Some((pixel / size.width) as u32);
        let camera = own_pixels(size, homes).map(|home| home.and_then(row));
        Self::lines(&camera.collect::<Vec<_>>(), &(0..size.pixels()).map(row).collect::<Vec<_>>())
    }

    /// Works like [`Mask::row`], for columns.
    pub fn column(size: Resolution, homes: Option<&Homes>) -> Result<Self> {
        Self::band(size, homes, [0, 0])
    }

    /// Lets light through from the projector columns `u` with `first ≤ u − h ≤ last`, where `h` is the column of the camera pixel's home.
    /// Columns count to the right. `size` and `homes` are as for [`Mask::row`].
    pub fn band(size: Resolution, homes: Option<&Homes>, [first, last]: [i32; 2]) -> Result<Self> {
        let end =
            |home: usize, shift: i64| ((home % size.width) as i64 + shift).clamp(0, size.width as i64) as u32;
        let rows = own_pixels(size, homes).map(|home| {
            home.map_or(0..0, |home| end(home, i64::from(first))..end(home, i64::from(last) + 1))
        });
        let labels: Vec<_> = (0..size.pixels()).map(|pixel| Some((pixel % size.width) as u32)).collect();
        Self::merged(&labels, &ones(size.width, rows)?)
    }

    /// Lets light through from projector pixels farther than `distance` pixels from the camera pixel's home. A camera pixel without a home
    /// lets all light through. `size` and `homes` are as for [`Mask::row`].
    pub fn beyond(size: Resolution, homes: Option<&Homes>, distance: f64) -> Result<Self> {
        let Resolution { width, height } = size;
        let within = |at: usize, reach: f64, length: usize| {
            (at as f64 - reach).ceil().max(0.0) as usize..length.min((at as f64 + reach).floor() as usize + 1)
        };
        let disc = |home: usize| {
            let [x, y] = [home % width, home / width];
            within(y, distance, height).flat_map(move |v| {
                let half = (distance.powi(2) - (v as f64 - y as f64).powi(2)).max(0.0).sqrt();
                within(x, half, width).map(move |u| (v * width + u) as u32)
            })
        };
        let rows = own_pixels(size, homes).map(|home| home.into_iter().flat_map(disc));
        let labels: Vec<_> = (0..size.pixels()).map(|pixel| Some(pixel as u32)).collect();
        Ok(Self { is_complement: true, ..Self::merged(&labels, &ones(size.pixels(), rows)?)? })
    }

    /// Lets light through from the projector pixels (`n`) of a line to the camera pixels (`m`) of the same line. A pixel may be on no line.
    pub fn lines(camera: &[Option<u32>], projector: &[Option<u32>]) -> Result<Self> {
        let count = projector.iter().flatten().max().map_or(0, |&last| last + 1);
        let rows = camera.iter().map(|line| line.filter(|&line| line < count).into_iter());
        Self::merged(projector, &ones(count as usize, rows)?)
    }

    /// The mask with these weights (`m × n`). Projector pixels with equal columns become one part.
    pub fn given(weights: &Csr) -> Result<Self> {
        let labels: Vec<_> = (0..weights.cols()).map(|pixel| Some(pixel as u32)).collect();
        Self::merged(&labels, &Csr::sum(&[(1.0, weights)])?)
    }

    /// The mask `Σ m_k p_kᵀ` of equally many `masks` (`m` values each) and `patterns` (`n` values each).
    ///
    /// # Errors
    /// [`Error::Dimension`] if their numbers differ, or the sizes of `masks`.
    pub fn pairs(masks: &[Vec<f64>], patterns: Vec<Vec<f64>>) -> Result<Self> {
        Error::check_size("the patterns of a mask", masks.len(), patterns.len())?;
        let (pixels, count) = (masks.first().map_or(0, Vec::len), masks.len());
        let starts = (0..=count).map(|k| k * pixels).collect();
        let columns = (0..count).flat_map(|_| 0..pixels as u32).collect();
        let weights = Csr::new(pixels, starts, columns, masks.concat())?.transposed();
        Ok(Self { parts: Parts::Patterns(patterns), weights, is_complement: false })
    }

    /// Makes one part of all parts that have the same weights everywhere, and drops the parts without any.
    fn merged(labels: &[Option<u32>], weights: &Csr) -> Result<Self> {
        let columns = weights.transposed();
        let (mut starts, mut rows, mut values) = (vec![0], Vec::new(), Vec::new());
        let mut known = HashMap::new();
        let mut merge = |part: usize| {
            let (at, of) = columns.row(part);
            let mut hash = blake3::Hasher::new();
            at.iter().zip(of).for_each(|(at, of)| {
                hash.update(&at.to_le_bytes()).update(&of.to_le_bytes());
            });
            (!at.is_empty()).then(|| {
                *known.entry(hash.finalize()).or_insert_with(|| {
                    rows.extend_from_slice(at);
                    values.extend_from_slice(of);
                    starts.push(rows.len());
                    starts.len() as u32 - 2
                })
            })
        };
        let names: Vec<Option<u32>> = (0..columns.rows()).map(&mut merge).collect();
        let weights = Csr::new(weights.rows(), starts, rows, values)?.transposed();
        let labels = labels.iter().map(|label| label.and_then(|label| names[label as usize])).collect();
        Ok(Self { parts: Parts::Labels(labels), weights, is_complement: false })
    }

    /// The numbers of camera and projector pixels, `m` and `n`.
    pub fn shape(&self) -> [usize; 2] {
        let columns = match &self.parts {
            Parts::Labels(labels) => labels.len(),
            Parts::Patterns(patterns) => patterns.first().map_or(0, Vec::len),
        };
        [self.weights.rows(), columns]
    }

    /// The number of parts: the photos that make the masked photo without random patterns, beside the white one of [`Mask::beyond`].
    pub fn parts(&self) -> usize {
        self.weights.cols()
    }

    /// The number of photos that [`probe_masked`](super::probe_masked) takes at most, for this budget.
    pub fn photos(&self, budget: usize) -> usize {
        self.parts().min(budget) + usize::from(self.is_complement)
    }

    /// Whether the photo under white is needed.
    pub(super) fn is_complement(&self) -> bool {
        self.is_complement
    }

    /// The weights of the parts (`m × parts`).
    pub(super) fn weights(&self) -> &Csr {
        &self.weights
    }

    /// The pattern in which each part has this value: `Lᵀ values` (`n`).
    pub(super) fn spread(&self, values: &[f64]) -> Vec<f64> {
        match &self.parts {
            Parts::Labels(labels) => {
                labels.iter().map(|label| label.map_or(0.0, |label| values[label as usize])).collect()
            }
            Parts::Patterns(patterns) => {
                let mut sum = vec![0.0; self.shape()[1]];
                for (value, pattern) in values.iter().zip(patterns) {
                    sum.iter_mut().zip(pattern).for_each(|(sum, pixel)| *sum += value * pixel);
                }
                sum
            }
        }
    }

    /// `(Π ∘ A) 1` (`m`) from the matrix `A` itself (`m × n`), without noise.
    pub fn exact(&self, matrix: &Csr) -> Vec<f64> {
        let mut of_part = vec![0.0; self.parts()];
        let row = |row: usize| {
            let (parts, weights) = self.weights.row(row);
            parts.iter().zip(weights).for_each(|(&part, weight)| of_part[part as usize] = *weight);
            let weight = |pixel: usize| match &self.parts {
                Parts::Labels(labels) => labels[pixel].map_or(0.0, |label| of_part[label as usize]),
                Parts::Patterns(all) => {
                    parts.iter().map(|&k| of_part[k as usize] * all[k as usize][pixel]).sum()
                }
            };
            let (columns, values) = matrix.row(row);
            let sum = columns.iter().zip(values).map(|(&pixel, value)| {
                let weight: f64 = weight(pixel as usize);
                value * if self.is_complement { 1.0 - weight } else { weight }
            });
            let sum = sum.sum::<f64>();
            parts.iter().for_each(|&part| of_part[part as usize] = 0.0);
            sum
        };
        (0..matrix.rows()).map(row).collect()
    }
}

/// The home of each camera pixel.
fn own_pixels<'a>(size: Resolution, homes: Option<&'a Homes>) -> impl Iterator<Item = Option<usize>> + 'a {
    let count = homes.map_or(size.pixels(), <[_]>::len);
    (0..count).map(move |pixel| homes.map_or(Some(pixel), |homes| homes[pixel]))
}

/// The matrix of `columns` columns with ones at these columns of each row.
fn ones(columns: usize, rows: impl Iterator<Item = impl Iterator<Item = u32>>) -> Result<Csr> {
    let (mut starts, mut all) = (vec![0], Vec::new());
    for row in rows {
        all.extend(row);
        if all.len() > MOST_WEIGHTS {
            let fault = format!("the mask has more than {MOST_WEIGHTS} weights");
            return Err(Error::option("--mask", fault).help("give a narrower mask, or a smaller --size"));
        }
        starts.push(all.len());
    }
    let weights = vec![1.0; all.len()];
    Csr::new(columns, starts, all, weights)
}
