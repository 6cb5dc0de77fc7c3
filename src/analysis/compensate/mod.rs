//! Light transport compensation: what to project so that the scene looks as wanted.
//!
//! | idea | here |
//! |---|---|
//! | what is wished | [`Target`] |
//! | what is known beside the photos: direct light, shape, crosstalk of colours, a first pattern | [`Prior`] |
//! | what clamping does, and what a method inside the box does instead | [`Clamping`] |
//! | every method at equal photos | [`compare_methods`] |
//! | another target for a scene that is captured already | [`compensate_by_model`] |

mod answer;
mod by_model;
mod clamping;
mod compare;
mod crosstalk;
mod defocus;
mod gaussian;
mod mixture;
mod options;
mod run;
mod target;

pub use by_model::{Photograph, compensate_by_model};
pub use clamping::Clamping;
pub use compare::{MethodRun, compare_methods};
pub use crosstalk::Crosstalk;
pub(crate) use mixture::Mixture;
pub use options::{CompensateOptions, Precondition};
pub use target::Target;

use super::similarity::Similarity;
use crate::error::{Error, Result};
use crate::image::Image;
use crate::krylov::{Constraint, Method, Status};
use crate::operator::{Adjoint, Observed, block, block_mut};
use answer::Answer;
use run::{Planes, Run};
use target::{norm_of, residual_norm};

/// A residual, relative to the wish, after so many photos of the method: the least until then.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CompensationRow {
    /// Photos taken by the method, from 1.
    pub photo: usize,
    /// `‖b − A x‖ / ‖b‖`; infinite where no pattern has been photographed yet.
    pub residual: f64,
}

/// What to project, and what is then seen. Residuals are `‖b − A x‖ / ‖b‖`, `b` being the light wished less the ambient light,
/// over all channels.
#[derive(Clone, Debug)]
pub struct Compensation {
    /// What to project, in [floor, 1].
    pub pattern: Image,
    /// The method's own answer, where that leaves the box and had to be clipped.
    pub unclipped: Option<Image>,
    /// What is wished, in W/(m² sr), ambient light included: the target times the peak.
    pub target: Image,
    /// The photo of `pattern`, ambient light included.
    pub observed: Image,
    /// The photo of the target itself, dimmed so that it would be as bright as wished on an even wall.
    pub uncompensated: Image,
    /// The radiance that 1 in the target stands for.
    pub peak: f64,
    /// Of `pattern`, from its photo.
    pub residual: f64,
    /// Of the method's own answer, as the method knows it.
    pub unclipped_residual: f64,
    /// Of `uncompensated`.
    pub uncompensated_residual: f64,
    /// A row for each photo of the method; before clipping.
    pub history: Vec<CompensationRow>,
    /// The same for projected Jacobi with as many photos; empty where it is not asked for.
    pub baseline: Vec<CompensationRow>,
    /// Photos that the method took. Those that only show a result (`observed`, `uncompensated`, and all of the baseline) are not
    /// among them.
    pub photos: usize,
    /// Photos before them: the white one, and one to measure a multiscale preconditioner.
    pub preparation: usize,
    /// How alike `observed` and `target` are, the data range being the peak.
    pub similarity: Similarity,
    /// The same of `uncompensated`.
    pub uncompensated_similarity: Similarity,
    /// What clipping did, photo by photo; none for an answer inside the box, and where no baseline is asked for.
    pub clamping: Option<Clamping>,
    /// Why the method ended; of several channels, the one that went least well.
    pub status: Status,
    /// The pattern is better than none, and within the tolerance or the best inside the box.
    pub good: bool,
}

/// What is known beside the photos; by default nothing.
#[derive(Clone, Debug, Default)]
pub struct Prior {
    /// The direct image under white of each channel (`n`), for [`Precondition::Direct`]; empty: it is measured.
    pub direct: Vec<Vec<f64>>,
    /// The direct image that the scene's shape alone predicts (`n`), up to a factor, for [`Precondition::Geometry`].
    pub geometry: Vec<f64>,
    /// The crosstalk of projector and camera colours; only for three channels.
    pub crosstalk: Option<Crosstalk>,
    /// Photos that were taken to learn all this.
    pub photos: usize,
    /// Where methods start (a plane for each channel), in place of darkness or the target over the white photo.
    pub start: Option<Vec<Vec<f64>>>,
}

/// What to project so that the photo is `target` times the peak: solves `A x = b` in each channel, with `b` the light wished less
/// the ambient light.
///
/// `channels` holds one operator (`n × n`) for each of the wish's channels. They are independent systems, and one colour photo is
/// one product with each; so they are solved one after the other, and the photos are those of the one that took most. The
/// observer of each channel's operator sees its products, and may stop them; the baseline is not observed. An answer that leaves
/// [floor, 1] is clipped, as a projector would do: both residuals are reported, and the box belongs inside the method
/// ([`Method::KrylovBox`]).
///
/// # Errors
/// As [`CompensateOptions::check`] and [`solve_adjoint`](crate::krylov::solve_adjoint); [`Error::Option`] naming `--peak` when
/// none is given and half of the white photo is black; [`Error::Dimension`] when sizes differ; [`Error::Numerical`] when there is
/// nothing to wish for.
pub fn compensate<O: Adjoint>(
    channels: &mut [O],
    wish: &Target,
    options: &CompensateOptions,
) -> Result<Compensation> {
    compensate_with(channels, wish, options, &Prior::default())
}

