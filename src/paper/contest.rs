//! Compensation as the paper's figures show it: the recipe that clamps, the methods inside the box, and the optimum, at
//! equal numbers of photos.

use std::ops::ControlFlow;
use std::sync::Arc;

use super::bench::Bench;
use super::figure::{Curve, Shot};
use super::stage::Stage;
use crate::analysis::compensate::Mixture;
use crate::error::Result;
use crate::krylov::{Diagonal, Method, SolveOptions, dot, norm, solve_adjoint};
use crate::observer::{Estimate, OnStep, Step};
use crate::operator::{Adjoint, Observed, Operator, Recorded, Symmetry};
use crate::transport::Part;

/// What is wished on a scene, in W/(m² sr), and the photo under white that says how much there is.
pub(super) struct Wish {
    pub(super) light: Vec<f64>,
    pub(super) peak: f64,
    white: Vec<f64>,
    /// What the rig reads for 1 W/(m² sr), told by the white photo.
    unit: f64,
}

impl Wish {
    /// `target` (in [0, 1]) times half the median of the white photo: all but the brightest parts can be had.
    pub(super) fn new(stage: &Stage, operator: &mut dyn Adjoint, target: &[f64]) -> Result<Self> {
        let mut white = vec![0.0; target.len()];
        operator.apply(&vec![1.0; target.len()], &mut white)?;
        let truth = stage.photo(&vec![1.0; target.len()]);
        let unit = white.iter().sum::<f64>() / truth.iter().sum::<f64>();
        let mut sorted = truth;
        sorted.sort_by(f64::total_cmp);
        let peak = 0.5 * sorted.get(sorted.len() / 2).copied().unwrap_or(0.0);
        Ok(Self { light: target.iter().map(|value| peak * value).collect(), peak, white, unit })
    }

    /// `‖b − A x‖ / ‖b‖` by the light itself, whatever the rig measured.
    pub(super) fn residual(&self, stage: &Stage, pattern: &[f64]) -> f64 {
        let seen = stage.photo(pattern);
        let misfit: Vec<f64> = self.light.iter().zip(&seen).map(|(b, y)| b - y).collect();
        norm(&misfit) / norm(&self.light)
    }

    fn options(&self, method: Method, photos: usize) -> Result<SolveOptions> {
        let boxed = method.facts().constraint == crate::krylov::Constraint::Box;
        Ok(SolveOptions {
            products: photos,
            rtol: 0.0,
            diagonal: boxed.then(|| self.white.clone()),
            ..SolveOptions::default()
        })
    }
}

/// A method's run.
pub(super) struct Entry {
    /// For each photo from the first: the residual of what the method answers, …
    pub(super) answered: Vec<f64>,
    /// … and of that answer clamped to [0, 1], as a projector shows it.
    pub(super) displayed: Vec<f64>,
    /// The last answer.
    pub(super) pattern: Vec<f64>,
    /// The photos, in order.
    pub(super) shots: Vec<Shot>,
}

impl Entry {
    /// The residual displayed after so many photos: the last there is, where the method ended before.
    pub(super) fn displayed_at(&self, photos: usize) -> f64 {
        at(&self.displayed, photos)
    }

    /// The same, before anything is clamped.
    pub(super) fn answered_at(&self, photos: usize) -> f64 {
        at(&self.answered, photos)
    }
}

fn at(residuals: &[f64], photos: usize) -> f64 {
    residuals.get(photos - 1).or(residuals.last()).copied().unwrap_or(f64::NAN)
}

/// Lets `method` take `photos` photos, and notes what its answer is worth after each.
pub(super) fn enter(
    stage: &Stage,
    operator: &mut dyn Adjoint,
    wish: &Wish,
    (method, scaled): (Method, bool),
    photos: usize,
) -> Result<Entry> {
    let mut options = wish.options(method, photos)?;
    if scaled {
        // Dark pixels are known by noise only.
        let floor = 1e-3 * wish.white.iter().copied().fold(0.0, f64::max);
        let white = wish.white.iter().map(|value| value.max(floor)).collect();
        options.preconditioner = Some(Arc::new(Diagonal::new(white)?));
    }
    let blurred = stage.out_of_focus || operator.symmetry() != Symmetry::Symmetric;
    if method == Method::KrylovBox && blurred {
        options.surrogate = Some(Arc::new(Mixture::new(stage.resolution, &wish.white)));
    }
    let mut entry =
        Entry { answered: Vec::new(), displayed: Vec::new(), pattern: Vec::new(), shots: Vec::new() };
    let mut recorded = Recorded::new(operator);
    let observer = OnStep::new(|step: &Step<'_>| {
        let Estimate::Solution { iterate, .. } = step.estimate else { return ControlFlow::Continue(()) };
        let answer = iterate();
        // A step may take no photo, and a photo may be two steps' in a method of pairs.
        while (entry.answered.len() as u64) < step.done {
            entry.answered.push(wish.residual(stage, &answer));
            entry.displayed.push(wish.residual(stage, &clamped(&answer)));
        }
        ControlFlow::Continue(())
    });
    let wanted: Vec<f64> = wish.light.iter().map(|light| wish.unit * light).collect();
    let found = solve_adjoint(method, &mut Observed::new(&mut recorded, &observer), &wanted, &options)?;
    entry.pattern = found.x;
    entry.shots = recorded.products.into_iter().map(Shot::from).collect();
    Ok(entry)
}

