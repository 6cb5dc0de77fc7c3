//! Light transport compensation: what to project so that the scene looks as wanted.

mod options;
mod wish;

pub use options::{CompensateOptions, Precondition};
pub use wish::Wish;
use wish::{norm_of, residual_norm};

use crate::error::Result;
use crate::image::Image;
use crate::krylov::{
    Constraint, Diagonal, Method, Multiscale, Preconditioner, Solution, SolveMonitor, SolveOptions, SolveRow,
    Start, Status, keep_solving, solve_adjoint,
};
use crate::operator::{Adjoint, Operator, Symmetry};

/// A residual, relative to the wish, after so many photos of the method: the least until then.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CompensationRow {
    /// Photos taken by the method, from 1.
    pub photo: usize,
    /// `‖b − A x‖ / ‖b‖`; infinite where no pattern has been photographed yet.
    pub residual: f64,
}

/// What to project, and what is then seen. Residuals are `‖b − A x‖ / ‖b‖`, `b` being the light wished less the
/// ambient light, over all channels.
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
    /// Photos that the method took. Those that only show a result (`observed`, `uncompensated`, and all of the baseline) are
    /// not among them.
    pub photos: usize,
    /// Photos before them: the white one, and one to measure a multiscale preconditioner.
    pub preparation: usize,
    /// Why the method ended; of several channels, the one that went least well.
    pub status: Status,
    /// The pattern is better than none, and within the tolerance or the best inside the box.
    pub good: bool,
}

/// What to project so that the photo is `target` times the peak: solves `A x = b` in each channel, with `b` the light
/// wished less the ambient light.
///
/// `channels` holds one operator (`n × n`) for each of the wish's channels. They are independent systems, and one colour photo is
/// one product with each; so they are solved one after the other, and the photos are those of the one that took most.
/// An answer that leaves [floor, 1] is clipped, as a projector would do: both residuals are reported, and the box
/// belongs inside the method ([`Method::KrylovBox`]).
///
/// # Errors
/// As [`CompensateOptions::check`] and [`solve_adjoint`]; [`Error::Option`](crate::Error::Option) naming `--peak` when none is given and half of the white
/// photo is black; [`Error::Dimension`](crate::Error::Dimension) when sizes differ; [`Error::Numerical`](crate::Error::Numerical) when there is nothing to wish for.
pub fn compensate<O: Adjoint>(
    channels: &mut [O],
    wish: &Wish,
    options: &CompensateOptions,
    monitor: &mut SolveMonitor<'_>,
) -> Result<Compensation> {
    options.check()?;
    wish.fits(channels)?;
    let ones = vec![vec![1.0; wish.pixels()]; channels.len()];
    let white = photograph(channels, &ones)?;
    let peak = options.peak.map_or_else(|| wish.default_peak(&white), Ok)?;
    let b = wish.light(peak)?;
    let mut run = Run { wish, white: &white, b: &b, options, preparation: 1 };
    let solutions = run.solve_all(channels, options.method, options.photos, monitor)?;
    let photos = solutions.iter().map(|found| found.stats.products).max().unwrap_or(0);
    let baseline = match options.method {
        Method::Jacobi => solutions.clone(),
        _ if !options.baseline => Vec::new(),
        _ => run.solve_all(channels, Method::Jacobi, photos.max(1), &mut keep_solving)?,
    };

    let answer: Vec<Vec<f64>> = solutions.iter().map(|found| found.x.clone()).collect();
    let pattern = clipped(&answer, options.floor);
    let observed = photograph(channels, &pattern)?;
    let plain = clipped(&wish.dimmed(&white, peak)?, options.floor);
    let uncompensated = photograph(channels, &plain)?;
    let scale = norm_of(&b);
    let residual = residual_norm(&b, &observed) / scale;
    let uncompensated_residual = residual_norm(&b, &uncompensated) / scale;
    let history = run.history(&solutions);
    let status = least_good(&solutions);
    // What the method knows by recurrence agrees with a photo to rounding, not to the last bit.
    let reached = residual <= options.rtol * (1.0 + 1e-6);
    let optimal =
        options.method.facts().constraint == Constraint::Box && status == Status::ConstrainedOptimum;
    Ok(Compensation {
        unclipped: if pattern == answer { None } else { Some(wish.image(&answer)?) },
        pattern: wish.image(&pattern)?,
        target: wish.radiance(peak)?,
        observed: wish.photo(&observed)?,
        uncompensated: wish.photo(&uncompensated)?,
        peak,
        residual,
        unclipped_residual: run.total(solutions.iter().map(|found| found.residual)),
        uncompensated_residual,
        history,
        baseline: run.history(&baseline),
        photos,
        preparation: run.preparation,
        status,
        good: residual < uncompensated_residual && (reached || optimal),
    })
}

