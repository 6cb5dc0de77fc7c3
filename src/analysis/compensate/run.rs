//! Solves for the patterns of all channels, by any method and preconditioner, with or without crosstalk.

use std::sync::Arc;

use super::bound::Bounded;
use super::crosstalk::{Crosstalk, Mixed, planes};
use super::defocus::Defocus;
use super::mixture::Mixture;
use super::target::{norm_of, residual_norm};
use super::two_sizes;
use super::{CompensateOptions, Compensation, CompensationRow, Precondition, Prior, Target};
use crate::analysis::planes::Planes;
use crate::analysis::separate::SeparateBy;
use crate::analysis::similarity::similarity;
use crate::error::{Error, Result};
use crate::krylov::{
    Constraint, Diagonal, Method, Multiscale, Preconditioner, Solution, SolveOptions, SolveRow, Start,
    Status, Surrogate, solve_adjoint,
};
use crate::observer::{Estimate, Observer, Step};
use crate::operator::{Adjoint, Operator, Recorded, Relayed, Symmetry, product};

/// The squares and shifts that measure an unknown direct image. They take 16 photos.
const SQUARES: SeparateBy = SeparateBy::Checkerboards { square: 4, shifts: 4 };

pub(super) struct Solved {
    /// The patterns as the method computed them. They may leave the box.
    pub(super) patterns: Planes,
    pub(super) residual: f64,
    pub(super) history: Vec<CompensationRow>,
    pub(super) photos: usize,
    pub(super) status: Status,
    /// The method's patterns after each photo, if they are stored.
    pub(super) answers: Vec<Planes>,
    /// The number of frames that the camera had taken for the method after each photo; empty if photos are computed.
    pub(super) frames: Vec<u64>,
    /// A residual that no pattern inside the box falls below, if one is known.
    pub(super) least: Option<f64>,
}

pub(super) struct Run<'a> {
    pub(super) target: &'a Target,
    pub(super) white: &'a [Vec<f64>],
    pub(super) b: &'a [Vec<f64>],
    pub(super) options: &'a CompensateOptions,
    pub(super) prior: &'a Prior,
    /// True if each product is a photo, so that long computations between products are worthwhile.
    pub(super) dear: bool,
    pub(super) preparation: usize,
}

