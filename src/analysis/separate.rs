//! Separation of direct light and global light. Direct light comes straight from the projector; global light reached other surfaces first.
//!
//! | method | photos | accuracy |
//! |---|---|---|
//! | [`SeparateBy::Checkerboards`] | `shifts²` | exact if global light is smooth on the scale of the squares |
//! | [`SeparateBy::Sinusoids`] | 3 or more per direction | exact if global light is smooth on the scale of the waves |
//! | [`SeparateBy::Codes`] | 4, 8, 16, … | light of near pixels cancels; other global light is in the standard errors |
//! | [`random_patterns`] | any number | unbiased; the noise falls as `1/√photos` |
//! | [`from_capture`] | the white photo | approximate, from the photos of a Krylov capture |
//!
//! The first two methods are by Nayar, Krishnan, Grossberg and Raskar, *Fast separation of direct and global components of a scene using
//! high frequency illumination* (2006), doi:10.1145/1141911.1141977. They fail where global light is sharp, as with a mirror. The other
//! methods estimate the diagonal of `A`, which is the direct light of a coaxial rig, and so handle mirrors. A simulator stores each bounce
//! and needs no separation: [`crate::transport::Part`], [`crate::transport::Layer`].

pub use comparison::{ComparisonRow, NearFar, NearFarOptions, compare_separations, near_far};
mod comparison;
mod high_frequency;

use super::LowRank;
use super::low_rank::{LowRankCapture, capture};
use super::planes::Planes;
use super::probe::Homes;
use crate::error::{Error, Result};
use crate::image::Resolution;
use crate::krylov::{Start, diagonal};
use crate::measure::{code_patterns, shifted_checkerboards};
use crate::operator::{Operator, Symmetry, product};
use crate::transport::{Bounces, TransportMatrix};
use high_frequency::{check_checkerboards, check_codes, check_sinusoids, errors_of_lines, lines, waves};

/// Direct and global light under white, which is a pattern of ones.
#[derive(Clone, Debug, PartialEq)]
pub struct Separation {
    /// The light of one bounce (`n`).
    pub direct: Vec<f64>,
    /// The light of two and more bounces (`n`).
    pub global: Vec<f64>,
    /// Standard errors of `direct` (`n`), if the method gives them.
    pub standard_error: Option<Vec<f64>>,
    /// Standard errors of `global` (`n`), if the method gives them.
    pub global_error: Option<Vec<f64>>,
    /// The number of photos taken, including the white photo.
    pub photos: usize,
}

impl Separation {
    /// Adds the errors of photos that a model predicted. The residuals of the lines do not show them. `errors` gives the standard errors of
    /// the photo of a pattern; those of different photos add up as if they were fully correlated, so the true errors may be smaller. Methods
    /// that fit no lines have no standard errors then.
    #[must_use]
    pub fn of_model(
        self,
        by: SeparateBy,
        (resolution, homes): (Resolution, Option<&Homes>),
        errors: impl Fn(&[f64]) -> Vec<f64>,
    ) -> Self {
        let mut patterns = by.patterns(resolution).peekable();
        if patterns.peek().is_none() {
            return Self { standard_error: None, global_error: None, ..self };
        }
        let shared = errors_of_lines(homes, patterns.collect(), errors);
        let [standard_error, global_error] =
            [self.standard_error, self.global_error].map(|of| of.unwrap_or_default());
        let both = |of: Vec<f64>, shared: &[f64]| of.iter().zip(shared).map(|(a, b)| a.hypot(*b)).collect();
        Self {
            standard_error: Some(both(standard_error, &shared[0])),
            global_error: Some(both(global_error, &shared[1])),
            ..self
        }
    }
}

/// A method that separates direct from global light, with its number of photos.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SeparateBy {
    /// Checkerboards with squares of `square` pixels at `shifts²` positions, in steps of `2·square/shifts` pixels in both directions. Nayar et
    /// al. take 5² photos with squares of 3 or more pixels.
    Checkerboards {
        /// Side of a square in pixels.
        square: usize,
        /// Number of positions in each direction.
        shifts: usize,
    },
    /// Sinusoids along rows and along columns, of evenly spaced phases.
    Sinusoids {
        /// Period in pixels.
        period: f64,
        /// Photos in each direction.
        phases: usize,
    },
    /// Codes: each pixel is lit in half of the photos, and near pixels have different codes.
    Codes {
        /// Number of photos, a power of two.
        photos: usize,
    },
    /// [`random_patterns`].
    Random {
        /// Number of photos without the white photo.
        photos: usize,
    },
    /// [`from_capture`], with a capture that starts from random signs.
    Capture {
        /// Number of photos without the white photo.
        photos: usize,
    },
}