/// What all channels' systems share.
struct Run<'a> {
    wish: &'a Wish,
    white: &'a [Vec<f64>],
    b: &'a [Vec<f64>],
    options: &'a CompensateOptions,
    preparation: usize,
}

impl Run<'_> {
    fn solve_all<O: Adjoint>(
        &mut self,
        channels: &mut [O],
        method: Method,
        photos: usize,
        monitor: &mut SolveMonitor<'_>,
    ) -> Result<Vec<Solution>> {
        let constrained = method.facts().constraint != Constraint::None;
        let mut found = Vec::new();
        for (channel, operator) in channels.iter_mut().enumerate() {
            let preconditioner = if constrained { None } else { self.preconditioner(operator, channel)? };
            let options = SolveOptions {
                products: photos,
                rtol: self.options.rtol,
                lower: self.options.floor,
                diagonal: constrained.then(|| self.white[channel].clone()),
                preconditioner,
                ..SolveOptions::default()
            };
            found.push(solve_adjoint(method, operator, &self.b[channel], &options, monitor)?);
        }
        Ok(found)
    }

    fn preconditioner(
        &mut self,
        operator: &mut dyn Operator,
        channel: usize,
    ) -> Result<Option<std::sync::Arc<dyn Preconditioner>>> {
        // Where the projector stands apart, its pixels are others than those of the white photo.
        if self.options.precondition.is_none() && operator.symmetry() != Symmetry::Symmetric {
            return Ok(None);
        }
        let white = self.white[channel].clone();
        Ok(match self.options.preconditioning() {
            Precondition::None => None,
            Precondition::Diagonal => Some(std::sync::Arc::new(Diagonal::new(white)?)),
            Precondition::Multiscale => {
                let probe = Start::default().vector(white.len());
                let mut photo = vec![0.0; white.len()];
                operator.apply(&probe, &mut photo)?;
                self.preparation = 2;
                let size = self.wish.resolution();
                let measured = Multiscale::measured(size.width, size.height, white, &probe, &photo)?;
                Some(std::sync::Arc::new(measured))
            }
        })
    }

    /// Relative residuals of all channels as one, relative to the whole wish.
    fn total(&self, residuals: impl Iterator<Item = f64>) -> f64 {
        let absolute = residuals.zip(self.b).map(|(residual, b)| match norm_of(std::slice::from_ref(b)) {
            // Of a channel without a wish the residual is absolute.
            0.0 => residual,
            length => residual * length,
        });
        absolute.map(|residual| residual * residual).sum::<f64>().sqrt() / norm_of(self.b)
    }

    /// The channels' histories as one: a channel that ended stays where it was.
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

fn photograph<O: Adjoint>(channels: &mut [O], patterns: &[Vec<f64>]) -> Result<Vec<Vec<f64>>> {
    let photo = |(operator, pattern): (&mut O, &Vec<f64>)| {
        let mut photo = vec![0.0; pattern.len()];
        operator.apply(pattern, &mut photo)?;
        Ok(photo)
    };
    channels.iter_mut().zip(patterns).map(photo).collect()
}

fn clipped(patterns: &[Vec<f64>], floor: f64) -> Vec<Vec<f64>> {
    patterns.iter().map(|plane| plane.iter().map(|value| value.clamp(floor, 1.0)).collect()).collect()
}

/// A channel that reached its tolerance says nothing of the others.
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
