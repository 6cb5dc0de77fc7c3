//! The photos of a separation, and what a simulator knows without any.

use anyhow::Result;

use super::super::console::Console;
use super::super::light::Light;
use super::super::live::Live;
use super::Args;
use super::planes::difference;
use crate::analysis::probe::{Probing, probe};
use crate::analysis::separate::{SeparateBy, Separation, separate};
use crate::image::Resolution;
use crate::operator::Operator;
use crate::report::separation::{Planes, Reach, relative_error};
use crate::sparse::Csr;
use crate::transport::{Bounces, Part};

/// One bounce, and two and more, under white.
pub(super) fn exact(light: &mut Light<'_>, console: &Console) -> Result<[Planes; 2]> {
    let mut white = |part| -> Result<Planes> {
        light.with_channels(part, console, |channels| {
            channels
                .iter_mut()
                .map(|operator| {
                    let mut photo = vec![0.0; operator.rows()];
                    operator.apply(&vec![1.0; operator.cols()], &mut photo)?;
                    Ok(photo)
                })
                .collect()
        })
    };
    Ok([white(Part::Direct)?, white(Part::Global)?])
}

/// Separates every channel; seen by `live` where these are photos of the run, and not of a comparison.
pub(super) fn measured(
    light: &mut Light<'_>,
    resolution: Resolution,
    by: SeparateBy,
    seed: u64,
    live: Option<&Live>,
    console: &Console,
) -> Result<Vec<Separation>> {
    light.with_channels(Part::Full, console, |channels| {
        let one = |operator: &mut dyn Operator| Ok(separate(operator, resolution, by, seed)?);
        match live {
            Some(live) => live.watch_all(channels).iter_mut().map(|operator| one(operator)).collect(),
            None => channels.iter_mut().map(|operator| one(operator)).collect(),
        }
    })
}

/// The second bounce, and the rest, from the layers of the matrix.
pub(super) fn bounces(light: &Light<'_>) -> Result<[Planes; 2]> {
    let Some(traced) = light.matrix() else { return Ok([Vec::new(), Vec::new()]) };
    let matrix = &traced.matrix;
    let (rows, count) = (matrix.resolution().pixels(), matrix.channels().count());
    let mut found = [Bounces::Two, Bounces::Rest].map(|_| vec![vec![0.0; rows]; count]);
    for layer in matrix.layers() {
        let planes = match layer.bounces() {
            Bounces::Two => &mut found[0],
            Bounces::Rest => &mut found[1],
            Bounces::One | Bounces::Global => continue,
        };
        for (channel, plane) in planes.iter_mut().enumerate() {
            layer.to_csr(channel)?.entries().for_each(|(row, _, weight)| plane[row] += weight);
        }
    }
    Ok(found)
}

/// Near and far indirect light, by probing what is not direct.
pub(super) fn reach(
    args: &Args,
    is_scene: bool,
    light: &mut Light<'_>,
    global: &Planes,
    live: &Live,
    console: &Console,
) -> Result<Option<Reach>> {
    let resolution = live.resolution();
    let photos = args.probes.unwrap_or(if is_scene { 100 } else { 0 });
    if photos == 0 {
        return Ok(None);
    }
    let square = light.with_operator(Part::Global, console, |operator| operator.rows() == operator.cols());
    if !square {
        console.note(
            "note: near and far indirect light are left out: projector and camera differ in their pixels",
        );
        return Ok(None);
    }
    let sigma = args.sigma.unwrap_or_else(|| (resolution.width as f64 / 16.0).max(1.0));
    let (seed, probing) = (args.trace.seed(), Probing::Near { sigma });
    live.expect(photos);
    let found = light.with_channels(Part::Global, console, |channels| {
        let one = |operator: &mut dyn Operator| probe(operator, resolution, probing, photos, seed);
        live.watch_all(channels).iter_mut().map(|operator| one(operator)).collect::<crate::Result<Vec<_>>>()
    })?;
    let near: Planes = found.iter().map(|found| found.values.clone()).collect();
    let errors: Planes = found.iter().map(|found| found.standard_errors.clone()).collect();
    let nothing = vec![vec![0.0; resolution.pixels()]; near.len()];
    let size =
        |planes: &Planes| -> f64 { planes.iter().flatten().map(|value| value * value).sum::<f64>().sqrt() };
    let error = match light.matrix() {
        Some(traced) => {
            let mut truth = nothing;
            for (channel, plane) in truth.iter_mut().enumerate() {
                weigh(&traced.matrix.to_csr(Part::Global, channel)?, resolution, probing, plane);
            }
            Some(relative_error(&near, &truth))
        }
        None => None,
    };
    Ok(Some(Reach {
        far: difference(global, &near),
        noise: size(&errors) / size(&near),
        near,
        sigma,
        photos,
        error,
    }))
}

/// `(Π ∘ A) 1`, from the matrix itself.
pub(in crate::cli) fn weigh(matrix: &Csr, resolution: Resolution, probing: Probing, sums: &mut [f64]) {
    let place = |pixel: usize| [(pixel % resolution.width) as f64, (pixel / resolution.width) as f64];
    matrix.entries().for_each(|(row, column, weight)| {
        let ([x, y], [u, v]) = (place(row), place(column));
        sums[row] += probing.weight((x - u).hypot(y - v)) * weight;
    });
}
