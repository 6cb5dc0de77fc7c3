//! Answers are checked with light that they were not computed from: of a scene by light paths of another seed, of a rig by one more photo.
//! Runs, models and matrices have no such light.

use super::source::Source;
use super::{Lab, Relighting, Separated};
use crate::analysis::segment::{Cut, KEPT};
use crate::analysis::verification::{
    EigenpairEstimate, eigenpair_estimates, eigenvalue_estimate, gap, relative_errors,
};
use crate::analysis::{Compensation, Segmentation};
use crate::error::Result;
use crate::image::{Image, Resolution};
use crate::io::manifest::{Independent, Verification};
use crate::krylov::{Eigs, Start};
use crate::transport::{EstimatedProduct, Part, Question};

/// A pattern and the photo that an answer predicts for it, in one channel.
struct Predicted {
    channel: usize,
    pattern: Vec<f64>,
    photo: Vec<f64>,
}

/// What independent light says of eigenpairs.
#[derive(Clone, Debug, PartialEq)]
pub struct VerifiedEigenpairs {
    /// How well the photos of the eigenvectors are predicted.
    pub verification: Verification,
    /// The eigenpairs of the scene, one for each that was found. Empty for a rig, whose one photo tells them all together.
    pub estimates: Vec<EigenpairEstimate>,
}

impl VerifiedEigenpairs {
    /// How many eigenvectors of a segmentation that counts so many `regions` are noise of its matrix: by independent light they keep less than
    /// [`KEPT`] of their light.
    pub fn refuted(&self, regions: usize) -> usize {
        let counted = self.estimates.iter().take(regions.saturating_sub(1));
        counted.filter(|estimate| estimate.quotient[0] + 2.0 * estimate.quotient[1] < KEPT).count()
    }
}

impl Lab {
    /// Checks eigenpairs of one part of the light transport matrix: the products of all eigenvectors by light paths of another seed, or one
    /// photo of their sum with random signs. `None` where there is no independent light, or where pairs are complex.
    ///
    /// # Errors
    /// As [`Lab::operator`].
    pub fn verify_eigenpairs(&mut self, part: Part, found: &Eigs) -> Result<Option<VerifiedEigenpairs>> {
        if found.imaginary_values.iter().any(|&value| value != 0.0) || found.values.is_empty() {
            return Ok(None);
        }
        let of = "photos of the eigenvectors";
        if !matches!(self.source, Source::Scene(_)) {
            let weights = vec![1.0; self.projector_resolution().pixels()];
            let sum = sum_with_signs(&found.vectors, &found.values, &weights, self.seed());
            let verification = self.verify(part, of, &[sum])?;
            return Ok(
                verification.map(|verification| VerifiedEigenpairs { verification, estimates: Vec::new() })
            );
        }
        let asked: Vec<Question<'_>> =
            found.vectors.iter().map(|pattern| Question { pattern, shift: 0.0 }).collect();
        let Some((by, products)) = self.independent(part, 0, &asked)? else { return Ok(None) };
        let photos: Vec<Vec<f64>> = found
            .vectors
            .iter()
            .zip(&found.values)
            .map(|(vector, value)| vector.iter().map(|entry| value * entry).collect())
            .collect();
        let pairs: Vec<(&[f64], &EstimatedProduct)> =
            photos.iter().map(Vec::as_slice).zip(&products).collect();
        let estimates = eigenpair_estimates(found, &products).unwrap_or_default();
        let verification = self.checked(by, of, &pairs);
        Ok(verification.map(|verification| VerifiedEigenpairs { verification, estimates }))
    }

