//! Products with their errors, computed by tracing anew. If their seed is not that of the matrix, the products are independent of the
//! matrix, so they can test results that were computed with the matrix.

use rayon::prelude::*;

use super::matrix::Part;
use super::noise::Halves;
use super::retraced::Way;
use super::{Channels, Retraced, RetracedOperator, Transport, luminance};
use crate::error::{Error, Result};
use crate::operator::{Adjoint, Direction, Operator, Symmetry, delegate};
use crate::render::TraceSettings;

/// The maximum number of vectors that are multiplied in one pass over the light paths.
const TOGETHER: usize = 16;

/// A product `y = P x` with its error.
#[derive(Clone, Debug, PartialEq)]
pub struct EstimatedProduct {
    /// `y`, with an entry for each camera pixel.
    pub product: Vec<f64>,
    /// One random draw of the error of each entry. Its mean is 0, and its variance is the variance of the entry of `y` ([`super::Noise`]).
    pub error: Vec<f64>,
    /// For a coaxial rig, the quadratic form that [`Question::shift`] describes, and its standard error. The standard error is estimated
    /// from one draw of the error for each start pixel.
    pub quadratic: Option<[f64; 2]>,
}

/// A pattern, and the quadratic form to compute for it.
#[derive(Clone, Copy, Debug)]
pub struct Question<'a> {
    /// The pattern `x`, with an entry for each projector pixel. Entries may be negative.
    pub pattern: &'a [f64],
    /// The number `s` of the form `xᵀ P x − s xᵀ D x`, where the diagonal matrix `D` has the row sums of `P` on its diagonal. With `s = 0`,
    /// the form is the Rayleigh quotient of a vector `x` of norm 1. If `s` is a computed eigenvalue of `D⁻¹ P` and `xᵀ D x = 1`, the form
    /// is the error of `s`.
    pub shift: f64,
}

/// Sums of squares that measure how close a prediction is to a photo.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Squares {
    /// The sum of the squared differences between the photo and the prediction.
    pub difference: f64,
    /// The sum of the squared errors of the photo. Noise increases the sums `difference` and `product` by this much.
    pub noise: f64,
    /// The sum of the squares of the photo.
    pub product: f64,
    /// The sums of the fourth powers of the differences and of the errors. They show how many pixels dominate the sums of squares.
    pub fourth: [f64; 2],
}

impl Squares {
    /// The sums over the pixels of a prediction and a photo. `noise` is the sum of the squared errors of the photo. These errors are
    /// assumed to be distributed over the pixels like the differences.
    pub fn new<'a>(
        prediction: impl IntoIterator<Item = &'a f64>,
        photo: impl IntoIterator<Item = &'a f64>,
        noise: f64,
    ) -> Self {
        let pixels = prediction.into_iter().zip(photo);
        let sums = pixels.fold(Self { noise, ..Self::default() }, |sums, (prediction, photo)| {
            let square = (prediction - photo).powi(2);
            let fourth = [sums.fourth[0] + square * square, 0.0];
            Self {
                difference: sums.difference + square,
                product: sums.product + photo * photo,
                fourth,
                ..sums
            }
        });
        let spread = if sums.difference > 0.0 { sums.fourth[0] / sums.difference.powi(2) } else { 1.0 };
        Self { fourth: [sums.fourth[0], noise * noise * spread], ..sums }
    }

    /// The number of standard errors by which the sum of squared differences exceeds its expectation. The expectation has three terms: the
    /// noise of the photo, the noise of the prediction with `own` times this variance, and allowed errors of the norm `allowed`. The fourth
    /// powers account for the heavy tails of light paths: a sum of squares scatters more if few pixels dominate it. A single pixel
    /// therefore never causes an excess of more than one standard error.
    pub fn excess(self, own: f64, allowed: f64) -> f64 {
        let expected = (1.0 + own) * self.noise;
        let excess = self.difference - expected - allowed * allowed;
        let scatter = (self.fourth[0] + (1.0 + own).powi(2) * self.fourth[1]).sqrt();
        if excess <= 0.0 || scatter > 0.0 { excess / scatter.max(f64::MIN_POSITIVE) } else { f64::INFINITY }
    }

    /// The smallest relative error of the prediction that this test can detect. With this error, [`Squares::excess`] is above `bound` in
    /// half of all cases. It is infinite if the photo is only noise.
    pub fn resolution(self, own: f64, bound: f64) -> f64 {
        let size = self.product - self.noise;
        let scatter = (1.0 + own) * (2.0 * self.fourth[1]).sqrt();
        if size > 0.0 { (bound * scatter / size).sqrt() } else { f64::INFINITY }
    }

    /// With the photo `y`, its error `e` and the prediction `p`: the relative difference without noise, `√(‖p − y‖² − ‖e‖²) / ‖y‖`, and the
    /// relative noise, `‖e‖ / ‖y‖`. The result is `None` if the photo is only noise.
    pub fn relative(self) -> Option<[f64; 2]> {
        let size = self.product - self.noise;
        let shares = [(self.difference - self.noise).max(0.0), self.noise];
        (size > 0.0).then(|| shares.map(|square| (square / size).sqrt()))
    }
}

