//! Verification of answers with light that is independent of them. For a scene, such light consists of light paths with another seed. For a
//! rig, it is one more photo. Runs, models and matrices have no independent light.
//!
//! The null hypothesis is that the answer is right within the stated errors. The stated errors combine three sources: the errors of the
//! independent photo, the errors of the photos or of the frozen matrix behind the answer, and the residuals that the answer states. For a
//! compensation on a rig, the rounding of its pattern to the projector's levels is added.

mod independent;

use super::source::Source;
use super::{Lab, Verified};
use crate::analysis::Segmentation;
use crate::analysis::low_rank::{Relit, SavedModel};
use crate::analysis::planes::Planes;
use crate::analysis::segment::{Cut, MASKED};
use crate::analysis::verification::{
    EigenpairEstimate, Grouped, Predicted as Compared, cut_estimates, eigenpair_estimates, judge,
};
use crate::error::Result;
use crate::finding::decimal;
use crate::image::Image;
use crate::io::manifest::{CheckVerdict, Independent, Verification};
use crate::krylov::{Eigs, Start};
use crate::measure::checkerboard;
use crate::operator::Operator;
use crate::render::TraceSettings;
use crate::transport::{EstimatedProduct, Part, Question, Squares, with_fewer_samples};

/// [`Light::own`] of as many light paths with another seed.
const AS_MANY_PATHS: f64 = 1.0;

/// [`Light::own`] of a photo of a rig. The standard errors that a rig states are correct to a factor of 1.3 (`stated_errors_of_rigs`),
/// so the sum of both variances may be 1.3² times the sum of the stated variances.
const AS_A_RIG_STATES: f64 = 2.0 * 1.3 * 1.3 - 1.0;

/// In 999 of 1000 cases, a sum of residuals with random signs is at most this factor times the root of the sum of their squares.
const SIGNED: f64 = 3.3;

/// Light that is independent of an answer.
#[derive(Clone, Copy)]
struct Light {
    by: Independent,
    /// The variance of a prediction's noise, relative to that of a photo by this light.
    own: f64,
}

/// A pattern and the photo that an answer predicts for it, in one channel.
struct Predicted {
    channel: usize,
    pattern: Vec<f64>,
    photo: Vec<f64>,
    /// The norm of the errors that the answer states.
    stated: f64,
}

/// Eigenpairs to be verified, `P u = λ W u`, with the diagonal matrix `W`.
struct Eigenpairs<'a> {
    vectors: &'a [Vec<f64>],
    values: &'a [f64],
    /// The diagonal of `W`. Pixels of weight 0 are left out.
    weights: &'a [f64],
    /// The shift of each vector's [`Question`].
    shifts: &'a [f64],
    /// The residual `‖W^-½ (P u − λ W u)‖` of each vector `u` with `uᵀ W u = 1`.
    residuals: &'a [f64],
}

/// The verification of eigenpairs, the photos that they predict, and the independent photos.
type PairsWithPhotos = (Verified, Vec<Vec<f64>>, Vec<EstimatedProduct>);

impl Lab {
    /// Verifies eigenpairs of one part of the light transport matrix. For a scene, light paths with another seed give the product of each
    /// eigenvector. For a rig, one photo shows the sum of all eigenvectors with random signs. Returns `None` without independent light or
    /// for complex pairs.
    pub fn verify_eigenpairs(&mut self, part: Part, found: &Eigs) -> Result<Option<Verified>> {
        if found.imaginary_values.iter().any(|&value| value != 0.0) || found.values.is_empty() {
            return Ok(None);
        }
        let count = found.values.len();
        let pairs = Eigenpairs {
            vectors: &found.vectors,
            values: &found.values,
            weights: &vec![1.0; self.projector_resolution().pixels()],
            shifts: &vec![0.0; count],
            residuals: &found.residuals,
        };
        let checked =
            self.verify_pairs(part, &pairs, |own, products| eigenpair_estimates(found, products, own))?;
        Ok(checked.map(|(verified, ..)| verified))
    }