impl SeparateBy {
    /// The method's name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Checkerboards { .. } => "checkerboards",
            Self::Sinusoids { .. } => "sinusoids",
            Self::Codes { .. } => "codes",
            Self::Random { .. } => "random",
            Self::Capture { .. } => "capture",
        }
    }

    /// The method and its settings in words.
    pub fn in_words(self) -> String {
        match self {
            Self::Checkerboards { square, shifts } => {
                format!("checkerboards of {square} px at {shifts}×{shifts} places")
            }
            Self::Sinusoids { period, phases } => {
                format!("sinusoids of {period} px at 2×{phases} phases")
            }
            Self::Codes { photos } => format!("{photos} patterns of codes"),
            Self::Random { photos } => format!("{photos} random patterns"),
            Self::Capture { photos } => format!("a capture of {photos} photos"),
        }
    }

    /// The number of photos, including the white photo.
    pub fn photos(self) -> usize {
        match self {
            Self::Checkerboards { shifts, .. } => shifts * shifts,
            Self::Sinusoids { phases, .. } => 2 * phases,
            Self::Codes { photos } => photos,
            Self::Random { photos } | Self::Capture { photos } => photos + 1,
        }
    }

    /// Refuses settings that the method cannot use, before any photo is taken. Fails with [`Error::Option`] naming the option.
    pub fn check(self) -> Result<()> {
        match self {
            Self::Checkerboards { square, shifts } => check_checkerboards(square, shifts),
            Self::Sinusoids { period, phases } => check_sinusoids(period, phases),
            Self::Codes { photos } => check_codes(photos),
            Self::Random { .. } | Self::Capture { .. } => Ok(()),
        }
    }

    /// The patterns of a method that fits lines to the photos; none for the other methods.
    fn patterns(self, resolution: Resolution) -> Box<dyn Iterator<Item = Vec<f64>>> {
        match self {
            Self::Checkerboards { square, shifts } => {
                Box::new(shifted_checkerboards(resolution, square, shifts))
            }
            Self::Sinusoids { period, phases } => Box::new(waves(resolution, period, phases)),
            Self::Codes { photos } => Box::new(code_patterns(resolution, photos)),
            Self::Random { .. } | Self::Capture { .. } => Box::new(std::iter::empty()),
        }
    }

    /// Separates direct and global light of `operator`, which transports all light (`n × n`). The symmetry of the operator is not checked.
    /// Fails with the errors of the method.
    pub fn measure(
        self,
        operator: &mut dyn Operator,
        resolution: Resolution,
        seed: u64,
    ) -> Result<Separation> {
        self.measure_by_map(operator, (resolution, None), seed)
    }

    /// Works like [`Self::measure`]. With homes, the operator is `m × n`, and the method must fit lines, as the first three do.
    fn measure_by_map(
        self,
        operator: &mut dyn Operator,
        (resolution, homes): (Resolution, Option<&Homes>),
        seed: u64,
    ) -> Result<Separation> {
        self.check()?;
        match self {
            Self::Checkerboards { .. } | Self::Sinusoids { .. } | Self::Codes { .. } => {
                lines(operator, homes, self.patterns(resolution))
            }
            Self::Random { photos } => random_patterns(operator, photos, seed),
            Self::Capture { photos } => {
                let options = LowRankCapture {
                    photos,
                    start: Some(Start::Rademacher { seed }),
                    ..LowRankCapture::default()
                };
                let model = capture(operator, &[], &options)?;
                let white = product(operator, &vec![1.0; resolution.pixels()])?;
                from_capture(&model, &white)
            }
        }
    }
}

/// Separates direct and global light of `operator`, which transports all light (`m × n`) of patterns of the size `resolution`. On a coaxial
/// rig (`n × n`, symmetric) camera pixels see the direct light of their own projector pixel, elsewhere that of their home.
///
/// # Errors
/// [`Error::Option`] naming `--by` if the operator is not symmetric and the homes are not known, or if the method cannot use them; the
/// errors of the method.
pub fn separate(
    operator: &mut dyn Operator,
    (resolution, homes): (Resolution, Option<&Homes>),
    by: SeparateBy,
    seed: u64,
) -> Result<Separation> {
    if operator.symmetry() == Symmetry::Symmetric {
        return by.measure(operator, resolution, seed);
    }
    let follows_map = !matches!(by, SeparateBy::Random { .. } | SeparateBy::Capture { .. });
    match homes {
        Some(_) if follows_map => by.measure_by_map(operator, (resolution, homes), seed),
        Some(_) => Err(Error::option("--by", format!(
            "{} needs a coaxial rig, where the light that a pixel sees directly comes from that very pixel of the projector",
            by.name()
        ))
        .help("use --by checkerboards, sinusoids or codes, which follow the map from camera to projector")),
        None => Err(Error::option("--by", format!(
            "{} needs to know which pixel of the projector lights a camera pixel directly, and the source does not state it",
            by.name()
        ))
        .help("use --by exact on a scene, put the projector where the camera is, or give the direct light or the map")),
    }
}

