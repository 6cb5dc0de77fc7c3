//! Another target for a scene that is captured already: the pattern from a model at no photo, made better by a few.

use super::{CompensateOptions, Compensation, Prior, Wish, compensate, compensate_with};
use crate::analysis::LowRank;
use crate::error::Result;
use crate::krylov::{SolveMonitor, keep_solving};
use crate::operator::Adjoint;

/// Products with the model, none of which is a photo.
const MODEL_PRODUCTS: usize = 60;

/// Solves for `wish` on `models` of the channels (by [`low_rank::capture`](crate::analysis::low_rank::capture())), takes that pattern
/// to the scene itself, and lets the method go on from there for `photos` photos. The first of these shows the pattern: with 1 the answer
/// is the model's, and its residual is true. The white photo, of which the capture has one, is not counted as another.
///
/// A model of few photos is exact for smooth patterns and lacks fine detail of indirect light, of which there is little; its
/// direct light should be known ([`LowRank`] with a direct image).
///
/// # Errors
/// As [`compensate`].
pub fn retarget<O: Adjoint>(
    models: &mut [LowRank],
    channels: &mut [O],
    wish: &Wish,
    options: &CompensateOptions,
    photos: usize,
    monitor: &mut SolveMonitor<'_>,
) -> Result<Compensation> {
    let free = CompensateOptions { photos: MODEL_PRODUCTS, baseline: false, ..*options };
    let guess = compensate(models, wish, &free, &mut keep_solving)?;
    let start = (0..guess.pattern.channels()).map(|channel| guess.pattern.plane(channel)).collect();
    let prior = Prior { start: Some(start), ..Prior::default() };
    let on_scene = CompensateOptions { photos, peak: Some(guess.peak), ..*options };
    let found = compensate_with(channels, wish, &on_scene, &prior, monitor)?;
    Ok(Compensation { preparation: found.preparation - 1, ..found })
}