    /// Verifies a segmentation of the light of `part` by the normalized cut, `G u = λ D u`, as [`Lab::verify_eigenpairs`]. The estimates
    /// cover all eigenvalues except the first, which is known. Fails as [`Lab::operator`].
    pub fn verify_segmentation(
        &mut self,
        part: Part,
        cut: Cut,
        found: &Segmentation,
    ) -> Result<Option<Verified>> {
        if cut != Cut::Normalized || found.eigenvectors.len() < 2 {
            return Ok(None);
        }
        let values = &found.eigenvalues[1..];
        // Masked pixels are not in the graph.
        let weights = found.degree.iter().zip(&found.mask);
        let weights: Vec<f64> = weights.map(|(&degree, &masked)| if masked { 0.0 } else { degree }).collect();
        let residuals = &found.residuals[1..];
        let vectors = &found.eigenvectors[1..];
        let pairs = Eigenpairs { vectors, values, weights: &weights, shifts: values, residuals };
        let checked =
            self.verify_pairs(part, &pairs, |own, products| cut_estimates(values, residuals, products, own))?;
        let Some((mut verified, photos, products)) = checked else { return Ok(None) };
        let [claimed, seen] = coordinates(found, &pairs, (&photos, &products));
        for (groups, labels) in &found.labels {
            let labels: Vec<Option<usize>> =
                labels.iter().map(|&label| (label != MASKED).then_some(usize::from(label))).collect();
            let grouped = Grouped::new(&labels, &weights, &claimed, &seen);
            if grouped.is_refuted() {
                verified.verification.verdict = CheckVerdict::Refuted;
                verified.verification.cause = Some(format!(
                    "the {groups} groups explain {:.2} % of what independent light tells apart, and shuffled labels up to {:.2} %",
                    100.0 * grouped.explained,
                    100.0 * grouped.by_chance
                ));
            }
            verified.supported.push((*groups, grouped.agreement));
        }
        if !verified.verification.is_passed() {
            verified.supported.iter_mut().for_each(|(_, share)| *share = 0.0);
        }
        self.note(&verified.verification);
        Ok(Some(verified))
    }