impl Run<'_> {
    /// Solves with `method`, with at most `photos` photos. Stores the patterns after each photo if `keep` is set.
    pub(super) fn solve<O: Adjoint>(
        &mut self,
        channels: &mut [O],
        method: Method,
        photos: usize,
        keep: bool,
    ) -> Result<Solved> {
        let crosstalk = self.prior.crosstalk.as_ref();
        let is_coupled = crosstalk.is_some_and(|crosstalk| crosstalk.coupled);
        let mut mixed;
        let operators: Vec<&mut dyn Adjoint> = match crosstalk {
            Some(crosstalk) if is_coupled => {
                mixed = Mixed { channels, crosstalk };
                vec![&mut mixed]
            }
            _ => channels.iter_mut().map(|operator| operator as &mut dyn Adjoint).collect(),
        };
        let apart = crosstalk.filter(|_| !is_coupled);
        let whites = apart.map_or([1.0; 3], Crosstalk::white);
        let starts = self.prior.start.as_ref();
        let starts = starts.map(|start| apart.map_or_else(|| start.clone(), |apart| apart.mix(start)));
        let systems = |planes: &[Vec<f64>]| if is_coupled { vec![planes.concat()] } else { planes.to_vec() };
        let (b, white, starts) =
            (systems(self.b), systems(self.white), starts.map(|starts| systems(&starts)));
        let mut found = Vec::new();
        for (index, operator) in operators.into_iter().enumerate() {
            // With crosstalk, the white photo is brighter than the product of a channel's operator with ones.
            let white = white[index].iter().map(|value| value / whites[index]).collect();
            let start = starts.as_ref().map(|starts| starts[index].clone());
            found.push(if self.target.has_one_size() {
                let setup = ((!is_coupled).then_some(index), white, start);
                let options = self.solve_options(operator, method, photos, setup, whites[index])?;
                kept(method, operator, &b[index], &options, keep)?
            } else {
                two_sizes::solve(self, operator, index, method, photos, keep)?
            });
        }
        let least =
            found.iter().any(|of| of.least > 0.0).then(|| self.total(found.iter().map(|of| of.least)));
        let answers = self.in_lockstep(&found.iter().map(|of| of.answers.as_slice()).collect::<Vec<_>>());
        let frames = sums(&found.iter().map(|of| of.frames.as_slice()).collect::<Vec<_>>());
        let solutions: Vec<Solution> = found.into_iter().map(|of| of.solution).collect();
        Ok(Solved {
            patterns: self.patterns(solutions.iter().map(|found| found.x.clone()).collect()),
            residual: self.total(solutions.iter().map(|found| found.residual)),
            history: self.history(&solutions),
            photos: solutions.iter().map(|found| found.stats.products).max().unwrap_or(0),
            status: least_good(&solutions),
            answers,
            frames,
            least,
        })
    }

    fn patterns(&self, answers: Planes) -> Planes {
        match &self.prior.crosstalk {
            Some(crosstalk) if crosstalk.coupled => planes(&answers.concat(), 3),
            Some(crosstalk) => crosstalk.unmix(&answers),
            None => answers,
        }
    }

    /// The patterns of all systems after each photo. A system that has ended keeps its last pattern.
    fn in_lockstep(&self, answers: &[&[Vec<f64>]]) -> Vec<Planes> {
        let most = answers.iter().map(|of| of.len()).max().unwrap_or(0);
        let at = |index: usize| {
            let one = |answer: &&[Vec<f64>]| answer.get(index).or(answer.last()).cloned();
            answers.iter().map(one).collect::<Option<Planes>>()
        };
        (0..most).filter_map(at).map(|answers| self.patterns(answers)).collect()
    }

    /// The options of one system. `upper` is the channel's response to white, relative to its response to its own colour.
    fn solve_options(
        &mut self,
        operator: &mut dyn Adjoint,
        method: Method,
        photos: usize,
        (channel, white, x0): (Option<usize>, Vec<f64>, Option<Vec<f64>>),
        upper: f64,
    ) -> Result<SolveOptions> {
        let constrained = method.facts().constraint != Constraint::None;
        let preconditioner =
            if constrained { None } else { self.preconditioner(operator, channel, white.clone())? };
        // If a rig is not symmetric, photos cannot measure its transpose, but a mixture of blurs has a transpose.
        let blurred = self.options.out_of_focus || operator.symmetry() != Symmetry::Symmetric;
        let surrogate: Option<Arc<dyn Surrogate>> = match method {
            Method::KrylovBox if blurred && self.dear && channel.is_some() => {
                Some(Arc::new(Mixture::new(self.target.resolution(), &white)))
            }
            _ => None,
        };
        Ok(SolveOptions {
            products: photos,
            rtol: self.options.rtol,
            lower: self.options.floor * upper,
            upper,
            diagonal: constrained.then_some(white),
            preconditioner,
            x0,
            surrogate,
            ..SolveOptions::default()
        })
    }

    fn preconditioner(
        &mut self,
        operator: &mut dyn Operator,
        channel: Option<usize>,
        white: Vec<f64>,
    ) -> Result<Option<Arc<dyn Preconditioner>>> {
        // If projector and camera have different positions, projector pixels do not correspond to pixels of the white photo.
        if self.options.precondition.is_none() && operator.symmetry() != Symmetry::Symmetric {
            return Ok(None);
        }
        let refuse = |fault: &str, help: &str| Err(Error::option("--precondition", fault).help(help));
        let size = self.target.resolution();
        let kind = self.options.unconstrained_preconditioning();
        let Some(channel) = channel.or((kind <= Precondition::Diagonal).then_some(0)) else {
            return refuse(
                "three colours in one system are preconditioned by the white photo only",
                "use diagonal or none, or un-mix the colours",
            );
        };
        Ok(match kind {
            Precondition::None => None,
            Precondition::Diagonal => Some(Arc::new(Diagonal::new(white)?)),
            Precondition::Multiscale => {
                let (probe, photo) = probe(operator)?;
                self.preparation = 2;
                let measured = Multiscale::measured(size.width, size.height, white, &probe, &photo)?;
                Some(Arc::new(measured))
            }
            Precondition::Direct => {
                let direct = match self.prior.direct.get(channel) {
                    Some(direct) => direct.clone(),
                    None => {
                        let found = SQUARES.measure(operator, size, 0)?;
                        self.preparation = 1 + found.photos;
                        found.direct
                    }
                };
                // The estimate may be negative at pixels without light.
                Some(Arc::new(Diagonal::new(direct.into_iter().map(|value| value.max(0.0)).collect())?))
            }
            Precondition::Geometry => {
                if self.prior.geometry.is_empty() {
                    return refuse("nothing is known of the scene's shape", "give a scene, or use diagonal");
                }
                Some(Arc::new(Diagonal::new(self.prior.geometry.clone())?))
            }
            Precondition::Defocus => match self.options.defocus {
                Some(width) => Some(Arc::new(Defocus::new(size, white, width)?)),
                None => {
                    let (probe, photo) = probe(operator)?;
                    self.preparation = 2;
                    Some(Arc::new(Defocus::measured(size, white, &probe, &photo)?.0))
                }
            },
        })
    }

    fn total(&self, residuals: impl Iterator<Item = f64>) -> f64 {
        if self.prior.crosstalk.as_ref().is_some_and(|crosstalk| crosstalk.coupled) {
            return residuals.fold(0.0, f64::max);
        }
        let absolute = residuals.zip(self.b).map(|(residual, b)| match norm_of(std::slice::from_ref(b)) {
            // The residual of a channel without target light is absolute.
            0.0 => residual,
            length => residual * length,
        });
        absolute.map(|residual| residual * residual).sum::<f64>().sqrt() / norm_of(self.b)
    }

    /// Combines the histories of the systems. A system that has ended keeps its last value.
    fn history(&self, solutions: &[Solution]) -> Vec<CompensationRow> {
        let most = solutions.iter().map(|found| found.history.len()).max().unwrap_or(0);
        let at = |found: &Solution, index: usize| {
            let row: Option<&SolveRow> = found.history.get(index).or(found.history.last());
            row.map_or(found.residual, |row| row.best)
        };
        (0..most)
            .map(|index| CompensationRow {
                photo: index + 1,
                residual: self.total(solutions.iter().map(|found| at(found, index))),
            })
            .collect()
    }
}

