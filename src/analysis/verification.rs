//! The quality of a result, judged by light that it was not computed from.
//!
//! The results for a scene are computed with a matrix from a finite number of light paths. The noise of this matrix is frozen (equal in all
//! products), so an eigenvector fits the noise as well as the light. The same matrix therefore cannot tell how good the eigenvector is.
//! Light paths of another seed can tell it ([`Retraced::estimated_products`](crate::transport::Retraced::estimated_products)). On a rig, a
//! photo that was not used for the result can tell it.

use crate::krylov::{Eigs, temple_kato};
use crate::transport::{EstimatedProduct, Squares};

/// A comparison of a predicted photo with an independent photo of the same pattern.
#[derive(Clone, Copy, Debug)]
pub struct Predicted {
    /// The difference between the two photos.
    pub squares: Squares,
    /// The variance of the noise in the prediction, relative to the variance of the noise in the independent photo.
    pub own: f64,
    /// The norm of the errors that the result states: a residual, or the part of the light that its photos do not determine.
    pub stated: f64,
    /// True if the result was computed from a frozen matrix. It then fits the noise of the matrix, so its errors have a part of second
    /// order.
    pub is_frozen: bool,
    /// [`EstimatedProduct::signs`], if the errors of the photo are random samples of its noise.
    pub signs: Option<f64>,
}

impl Predicted {
    /// The norm of the errors that the prediction may have in addition to noise.
    ///
    /// A result that fits the noise of its matrix has more noise than another vector. The excess is about `ε²`, where `ε` is the relative
    /// size of the noise. Twice this excess is allowed. With 24×24 pixels and 64 light paths, this covers vectors of `ε = 0.3`.
    pub fn allowed(&self) -> f64 {
        let size = (self.squares.product - self.squares.noise).max(f64::MIN_POSITIVE).sqrt();
        let fitted = if self.is_frozen { 2.0 * self.own * self.squares.noise / size } else { 0.0 };
        self.stated.hypot(fitted)
    }

    /// The larger excess of two tests, one on the sum of squares and one on signs. The test on squares detects errors of a few pixels. The
    /// test on signs detects errors of many pixels that the noise of a few pixels hides.
    pub fn excess(&self) -> f64 {
        self.squares.excess(self.own, self.allowed()).max(self.signs.unwrap_or(f64::NEG_INFINITY))
    }
}

/// The outcome of a comparison of predicted photos with independent photos.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Judged {
    /// The largest excess, in standard errors.
    pub statistic: f64,
    /// The index of the photo with this excess.
    pub at: usize,
    /// The chance of an excess at least this large if the result is correct, times the number of tests (Bonferroni).
    pub p_value: f64,
    /// The smallest relative error that all photos together would have revealed in 99 of 100 cases.
    pub resolution: f64,
}

/// An excess of 3.1 has a chance of 0.001. If an error raises the expected excess by a further 2.3, it is found in 99 of 100 cases.
const SEEN: f64 = 3.1 + 2.3;

/// Judges all predicted photos of a result; `None` if there are no photos.
pub fn judge(photos: &[Predicted]) -> Option<Judged> {
    let each = photos.iter().map(Predicted::excess).enumerate();
    let (at, statistic) = each.max_by(|a, b| a.1.total_cmp(&b.1))?;
    let own = photos.iter().map(|photo| photo.own).fold(0.0, f64::max);
    let all: Squares = photos.iter().map(|photo| photo.squares).sum();
    let p_value = (2.0 * photos.len() as f64 * upper_tail(statistic)).min(1.0);
    // Errors that the result itself states hide other errors, as noise does.
    let stated = photos.iter().map(|photo| photo.allowed().powi(2)).sum::<f64>() / (all.product - all.noise);
    let resolution =
        if stated >= 0.0 { all.resolution(own, SEEN).hypot(stated.sqrt()) } else { f64::INFINITY };
    Some(Judged { statistic, at, p_value, resolution })
}

/// The chance that a standard normal variable is above `z`, with a relative error of 1.2e-7 (Press et al., *Numerical Recipes*, `erfcc`).
fn upper_tail(z: f64) -> f64 {
    const TERMS: [f64; 10] = [
        -1.265_512_23,
        1.000_023_68,
        0.374_091_96,
        0.096_784_18,
        -0.186_288_06,
        0.278_868_07,
        -1.135_203_98,
        1.488_515_87,
        -0.822_152_23,
        0.170_872_77,
    ];
    let x = z.abs() / std::f64::consts::SQRT_2;
    let t = 1.0 / (1.0 + 0.5 * x);
    let series = TERMS.iter().rev().fold(0.0, |sum, term| sum * t + term);
    let above = 0.5 * t * (series - x * x).exp();
    if z >= 0.0 { above } else { 1.0 - above }
}