    /// Verifies eigenpairs. For a scene, light paths with another seed give the product of each vector, and these products give
    /// `estimates`. For a rig, one photo shows the sum of the vectors with random signs.
    fn verify_pairs(
        &mut self,
        part: Part,
        pairs: &Eigenpairs<'_>,
        estimates: impl FnOnce(f64, &[EstimatedProduct]) -> Option<Vec<EigenpairEstimate>>,
    ) -> Result<Option<PairsWithPhotos>> {
        let sum = match self.source {
            Source::Scene(_) => None,
            _ => Some(pairs.sum_with_signs(self.seed())),
        };
        let asked: Vec<Question<'_>> = match &sum {
            None => pairs.questions(),
            Some(sum) => vec![Question { pattern: &sum.pattern, shift: 0.0 }],
        };
        let found = self.independent(part, 0, &asked, with_fewer_samples)?;
        let Some((light, mut products)) = found else { return Ok(None) };
        for product in &mut products {
            let entries = product.product.iter_mut().zip(&mut product.error).zip(pairs.weights);
            entries.filter(|(_, weight)| **weight == 0.0).for_each(|((y, e), _)| (*y, *e) = (0.0, 0.0));
        }
        let (photos, estimates): (Vec<Vec<f64>>, Vec<EigenpairEstimate>) = match &sum {
            None => (pairs.photos().collect(), estimates(light.own, &products).unwrap_or_default()),
            Some(sum) => (vec![sum.photo.clone()], Vec::new()),
        };
        let stated = match &sum {
            None => pairs.residuals,
            Some(sum) => &[sum.stated],
        };
        let compared = |((photo, product), &stated): ((&Vec<f64>, &EstimatedProduct), &f64)| {
            of_product(light, &pairs.normalized(product), &pairs.unit(photo), stated)
        };
        let compared: Vec<Compared> = photos.iter().zip(&products).zip(stated).map(compared).collect();
        let verification = self.checked(light.by, "photos of the eigenvectors", &compared, |at| {
            // The quotient of an eigenvector is the fraction of light that it keeps. It shows whether the vector is only matrix noise.
            let estimate: &EigenpairEstimate = estimates.get(at)?;
            let [kept, error] = estimate.quotient;
            Some(format!(
                "by independent light the quotient of eigenvector {} is {kept:.4} ± {error:.4}, and its eigenvalue is stated as {}",
                at + 1,
                decimal(pairs.values[at], 4)
            ))
        });
        let verified = |verification: Verification| Verified { estimates, ..verification.into() };
        Ok(verification.map(|verification| (verified(verification), photos, products)))
    }

    /// Verifies a captured model with its relit photos. A rig takes one photo, of the first relit pattern. Fails as [`Lab::operator`].
    pub fn verify_relighting(&mut self, model: &SavedModel, relit: &[Relit]) -> Result<Option<Verification>> {
        let of = "relit photos";
        if matches!(self.source, Source::Rig(_)) {
            let first = relit.iter().take(1).map(|relit| (&relit.pattern, &relit.relit));
            let mut predicted = self.predicted(&first.collect::<Vec<_>>(), &model.ambient);
            for one in &mut predicted {
                one.stated = relit[0].stated.value().unwrap_or(0.0) * norm(&one.photo);
            }
            return self.verify(Part::Full, of, &predicted);
        }
        // Each relit photo was already compared with independent light.
        let light = Light { by: Independent::AnotherSeed, own: AS_MANY_PATHS };
        let comparisons = relit.iter().filter_map(|relit| {
            let squares = relit.comparison?;
            Some(compared(light, squares, relit.stated.value().unwrap_or(0.0) * squares.product.sqrt()))
        });
        let comparisons: Vec<Compared> = comparisons.collect();
        Ok(self.checked(light.by, of, &comparisons, |_| None))
    }

    /// Verifies a separation with the photo of a checkerboard whose squares are three pixels wide. The photo shows the direct light of the
    /// white squares, and about half of the global light. `error` is the relative error of the direct light. Fails as [`Lab::operator`].
    pub fn verify_separation(
        &mut self,
        direct: &Planes,
        global: &Planes,
        error: f64,
    ) -> Result<Option<Verification>> {
        let size = self.projector_resolution();
        if size.pixels() != self.resolution().pixels() {
            return Ok(None);
        }
        let pattern = checkerboard(size, 3, [3, 0]);
        // The global light under the checkerboard differs from half of the global light under white. A scene's matrix gives the difference.
        // For a rig the difference is unknown, and is at most another half.
        let signs: Vec<f64> = pattern.iter().map(|x| x - 0.5).collect();
        let mut resolving = match self.source {
            Source::Scene(_) => Some(self.reference_operators(Part::Global)?),
            _ => None,
        };
        let mut predicted = Vec::with_capacity(direct.len());
        for (channel, (direct, indirect)) in direct.iter().zip(global).enumerate() {
            let mut resolved = vec![0.0; pattern.len()];
            if let Some(operators) = &mut resolving {
                operators[channel].apply(&signs, &mut resolved)?;
            }
            let light = direct.iter().zip(indirect).zip(&pattern).zip(&resolved);
            let photo = light.map(|(((d, g), x), resolved)| d * x + 0.5 * g + resolved).collect();
            let of_direct = error * norm(direct);
            let of_global = if resolving.is_some() { 0.0 } else { 0.5 * norm(indirect) };
            let stated = of_direct.hypot(of_global);
            predicted.push(Predicted { channel, photo, pattern: pattern.clone(), stated });
        }
        self.verify(Part::Full, "the photo of a checkerboard", &predicted)
    }

    /// The pairs of patterns and predicted photos, ordered by channel. The ambient light is subtracted from the photos.
    fn predicted(&self, photos: &[(&Image, &Image)], ambient: &Image) -> Vec<Predicted> {
        let of = |&(pattern, photo): &(&Image, &Image)| {
            let planes = photo.planes().into_iter().zip(ambient.planes()).enumerate();
            let pattern = pattern.clone();
            planes.map(move |(channel, (photo, ambient))| Predicted {
                channel,
                pattern: pattern.plane(channel.min(pattern.channels() - 1)),
                photo: photo.iter().zip(&ambient).map(|(photo, ambient)| photo - ambient).collect(),
                stated: 0.0,
            })
        };
        let mut predicted: Vec<Predicted> = photos.iter().flat_map(of).collect();
        predicted.sort_by_key(|one| one.channel);
        predicted
    }

    fn verify(&mut self, part: Part, of: &str, predicted: &[Predicted]) -> Result<Option<Verification>> {
        let Some((light, products)) = self.products_of(part, predicted)? else { return Ok(None) };
        Ok(self.checked(light.by, of, &photos_compared(light, predicted, &products), |_| None))
    }

    /// Independent photos of the patterns. The patterns must be in ascending order of channel.
    fn products_of(
        &mut self,
        part: Part,
        predicted: &[Predicted],
    ) -> Result<Option<(Light, Vec<EstimatedProduct>)>> {
        let (mut products, mut light) = (Vec::with_capacity(predicted.len()), None);
        for of_channel in predicted.chunk_by(|a, b| a.channel == b.channel) {
            let asked: Vec<Question<'_>> =
                of_channel.iter().map(|one| Question { pattern: &one.pattern, shift: 0.0 }).collect();
            // Few pixels may carry the noise of a photo under all light, as behind a mirror, and half as many paths would then miss errors
            // of twice the noise. The photo of a compensation is also shown.
            let found = self.independent(part, of_channel[0].channel, &asked, TraceSettings::clone)?;
            let Some((by, found)) = found else { return Ok(None) };
            light = Some(by);
            products.extend(found);
        }
        Ok(light.map(|light| (light, products)))
    }

    /// Judges the comparisons of photos, and records the verification in the open run. `cause` explains the largest deviation. Returns
    /// `None` if the photos contain no light.
    fn checked(
        &mut self,
        by: Independent,
        of: &str,
        photos: &[Compared],
        cause: impl FnOnce(usize) -> Option<String>,
    ) -> Option<Verification> {
        let squares: Squares = photos.iter().map(|photo| photo.squares).sum();
        let judged = judge(photos).filter(|_| squares.product > 0.0)?;
        // For photos of pure noise, the errors are relative to the noisy photos themselves.
        let nothing = || [squares.difference, squares.noise].map(|square| (square / squares.product).sqrt());
        let [error, noise] = squares.relative().unwrap_or_else(nothing);
        let resolution = judged.resolution.min(f64::MAX);
        let verdict = Verification::judged(judged.p_value, resolution);
        let verification = Verification {
            by,
            of: of.into(),
            error,
            noise,
            verdict,
            statistic: judged.statistic.min(f64::MAX),
            p_value: judged.p_value,
            resolution,
            cause: if verdict == CheckVerdict::Refuted { cause(judged.at) } else { None },
        };
        self.note(&verification);
        Some(verification)
    }

    fn note(&mut self, verification: &Verification) {
        if let Some(run) = &mut self.run {
            run.manifest.verification = Some(verification.clone());
        }
    }
}

