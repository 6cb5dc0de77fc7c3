//! More levels than the projector has: what a frame could not show is shown by the next, and the photos are added up
//! (section 7.2).
//!
//! With `δ` the widest step between levels, the first of `K` frames shows, at weight `w = 1/(1+δ)`, the level below
//! `x / w`; what is left is at most `w δ` anywhere, and is itself a pattern of that range. The last frame shows the nearest
//! level. For one bit these are the binary digits: ½, ¼, …. The error falls by `δ/(1+δ)` with each frame.
//!
//! The noise is that of `Σ w_k photo_k`. Each photo has the camera's whole read noise, whatever its weight: at equal
//! light in total, `t/K` seconds each, the standard deviation by read noise alone grows by `K √Σ w_k²`
//! ([`amplification`]) over one photo of `t`. So with little light more frames can be worse than fewer.

use super::display::{Display, Displayed};
use crate::error::Result;
use crate::transport::Part;

/// A frame and its weight in the sum.
#[derive(Clone, Debug)]
pub(super) struct BitPlane {
    pub(super) weight: f64,
    pub(super) displayed: Displayed,
}

/// The weights of `count` frames on a projector whose widest step is `step`.
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

/// By how much the standard deviation grows when one photo is divided into these, at equal light in total and read
/// noise alone.
pub fn amplification(weights: &[f64]) -> f64 {
    weights.len() as f64 * weights.iter().map(|weight| weight * weight).sum::<f64>().sqrt()
}

/// Decomposes `wish` (one plane for all channels, or one for each) into `count` frames. Frames without light are left out.
pub(super) fn decompose(
    display: &Display,
    wish: &[Vec<f64>],
    part: Part,
    count: u32,
) -> Result<Vec<BitPlane>> {
    let mut left = wish.to_vec();
    let weights = weights(count, display.widest_step());
    let mut planes = Vec::with_capacity(weights.len());
    for (index, &weight) in weights.iter().enumerate() {
        let scaled: Vec<Vec<f64>> =
            left.iter().map(|plane| plane.iter().map(|light| light / weight).collect()).collect();
        let last = index + 1 == weights.len();
        let displayed = if last { display.show(&scaled, part)? } else { display.show_below(&scaled)? };
        if !last {
            // Channels of unlike curves leave unlike remainders.
            left = displayed
                .light
                .iter()
                .enumerate()
                .map(|(channel, shown)| {
                    let wish = &left[channel.min(left.len() - 1)];
                    wish.iter().zip(shown).map(|(wish, shown)| wish - weight * shown).collect()
                })
                .collect();
        }
        if displayed.frame.levels().iter().any(|&level| level > 0) {
            planes.push(BitPlane { weight, displayed });
        }
    }
    Ok(planes)
}
