//! Answers are checked with light that they were not computed from: of a scene by light paths of another seed, of a rig by one more photo.
//! Runs, models and matrices have no such light.

mod compensation;

pub use compensation::VerifiedCompensation;

use super::source::Source;
use super::{Lab, Relighting, Separated};
use crate::analysis::Segmentation;
use crate::analysis::segment::{Cut, KEPT};
use crate::analysis::verification::{EigenpairEstimate, cut_estimates, eigenpair_estimates};
use crate::error::Result;
use crate::image::{Image, Resolution};
use crate::io::manifest::{Independent, Verification};
use crate::krylov::{Eigs, Start};
use crate::transport::{EstimatedProduct, Part, Question, Squares};

/// A pattern and the photo that an answer predicts for it, in one channel.
struct Predicted {
    channel: usize,
    pattern: Vec<f64>,
    photo: Vec<f64>,
}

/// Eigenpairs to be checked, `P u = λ W u`, with the diagonal matrix `W`.
struct Eigenpairs<'a> {
    vectors: &'a [Vec<f64>],
    values: &'a [f64],
    /// The diagonal of `W`. Pixels of weight 0 are left out.
    weights: &'a [f64],
    /// The shift of each vector's [`Question`].
    shifts: &'a [f64],
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
        let count = found.values.len();
        let pairs = Eigenpairs {
            vectors: &found.vectors,
            values: &found.values,
            weights: &vec![1.0; self.projector_resolution().pixels()],
            shifts: &vec![0.0; count],
        };
        self.verify_pairs(part, &pairs, |products| eigenpair_estimates(found, products))
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
        let values = &found.eigenvalues[1..];
        // Masked pixels are not in the graph.
        let weights = found.degree.iter().zip(&found.mask);
        let weights: Vec<f64> = weights.map(|(&degree, &masked)| if masked { 0.0 } else { degree }).collect();
        let pairs =
            Eigenpairs { vectors: &found.eigenvectors[1..], values, weights: &weights, shifts: values };
        self.verify_pairs(part, &pairs, |products| cut_estimates(values, &found.residuals[1..], products))
    }

    /// Checks eigenpairs: each by light paths of another seed, from which `estimates` follow, or their sum with random signs by one photo.
    fn verify_pairs(
        &mut self,
        part: Part,
        pairs: &Eigenpairs<'_>,
        estimates: impl FnOnce(&[EstimatedProduct]) -> Option<Vec<EigenpairEstimate>>,
    ) -> Result<Option<VerifiedEigenpairs>> {
        let sum = match self.source {
            Source::Scene(_) => None,
            _ => Some(pairs.sum_with_signs(self.seed())),
        };
        let asked: Vec<Question<'_>> = match &sum {
            None => pairs.questions(),
            Some(sum) => vec![Question { pattern: &sum.pattern, shift: 0.0 }],
        };
        let Some((by, mut products)) = self.independent(part, 0, &asked)? else { return Ok(None) };
        for product in &mut products {
            let entries = product.product.iter_mut().zip(&mut product.error).zip(pairs.weights);
            entries.filter(|(_, weight)| **weight == 0.0).for_each(|((y, e), _)| (*y, *e) = (0.0, 0.0));
        }
        let (squares, estimates) = match &sum {
            None => {
                let each = pairs.photos().zip(&products).map(|(photo, product)| product.squares(&photo));
                (each.sum(), estimates(&products).unwrap_or_default())
            }
            Some(sum) => (squares(std::slice::from_ref(sum), &products), Vec::new()),
        };
        let verification = self.checked(by, "photos of the eigenvectors", squares);
        Ok(verification.map(|verification| VerifiedEigenpairs { verification, estimates }))
    }

    /// Checks a captured model: the relit photos; on a rig the first one, to take one photo only.
    ///
    /// # Errors
    /// As [`Lab::operator`].
    pub fn verify_relighting(&mut self, found: &Relighting) -> Result<Option<Verification>> {
        let of = "relit photos";
        if matches!(self.source, Source::Rig(_)) {
            let first = found.relit.iter().take(1).map(|relit| (&relit.pattern, &relit.relit));
            let predicted = self.predicted(&first.collect::<Vec<_>>(), &found.model.ambient);
            return self.verify(Part::Full, of, &predicted);
        }
        // The answer to each question holds this comparison already.
        let comparisons: Vec<Squares> = found.relit.iter().filter_map(|relit| relit.comparison).collect();
        let are_there = !comparisons.is_empty();
        Ok(are_there
            .then(|| self.checked(Independent::AnotherSeed, of, comparisons.into_iter().sum()))
            .flatten())
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
        Ok(self.checked(by, of, squares(predicted, &products)))
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

    /// Notes a comparison in the record of the open run. `None` where the photos are nothing but noise.
    fn checked(&mut self, by: Independent, of: &str, squares: Squares) -> Option<Verification> {
        let [error, noise] = squares.relative()?;
        let verification = Verification { by, of: of.into(), error, noise };
        if let Some(run) = &mut self.run {
            run.manifest.verification = Some(verification.clone());
        }
        Some(verification)
    }
}

impl Eigenpairs<'_> {
    /// Each vector as a pattern.
    fn questions(&self) -> Vec<Question<'_>> {
        let each = self.vectors.iter().zip(self.shifts);
        each.map(|(pattern, &shift)| Question { pattern, shift }).collect()
    }

    /// The photo of each vector, `λ W u`.
    fn photos(&self) -> impl Iterator<Item = Vec<f64>> {
        let photo = |(vector, value): (&Vec<f64>, &f64)| {
            vector.iter().zip(self.weights).map(|(entry, weight)| value * weight * entry).collect()
        };
        self.vectors.iter().zip(self.values).map(photo)
    }

    /// The sum of the vectors with random signs, and its photo.
    fn sum_with_signs(&self, seed: u64) -> Predicted {
        let signs = Start::Rademacher { seed }.vector(self.vectors.len());
        let sum = |vectors: &mut dyn Iterator<Item = Vec<f64>>| {
            let mut sum = vec![0.0; self.weights.len()];
            for (vector, sign) in vectors.zip(&signs) {
                sum.iter_mut().zip(vector).for_each(|(sum, entry)| *sum += sign * entry);
            }
            sum
        };
        Predicted {
            channel: 0,
            pattern: sum(&mut self.vectors.iter().cloned()),
            photo: sum(&mut self.photos()),
        }
    }
}

/// How near predicted photos are to the independent ones, all together.
fn squares(predicted: &[Predicted], products: &[EstimatedProduct]) -> Squares {
    predicted.iter().zip(products).map(|(one, product)| product.squares(&one.photo)).sum()
}

/// A checkerboard of so many pixels.
fn checkerboard(size: Resolution, square: usize) -> Vec<f64> {
    let value = |pixel: usize| (pixel % size.width / square + pixel / size.width / square) % 2;
    (0..size.pixels()).map(|pixel| value(pixel) as f64).collect()
}