/// Takes the photo of a pattern of random signs. Returns the pattern and the photo.
fn probe(operator: &mut dyn Operator) -> Result<(Vec<f64>, Vec<f64>)> {
    let probe = Start::default().vector(operator.cols());
    let photo = product(operator, &probe)?;
    Ok((probe, photo))
}

/// The total number of frames of all systems after each photo. A system that has ended takes no more frames.
fn sums(frames: &[&[u64]]) -> Vec<u64> {
    let most = frames.iter().map(|of| of.len()).max().unwrap_or(0);
    let at = |index: usize| frames.iter().filter_map(|of| of.get(index).or(of.last())).sum();
    (0..most).map(at).collect()
}

/// The result of one system.
pub(super) struct Kept {
    pub(super) solution: Solution,
    /// The patterns after each photo, if they are stored.
    pub(super) answers: Vec<Vec<f64>>,
    /// The number of frames after each photo.
    frames: Vec<u64>,
    /// A residual that no vector inside the box falls below. It is 0 if nothing is known.
    pub(super) least: f64,
}

/// Solves a system, and stores the pattern after each photo if `keep` is set.
pub(super) fn kept(
    method: Method,
    operator: &mut dyn Adjoint,
    b: &[f64],
    options: &SolveOptions,
    keep: bool,
) -> Result<Kept> {
    let mut answers = Vec::new();
    let relay = |observer: &dyn Observer, step: &Step<'_>| {
        if let (true, Estimate::Solution { iterate, .. }) = (keep, step.estimate) {
            answers.push(iterate());
        }
        observer.step(step)
    };
    let mut bounded = Bounded::new(operator, b, [options.lower, options.upper]);
    let mut recorded = Recorded::of_frames(&mut bounded);
    let solution = solve_adjoint(method, &mut Relayed::new(&mut recorded, relay), b, options)?;
    let frames = recorded.frames;
    Ok(Kept { solution, answers, frames, least: bounded.least() })
}

