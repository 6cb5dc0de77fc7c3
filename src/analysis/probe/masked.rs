//! The masked photo as a sum of photos.
//!
//! With `Π = Σ m_k p_kᵀ`, the masked photo `(Π ∘ A) 1` is `Σ m_k ∘ (A p_k)`: one photo a pair, whose pixels are multiplied by `m_k`
//! afterwards. For any mask `Π = W L` and random signs `s`, `E[(W s) (Lᵀ s)ᵀ] = Π`, so the mean of `(W s) ∘ (A Lᵀ s)` is the masked photo
//! too. If the photos are fewer than the parts, `W ≈ Q Qᵀ W` comes first, where `Q` is an orthonormal basis of the range of `W` that random
//! vectors find. Its part of the mask takes one photo a vector, and random signs are left with the rest. This is the variance reduction of
//! Meyer, Musco, Musco and Woodruff, *Hutch++* (2021), doi:10.1137/1.9781611976496.16, for photos in place of traces.
//!
//! O'Toole, Raskar and Kutulakos (2012), doi:10.1145/2185520.2185535, block light by a mask in front of the camera. Here all light reaches
//! the camera, so masked light still adds its shot noise, and can saturate.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use super::{Mask, Probed, Samples};
use crate::error::{Error, Result};
use crate::krylov::{dot, norm};
use crate::operator::{Operator, product};
use crate::sparse::Csr;

/// The most vectors of the basis `Q`. Their orthonormalization takes time that grows with the square of their number.
const MOST_VECTORS: usize = 256;

/// The fewest random patterns after those of the basis, so that their spread tells their error.
const LEAST_RANDOM: usize = 4;

/// A vector that is in the range of the basis up to this share of its norm tells that the basis is complete.
const IN_RANGE: f64 = 1e-9;

/// Probes under a mask with at most `photos` products with `operator` (`m × n`), and a white one more for [`Mask::beyond`]. As many products
/// as the mask has parts, or as its rank is, make the photo without random patterns. The standard errors then come from the variances of the
/// operator's products, or from their standard errors as if these were even over the pixels. They are 0 if neither is known.
///
/// # Errors
/// [`Error::Option`] naming `--photos`; [`Error::Dimension`] if sizes differ; any error of the operator.
pub fn probe_masked(operator: &mut dyn Operator, mask: &Mask, photos: usize, seed: u64) -> Result<Probed> {
    let [m, n] = mask.shape();
    let found = format!("{}x{}", operator.rows(), operator.cols());
    Error::check_size("the transport operator to be probed", format!("{m}x{n}"), found)?;
    let mut random = Pcg64::seed_from_u64(seed);
    let mut sum = Sum { values: vec![0.0; m], variances: vec![0.0; m], photos: 0 };
    if mask.parts() <= photos {
        let columns = mask.weights().transposed();
        for part in 0..mask.parts() {
            let mut lit = vec![0.0; mask.parts()];
            lit[part] = 1.0;
            let mut weights = vec![0.0; m];
            let (rows, values) = columns.row(part);
            rows.iter().zip(values).for_each(|(&row, value)| weights[row as usize] = *value);
            sum.add(operator, &mask.spread(&lit), &weights)?;
        }
    } else if photos < 2 {
        return Err(Error::option("--photos", format!("{photos} tell no error")).help("give at least 2"));
    } else {
        let basis = Basis::find(mask.weights(), photos, &mut random);
        for (vector, code) in basis.vectors.iter().zip(&basis.codes) {
            sum.add(operator, &mask.spread(code), vector)?;
        }
        if !basis.is_complete {
            let samples = sum.photos..photos;
            sum.add_random(operator, mask, &basis, (samples.len(), &mut random))?;
        }
    }
    if mask.is_complement() {
        sum.values.iter_mut().for_each(|value| *value = -*value);
        sum.add(operator, &vec![1.0; n], &vec![1.0; m])?;
    }
    let standard_errors = sum.variances.into_iter().map(f64::sqrt).collect();
    Ok(Probed { values: sum.values, standard_errors, photos: sum.photos })
}