/// A judgement of the groups of a segmentation by independent light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grouped {
    /// Independent light gives coordinates to the pixels. This is the share of their variance that lies between the groups.
    pub explained: f64,
    /// The largest share, in 999 of 1000 cases, for labels unrelated to the light.
    pub by_chance: f64,
    /// The share of pixels that independent coordinates assign to the same group, relative to this share for the coordinates of the result.
    pub agreement: f64,
}

impl Grouped {
    /// Compares `labels` (`None` is masked) with two sets of coordinates: `claimed` belong to the result, and `seen` come from independent
    /// light. Each coordinate has one value per pixel, and `weights` weight the pixels. If the groups explain no larger share of the
    /// variance than shuffled labels would, they say nothing about the light (an analysis of variance).
    pub fn new(labels: &[Option<usize>], weights: &[f64], claimed: &[Vec<f64>], seen: &[Vec<f64>]) -> Self {
        let groups = labels.iter().flatten().max().map_or(0, |last| last + 1);
        let pixels = labels.iter().flatten().count();
        let centres = |of: &[Vec<f64>]| -> Vec<Vec<f64>> {
            let mean = |values: &Vec<f64>| {
                let mut sums = vec![[0.0; 2]; groups];
                for ((label, weight), value) in labels.iter().zip(weights).zip(values) {
                    if let Some(label) = label {
                        sums[*label][0] += weight;
                        sums[*label][1] += weight * value;
                    }
                }
                sums.into_iter().map(|[weight, sum]| if weight > 0.0 { sum / weight } else { 0.0 }).collect()
            };
            of.iter().map(mean).collect()
        };
        let [mut between, mut total] = [0.0; 2];
        for (values, centres) in seen.iter().zip(centres(seen)) {
            let all = labels.iter().zip(weights).zip(values).filter(|((label, _), _)| label.is_some());
            let [weight, sum] =
                all.clone().fold([0.0; 2], |[w, s], ((_, weight), value)| [w + weight, s + weight * value]);
            let mean = if weight > 0.0 { sum / weight } else { 0.0 };
            for ((label, weight), value) in all {
                total += weight * (value - mean).powi(2);
                between += weight * (label.map_or(mean, |label| centres[label]) - mean).powi(2);
            }
        }
        let own = centres(claimed);
        let agreeing = |of: &[Vec<f64>]| {
            let agrees = |pixel: &usize| {
                let distance = |group: usize| -> f64 {
                    of.iter()
                        .zip(&own)
                        .map(|(values, centres)| (values[*pixel] - centres[group]).powi(2))
                        .sum()
                };
                let nearest = (0..groups).min_by(|a, b| distance(*a).total_cmp(&distance(*b)));
                labels[*pixel].is_some() && nearest == labels[*pixel]
            };
            (0..labels.len()).filter(agrees).count() as f64
        };
        let freedom = groups.saturating_sub(1).max(1) as f64;
        // Wilson and Hilferty's quantile of χ² at 0.999, per degree of freedom.
        let most = (1.0 - 2.0 / (9.0 * freedom) + 3.09 * (2.0 / (9.0 * freedom)).sqrt()).powi(3);
        Self {
            explained: if total > 0.0 { between / total } else { 0.0 },
            by_chance: most * freedom / pixels.max(1) as f64,
            agreement: (agreeing(seen) / agreeing(claimed).max(1.0)).min(1.0),
        }
    }

    /// Returns true if the groups explain no larger share of the variance than chance does.
    pub fn is_refuted(&self) -> bool {
        self.explained <= self.by_chance
    }
}

/// An eigenpair of the scene itself, as opposed to an eigenpair of a noisy matrix.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct EigenpairEstimate {
    /// The eigenvalue: the mean of `θ = uᵀ Â u`, the eigenvalue of the noisy matrix `Â`, and of `q = uᵀ A' u` by independent light. The
    /// eigenvector `u` fits the noise `E` of `Â`, so `θ` is too large by about `Σ_k (u_kᵀ E u)² / (λ − λ_k)`, and `q` is too small by the
    /// same amount. The mean has no error of second order.
    pub value: f64,
    /// The standard error of `value`. It includes the change that more photos would cause.
    pub standard_error: f64,
    /// `q`, and its standard error from the noise of the independent light alone. `q` is the share of its light that the eigenvector really
    /// keeps.
    pub quotient: [f64; 2],
    /// `‖A u − q u‖` by independent light, without the noise of the independent light. The scene has an eigenvalue within this distance of
    /// `q`, and a photo of `u` differs from `q u` by this norm. `None` if no residual was requested.
    pub residual: Option<f64>,
}

