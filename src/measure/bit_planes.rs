//! The bit-plane stage: a pattern of more levels than the projector has, as a weighted sum of several frames
//! (O'Toole and Kutulakos, section 7.2).
//!
//! Each frame shows the quantization error of the frames before it. Let `δ` be the widest step between
//! levels. The first of `K` frames has weight `w = 1/(1+δ)` and shows the level below `x / w`. The remainder
//! is at most `w δ` at every pixel, and is a pattern of that range for the next frame. The last frame shows
//! the nearest level. For a projector of one bit these are the binary digits, with weights ½, ¼, …. The error
//! falls by `δ/(1+δ)` with each frame.
//!
//! The noise is that of `Σ w_k photo_k`. Each photo has the full read noise of the camera, whatever its
//! weight. With `K` exposures of `t/K` seconds instead of one of `t`, the standard deviation due to read
//! noise grows by the factor `K √Σ w_k²` ([`amplification`]). In little light, more frames can therefore be
//! worse than fewer.

use super::display::{Display, Displayed};
use crate::error::Result;
use crate::transport::Part;

/// A frame and its weight in the sum.
#[derive(Clone, Debug)]
pub(crate) struct BitPlane {
    pub(crate) weight: f64,
    pub(crate) displayed: Displayed,
}

/// The weights of `count` frames on a projector whose widest step between levels is `step` (levels from 0 to
/// 1).
pub fn weights(count: u32, step: f64) -> Vec<f64> {
    let mut range = 1.0;
    let mut weights: Vec<f64> = (1..count)
        .map(|_| {
            let weight = range / (1.0 + step);
            range = weight * step;
            weight
        })
        .collect();
    weights.push(range);
    weights
}

/// The factor by which the standard deviation grows when one photo is divided into frames of these weights,
/// at equal total exposure and with read noise alone.
pub fn amplification(weights: &[f64]) -> f64 {
    weights.len() as f64 * weights.iter().map(|weight| weight * weight).sum::<f64>().sqrt()
}

/// Decomposes the pattern `target` into `count` frames. It has one plane for all channels, or one plane per
/// channel. Frames without light are left out.
pub(crate) fn decompose(
    display: &Display,
    target: &[Vec<f64>],
    part: Part,
    count: u32,
) -> Result<Vec<BitPlane>> {
    let mut left = target.to_vec();
    let weights = weights(count, display.widest_step());
    let mut planes = Vec::with_capacity(weights.len());
    for (index, &weight) in weights.iter().enumerate() {
        let scaled: Vec<Vec<f64>> =
            left.iter().map(|plane| plane.iter().map(|light| light / weight).collect()).collect();
        let last = index + 1 == weights.len();
        let displayed = if last { display.show(&scaled, part)? } else { display.show_below(&scaled)? };
        if !last {
            // Channels with different response curves leave different remainders.
            left = displayed
                .light
                .iter()
                .enumerate()
                .map(|(channel, shown)| {
                    let target = &left[channel.min(left.len() - 1)];
                    target.iter().zip(shown).map(|(target, shown)| target - weight * shown).collect()
                })
                .collect();
        }
        if displayed.frame.levels().iter().any(|&level| level > 0) {
            planes.push(BitPlane { weight, displayed });
        }
    }
    Ok(planes)
}
