//! Compensation for a new target on a captured scene. A model of the scene's light replaces most or all further photos.

use super::run::{Answer, Run};
use super::target::{norm_of, residual_norm};
use super::{CompensateOptions, Compensation, CompensationRow, Prior, Scene, Target, clipped};
use crate::analysis::LowRank;
use crate::analysis::planes::{difference, sum};
use crate::error::Result;
use crate::krylov::Constraint;

/// The number of products with the model for each pattern. They cost no photos.
const PRODUCTS: usize = 300;

/// If a correction leaves more than this share of the residual, no further correction follows.
const STALLED: f64 = 0.98;

/// A function that takes the photo of a pattern. Pattern and photo have one plane per channel, and the photo is without ambient light.
pub type Photograph<'a> = dyn FnMut(&[Vec<f64>]) -> Result<Vec<Vec<f64>>> + 'a;

/// Finds the pattern whose photo is `target` times the peak, with a model `Â` of the light (one model per channel). At most `corrections`
/// photos of the scene itself correct the pattern:
///
/// ```text
/// x₀ = argmin ‖b − Â x‖,   xₜ = argmin ‖(b − (A xₜ₋₁ − Â xₜ₋₁)) − Â x‖   over floor ≤ x ≤ 1
/// ```
///
/// Each correction photographs the previous pattern, and subtracts the model's error for this pattern from the target. A relative error `e`
/// of the model becomes `e^(t+1)` after `t` photos, as in iterative refinement. `photograph_it` is called at most `corrections` times. The
/// calls end earlier if a photo is hardly better than the photo before it. [`CompensateOptions::photos`] is ignored.
///
/// In the result, `observed` is the prediction of the corrected model, and `residual` follows from this prediction. `history` holds the
/// residuals of the photos, one for each pattern except the last. There is no baseline. Fails as [`compensate`](super::compensate()) or
/// `photograph_it` does.
pub fn compensate_by_model(
    model: &mut [LowRank],
    target: &Target,
    options: &CompensateOptions,
    corrections: usize,
    photograph_it: &mut Photograph<'_>,
) -> Result<Compensation> {
    options.check()?;
    let target = &target.lifted(options.lift);
    target.fits(model)?;
    let prior = Prior::default();
    let mut scene = Scene { channels: model, prior: &prior };
    let white = scene.photograph(&vec![vec![1.0; target.projector().pixels()]; scene.channels.len()])?;
    let peak = options.peak.map_or_else(|| target.default_peak(&white), Ok)?;
    let b = target.light(peak)?;
    let scale = norm_of(&b);
    let mut missed: Vec<Vec<f64>> = vec![vec![0.0; target.pixels()]; scene.channels.len()];
    let mut history: Vec<CompensationRow> = Vec::new();
    let mut stalled = false;
    loop {
        let goal = difference(&b, &missed);
        let mut run =
            Run { target, white: &white, b: &goal, options, prior: &prior, dear: false, preparation: 0 };
        let solved = run.solve(scene.channels, options.method, PRODUCTS, false)?;
        let pattern = clipped(&solved.patterns, options.floor);
        let modelled = scene.photograph(&pattern)?;
        if history.len() < corrections && !stalled {
            let photo = photograph_it(&pattern)?;
            let residual = residual_norm(&b, &photo) / scale;
            // The photos of the earlier patterns predict the photo of the last pattern well enough.
            stalled = residual <= options.rtol
                || history.last().is_some_and(|before| residual > STALLED * before.residual);
            history.push(CompensationRow { photo: history.len() + 1, residual });
            missed = difference(&photo, &modelled);
            continue;
        }
        let predicted = sum(&modelled, &missed);
        let plain = scene.photograph(&clipped(&target.dimmed(&white, peak), options.floor))?;
        let boxed = options.method.facts().constraint == Constraint::Box;
        let answer =
            Answer { target, options, peak, b: &b, pattern, observed: predicted, uncompensated: plain };
        let found = answer.of(solved)?;
        // This pattern is as good as the model allows, and further products with the model cannot improve it.
        let good = found.residual < found.uncompensated_residual && (boxed || found.good);
        // A bound for the model is none for the scene.
        return Ok(Compensation { good, photos: history.len(), history, least_residual: None, ..found });
    }
}