    /// Checks a segmentation of the light of `part` by the normalized cut: `G u = λ D u`, as [`Lab::verify_eigenpairs`]. The estimates are of its
    /// eigenvalues but the first, which is known.
    ///
    /// # Errors
    /// As [`Lab::operator`].
    pub fn verify_segmentation(
        &mut self,
        part: Part,
        cut: Cut,
        found: &Segmentation,
    ) -> Result<Option<VerifiedEigenpairs>> {
        if cut != Cut::Normalized || found.eigenvectors.len() < 2 {
            return Ok(None);
        }
        let of = "photos of the eigenvectors";
        let (vectors, values) = (&found.eigenvectors[1..], &found.eigenvalues[1..]);
        if !matches!(self.source, Source::Scene(_)) {
            let sum = sum_with_signs(vectors, values, &found.degree, self.seed());
            let verification = self.verify(part, of, &[sum])?;
            return Ok(
                verification.map(|verification| VerifiedEigenpairs { verification, estimates: Vec::new() })
            );
        }
        let question = |(pattern, shift)| Question { pattern, shift };
        let asked: Vec<Question<'_>> =
            vectors.iter().map(Vec::as_slice).zip(values.iter().copied()).map(question).collect();
        let Some((by, mut products)) = self.independent(part, 0, &asked)? else { return Ok(None) };
        // Masked pixels are not in the graph.
        for product in &mut products {
            let entries = product.product.iter_mut().zip(&mut product.error).zip(&found.mask);
            entries.filter(|(_, masked)| **masked).for_each(|((y, e), _)| (*y, *e) = (0.0, 0.0));
        }
        let photos: Vec<Vec<f64>> = vectors
            .iter()
            .zip(values)
            .map(|(vector, value)| vector.iter().zip(&found.degree).map(|(u, d)| value * d * u).collect())
            .collect();
        let pairs: Vec<(&[f64], &EstimatedProduct)> =
            photos.iter().map(Vec::as_slice).zip(&products).collect();
        let estimates = products.iter().enumerate().filter_map(|(index, product)| {
            let gap = gap(values, index);
            let residual = found.residuals[1 + index];
            let unconverged = if gap > residual { residual * residual / gap } else { residual };
            Some(eigenvalue_estimate(values, index, unconverged, product.quadratic?))
        });
        let estimates = estimates.collect();
        let verification = self.checked(by, of, &pairs);
        Ok(verification.map(|verification| VerifiedEigenpairs { verification, estimates }))
    }

    /// Checks a compensation: what is seen under its pattern, and its relative distance from the target by independent light, `‖y − b‖ / ‖b‖` without
    /// noise. Not for a rig whose colours mix.
    ///
    /// # Errors
    /// As [`Lab::operator`].
    pub fn verify_compensation(&mut self, found: &Compensation) -> Result<Option<(Verification, f64)>> {
        let ambient = self.ambient()?;
        let predicted = self.predicted(&[(&found.pattern, &found.observed)], &ambient);
        let target = self.predicted(&[(&found.pattern, &found.target)], &ambient);
        let Some((by, products)) = self.products_of(Part::Full, &predicted)? else { return Ok(None) };
        let [mut off, mut size] = [0.0; 2];
        for (target, product) in target.iter().zip(&products) {
            let squares = product.squares(&target.photo);
            off += squares.difference - squares.noise;
            size += target.photo.iter().map(|value| value * value).sum::<f64>();
        }
        let verification = self.checked(by, "the photo of the compensation", &pairs(&predicted, &products));
        Ok(verification.map(|verification| (verification, (off.max(0.0) / size).sqrt())))
    }

    /// Checks a captured model: the relit photos; on a rig the first one, to take one photo only.
    ///
    /// # Errors
    /// As [`Lab::operator`].
    pub fn verify_relighting(&mut self, found: &Relighting) -> Result<Option<Verification>> {
        let most = if matches!(self.source, Source::Scene(_)) { found.relit.len() } else { 1 };
        let relit: Vec<(&Image, &Image)> =
            found.relit.iter().take(most).map(|relit| (&relit.pattern, &relit.relit)).collect();
        let predicted = self.predicted(&relit, &found.model.ambient);
        self.verify(Part::Full, "relit photos", &predicted)
    }

    /// Checks a separation: the photo of a checkerboard of three pixels, which is its direct light and half of the global light.
    ///
    /// # Errors
    /// As [`Lab::operator`].
    pub fn verify_separation(&mut self, found: &Separated) -> Result<Option<Verification>> {
        let size = self.projector_resolution();
        if size.pixels() != self.resolution().pixels() {
            return Ok(None);
        }
        let pattern = checkerboard(size, 3);
        let predicted: Vec<Predicted> = (found.direct.iter().zip(&found.global))
            .enumerate()
            .map(|(channel, (direct, global))| {
                let photo = direct.iter().zip(global).zip(&pattern).map(|((d, g), x)| d * x + 0.5 * g);
                Predicted { channel, photo: photo.collect(), pattern: pattern.clone() }
            })
            .collect();
        self.verify(Part::Full, "the photo of a checkerboard", &predicted)
    }

