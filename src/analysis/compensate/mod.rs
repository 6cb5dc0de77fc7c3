//! Light transport compensation finds the pattern under which the scene looks like a target.
//!
//! | topic | item |
//! |---|---|
//! | the target | [`Target`] |
//! | prior knowledge in addition to the photos: direct light, shape, crosstalk of colours, a first pattern | [`Prior`] |
//! | the cost of clamping, compared with a box-constrained method | [`Clamping`] |
//! | all methods at equal numbers of photos | [`compare_methods`] |
//! | another target for a scene that is already captured | [`compensate_by_model`] |

mod bound;
mod by_model;
mod compare;
mod crosstalk;
mod defocus;
mod gaussian;
mod mixture;
mod options;
mod run;
mod target;
#[cfg(test)]
mod tests_of_two_sizes;
mod two_sizes;

pub use by_model::{Photograph, compensate_by_model};
pub use compare::{Clamping, MethodRun, compare_methods};
pub use crosstalk::Crosstalk;
#[cfg(feature = "paper")]
pub(crate) use mixture::Mixture;
pub use options::{CompensateOptions, Precondition};
pub use target::Target;

use super::planes::Planes;
use super::similarity::Similarity;
use crate::error::{Error, Result};
use crate::image::Image;
use crate::krylov::{Constraint, Method, Status};
use crate::operator::{Adjoint, Observed, block, block_mut, product};
use crate::sparse::Csr;
use run::{Answer, ROUNDING, Run};
use target::{norm_of, residual_norm};

/// The smallest residual so far after a number of the method's photos, relative to the target light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CompensationRow {
    /// The number of photos taken by the method, from 1.
    pub photo: usize,
    /// `‖b − A x‖ / ‖b‖`; infinite before the first pattern is photographed.
    pub residual: f64,
}

/// The pattern to project, and its photos. Residuals are `‖b − A x‖ / ‖b‖` over all channels, where `b` is the target minus ambient light.
#[derive(Clone, Debug)]
pub struct Compensation {
    /// The pattern to project, in [floor, 1].
    pub pattern: Image,
    /// The pattern as the method computed it, if it left the box and was clipped.
    pub unclipped: Option<Image>,
    /// The target light in W/(m² sr), including ambient light: the target times the peak.
    pub target: Image,
    /// The photo of `pattern`, including ambient light.
    pub observed: Image,
    /// The photo of the target itself as a pattern. The pattern is dimmed so that its photo would have the target's brightness on an even
    /// wall.
    pub uncompensated: Image,
    /// The radiance of a target value of 1.
    pub peak: f64,
    /// The residual of `pattern`, from its photo.
    pub residual: f64,
    /// The residual of the pattern before clipping, as the method computes it.
    pub unclipped_residual: f64,
    /// A residual that no pattern in [floor, 1] falls below. It follows from the method's products with the transpose. `None` if there
    /// are no such products, if they are noisy, or if they exclude nothing.
    pub least_residual: Option<f64>,
    /// The residual of `uncompensated`.
    pub uncompensated_residual: f64,
    /// One row per photo of the method, before clipping.
    pub history: Vec<CompensationRow>,
    /// The history of projected Jacobi with the same number of photos; empty if no baseline was requested.
    pub baseline: Vec<CompensationRow>,
    /// The number of photos taken by the method. Photos that only show a result (`observed`, `uncompensated`, and all of the baseline) do
    /// not count.
    pub photos: usize,
    /// The number of frames that the camera had taken for the method after each of these photos; empty if photos are computed.
    pub frames: Vec<u64>,
    /// The number of photos taken before the method: the white photo, and the photos that measure a preconditioner or a prior.
    pub preparation: usize,
    /// The similarity of `observed` and `target`, with the peak as the data range.
    pub similarity: Similarity,
    /// The similarity of `uncompensated` and `target`.
    pub uncompensated_similarity: Similarity,
    /// The effect of clipping after each photo; `None` if the method's pattern is inside the box, or if no baseline was requested.
    pub clamping: Option<Clamping>,
    /// The reason why the method ended. For several channels, it is the least successful status.
    pub status: Status,
    /// True in three cases: the pattern is within the tolerance; it is the optimum inside the box; or it is better than no compensation,
    /// and its photos allowed no better pattern.
    pub good: bool,
}

impl Compensation {
    /// Returns true if the target itself, projected without compensation, would have a residual at least as small.
    pub fn is_needless(&self) -> bool {
        self.residual >= self.uncompensated_residual - ROUNDING
    }
}

