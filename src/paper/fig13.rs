//! Figure 13: a sinusoid from a binary projector, as a threshold and as bit planes, and the noise of photos with small weights.
//!
//! Every frame is black and white. Our weights are 1/2, 1/4, and so on, the last one twice. Section 7.2 of the paper gives none.

use super::bench::{Bench, Set, Stage};
use super::check::Check;
use super::figure::{Content, Figure, Panel, Plot, Points, Reproduced, Rig};
use super::vectors::{add, minus, product};
use crate::error::Result;
use crate::krylov::norm;
use crate::measure::bit_plane_weights;
use crate::operator::Operator;
use crate::transport::Part;

const SIDE: usize = 100;
/// The number of bit planes of the displayed result.
const PLANES: u32 = 8;
/// The largest number of bit planes in the curves. The smallest is 1.
const MOST: u32 = 10;
const PERIODS: f64 = 4.0;
/// The exposure of all planes together in dim light, in seconds. White then fills a hundredth of what it fills in its own exposure (0.1 s).
const DIM: f64 = 1e-3;

pub(super) fn reproduce(bench: &mut Bench) -> Result<Reproduced> {
    let side = bench.side(SIDE);
    let stage = bench.stage(Set::Corner, side)?;
    let pattern = sinusoid(side);
    let truth = stage.photo(&pattern);
    let off = |photo: &[f64]| norm(&minus(photo, &truth)) / norm(&truth);

    let photos = &mut bench.photos(&stage, Part::Full)?;
    let white = vec![1.0; stage.pixels()];
    let unit = stage.reading(&product(photos, &white)?);
    let mut take = |planes: u32| summed(photos, &planes_of(&pattern, planes), unit);
    let (plain, decomposed) = (take(1)?, take(PLANES)?);
    let mut bright = Points::new();
    for planes in 1..=MOST {
        bright.push((f64::from(planes), off(&take(planes)?)));
    }
    let mut checks = vec![
        Check::of("error of the photo by 8 bit planes over that of plain one bit")
            .at_most(off(&decomposed) / off(&plain), 0.05)
            .refutes(
                "the same frames with equal weights",
                off(&equally(photos, &pattern, unit, &truth)?) / off(&plain),
            ),
        Check::of("error of plain one bit, %").stated(100.0 * off(&plain)),
        Check::of("error by 8 bit planes, %").stated(100.0 * off(&decomposed)),
    ];
    let mut lines = vec![("bright", bright)];
    if bench.rig() == Rig::Virtual {
        let dim = Dim::of(bench, &stage, (&pattern, unit), &off)?;
        let rise = |curve: &Points| {
            let least = curve.iter().map(|(_, error)| *error).fold(f64::INFINITY, f64::min);
            curve.last().map_or(f64::NAN, |(_, error)| error / least)
        };
        checks.extend([
            Check::of("dim: light of the photo of the smallest weight over the noise of the photo of the largest weight, both weighted, 8 planes")
                .at_most(dim.last_over_first, 1.0)
                .refutes("equal weights", dim.unweighted),
            Check::of(format!("dim: error by {MOST} bit planes over that of the best number of planes, at equal light in total"))
                .at_least(rise(&dim.curve), 1.2)
                .refutes("bright light", rise(&lines[0].1)),
        ]);
        lines.push(("dim", dim.curve));
    }
    Ok(Reproduced {
        setting: format!("corner, {}, black and white frames, {PLANES} bit planes", stage.resolution),
        checks,
        panels: panels(&stage, &pattern, &truth, &plain, &decomposed),
        plots: vec![Plot::logarithmic(
            "Relative error of the photo of a sinusoid. In dim light (virtual rig alone) each photo adds its noise, and more bit planes are worse \
             than fewer.",
            ["bit planes", "relative error"],
            lines,
        )],
        photos: 1 + PLANES as usize,
        ..Reproduced::of(Figure::Fig13, bench.rig())
    })
}

/// Photos in dim light, at equal exposure of all planes together.
struct Dim {
    /// The relative error for each number of planes.
    curve: Points,
    /// The light of the last photo over the noise of the first photo, with their weights and without.
    last_over_first: f64,
    unweighted: f64,
}