    /// Patterns and photos with ambient light, by channel.
    fn predicted(&self, photos: &[(&Image, &Image)], ambient: &Image) -> Vec<Predicted> {
        let of = |&(pattern, photo): &(&Image, &Image)| {
            let planes = photo.planes().into_iter().zip(ambient.planes()).enumerate();
            let pattern = pattern.clone();
            planes.map(move |(channel, (photo, ambient))| Predicted {
                channel,
                pattern: pattern.plane(channel.min(pattern.channels() - 1)),
                photo: photo.iter().zip(&ambient).map(|(photo, ambient)| photo - ambient).collect(),
            })
        };
        let mut predicted: Vec<Predicted> = photos.iter().flat_map(of).collect();
        predicted.sort_by_key(|one| one.channel);
        predicted
    }

    fn verify(&mut self, part: Part, of: &str, predicted: &[Predicted]) -> Result<Option<Verification>> {
        let Some((by, products)) = self.products_of(part, predicted)? else { return Ok(None) };
        Ok(self.checked(by, of, &pairs(predicted, &products)))
    }

    /// Independent photos of the patterns, whose channels ascend.
    fn products_of(
        &mut self,
        part: Part,
        predicted: &[Predicted],
    ) -> Result<Option<(Independent, Vec<EstimatedProduct>)>> {
        let (mut products, mut by) = (Vec::with_capacity(predicted.len()), None);
        for of_channel in predicted.chunk_by(|a, b| a.channel == b.channel) {
            let asked: Vec<Question<'_>> =
                of_channel.iter().map(|one| Question { pattern: &one.pattern, shift: 0.0 }).collect();
            let Some((light, found)) = self.independent(part, of_channel[0].channel, &asked)? else {
                return Ok(None);
            };
            by = Some(light);
            products.extend(found);
        }
        Ok(by.map(|by| (by, products)))
    }

    /// Compares, and notes the result in the record of the open run.
    fn checked(
        &mut self,
        by: Independent,
        of: &str,
        pairs: &[(&[f64], &EstimatedProduct)],
    ) -> Option<Verification> {
        let [error, noise] = relative_errors(pairs)?;
        let verification = Verification { by, of: of.into(), error, noise };
        if let Some(run) = &mut self.run {
            run.manifest.verification = Some(verification.clone());
        }
        Some(verification)
    }
}

/// Predicted photos with the independent ones.
fn pairs<'a>(
    predicted: &'a [Predicted],
    products: &'a [EstimatedProduct],
) -> Vec<(&'a [f64], &'a EstimatedProduct)> {
    predicted.iter().map(|one| one.photo.as_slice()).zip(products).collect()
}

/// The sum of eigenvectors with random signs, and the photo that follows from their eigenvalues; each entry of the photo is weighted.
fn sum_with_signs(vectors: &[Vec<f64>], values: &[f64], weights: &[f64], seed: u64) -> Predicted {
    let signs = Start::Rademacher { seed }.vector(vectors.len());
    let [mut pattern, mut photo] = [vec![0.0; weights.len()], vec![0.0; weights.len()]];
    for ((vector, value), sign) in vectors.iter().zip(values).zip(signs) {
        for (pixel, entry) in vector.iter().enumerate() {
            pattern[pixel] += sign * entry;
            photo[pixel] += sign * value * weights[pixel] * entry;
        }
    }
    Predicted { channel: 0, pattern, photo }
}

/// A checkerboard of so many pixels.
fn checkerboard(size: Resolution, square: usize) -> Vec<f64> {
    let value = |pixel: usize| (pixel % size.width / square + pixel / size.width / square) % 2;
    (0..size.pixels()).map(|pixel| value(pixel) as f64).collect()
}
