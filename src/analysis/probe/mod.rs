//! Probing: photos of a scene by a selection of its light paths.
//!
//! A probing matrix `Π` (`n × n`) weights each path by its first projector pixel and its last camera pixel. The probed photo is
//! `(Π ∘ A) 1`. Let random patterns `r` have mean zero and the correlation `E[r_i r_j] = h(i − j)`. The mean of `r ∘ A r` is then the
//! probed photo for `Π_ij = h(i − j)`: `r` is projected, and its signed values multiply the photo as a mask. No column of `A` is ever
//! measured. Here `h` is a Gaussian of the distance in pixels, with `h(0) = 1`.
//!
//! O'Toole, Raskar and Kutulakos, *Primal-dual coding to probe light transport* (2012), doi:10.1145/2185520.2185535.

mod epipolar;
mod mask;
mod masked;
#[cfg(test)]
mod tests_of_masks;

use std::ops::Range;

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use rayon::prelude::*;

pub use epipolar::epipolar_lines_of_map;
pub use mask::Mask;
pub use masked::probe_masked;

use crate::error::{Error, Result};
use crate::image::{Resolution, add_weighted};
use crate::operator::{Operator, product};
use crate::sparse::Csr;

/// A selection of light paths.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Probing {
    /// Paths that return to the pixel where they started: on a coaxial rig, direct light. Where photos and patterns have different sizes,
    /// paths that return to the camera pixel which their projector pixel lights directly.
    Direct,
    /// All paths except the paths of `Direct`.
    Indirect,
    /// Paths that end near their start, with weight `exp(−d²/2σ²)` at distance `d` in pixels, direct light included.
    Near {
        /// Standard deviation `σ` in pixels, above 0.
        sigma: f64,
    },
    /// All paths except the paths of `Near`, by their weights.
    Far {
        /// Standard deviation `σ` in pixels, above 0.
        sigma: f64,
    },
    /// Indirect light from nearby: `Near` minus `Direct`, from the same random signs.
    NearIndirect {
        /// Standard deviation `σ` in pixels, above 0.
        sigma: f64,
    },
}

/// The default standard deviation, in pixels, of the Gaussian that selects near light: a sixteenth of the width, and at least one pixel.
pub fn default_sigma(resolution: Resolution) -> f64 {
    (resolution.width as f64 / 16.0).max(1.0)
}

impl Probing {
    fn sigma(self) -> f64 {
        match self {
            Self::Direct | Self::Indirect => 0.0,
            Self::Near { sigma } | Self::Far { sigma } | Self::NearIndirect { sigma } => sigma,
        }
    }

    /// Checks the value of `sigma` before any photo is taken. Fails with [`Error::Option`] naming `--sigma`.
    pub fn check(self) -> Result<()> {
        let sigma = self.sigma();
        // A Gaussian far wider than any projector lets all light through.
        if (0.0..=4096.0).contains(&sigma) && (sigma > 0.0 || matches!(self, Self::Direct | Self::Indirect)) {
            return Ok(());
        }
        Err(Error::option("--sigma", format!("{sigma} pixels"))
            .help("give a distance above 0 and up to 4096 pixels"))
    }

    /// The number of photos for this number of random patterns.
    pub fn photos(self, patterns: usize) -> usize {
        match self {
            Self::NearIndirect { .. } => 2 * patterns,
            Self::Indirect | Self::Far { .. } => patterns + 1,
            Self::Direct | Self::Near { .. } => patterns,
        }
    }

    /// The selection in words.
    pub fn in_words(self) -> String {
        match self {
            Self::Direct => "direct light".into(),
            Self::Indirect => "indirect light".into(),
            Self::Near { sigma } => format!("light from near by, σ {sigma} px"),
            Self::Far { sigma } => format!("light from farther away than σ {sigma} px"),
            Self::NearIndirect { sigma } => format!("indirect light from near by, σ {sigma} px"),
        }
    }

    /// The weight of paths that end `distance` pixels from their start.
    pub fn weight(self, distance: f64) -> f64 {
        let direct = f64::from(u8::from(distance == 0.0));
        let near = |sigma: f64| (-0.5 * (distance / sigma).powi(2)).exp();
        match self {
            Self::Direct => direct,
            Self::Indirect => 1.0 - direct,
            Self::Near { sigma } => near(sigma),
            Self::Far { sigma } => 1.0 - near(sigma),
            Self::NearIndirect { sigma } => near(sigma) - direct,
        }
    }