impl Dim {
    fn of(
        bench: &mut Bench,
        stage: &Stage,
        (pattern, unit): (&[f64], f64),
        off: &dyn Fn(&[f64]) -> f64,
    ) -> Result<Self> {
        let mut curve = Points::new();
        let (mut last_over_first, mut unweighted) = (f64::NAN, f64::NAN);
        for planes in 1..=MOST {
            let photos = &mut bench.photos_exposed(stage, DIM / f64::from(planes))?;
            let frames = planes_of(pattern, planes);
            curve.push((f64::from(planes), off(&summed(photos, &frames, unit)?)));
            if planes == PLANES
                && let (Some((large, first)), Some((small, last))) = (frames.first(), frames.last())
            {
                let seen: Vec<f64> = product(photos, first)?.into_iter().map(|value| value / unit).collect();
                let noise = norm(&minus(&seen, &stage.photo(first)));
                unweighted = norm(&stage.photo(last)) / noise;
                last_over_first = unweighted * small / large;
            }
        }
        Ok(Self { curve, last_over_first, unweighted })
    }
}

/// The binary frames of `pattern` (values in [0, 1]) and their weights: each frame but the last has the pixels whose remainder is at least
/// its weight, and the last one is rounded.
fn planes_of(pattern: &[f64], count: u32) -> Vec<(f64, Vec<f64>)> {
    let mut left = pattern.to_vec();
    let weights = bit_plane_weights(count, 1.0);
    let last = weights.len() - 1;
    let frame = |(index, weight): (usize, f64)| {
        let threshold = if index == last { 0.5 * weight } else { weight };
        let frame: Vec<f64> = left.iter().map(|left| f64::from(u8::from(*left >= threshold))).collect();
        add(&mut left, -weight, &frame);
        (weight, frame)
    };
    weights.into_iter().enumerate().map(frame).collect()
}

/// The weighted sum of the frames' photos, in W/(m² sr).
fn summed(photos: &mut dyn Operator, frames: &[(f64, Vec<f64>)], unit: f64) -> Result<Vec<f64>> {
    let mut sum = vec![0.0; photos.rows()];
    for (weight, frame) in frames {
        add(&mut sum, weight / unit, &product(photos, frame)?);
    }
    Ok(sum)
}

/// A wrong answer: the sum of the photos with equal weights, scaled to the norm of the right photo.
fn equally(photos: &mut dyn Operator, pattern: &[f64], unit: f64, truth: &[f64]) -> Result<Vec<f64>> {
    let frames: Vec<_> = planes_of(pattern, PLANES).into_iter().map(|(_, frame)| (1.0, frame)).collect();
    let mut sum = summed(photos, &frames, unit)?;
    let scale = norm(truth) / norm(&sum);
    sum.iter_mut().for_each(|value| *value *= scale);
    Ok(sum)
}

/// `½ + ½ sin` along the rows.
fn sinusoid(side: usize) -> Vec<f64> {
    let value = |pixel: usize| {
        let x = ((pixel % side) as f64 + 0.5) / side as f64;
        0.5 + 0.5 * (std::f64::consts::TAU * PERIODS * x).sin()
    };
    (0..side * side).map(value).collect()
}

fn panels(stage: &Stage, pattern: &[f64], truth: &[f64], plain: &[f64], decomposed: &[f64]) -> Vec<Panel> {
    let white = truth.iter().copied().fold(0.0, f64::max);
    let shown = Content::Light { values: pattern.to_vec(), white: Some(1.0) };
    let light = |values: &[f64]| Content::Light { values: values.to_vec(), white: Some(white) };
    let less = |photo: &[f64]| Content::Signed(minus(photo, truth));
    vec![
        stage.panel("pattern", "What is to be projected, 0 to 1", shown),
        stage.panel("truth", "Its photo, W/(m² sr)", light(truth)),
        stage.panel("plain", "One bit: the threshold", light(plain)),
        stage.panel("decomposed", "In 8 bit planes", light(decomposed)),
        stage.panel("error-plain", "One bit less truth, W/(m² sr)", less(plain)),
        stage.panel("error-decomposed", "8 bit planes less truth, W/(m² sr)", less(decomposed)),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weighted_frames_add_up_to_the_pattern_within_half_of_the_last_weight() {
        let pattern: Vec<f64> = (0..=1000).map(|step| f64::from(step) / 1000.0).collect();
        for planes in [1, 2, 5, 8] {
            let frames = planes_of(&pattern, planes);
            let mut sum = vec![0.0; pattern.len()];
            frames.iter().for_each(|(weight, frame)| add(&mut sum, *weight, frame));
            assert!(frames.iter().all(|(_, frame)| frame.iter().all(|value| [0.0, 1.0].contains(value))));
            // The weights add up to 1, so a pattern of 1 has all frames lit.
            let most = 0.5 * frames[frames.len() - 1].0 + 1e-12;
            assert!(sum.iter().zip(&pattern).all(|(sum, value)| (sum - value).abs() <= most), "{planes}");
        }
    }
}