impl std::iter::Sum for Squares {
    fn sum<I: Iterator<Item = Self>>(each: I) -> Self {
        each.fold(Self::default(), |sums, one| Self {
            difference: sums.difference + one.difference,
            noise: sums.noise + one.noise,
            product: sums.product + one.product,
            fourth: [0, 1].map(|of| sums.fourth[of] + one.fourth[of]),
        })
    }
}

impl EstimatedProduct {
    /// A sign test of a prediction. At each pixel, the test compares the difference between photo and prediction with a random draw of
    /// allowed errors. The allowed errors are the noise of photo and prediction, errors of the norm `allowed` that are distributed like the
    /// noise, and errors of the same norm that are distributed evenly. The result is the number of standard errors by which the count of
    /// pixels with the larger difference exceeds half of all pixels. If the prediction is right, the difference and the random draw have
    /// the same distribution at each pixel, however heavy its tails are. Unlike in sums of squares, a pixel of enormous noise counts only
    /// once.
    pub fn signs(&self, prediction: &[f64], own: f64, allowed: f64) -> f64 {
        let noise = self.error.iter().map(|error| error * error).sum::<f64>();
        let square = allowed * allowed;
        let more = 1.0 + own + if noise > 0.0 { square / noise } else { 0.0 };
        let evenly = square / self.product.len().max(1) as f64;
        let (mut farther, mut count) = (0.0, 0.0);
        for ((prediction, photo), error) in prediction.iter().zip(&self.product).zip(&self.error) {
            let difference = (prediction - photo).powi(2);
            if *error != 0.0 {
                count += 1.0;
                farther += f64::from(u8::from(difference > error * error * more + evenly));
            }
        }
        if count > 0.0 { (farther - 0.5 * count) / (0.25 * count).sqrt() } else { f64::NEG_INFINITY }
    }

    /// The sums of squares for a prediction of this product.
    pub fn squares(&self, prediction: &[f64]) -> Squares {
        let squares =
            Squares::new(prediction, &self.product, self.error.iter().map(|error| error * error).sum());
        let fourth = self.error.iter().map(|error| error.powi(4)).sum();
        Squares { fourth: [squares.fourth[0], fourth], ..squares }
    }
}

/// The same settings with another seed. No other run of the program uses this seed by accident.
pub fn with_other_seed(settings: &TraceSettings) -> TraceSettings {
    TraceSettings { seed: settings.seed ^ 0x5eed_cafe, ..*settings }
}

/// With `n` pixels, [`with_fewer_samples`] leaves `SAMPLES / √n` of the samples, so that up to 64×64 pixels all of them remain, and a check
/// of more pixels detects as much as one of 64×64. With half of this share, the check passed the segmentation of corner for one of two
/// seeds, although all paths refute its ninth eigenvector. With a quarter of it, right answers on nine-cells were not proven.
const SAMPLES: f64 = 64.0;

/// Two samples in each half tell the noise: with so few, no right answer was refuted for 174 seeds each of zigzag, corner, cornell and
/// mirror.
const LEAST_SAMPLES: u32 = 4;

/// The same settings with as many samples as a check of eigenvectors needs. The scatter of a test over `n` pixels, relative to the noise of
/// a photo, falls as `1/√n`, so the noise of the check may be larger for more pixels. A projector with a resolution of its own keeps all
/// paths, because their rounded number per projector pixel would not fall by the same factor.
pub fn with_fewer_samples(settings: &TraceSettings) -> TraceSettings {
    let share = if settings.projector.is_some() {
        1.0
    } else {
        SAMPLES / (settings.resolution.pixels() as f64).sqrt()
    };
    let samples = (share * f64::from(settings.samples)).ceil() as u32;
    TraceSettings { samples: samples.max(LEAST_SAMPLES).min(settings.samples), ..*settings }
}