/// Compares one predicted photo with the independent one, from their sums of squares.
fn compared(light: Light, squares: Squares, stated: f64) -> Compared {
    let is_frozen = light.by == Independent::AnotherSeed;
    Compared { squares, own: light.own, stated, is_frozen, signs: None }
}

/// Compares a predicted photo with an independent product. For light paths, the errors of the product are random draws of its noise.
fn of_product(light: Light, product: &EstimatedProduct, photo: &[f64], stated: f64) -> Compared {
    let compared = compared(light, product.squares(photo), stated);
    let signs = compared.is_frozen.then(|| product.signs(photo, compared.own, compared.allowed()));
    Compared { signs, ..compared }
}

fn photos_compared(light: Light, predicted: &[Predicted], products: &[EstimatedProduct]) -> Vec<Compared> {
    let each = predicted.iter().zip(products);
    each.map(|(one, product)| of_product(light, product, &one.photo, one.stated)).collect()
}

/// The coordinates of pixels by the segmentation, and by independent light. The axes are the eigenvectors, or the one sum of them that a
/// rig has photographed.
fn coordinates(
    found: &Segmentation,
    pairs: &Eigenpairs<'_>,
    (photos, products): (&[Vec<f64>], &[EstimatedProduct]),
) -> [Vec<Vec<f64>>; 2] {
    let per_weight = |photo: &[f64], factor: f64| -> Vec<f64> {
        let each = photo.iter().zip(pairs.weights);
        each.map(|(y, &weight)| if weight > 0.0 { factor * y / weight } else { 0.0 }).collect()
    };
    if products.len() < pairs.vectors.len() {
        let claimed = photos.iter().map(|photo| per_weight(photo, 1.0)).collect();
        return [claimed, products.iter().map(|product| per_weight(&product.product, 1.0)).collect()];
    }
    let along = |index: usize, entries: &[f64]| -> Vec<f64> {
        entries.iter().map(|&entry| found.embedding.coordinate(index + 1, entry)).collect()
    };
    let resolved = |index: &usize| pairs.values[*index] > 0.0;
    let which: Vec<usize> = (0..pairs.vectors.len()).filter(resolved).collect();
    let claimed = which.iter().map(|&index| along(index, &pairs.vectors[index])).collect();
    let seen =
        |&index: &usize| along(index, &per_weight(&products[index].product, 1.0 / pairs.values[index]));
    [claimed, which.iter().map(seen).collect()]
}