impl EigenpairEstimate {
    /// The error of the eigenvalue `theta` of the noisy matrix: the known part of its bias, combined with the standard error.
    pub fn error_of(&self, theta: f64) -> f64 {
        self.standard_error.hypot(theta - self.value)
    }
}

/// If eigenvalues are nearer to each other than half the difference `θ − q`, errors of second order do not cancel in the mean of `θ` and
/// `q`. This share of the half difference then counts as an error of the mean. The share was chosen on the scenes zigzag and cornell;
/// `cargo bench --bench stated_errors` tests it on other scenes.
const NOT_CANCELLED: f64 = 2.0 / 3.0;

/// The eigenpairs of the scene, from the eigenpairs of a symmetric matrix and one independent product per eigenvector. `None` if pairs are
/// complex, or if the products state no quadratic form. `own` is the variance of the matrix's noise relative to that of the products.
pub fn eigenpair_estimates(
    found: &Eigs,
    independent: &[EstimatedProduct],
    own: f64,
) -> Option<Vec<EigenpairEstimate>> {
    if found.imaginary_values.iter().any(|&value| value != 0.0) || found.values.len() != independent.len() {
        return None;
    }
    let of = |(index, independent): (usize, &EstimatedProduct)| {
        let [quadratic, error] = independent.quadratic?;
        let theta = found.values[index];
        let unconverged = found.gap_bounds[index].min(found.residuals[index]);
        let scaled: Vec<f64> = found.vectors[index].iter().map(|u| quadratic * u).collect();
        let squares = independent.squares(&scaled);
        Some(EigenpairEstimate {
            residual: Some((squares.difference - squares.noise).max(0.0).sqrt()),
            ..eigenvalue_estimate(&found.values, index, unconverged, [quadratic - theta, error], own)
        })
    };
    independent.iter().enumerate().map(of).collect()
}

/// The eigenvalues of the scene, from the eigenvalues of a matrix's normalized cut and the residuals of their eigenvectors. For each
/// eigenvalue, independent light states the error by [`Question::shift`](crate::transport::Question::shift). `None` if the products state
/// no quadratic form. `own` has the same meaning as for [`eigenpair_estimates`].
pub fn cut_estimates(
    values: &[f64],
    residuals: &[f64],
    independent: &[EstimatedProduct],
    own: f64,
) -> Option<Vec<EigenpairEstimate>> {
    let of = |(index, independent): (usize, &EstimatedProduct)| {
        let unconverged = temple_kato(residuals[index], gap(values, index));
        Some(eigenvalue_estimate(values, index, unconverged, independent.quadratic?, own))
    };
    independent.iter().enumerate().map(of).collect()
}

/// Estimates the eigenvalue `index` among `values` of a matrix. More photos would change this eigenvalue by about `unconverged`. By
/// independent light, the quotient `q` lies `above` the eigenvalue, with the standard error `error`. The variance of the eigenvalue's noise
/// is `own` times the square of this error. The residual is not known.
fn eigenvalue_estimate(
    values: &[f64],
    index: usize,
    unconverged: f64,
    [above, error]: [f64; 2],
    own: f64,
) -> EigenpairEstimate {
    let theta = values[index];
    // The estimate is the mean of two values, whose variances are `error²` and about `own · error²`.
    let noise = 0.5 * error * (1.0 + own).sqrt();
    let half = 0.5 * above.abs();
    let not_cancelled = NOT_CANCELLED * half * (half / gap(values, index)).min(1.0);
    EigenpairEstimate {
        value: theta + 0.5 * above,
        standard_error: noise.hypot(unconverged).hypot(not_cancelled),
        quotient: [theta + above, error],
        residual: None,
    }
}