/// A masked photo so far.
struct Sum {
    values: Vec<f64>,
    variances: Vec<f64>,
    photos: usize,
}

impl Sum {
    /// Adds the photo of a pattern, multiplied by `weights`.
    fn add(&mut self, operator: &mut dyn Operator, pattern: &[f64], weights: &[f64]) -> Result<()> {
        let photo = product(operator, pattern)?;
        self.photos += 1;
        let even = operator.standard_error().powi(2) / photo.len().max(1) as f64;
        let variances = operator.variances();
        for (pixel, weight) in weights.iter().enumerate() {
            self.values[pixel] += weight * photo[pixel];
            self.variances[pixel] += weight * weight * variances.get(pixel).unwrap_or(&even);
        }
        Ok(())
    }

    /// Adds the mean over random patterns under the part of the mask that `basis` leaves out.
    fn add_random(
        &mut self,
        operator: &mut dyn Operator,
        mask: &Mask,
        basis: &Basis,
        (count, random): (usize, &mut Pcg64),
    ) -> Result<()> {
        let mut samples = Samples::new(self.values.len());
        for _ in 0..count {
            let signs: Vec<f64> = signs(mask.parts(), random);
            let photo = product(operator, &mask.spread(&signs))?;
            self.photos += 1;
            let mut weights = mask.weights().times(&signs);
            basis.remove_from(&mut weights);
            samples.add(weights.into_iter().zip(photo).map(|(weight, photo)| weight * photo));
        }
        let errors = samples.standard_errors();
        for (pixel, value) in samples.mean.into_iter().enumerate() {
            self.values[pixel] += value;
            self.variances[pixel] += errors[pixel] * errors[pixel];
        }
        Ok(())
    }
}

fn signs(count: usize, random: &mut Pcg64) -> Vec<f64> {
    (0..count).map(|_| if random.random() { 1.0 } else { -1.0 }).collect()
}

/// Orthonormal vectors `q` (`m`) in the range of `W`, and `Wᵀ q` for each (`parts`).
struct Basis {
    vectors: Vec<Vec<f64>>,
    codes: Vec<Vec<f64>>,
    is_complete: bool,
}

impl Basis {
    /// Finds the whole range if it has at most `photos` dimensions. Otherwise, the number of vectors is the one that leaves the least
    /// variance, if all photos take an equal part in it.
    fn find(weights: &Csr, photos: usize, random: &mut Pcg64) -> Self {
        let transposed = weights.transposed();
        let mut basis = Self { vectors: Vec::new(), codes: Vec::new(), is_complete: false };
        let all: f64 = weights.weights().iter().map(|weight| weight * weight).sum();
        let (mut left, mut best) = (all, (0, all / photos as f64));
        for count in 1..=photos.min(MOST_VECTORS) {
            let mut vector: Vec<f64> = (0..weights.cols()).map(|_| random.random_range(-1.0..1.0)).collect();
            vector = weights.times(&vector);
            let before = norm(&vector);
            // Once more, since the first time leaves errors of rounding.
            (0..2).for_each(|_| basis.remove_from(&mut vector));
            let length = norm(&vector);
            if length <= IN_RANGE * before {
                basis.is_complete = true;
                return basis;
            }
            vector.iter_mut().for_each(|value| *value /= length);
            let code = transposed.times(&vector);
            left -= dot(&code, &code);
            basis.vectors.push(vector);
            basis.codes.push(code);
            let rest = photos - count;
            if rest >= LEAST_RANDOM && left / rest as f64 <= best.1 {
                best = (count, left / rest as f64);
            }
        }
        basis.vectors.truncate(best.0);
        basis.codes.truncate(best.0);
        basis
    }

    /// `vector ← (1 − Q Qᵀ) vector`.
    fn remove_from(&self, vector: &mut [f64]) {
        for own in &self.vectors {
            let share = dot(own, vector);
            vector.iter_mut().zip(own).for_each(|(value, own)| *value -= share * own);
        }
    }
}