    /// `(Π ∘ A) 1` from the matrix itself, without noise. `resolution` is that of patterns, and `homes` is as for [`probe`].
    pub fn exact(self, matrix: &Csr, resolution: Resolution, homes: Option<&Homes>) -> Vec<f64> {
        let place = |pixel: usize| [(pixel % resolution.width) as f64, (pixel / resolution.width) as f64];
        let mut sums = vec![0.0; matrix.rows()];
        matrix.entries().for_each(|(row, column, weight)| {
            let home = homes.map_or(Some(row), |homes| homes[row]);
            let distance = home.map_or(f64::INFINITY, |home| {
                let ([x, y], [u, v]) = (place(home), place(column));
                (x - u).hypot(y - v)
            });
            sums[row] += self.weight(distance) * weight;
        });
        sums
    }
}

/// For each camera pixel, the projector pixel that lights it directly, if there is one. Distances are measured from there.
pub type Homes = [Option<usize>];

/// A probed photo.
#[derive(Clone, Debug, PartialEq)]
pub struct Probed {
    /// The unbiased estimate of `(Π ∘ A) 1` (`n`).
    pub values: Vec<f64>,
    /// The standard error of each value, from the spread of the samples (`n`).
    pub standard_errors: Vec<f64>,
    /// The number of photos taken: products with signed patterns, and the white photo if it is needed.
    pub photos: usize,
}

/// Probes with `photos ≥ 2` random patterns of this resolution (`n` pixels). Each pattern takes one product with `operator` (`m × n`), or
/// two products for [`Probing::NearIndirect`]. Without `homes`, photos have the pixels of patterns. [`Probing::Indirect`] and [`Probing::Far`] take one more product with white, from which they subtract the
/// probed light.
///
/// # Errors
/// [`Error::Option`] naming `--photos` or `--sigma`; [`Error::Dimension`] if sizes differ; any error of the operator.
pub fn probe(
    operator: &mut dyn Operator,
    (resolution, homes): (Resolution, Option<&Homes>),
    probing: Probing,
    photos: usize,
    seed: u64,
) -> Result<Probed> {
    probing.check()?;
    let (n, m) = (resolution.pixels(), homes.map_or(resolution.pixels(), <[_]>::len));
    let found = format!("{}x{}", operator.rows(), operator.cols());
    Error::check_size("the transport operator to be probed", format!("{m}x{n}"), found)?;
    if photos < 2 {
        return Err(Error::option("--photos", format!("{photos} tell no error")).help("give at least 2"));
    }
    let mut random = Pcg64::seed_from_u64(seed);
    let kernel = kernel(probing.sigma());
    let mut samples = Samples::new(m);
    let mut products = 0;
    for _ in 0..photos {
        let signs = Signs::draw(resolution, kernel.len() / 2, &mut random);
        let mut sample = correlation(operator, homes, &signs.smoothed(&kernel))?;
        products += 1;
        if let Probing::NearIndirect { .. } = probing {
            // Both patterns use the same signs, so that their common noise cancels in the difference.
            let direct = correlation(operator, homes, &signs.smoothed(&[1.0]))?;
            products += 1;
            sample.iter_mut().zip(direct).for_each(|(near, direct)| *near -= direct);
        }
        samples.add(sample);
    }
    let standard_errors = samples.standard_errors();
    let mut mean = samples.mean;
    if matches!(probing, Probing::Indirect | Probing::Far { .. }) {
        let white = product(operator, &vec![1.0; n])?;
        products += 1;
        mean.iter_mut().zip(white).for_each(|(mean, white)| *mean = white - *mean);
    }
    Ok(Probed { values: mean, standard_errors, photos: products })
}

/// Random photos, by their mean and their spread.
struct Samples {
    count: usize,
    mean: Vec<f64>,
    squares: Vec<f64>,
}

impl Samples {
    fn new(pixels: usize) -> Self {
        Self { count: 0, mean: vec![0.0; pixels], squares: vec![0.0; pixels] }
    }

    fn add(&mut self, sample: impl IntoIterator<Item = f64>) {
        self.count += 1;
        for (i, value) in sample.into_iter().enumerate() {
            let before = value - self.mean[i];
            self.mean[i] += before / self.count as f64;
            self.squares[i] += before * (value - self.mean[i]);
        }
    }

    /// The standard errors of the mean of at least two samples.
    fn standard_errors(&self) -> Vec<f64> {
        let degrees = (self.count * (self.count - 1)) as f64;
        self.squares.iter().map(|square| (square / degrees).sqrt()).collect()
    }
}

/// Returns the random patterns (`n` each) at these places of the sequence of this seed. Their correlation is a Gaussian of `sigma` pixels
/// with the value 1 at distance 0.
pub(super) fn smooth_patterns(
    resolution: Resolution,
    sigma: f64,
    places: Range<usize>,
    seed: u64,
) -> Vec<Vec<f64>> {
    let mut random = Pcg64::seed_from_u64(seed);
    let kernel = kernel(sigma);
    let signs = (0..places.end).map(|_| Signs::draw(resolution, kernel.len() / 2, &mut random));
    signs.skip(places.start).map(|signs| signs.smoothed(&kernel)).collect()
}