impl Retraced<'_> {
    /// The products of one part and channel with the patterns of `asked`. One pass over the light paths computes up to sixteen products.
    ///
    /// # Errors
    /// [`Error::Dimension`] when a vector has another length; the errors of [`Transport::photograph`].
    pub fn estimated_products(
        &mut self,
        part: Part,
        channel: usize,
        asked: &[Question<'_>],
    ) -> Result<Vec<EstimatedProduct>> {
        let columns = self.pattern_resolution().pixels();
        for question in asked {
            Error::check_size("entries of a pattern", columns, question.pattern.len())?;
        }
        let mut found = Vec::with_capacity(asked.len());
        for asked in asked.chunks(TOGETHER) {
            // The loops are compiled for several numbers of patterns, so a single pattern costs no more than necessary.
            found.extend(match asked.len() {
                1 => self.estimated_block::<1>(part, channel, asked)?,
                2 => self.estimated_block::<2>(part, channel, asked)?,
                3..=4 => self.estimated_block::<4>(part, channel, asked)?,
                5..=8 => self.estimated_block::<8>(part, channel, asked)?,
                9..=12 => self.estimated_block::<12>(part, channel, asked)?,
                _ => self.estimated_block::<TOGETHER>(part, channel, asked)?,
            });
        }
        Ok(found)
    }

    fn estimated_block<const P: usize>(
        &mut self,
        part: Part,
        channel: usize,
        asked: &[Question<'_>],
    ) -> Result<Vec<EstimatedProduct>> {
        let symmetric = self.tracer.symmetric(&self.settings);
        let mut lit = vec![[0.0; P]; self.pattern_resolution().pixels()];
        let mut shifts = [0.0; P];
        for (place, question) in asked.iter().enumerate() {
            lit.iter_mut().zip(question.pattern).for_each(|(lit, &value)| lit[place] = value);
            shifts[place] = question.shift;
        }
        let mut sums = Sums::<P>::new(self.photo_resolution().pixels(), symmetric);
        let way = Way { direction: Direction::Forward, part, with_ambient: false };
        let is_gray = self.channels == Channels::Luma;
        let project = |rgb: [f32; 3]| [if is_gray { luminance(rgb) } else { rgb[channel] }];
        self.each(way, project, &mut |contributions| {
            // Each sum is assigned to one task, which adds the contributions in path order.
            let WeightSums { products, of_starts, .. } = sums.of(contributions.halves());
            let tasks = rayon::current_num_threads();
            let shares = Stripes::of(products, tasks).into_par_iter().zip(Stripes::of(of_starts, tasks));
            shares.for_each(|(mut products, mut of_starts)| {
                contributions.entries(|run, row, column, &[value]| {
                    let (Some(column), value) = (column, f64::from(value)) else { return };
                    if let Some(products) = products.at(row) {
                        for (product, light) in products[run.half].iter_mut().zip(&lit[column]) {
                            *product += value * light;
                        }
                    }
                    if symmetric && let Some(sums) = of_starts.at(run.pixel as usize) {
                        let pairs = lit[row].iter().zip(&lit[column]).zip(&shifts);
                        for (sum, ((own, light), shift)) in sums[run.half].iter_mut().zip(pairs) {
                            *sum += value * own * (light - shift * own);
                        }
                    }
                });
            });
        })?;
        Ok((0..asked.len()).map(|place| sums.product(place)).collect())
    }
}

/// `y = P x` for one part and channel, computed from light paths with the seed of the settings. The errors of the products are known
/// ([`Operator::standard_errors`]). For the transpose of a rig that is not coaxial, the error is not computed, and 0 is returned.
pub struct EstimatedOperator<'a> {
    operator: RetracedOperator<'a>,
    errors: Vec<f64>,
}

impl<'a> EstimatedOperator<'a> {
    /// The operator of a scene with its settings. `channel` must be below [`Channels::count`].
    pub fn new(retraced: Retraced<'a>, part: Part, channel: usize) -> Self {
        Self { operator: RetracedOperator { retraced, part, channel }, errors: Vec::new() }
    }
}

impl Operator for EstimatedOperator<'_> {
    delegate!(operator: rows, cols, symmetry);

    fn apply_block(&mut self, xs: &[&[f64]], ys: &mut [&mut [f64]]) -> Result<()> {
        let RetracedOperator { retraced, part, channel } = &mut self.operator;
        let asked: Vec<Question<'_>> = xs.iter().map(|pattern| Question { pattern, shift: 0.0 }).collect();
        let products = retraced.estimated_products(*part, *channel, &asked)?;
        self.errors.clear();
        for (product, y) in products.iter().zip(ys) {
            y.copy_from_slice(&product.product);
            self.errors.push(product.error.iter().map(|error| error * error).sum::<f64>().sqrt());
        }
        Ok(())
    }

    fn block_size(&self) -> usize {
        TOGETHER
    }

    fn standard_errors(&self) -> Vec<f64> {
        self.errors.clone()
    }
}

