//! A new target on a scene that is captured already: compensation by a model of its light, at no or few further photos.

use super::answer::Answer;
use super::run::Run;
use super::target::{norm_of, residual_norm};
use super::{CompensateOptions, Compensation, CompensationRow, Prior, Scene, Target, clipped};
use crate::analysis::LowRank;
use crate::error::Result;
use crate::krylov::Constraint;

/// Products with the model for each answer; they cost no photo.
const PRODUCTS: usize = 300;

/// A correction that leaves more than this share of the residual is the last one.
const STALLED: f64 = 0.98;

/// Takes the photo of a pattern, a plane for each channel of either, without ambient light.
pub type Photograph<'a> = dyn FnMut(&[Vec<f64>]) -> Result<Vec<Vec<f64>>> + 'a;

/// What to project so that the photo is `target` times the peak, by a model `Â` of the light (one for each channel), and corrected by at
/// most `corrections` photos of the scene itself:
///
/// ```text
/// x₀ = argmin ‖b − Â x‖,   xₜ = argmin ‖(b − (A xₜ₋₁ − Â xₜ₋₁)) − Â x‖   over floor ≤ x ≤ 1
/// ```
///
/// Each correction photographs the answer before it and takes what the model missed there off the wish: an error `e` of the model
/// leaves `e^(t+1)` after `t` photos, as iterative refinement does. `photograph_it` is never called without corrections, and no more
/// once a photo was hardly better than the one before. [`CompensateOptions::photos`] is of no account.
///
/// In the answer `observed` is what the corrected model predicts, and `residual` follows from it; `history` has what the photos
/// themselves showed, of each answer but the last. There is no baseline.
///
/// # Errors
/// As [`compensate`](super::compensate()); whatever `photograph_it` fails with.
pub fn compensate_by_model(
    model: &mut [LowRank],
    wish: &Target,
    options: &CompensateOptions,
    corrections: usize,
    photograph_it: &mut Photograph<'_>,
) -> Result<Compensation> {
    options.check()?;
    let wish = &wish.lifted(options.lift);
    wish.fits(model)?;
    let prior = Prior::default();
    let mut scene = Scene { channels: model, prior: &prior };
    let white = scene.photograph(&vec![vec![1.0; wish.pixels()]; scene.channels.len()])?;
    let peak = options.peak.map_or_else(|| wish.default_peak(&white), Ok)?;
    let b = wish.light(peak)?;
    let scale = norm_of(&b);
    let mut missed: Vec<Vec<f64>> = vec![vec![0.0; wish.pixels()]; scene.channels.len()];
    let mut history: Vec<CompensationRow> = Vec::new();
    let mut stalled = false;
    loop {
        let goal = combined(&b, &missed, |b, missed| b - missed);
        let mut run =
            Run { wish, white: &white, b: &goal, options, prior: &prior, dear: false, preparation: 0 };
        let solved = run.solve(scene.channels, options.method, PRODUCTS, false)?;
        let pattern = clipped(&solved.patterns, options.floor);
        let modelled = scene.photograph(&pattern)?;
        if history.len() < corrections && !stalled {
            let photo = photograph_it(&pattern)?;
            let residual = residual_norm(&b, &photo) / scale;
            // The last answer before the end is predicted well enough by the photos of those before it.
            stalled = residual <= options.rtol
                || history.last().is_some_and(|before| residual > STALLED * before.residual);
            history.push(CompensationRow { photo: history.len() + 1, residual });
            missed = combined(&photo, &modelled, |photo, modelled| photo - modelled);
            continue;
        }
        let predicted = combined(&modelled, &missed, |modelled, missed| modelled + missed);
        let plain = scene.photograph(&clipped(&wish.dimmed(&white, peak)?, options.floor))?;
        let boxed = options.method.facts().constraint == Constraint::Box;
        let answer =
            Answer { wish, options, peak, b: &b, pattern, observed: predicted, uncompensated: plain };
        let found = answer.of(solved)?;
        // No further photo of the model's could make it better, so this is as good as the model.
        let good = found.residual < found.uncompensated_residual && (boxed || found.good);
        return Ok(Compensation { good, photos: history.len(), history, ..found });
    }
}

fn combined(a: &[Vec<f64>], b: &[Vec<f64>], with: fn(f64, f64) -> f64) -> Vec<Vec<f64>> {
    let plane = |(a, b): (&Vec<f64>, &Vec<f64>)| a.iter().zip(b).map(|(&a, &b)| with(a, b)).collect();
    a.iter().zip(b).map(plane).collect()
}