/// Prior knowledge in addition to the photos; none by default.
#[derive(Clone, Debug, Default)]
pub struct Prior {
    /// The direct image under white of each channel (`n`), for [`Precondition::Direct`]. It is measured if empty.
    pub direct: Vec<Vec<f64>>,
    /// The direct image predicted from the scene's shape alone (`n`), up to a factor, for [`Precondition::Geometry`].
    pub geometry: Vec<f64>,
    /// The crosstalk of projector and camera colours. Only for three channels.
    pub crosstalk: Option<Crosstalk>,
    /// The map from camera to projector of each channel (`n × m`), for methods without a transpose where photos and patterns have different
    /// sizes. A row is the mean over the camera pixels that see the projector pixel directly.
    pub map: Vec<Csr>,
    /// The number of photos taken to obtain this knowledge.
    pub photos: usize,
    /// The first pattern of the methods, one plane per channel. By default, methods start from black, or from the target over the white
    /// photo.
    pub start: Option<Vec<Vec<f64>>>,
}

/// Finds the pattern whose photo is `target` times the peak. Solves `A x = b` for each channel, where `b` is the target light minus ambient
/// light.
///
/// `channels` holds one operator (`m × n`) per channel of the target, with a row for each pixel of the target and a column for each pixel
/// of a pattern ([`Target::for_projector`]). The channels are independent systems and are solved one after the
/// other. One colour photo is one product with each operator, so the number of photos is the largest number of products of a channel. The
/// observer of each operator sees the products of the method and may stop the method; the baseline is not observed. A pattern outside
/// [floor, 1] is clipped, as by a projector, and the residuals before and after clipping are both reported. [`Method::KrylovBox`] keeps its
/// patterns inside the box.
///
/// # Errors
/// The errors of [`CompensateOptions::check`] and [`solve_adjoint`](crate::krylov::solve_adjoint); [`Error::Option`] naming `--peak` if no
/// peak is given and half of the white photo is black; [`Error::Dimension`] if sizes differ; [`Error::Numerical`] if there is no target
/// light.
pub fn compensate<O: Adjoint>(
    channels: &mut [O],
    target: &Target,
    options: &CompensateOptions,
) -> Result<Compensation> {
    compensate_with(channels, target, options, &Prior::default())
}

/// Does the same as [`compensate`], with prior knowledge in addition to the photos.
///
/// # Errors
/// The errors of [`compensate`]; [`Error::Dimension`] if `prior` has crosstalk but there are not three channels, or if `prior` has planes
/// of another size; [`Error::Option`] naming `--precondition` if `prior` lacks the knowledge that the preconditioner needs.
pub fn compensate_with<O: Adjoint>(
    channels: &mut [O],
    target: &Target,
    options: &CompensateOptions,
    prior: &Prior,
) -> Result<Compensation> {
    options.check()?;
    let target = &target.lifted(options.lift);
    target.fits(channels)?;
    prior.fits(target, channels.len())?;
    let mut scene = Scene { channels, prior };
    if !target.has_one_size() {
        prior.fits_two_sizes(options)?;
    }
    let ones = vec![vec![1.0; target.projector().pixels()]; scene.channels.len()];
    let white = scene.photograph(&ones)?;
    let peak = options.peak.map_or_else(|| target.default_peak(&white), Ok)?;
    let b = target.light(peak)?;
    let mut run = Run { target, white: &white, b: &b, options, prior, dear: true, preparation: 1 };
    let keep = options.method.facts().constraint != Constraint::Box && options.baseline;
    let solved = run.solve(scene.channels, options.method, options.photos, keep)?;
    let preparation = run.preparation;
    let again = solved.photos.max(1);
    // Between two sizes, the methods without a transpose need the map.
    let has_map = target.has_one_size() || !prior.map.is_empty();
    let baseline = match options.method {
        Method::Jacobi => solved.history.clone(),
        _ if !options.baseline || !has_map => Vec::new(),
        _ => run.solve(&mut unobserved(scene.channels), Method::Jacobi, again, false)?.history,
    };

    let pattern = clipped(&solved.patterns, options.floor);
    let observed = scene.photograph(&pattern)?;
    let plain = clipped(&target.dimmed(&white, peak), options.floor);
    let uncompensated = scene.photograph(&plain)?;
    let keep = keep && pattern != solved.patterns;
    let displayed = match keep {
        true => scene.displayed(&solved.answers, options.floor, &b)?,
        false => Vec::new(),
    };
    let answer = Answer { target, options, peak, b: &b, pattern, observed, uncompensated };
    let found = answer.of(solved)?;
    let clamping = if keep && has_map {
        let boxed = run.solve(&mut unobserved(scene.channels), Method::KrylovBox, again, false)?.history;
        Some(Clamping { displayed, boxed, uncompensated: found.uncompensated_residual })
    } else {
        None
    };
    Ok(Compensation { baseline, clamping, preparation: preparation + prior.photos, ..found })
}