/// What the figures of compensation hold against each other: methods at equal photos, doing nothing, and the best there is.
pub(super) struct Contest {
    pub(super) wish: Wish,
    /// A Krylov method, whose answer is clamped in the end: the paper's way.
    pub(super) recipe: Entry,
    /// The same scaled by the white photo.
    pub(super) scaled: Entry,
    pub(super) boxed: Entry,
    pub(super) jacobi: Entry,
    /// See [`optimum`].
    pub(super) bound: f64,
    pub(super) optimum: f64,
    /// The picture itself as a pattern, and its residual.
    pub(super) plain: Vec<f64>,
    pub(super) uncompensated: f64,
}

impl Contest {
    /// Each method takes `photos` photos beside the white one; the optimum, which no rig has to take, `products`.
    pub(super) fn hold(
        bench: &mut Bench,
        stage: &Arc<Stage>,
        target: &[f64],
        recipe: Method,
        photos: usize,
        products: usize,
    ) -> Result<Self> {
        let (wish, [recipe, scaled, boxed, jacobi]) = bench.with_rig(stage, Part::Full, |operator| {
            let wish = Wish::new(stage, operator, target)?;
            let mut enter = |method| enter(stage, operator, &wish, method, photos);
            let entries = [
                enter((recipe, false))?,
                enter((recipe, true))?,
                enter((Method::KrylovBox, false))?,
                enter((Method::Jacobi, false))?,
            ];
            Ok((wish, entries))
        })?;
        let (bound, optimum) = optimum(stage, &wish, products)?;
        let plain = clamped(&target.iter().map(|value| 0.5 * value).collect::<Vec<_>>());
        let uncompensated = wish.residual(stage, &plain);
        Ok(Self { wish, recipe, scaled, boxed, jacobi, bound, optimum, plain, uncompensated })
    }
}

/// What a projector makes of a pattern.
pub(super) fn clamped(pattern: &[f64]) -> Vec<f64> {
    pattern.iter().map(|value| value.clamp(0.0, 1.0)).collect()
}

/// No pattern in [0, 1] has a smaller relative residual than the first number; the second is one that a pattern has.
///
/// By convexity `½‖b − A z‖² ≥ ½‖r‖² + (Aᵀr)ᵀ(x − z)`, whose least over the box is a sum over pixels (the gap of Frank and
/// Wolfe); `x` is by accelerated gradients, and how good it is matters only to how sharp the bound is.
pub(super) fn optimum(stage: &Stage, wish: &Wish, products: usize) -> Result<(f64, f64)> {
    let operator = &mut stage.ideal(Part::Full);
    let mut options = wish.options(Method::Fista, products)?;
    options.diagonal = Some(stage.photo(&vec![1.0; stage.pixels()]));
    let x = solve_adjoint(Method::Fista, operator, &wish.light, &options)?.x;
    let (mut seen, mut gradient) = (vec![0.0; x.len()], vec![0.0; x.len()]);
    operator.apply(&x, &mut seen)?;
    let misfit: Vec<f64> = wish.light.iter().zip(&seen).map(|(b, y)| b - y).collect();
    operator.apply_adjoint(&misfit, &mut gradient)?;
    let gap: f64 = x.iter().zip(&gradient).map(|(x, g)| if *g > 0.0 { g * (1.0 - x) } else { -g * x }).sum();
    let square = dot(&misfit, &misfit);
    let scale = norm(&wish.light);
    Ok(((square - 2.0 * gap).max(0.0).sqrt() / scale, square.sqrt() / scale))
}

/// A line of residuals over photos.
pub(super) fn line(name: &str, residuals: &[f64]) -> Curve {
    let points = residuals.iter().enumerate().map(|(index, &residual)| (index as f64 + 1.0, residual));
    Curve { name: name.into(), points: points.collect() }
}