// These methods estimate the diagonal of `A`. For coaxial pinholes, the diagonal is the direct light plus the global light that returns to
// its own pixel. In a zigzag at 64×64, the returning light is 4 % of the global light, mostly along the folds. The share falls with more
// pixels.

/// Separates with a white pattern and `photos ≥ 2` patterns of random signs. A signed pattern takes one product with `operator` (`n × n`).
/// The result is unbiased for any scene. The variance of a pixel is `Σ_{j≠i} A_ij² / photos`.
pub fn random_patterns(operator: &mut dyn Operator, photos: usize, seed: u64) -> Result<Separation> {
    let estimate = diagonal(operator, photos, seed)?;
    let ones = vec![1.0; operator.cols()];
    let white = product(operator, &ones)?;
    let global = white.iter().zip(&estimate.values).map(|(white, direct)| white - direct).collect();
    Ok(Separation {
        direct: estimate.values,
        global,
        // The errors of the direct light, from all patterns, also serve for the global light. The white photo has the noise of one photo.
        global_error: Some(estimate.standard_errors.clone()),
        standard_error: Some(estimate.standard_errors),
        photos: estimate.products + 1,
    })
}

/// Separates with the photos `W = A Q` of a Krylov process on all light. `Σ_k q_k ∘ W_k` is the diagonal of `A Q Qᵀ`. Divided by the
/// diagonal of `Q Qᵀ`, it estimates the diagonal of `A`; only the white photo is taken in addition. The method works like
/// [`random_patterns`] if the patterns differ randomly between neighbouring pixels, so use [`Start::Rademacher`](crate::krylov::Start).
/// More photos hardly help: at each pixel, all patterns of a process carry the signs of its start, so their errors repeat. In a room with a
/// mirror ball, the error is a quarter of the light both with 4 and with 128 photos. If new photos can be taken, use [`random_patterns`].
/// Fails with [`Error::Dimension`] if the white photo (`n`) and the model differ in size.
pub fn from_capture(model: &LowRank, white: &[f64]) -> Result<Separation> {
    let n = model.cols();
    Error::check_size("pixels of the white photo", n, white.len())?;
    let (mut products, mut squares) = (vec![0.0; n], vec![0.0; n]);
    for (pattern, photo) in model.basis().iter().zip(model.photos()) {
        for i in 0..n {
            products[i] += pattern[i] * photo[i];
            squares[i] += pattern[i] * pattern[i];
        }
    }
    // A pixel that no pattern lit counts as a pixel without direct light.
    let direct: Vec<f64> =
        products.iter().zip(&squares).map(|(p, s)| if *s > 0.0 { p / s } else { 0.0 }).collect();
    let global = white.iter().zip(&direct).map(|(white, direct)| white - direct).collect();
    Ok(Separation { direct, global, standard_error: None, global_error: None, photos: model.rank() + 1 })
}

/// The light of exactly two bounces, and the light of three or more bounces, under white, from a matrix that stores them as separate
/// layers. Fails as [`TransportMatrix::layers`] does; a well-formed matrix in one process gives no error.
pub fn second_and_rest(matrix: &TransportMatrix) -> Result<[Planes; 2]> {
    let (rows, count) = (matrix.resolution().pixels(), matrix.channels().count());
    let mut found = [Bounces::Two, Bounces::Rest].map(|_| vec![vec![0.0; rows]; count]);
    for layer in &*matrix.layers()? {
        let planes = match layer.bounces() {
            Bounces::Two => &mut found[0],
            Bounces::Rest => &mut found[1],
            Bounces::One | Bounces::Global => continue,
        };
        for (channel, plane) in planes.iter_mut().enumerate() {
            layer.to_csr(channel)?.entries().for_each(|(row, _, weight)| plane[row] += weight);
        }
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_that_a_method_cannot_use_are_refused_by_name() {
        for (by, name) in [
            (SeparateBy::Checkerboards { square: 0, shifts: 4 }, "--square"),
            (SeparateBy::Sinusoids { period: 1.0, phases: 3 }, "--period"),
            (SeparateBy::Sinusoids { period: 4.0, phases: 2 }, "--phases"),
            (SeparateBy::Codes { photos: 12 }, "--photos"),
        ] {
            assert!(matches!(by.check(), Err(Error::Option { option, .. }) if option == name), "{name}");
        }
        assert!(SeparateBy::Codes { photos: 16 }.check().is_ok());
        assert!(SeparateBy::Checkerboards { square: 2, shifts: 4 }.check().is_ok());
    }
}
