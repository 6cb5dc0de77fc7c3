//! Separation by estimating the diagonal of `A`: for coaxial pinholes the direct light, plus the global light that returns to its
//! own pixel (4 % of it in a zigzag at 64×64, most of that along the folds; less with more pixels).

use super::Separation;
use crate::analysis::LowRank;
use crate::error::{Error, Result};
use crate::krylov::diagonal;
use crate::operator::Operator;

/// Separates with `photos ≥ 2` patterns of random signs and the white one; a signed pattern is one product with `operator` (`n ×
/// n`). The result is unbiased for any scene; a pixel's variance is `Σ_{j≠i} A_ij² / photos`.
pub fn random_patterns(operator: &mut dyn Operator, photos: usize, seed: u64) -> Result<Separation> {
    let estimate = diagonal(operator, photos, seed)?;
    let mut white = vec![0.0; operator.rows()];
    operator.apply(&vec![1.0; operator.cols()], &mut white)?;
    let global = white.iter().zip(&estimate.values).map(|(white, direct)| white - direct).collect();
    Ok(Separation {
        direct: estimate.values,
        global,
        // The white photo has the noise of one photo, the direct light that of all patterns as far as they do not explain it.
        global_error: Some(estimate.standard_errors.clone()),
        standard_error: Some(estimate.standard_errors),
        photos: estimate.products + 1,
    })
}

/// Separates with the photos `W = A Q` of a Krylov process on all of the light. `Σ_k q_k ∘ W_k` is the diagonal of `A Q Qᵀ`;
/// divided by that of `Q Qᵀ`, it estimates the diagonal of `A` with no photo but the white one. It works like [`random_patterns`]
/// as far as the patterns are random between neighbouring pixels: use [`Start::Rademacher`](crate::krylov::Start). More photos
/// hardly help: at each pixel, all patterns of a process carry the signs of its start, so their errors repeat (in a room with a
/// mirror ball, a quarter of the light at 4 photos and at 128). If new photos can be taken, use [`random_patterns`].
///
/// # Errors
/// [`Error::Dimension`] if the white photo (`n`) and the model differ in size.
pub fn from_capture(model: &LowRank, white: &[f64]) -> Result<Separation> {
    let n = model.cols();
    if white.len() != n {
        return Err(Error::Dimension {
            what: "pixels of the white photo",
            expected: n.to_string(),
            found: white.len().to_string(),
        });
    }
    let (mut products, mut squares) = (vec![0.0; n], vec![0.0; n]);
    for (pattern, photo) in model.basis().iter().zip(model.photos()) {
        for i in 0..n {
            products[i] += pattern[i] * photo[i];
            squares[i] += pattern[i] * pattern[i];
        }
    }
    // A pixel that no pattern lit counts as without direct light.
    let direct: Vec<f64> =
        products.iter().zip(&squares).map(|(p, s)| if *s > 0.0 { p / s } else { 0.0 }).collect();
    let global = white.iter().zip(&direct).map(|(white, direct)| white - direct).collect();
    Ok(Separation { direct, global, standard_error: None, global_error: None, photos: model.rank() + 1 })
}