/// The least successful status, because a single channel within its tolerance says nothing about the other channels.
fn least_good(solutions: &[Solution]) -> Status {
    let statuses = || solutions.iter().map(|found| found.stats.status);
    let rank = |status: &Status| match status {
        Status::ReachedTolerance => 0,
        Status::SpaceExhausted => 1,
        Status::ConstrainedOptimum | Status::LeastSquares => 2,
        _ => 3,
    };
    statuses().max_by_key(rank).unwrap_or(Status::ReachedTolerance)
}

/// Residuals that differ by less than this value count as equal, because patterns and photos are stored in single precision.
pub(super) const ROUNDING: f64 = 1e-6;

/// A projected pattern and its photos, taken or modelled. Patterns and photos have one plane per channel, and photos are without ambient
/// light.
pub(super) struct Answer<'a> {
    pub(super) target: &'a Target,
    pub(super) options: &'a CompensateOptions,
    pub(super) peak: f64,
    /// The light that the projector must add to reach the target.
    pub(super) b: &'a [Vec<f64>],
    pub(super) pattern: Planes,
    pub(super) observed: Planes,
    pub(super) uncompensated: Planes,
}

impl Answer<'_> {
    /// Completes the result with the values that the method reports. A pattern is good in three cases: it is within the tolerance; it is no
    /// worse than no compensation, and is the optimum inside the box; or it is better than no compensation, the user requested no
    /// tolerance, and its photos allowed no better pattern. Preparation and comparisons are left empty.
    pub(super) fn of(self, solved: Solved) -> Result<Compensation> {
        let Self { target, options, peak, b, pattern, observed, uncompensated } = self;
        let scale = norm_of(b);
        let residual = residual_norm(b, &observed) / scale;
        let uncompensated_residual = residual_norm(b, &uncompensated) / scale;
        // The residual that the method computes agrees with the residual of a photo only up to rounding.
        let reached = residual <= options.rtol * (1.0 + ROUNDING);
        let boxed = options.method.facts().constraint == Constraint::Box;
        let optimal = boxed && solved.status == Status::ConstrainedOptimum;
        let spent = !options.must_reach
            && matches!(solved.status, Status::BudgetSpent | Status::NoiseFloor | Status::LeastSquares);
        let (radiance, observed) = (target.radiance(peak)?, target.photo(&observed)?);
        let uncompensated = target.photo(&uncompensated)?;
        Ok(Compensation {
            unclipped: if pattern == solved.patterns {
                None
            } else {
                Some(target.pattern(&solved.patterns)?)
            },
            pattern: target.pattern(&pattern)?,
            similarity: similarity(&observed, &radiance, peak)?,
            uncompensated_similarity: similarity(&uncompensated, &radiance, peak)?,
            target: radiance,
            observed,
            uncompensated,
            peak,
            residual,
            unclipped_residual: solved.residual,
            least_residual: solved.least.filter(|least| *least > ROUNDING),
            uncompensated_residual,
            history: solved.history,
            baseline: Vec::new(),
            photos: solved.photos,
            frames: solved.frames,
            preparation: 0,
            clamping: None,
            status: solved.status,
            good: reached
                || (optimal && residual <= uncompensated_residual + ROUNDING)
                || (spent && residual < uncompensated_residual),
        })
    }
}