impl Adjoint for EstimatedOperator<'_> {
    fn apply_adjoint_block(&mut self, ys: &[&[f64]], xs: &mut [&mut [f64]]) -> Result<()> {
        if self.symmetry() == Symmetry::Symmetric {
            return self.apply_block(ys, xs);
        }
        self.errors = vec![0.0; ys.len()];
        self.operator.apply_adjoint_block(ys, xs)
    }
}

/// The sums of both halves of the samples, for each pattern of a block.
type HalfSums<const P: usize> = [[f64; P]; 2];

/// Sums over the light paths. The sample weights may differ between paths from the camera and paths from the projector.
struct Sums<const P: usize> {
    rows: usize,
    symmetric: bool,
    of_weights: Vec<WeightSums<P>>,
}

struct WeightSums<const P: usize> {
    halves: Halves,
    products: Vec<HalfSums<P>>,
    /// The sums of the quadratic form by start pixel, for a coaxial rig. The sums of different start pixels are independent.
    of_starts: Vec<HalfSums<P>>,
}

impl<const P: usize> Sums<P> {
    fn new(rows: usize, symmetric: bool) -> Self {
        Self { rows, symmetric, of_weights: Vec::new() }
    }

    fn of(&mut self, halves: Halves) -> &mut WeightSums<P> {
        let known = self.of_weights.iter().position(|sums| sums.halves == halves);
        let at = known.unwrap_or_else(|| {
            let starts = if self.symmetric { self.rows } else { 0 };
            let (products, of_starts) = (vec![[[0.0; P]; 2]; self.rows], vec![[[0.0; P]; 2]; starts]);
            self.of_weights.push(WeightSums { halves, products, of_starts });
            self.of_weights.len() - 1
        });
        &mut self.of_weights[at]
    }

    fn product(&self, place: usize) -> EstimatedProduct {
        let (mut product, mut error) = (vec![0.0; self.rows], vec![0.0; self.rows]);
        let [mut value, mut variance] = [0.0; 2];
        for sums in &self.of_weights {
            let estimates = |of: &HalfSums<P>| sums.halves.estimate([of[0][place], of[1][place]]);
            for ((product, error), row) in product.iter_mut().zip(&mut error).zip(&sums.products) {
                let [mean, of_mean] = estimates(row);
                *product += mean;
                *error += of_mean;
            }
            for [mean, of_mean] in sums.of_starts.iter().map(estimates) {
                value += mean;
                variance += of_mean * of_mean;
            }
        }
        let quadratic = self.symmetric.then(|| [value, variance.sqrt()]);
        EstimatedProduct { product, error, quadratic }
    }
}

/// The stripes of an array that one task handles. Stripes are narrow and dealt to the tasks in turn, so each task gets an equal share of
/// the pixels of a batch.
struct Stripes<'a, T> {
    mine: Vec<&'a mut [T]>,
    /// For each stripe of the array, its index in `mine`. The stripes of other tasks have an index beyond the end of `mine`.
    places: Vec<u32>,
}

impl<T> Stripes<'_, T> {
    const WIDTH: usize = 16;

    fn of(values: &mut [T], tasks: usize) -> Vec<Stripes<'_, T>> {
        let count = values.len().div_ceil(Self::WIDTH);
        let mut stripes: Vec<Stripes<'_, T>> =
            (0..tasks).map(|_| Stripes { mine: Vec::new(), places: vec![u32::MAX; count] }).collect();
        for (stripe, values) in values.chunks_mut(Self::WIDTH).enumerate() {
            let Stripes { mine, places } = &mut stripes[stripe % tasks];
            places[stripe] = mine.len() as u32;
            mine.push(values);
        }
        stripes
    }

    fn at(&mut self, index: usize) -> Option<&mut T> {
        let place = self.places[index / Self::WIDTH];
        self.mine.get_mut(place as usize).map(|stripe| &mut stripe[index % Self::WIDTH])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stripes_go_round_the_tasks() {
        for tasks in 1..5 {
            let mut owner = [usize::MAX; 101];
            for (task, mut stripes) in Stripes::of(&mut owner, tasks).into_iter().enumerate() {
                (0..101).for_each(|index| stripes.at(index).into_iter().for_each(|owner| *owner = task));
            }
            assert!((0..101).all(|index| owner[index] == index / 16 % tasks), "in the place of its index");
        }
    }
}