/// As [`compensate`], with what is known beside the photos.
///
/// # Errors
/// As [`compensate`]; [`Error::Dimension`] when `prior` has crosstalk and there are not three channels, or a plane of another
/// size; [`Error::Option`] naming `--precondition` when it lacks what that needs.
pub fn compensate_with<O: Adjoint>(
    channels: &mut [O],
    wish: &Target,
    options: &CompensateOptions,
    prior: &Prior,
) -> Result<Compensation> {
    options.check()?;
    let wish = &wish.lifted(options.lift);
    wish.fits(channels)?;
    prior.fits(wish, channels.len())?;
    let mut scene = Scene { channels, prior };
    let ones = vec![vec![1.0; wish.pixels()]; scene.channels.len()];
    let white = scene.photograph(&ones)?;
    let peak = options.peak.map_or_else(|| wish.default_peak(&white), Ok)?;
    let b = wish.light(peak)?;
    let mut run = Run { wish, white: &white, b: &b, options, prior, dear: true, preparation: 1 };
    let keep = options.method.facts().constraint != Constraint::Box && options.baseline;
    let solved = run.solve(scene.channels, options.method, options.photos, keep)?;
    let preparation = run.preparation;
    let again = solved.photos.max(1);
    let baseline = match options.method {
        Method::Jacobi => solved.history.clone(),
        _ if !options.baseline => Vec::new(),
        _ => run.solve(&mut unobserved(scene.channels), Method::Jacobi, again, false)?.history,
    };

    let pattern = clipped(&solved.patterns, options.floor);
    let observed = scene.photograph(&pattern)?;
    let plain = clipped(&wish.dimmed(&white, peak)?, options.floor);
    let uncompensated = scene.photograph(&plain)?;
    let keep = keep && pattern != solved.patterns;
    let displayed = match keep {
        true => scene.displayed(&solved.answers, options.floor, &b)?,
        false => Vec::new(),
    };
    let answer = Answer { wish, options, peak, b: &b, pattern, observed, uncompensated };
    let found = answer.of(solved)?;
    let clamping = if keep {
        let boxed = run.solve(&mut unobserved(scene.channels), Method::KrylovBox, again, false)?.history;
        Some(Clamping { displayed, boxed, uncompensated: found.uncompensated_residual })
    } else {
        None
    };
    Ok(Compensation { baseline, clamping, preparation: preparation + prior.photos, ..found })
}

impl Prior {
    fn fits(&self, wish: &Target, channels: usize) -> Result<()> {
        let mismatch = |what, expected: usize, found: usize| {
            Err(Error::Dimension { what, expected: expected.to_string(), found: found.to_string() })
        };
        if self.crosstalk.is_some() && channels != 3 {
            return mismatch("channels between which there is crosstalk", 3, channels);
        }
        let start = self.start.as_ref().map_or(0, Vec::len);
        for (what, count) in [("direct images", self.direct.len()), ("planes of the first pattern", start)] {
            if count != 0 && count != channels {
                return mismatch(what, channels, count);
            }
        }
        let geometry = Some(&self.geometry).filter(|plane| !plane.is_empty());
        let mut planes = self.direct.iter().chain(geometry).chain(self.start.iter().flatten());
        match planes.find(|plane| plane.len() != wish.pixels()) {
            Some(plane) => mismatch("pixels of what is known beforehand", wish.pixels(), plane.len()),
            None => Ok(()),
        }
    }
}

/// The channels behind the crosstalk of their colours.
struct Scene<'a, O> {
    channels: &'a mut [O],
    prior: &'a Prior,
}

impl<O: Adjoint> Scene<'_, O> {
    /// The photo of a pattern in all colours.
    fn photograph(&mut self, patterns: &[Vec<f64>]) -> Result<Planes> {
        let mixed = self.prior.crosstalk.as_ref().map(|crosstalk| crosstalk.mix(patterns));
        let photo = |(operator, pattern): (&mut O, &Vec<f64>)| {
            let mut photo = vec![0.0; pattern.len()];
            operator.apply(pattern, &mut photo)?;
            Ok(photo)
        };
        self.channels.iter_mut().zip(mixed.as_deref().unwrap_or(patterns)).map(photo).collect()
    }

    /// What would be seen of each answer, had it been clipped and projected.
    fn displayed(&mut self, answers: &[Planes], floor: f64, b: &[Vec<f64>]) -> Result<Vec<CompensationRow>> {
        // With several channels, colour photos are taken one after the other: the order of products is part of a journal.
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

    /// The photos of several patterns; of one channel, as a block.
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

/// The channels without their observers.
fn unobserved<O: Adjoint>(channels: &mut [O]) -> Vec<Observed<'_, O>> {
    channels.iter_mut().map(|operator| Observed::new(operator, &())).collect()
}

fn clipped(patterns: &[Vec<f64>], floor: f64) -> Planes {
    patterns.iter().map(|plane| plane.iter().map(|value| value.clamp(floor, 1.0)).collect()).collect()
}