fn norm(values: &[f64]) -> f64 {
    values.iter().map(|value| value * value).sum::<f64>().sqrt()
}

impl Eigenpairs<'_> {
    fn questions(&self) -> Vec<Question<'_>> {
        let each = self.vectors.iter().zip(self.shifts);
        each.map(|(pattern, &shift)| Question { pattern, shift }).collect()
    }

    /// The predicted photo `λ W u` of each vector.
    fn photos(&self) -> impl Iterator<Item = Vec<f64>> {
        let photo = |(vector, value): (&Vec<f64>, &f64)| {
            vector.iter().zip(self.weights).map(|(entry, weight)| value * weight * entry).collect()
        };
        self.vectors.iter().zip(self.values).map(photo)
    }

    /// Multiplies a photo by `W^-½`. The photo `λ W u` of an eigenvector with `uᵀ W u = 1` then has the norm `|λ|`.
    fn unit(&self, photo: &[f64]) -> Vec<f64> {
        let each = photo.iter().zip(self.weights);
        each.map(|(y, weight)| if *weight > 0.0 { y / weight.sqrt() } else { 0.0 }).collect()
    }

    /// Multiplies a product by `W^-½`, as [`Self::unit`].
    fn normalized(&self, product: &EstimatedProduct) -> EstimatedProduct {
        EstimatedProduct {
            product: self.unit(&product.product),
            error: self.unit(&product.error),
            quadratic: product.quadratic,
        }
    }

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
            // The residuals may be parallel, so that their sum depends on the signs.
            stated: (SIGNED * norm(self.residuals)).min(self.residuals.iter().sum()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::builtin;

    /// The noise of the run is the noise of as many paths with the other seed.
    #[test]
    fn the_noise_of_a_run_relative_to_its_check_follows_from_the_numbers_of_paths() -> Result<()> {
        for (size, expected) in [(12, 1.0), (128, 0.5)] {
            let scene = builtin::zigzag().to_scene();
            let mut lab = Lab::builder_of_scene(scene).size(size, size).samples(16).open()?;
            let pattern = vec![1.0; size * size];
            let asked = [Question { pattern: &pattern, shift: 0.0 }];
            let mut of =
                |paths: fn(&TraceSettings) -> TraceSettings| lab.independent(Part::Global, 0, &asked, paths);
            let (Some((run, of_run)), Some((check, of_check))) =
                (of(TraceSettings::clone)?, of(with_fewer_samples)?)
            else {
                unreachable!("a scene has other light")
            };
            assert_eq!((run.own, check.own), (AS_MANY_PATHS, expected));
            let noise = |of: &[EstimatedProduct]| norm(&of[0].error).powi(2);
            let ratio = noise(&of_run) / noise(&of_check) / expected;
            // Sobol points make the ratio up to a tenth smaller here, and each sum of squares has an error of some percent.
            assert!((0.75..1.15).contains(&ratio), "{ratio}");
        }
        Ok(())
    }
}