fn correlation(operator: &mut dyn Operator, homes: Option<&Homes>, pattern: &[f64]) -> Result<Vec<f64>> {
    let photo = product(operator, pattern)?;
    let mask =
        |pixel: usize| homes.map_or(Some(pixel), |homes| homes[pixel]).map_or(0.0, |home| pattern[home]);
    Ok(photo.iter().enumerate().map(|(pixel, photo)| photo * mask(pixel)).collect())
}

/// A Gaussian of standard deviation `σ/√2`. Its autocorrelation is a Gaussian of standard deviation `σ`, and its squares add up to 1.
fn kernel(sigma: f64) -> Vec<f64> {
    let own = sigma / std::f64::consts::SQRT_2;
    let reach = (4.0 * own).ceil() as i64;
    let values: Vec<f64> = (-reach..=reach)
        .map(|d| if d == 0 { 1.0 } else { (-0.5 * (d as f64 / own).powi(2)).exp() })
        .collect();
    let length = values.iter().map(|value| value * value).sum::<f64>().sqrt();
    values.iter().map(|value| value / length).collect()
}

/// Random signs on a raster with a margin. With the margin, patterns have the same statistics at the edge as elsewhere.
struct Signs {
    resolution: Resolution,
    margin: usize,
    values: Vec<f64>,
}

impl Signs {
    fn draw(resolution: Resolution, margin: usize, random: &mut Pcg64) -> Self {
        let count = (resolution.width + 2 * margin) * (resolution.height + 2 * margin);
        let values = (0..count).map(|_| if random.random() { 1.0 } else { -1.0 }).collect();
        Self { resolution, margin, values }
    }

    /// Convolves along rows, then along columns, and removes the margin.
    fn smoothed(&self, kernel: &[f64]) -> Vec<f64> {
        let Resolution { width, height } = self.resolution;
        let first = self.margin - kernel.len() / 2;
        let mut rows = vec![0.0; width * (height + 2 * self.margin)];
        // A resolution without pixels has no rows.
        let from = self.values.par_chunks((width + 2 * self.margin).max(1));
        rows.par_chunks_mut(width.max(1)).zip(from).for_each(|(to, from)| {
            add_weighted(to, kernel.iter().enumerate().map(|(k, weight)| (*weight, &from[first + k..])));
        });
        let mut picture = vec![0.0; width * height];
        picture.par_chunks_mut(width.max(1)).enumerate().for_each(|(y, to)| {
            let row = |k: usize| &rows[(y + first + k) * width..];
            add_weighted(to, kernel.iter().enumerate().map(|(k, weight)| (*weight, row(k))));
        });
        picture
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patterns_continue_their_sequence_and_may_have_no_pixel() {
        let resolution = Resolution::new(7, 5);
        let all = smooth_patterns(resolution, 2.5, 0..5, 3);
        assert_eq!(smooth_patterns(resolution, 2.5, 2..5, 3), all[2..]);
        assert!(all[0] != all[1] && all.iter().all(|pattern| pattern.len() == 35));
        assert_eq!(smooth_patterns(Resolution::new(0, 0), 2.5, 0..2, 3), vec![Vec::<f64>::new(); 2]);
    }

    #[test]
    fn patterns_have_the_correlation_of_their_probing() {
        let (sigma, resolution) = (1.5, Resolution::new(12, 9));
        let kernel = kernel(sigma);
        let mut random = Pcg64::seed_from_u64(5);
        let draws = 20_000;
        let mut sums = vec![0.0; resolution.pixels()];
        for _ in 0..draws {
            let pattern = Signs::draw(resolution, kernel.len() / 2, &mut random).smoothed(&kernel);
            // The correlation with a corner pixel depends most on the margin.
            sums.iter_mut().zip(&pattern).for_each(|(sum, value)| *sum += pattern[0] * value);
        }
        for (pixel, sum) in sums.iter().enumerate() {
            let (x, y) = (pixel % resolution.width, pixel / resolution.width);
            let expected = Probing::Near { sigma }.weight(((x * x + y * y) as f64).sqrt());
            // The product of two such values has a variance of at most 3. The tolerance is 4.5 standard errors, plus the errors from the
            // sampling of the kernel and from its truncation at four deviations.
            let error = (sum / f64::from(draws) - expected).abs();
            assert!(error < 4.5 * (3.0 / f64::from(draws)).sqrt() + 1e-3, "({x}, {y}): {error}");
        }
    }
}