impl Prior {
    fn fits(&self, target: &Target, channels: usize) -> Result<()> {
        if self.crosstalk.is_some() {
            Error::check_size("channels between which there is crosstalk", 3, channels)?;
        }
        let start = self.start.as_ref().map_or(0, Vec::len);
        for (what, count) in [("direct images", self.direct.len()), ("planes of the first pattern", start)] {
            if count != 0 {
                Error::check_size(what, channels, count)?;
            }
        }
        let geometry = Some(&self.geometry).filter(|plane| !plane.is_empty());
        if !self.map.is_empty() {
            Error::check_size("maps from camera to projector", channels, self.map.len())?;
        }
        for plane in self.direct.iter().chain(geometry).chain(self.start.iter().flatten()) {
            Error::check_size("pixels of what is known beforehand", target.pixels(), plane.len())?;
        }
        Ok(())
    }
}

impl Prior {
    /// Refuses what is not supported where photos and patterns have different sizes.
    fn fits_two_sizes(&self, options: &CompensateOptions) -> Result<()> {
        let is_plain = matches!(options.precondition, None | Some(Precondition::None));
        let fault = "it is for photos and patterns of one size";
        match (self.crosstalk.is_some(), is_plain, options.out_of_focus) {
            (true, ..) => Err(Error::option("--crosstalk", fault).help("leave it out")),
            (_, false, _) => Err(Error::option("--precondition", fault).help("leave it out")),
            (.., true) => Err(Error::option("--out-of-focus", fault).help("leave it out")),
            _ => Ok(()),
        }
    }
}

struct Scene<'a, O> {
    channels: &'a mut [O],
    prior: &'a Prior,
}

impl<O: Adjoint> Scene<'_, O> {
    fn photograph(&mut self, patterns: &[Vec<f64>]) -> Result<Planes> {
        let mixed = self.prior.crosstalk.as_ref().map(|crosstalk| crosstalk.mix(patterns));
        let photo = |(operator, pattern): (&mut O, &Vec<f64>)| product(operator, pattern);
        self.channels.iter_mut().zip(mixed.as_deref().unwrap_or(patterns)).map(photo).collect()
    }

    fn displayed(&mut self, answers: &[Planes], floor: f64, b: &[Vec<f64>]) -> Result<Vec<CompensationRow>> {
        // The channels take their photos one after the other, because a journal depends on the order of products.
        let size = match &*self.channels {
            [operator] => operator.block_size().max(1),
            _ => 1,
        };
        let mut rows = Vec::new();
        for answers in answers.chunks(size) {
            let patterns: Vec<Planes> = answers.iter().map(|answer| clipped(answer, floor)).collect();
            for seen in self.photographs(patterns)? {
                rows.push(CompensationRow {
                    photo: rows.len() + 1,
                    residual: residual_norm(b, &seen) / norm_of(b),
                });
            }
        }
        Ok(rows)
    }

    /// Takes the photos of several patterns. A single channel takes them as a block.
    fn photographs(&mut self, patterns: Vec<Planes>) -> Result<Vec<Planes>> {
        let [operator] = &mut *self.channels else {
            return patterns.iter().map(|pattern| self.photograph(pattern)).collect();
        };
        let patterns = patterns.concat();
        let mut photos = vec![vec![0.0; operator.rows()]; patterns.len()];
        operator.apply_block(&block(&patterns), &mut block_mut(&mut photos))?;
        Ok(photos.into_iter().map(|photo| vec![photo]).collect())
    }
}

fn unobserved<O: Adjoint>(channels: &mut [O]) -> Vec<Observed<'_, O>> {
    channels.iter_mut().map(|operator| Observed::new(operator, &())).collect()
}

fn clipped(patterns: &[Vec<f64>], floor: f64) -> Planes {
    patterns.iter().map(|plane| plane.iter().map(|value| value.clamp(floor, 1.0)).collect()).collect()
}