/// The distance from one value to the nearest other value. It is infinite if there is no other value, and never 0.
fn gap(values: &[f64], index: usize) -> f64 {
    let others = values.iter().enumerate().filter(|(other, _)| *other != index);
    let distances = others.map(|(_, value)| (value - values[index]).abs());
    distances.fold(f64::INFINITY, f64::min).max(f64::MIN_POSITIVE)
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_distr::StandardNormal;
    use rand_pcg::Pcg64;

    use super::*;

    #[test]
    fn chances_are_those_of_normal_deviates() {
        for (z, p) in [(0.0, 0.5), (1.0, 0.158_655_3), (3.1, 9.676e-4), (-2.0, 0.977_249_9), (6.0, 9.866e-10)]
        {
            assert!((upper_tail(z) / p - 1.0).abs() < 1e-4, "{z}: {}", upper_tail(z));
        }
        assert!(upper_tail(f64::INFINITY) == 0.0 && upper_tail(f64::NAN).is_nan());
        assert!(judge(&[]).is_none());
    }

    /// A photo of even light and its prediction. Both have noise with heavy tails. The variance of the prediction's noise is a quarter of
    /// that of the photo's, and is stated as `own`. The prediction is wrong by `wrong` times its own noise.
    fn photo(random: &mut Pcg64, wrong: f64, own: f64) -> Predicted {
        let mut normal = || random.sample::<f64, _>(StandardNormal);
        // The size of the noise differs between pixels by a factor of a hundred.
        let sizes: Vec<f64> = (0..4096).map(|_| 0.03 * (1.2 * normal()).exp()).collect();
        let mut noise = |of: f64| -> Vec<f64> { sizes.iter().map(|size| of * size * normal()).collect() };
        let [frozen, check, error, off] = [noise(0.5), noise(1.0), noise(1.0), noise(0.5)];
        let prediction: Vec<f64> =
            frozen.iter().zip(&off).map(|(frozen, off)| 1.0 + frozen + wrong * off).collect();
        let product = check.iter().map(|check| 1.0 + check).collect();
        let product = EstimatedProduct { product, error, quadratic: None };
        let signs = Some(product.signs(&prediction, own, 0.0));
        Predicted { squares: product.squares(&prediction), own, stated: 0.0, is_frozen: false, signs }
    }

    #[test]
    fn a_photo_within_its_noise_is_not_refuted_and_one_of_twice_the_noise_is() {
        let mut random = Pcg64::seed_from_u64(5);
        let mut refuted = |wrong: f64, own: f64| {
            let judged = (0..300).filter_map(|_| judge(&[photo(&mut random, wrong, own)]));
            judged.filter(|judged| judged.p_value < 1e-3).count()
        };
        // Each photo has a chance of 0.001 to be refuted, so three or more of 300 have a chance of 0.004.
        assert!(refuted(0.0, 0.25) <= 2, "right ones");
        assert_eq!(refuted(2.0, 0.25), 300, "wrong ones");
        // If the noise of the prediction is taken for as large as that of the photo, it hides most errors. If it is taken for none, right
        // answers are refuted.
        let off = [refuted(2.0, 1.0), refuted(0.0, 0.0)];
        assert!(off[0] < 200 && off[1] > 100, "{off:?}");
    }

    /// An error in one part of the picture affects at most half of the pixels. The sum of squares detects it.
    #[test]
    fn an_error_of_few_pixels_is_seen() {
        let product = EstimatedProduct { product: vec![1.0; 900], error: vec![0.05; 900], quadratic: None };
        let prediction: Vec<f64> = (0..900).map(|at| if at < 60 { 1.5 } else { 1.0 }).collect();
        let signs = product.signs(&prediction, 1.0, 0.0);
        let photo = Predicted {
            squares: product.squares(&prediction),
            own: 1.0,
            stated: 0.0,
            is_frozen: true,
            signs: Some(signs),
        };
        assert!(signs < 0.0 && photo.excess() > 5.0, "{signs} {}", photo.excess());
        // A difference that the result states does not count as an error.
        assert!(Predicted { stated: 0.5 * 60.0_f64.sqrt(), ..photo }.excess() < 0.0);
    }

    #[test]
    fn shuffled_labels_say_nothing_of_the_light_and_groups_do() {
        let mut random = Pcg64::seed_from_u64(7);
        let weights = vec![1.0; 600];
        let mut refuted = [0; 2];
        for _ in 0..200 {
            let truth: Vec<usize> = (0..600).map(|_| random.random_range(0..3)).collect();
            let noisy = |random: &mut Pcg64, noise: f64| -> Vec<f64> {
                truth.iter().map(|&of| of as f64 + noise * random.sample::<f64, _>(StandardNormal)).collect()
            };
            let (claimed, seen) = (vec![noisy(&mut random, 0.1)], vec![noisy(&mut random, 0.5)]);
            let right: Vec<Option<usize>> = truth.iter().copied().map(Some).collect();
            let shuffled: Vec<Option<usize>> = (0..600).map(|_| Some(random.random_range(0..3))).collect();
            let of_right = Grouped::new(&right, &weights, &claimed, &seen);
            // Half a unit of noise moves a third of the middle group's pixels to another group, and a sixth of the pixels of the first and
            // the last group.
            assert!((0.7..0.85).contains(&of_right.agreement), "{of_right:?}");
            refuted[0] += usize::from(of_right.is_refuted());
            refuted[1] += usize::from(Grouped::new(&shuffled, &weights, &claimed, &seen).is_refuted());
        }
        assert!(refuted[0] == 0 && refuted[1] >= 198, "{refuted:?}");
    }
}
