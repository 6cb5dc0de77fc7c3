//! Figure 2: the principal eigenvector by optical power iteration.
//!
//! A glossy sheet that is bent into a trough has one specular spot, and the photos converge to it. The ratio of the two largest eigenvalues
//! determines the speed: `tan θ_k ≤ (λ₂/λ₁)^k tan θ_0` for the angle `θ_k` to the principal eigenvector. The Krylov subspace of the same
//! photos contains a far better vector.

use super::bench::{Bench, Set, Stage};
use super::check::Check;
use super::figure::{Content, Figure, Panel, Plot, Points, Reproduced, counted};
use super::vectors::{Spectrum, overlap, product, spectrum, unit};
use crate::error::Result;
use crate::image::Resolution;
use crate::krylov::{EigsMethod, EigsOptions, Factorization, Start, Which, dot, eigs};
use crate::operator::{Adjoint, Operator, Recorded};
use crate::transport::Part;

const SIDE: usize = 100;
/// The pixels per side for the dense eigensolver, which then has 1024 unknowns.
const DENSE_SIDE: usize = 32;
const PHOTOS: usize = 50;
const ALIKE: f64 = 0.999;
/// The largest fraction of the pixels that counts as a spot.
const SPOT: f64 = 1e-3;
/// The largest number of products with the matrix itself, in the search for the number of photos needed.
const MOST: usize = 5000;
const SHOWN: [usize; 4] = [1, 5, 15, 50];

pub(super) fn reproduce(bench: &mut Bench) -> Result<Reproduced> {
    let small = bench.stage(Set::GlossySheet, DENSE_SIDE.min(bench.side(SIDE)))?;
    let exact = spectrum(&small.traced.matrix.to_csr(Part::Full, 0)?)?;
    let from_small = iterate(&mut bench.photos(&small, Part::Full)?)?;

    let stage = bench.stage(Set::GlossySheet, bench.side(SIDE))?;
    let truth = &mut bench.truth(&stage, Part::Full)?;
    let leading = leading(truth)?;
    let reference = &leading.vectors[0];
    let patterns = iterate(&mut bench.photos(&stage, Part::Full)?)?;
    let krylov = lanczos(&mut bench.photos(&stage, Part::Full)?, reference)?;
    let speed = Speed::of(&leading.values, stage.pixels(), reference);
    let needed = photos_needed(truth, reference)?;
    let vector = last(&patterns);
    let first = patterns.first().map_or(&[][..], Vec::as_slice);
    // The same numbers of the matrix itself, which has no devices.
    let ideal = iterate(truth)?;
    let small_ideal = iterate(&mut bench.truth(&small, Part::Full)?)?;
    let highlight = brightest(&stage.white());
    let far = |pattern: &[f64]| distance(stage.resolution, brightest(pattern), highlight);
    let lowest = |pattern: &[f64]| pattern.iter().copied().fold(0.0, f64::min) / largest(pattern);
    let matte = bench.stage(Set::MatteSheet, bench.side(SIDE))?;
    let checks = vec![
        Check::of(format!(
            "effective number of pixels of the pattern after {PHOTOS} photos, of {}",
            stage.pixels()
        ))
        .at_most(sharing(vector), (SPOT * stage.pixels() as f64).max(1.5))
        .refutes("the first photo", sharing(first))
        .without_devices(sharing(last(&ideal))),
        Check::of("distance of its brightest pixel from the specular spot of the white photo, in pixels")
            .at_most(far(vector), 1.0)
            .refutes(
                "the brightest pixel of the sheet without gloss",
                distance(stage.resolution, brightest(&matte.white()), highlight),
            ),
        Check::of(format!("overlap with the dense eigenvector, {}", small.resolution))
            .at_least(overlap(last(&from_small), &exact.vectors[0]), ALIKE)
            .refutes("the second eigenvector", overlap(&exact.vectors[1], &exact.vectors[0]))
            .without_devices(overlap(last(&small_ideal), &exact.vectors[0])),
        Check::of(format!("overlap with the eigenvector by 400 Lanczos steps, {}", stage.resolution))
            .at_least(overlap(vector, reference), ALIKE)
            .refutes("the first photo", overlap(first, reference))
            .without_devices(overlap(last(&ideal), reference)),
        Check::of("overlap of the best vector of the Krylov space of as many photos")
            .at_least(krylov.last().map_or(f64::NAN, |apart| 1.0 - apart), ALIKE)
            .refutes("the second eigenvector", overlap(&leading.vectors[1], reference))
            .without_devices(lanczos(truth, reference)?.last().map_or(f64::NAN, |apart| 1.0 - apart)),
        Check::of("least entry of the pattern over its largest")
            .at_least(lowest(vector), -0.01)
            .refutes("random signs", lowest(&Start::default().vector(stage.pixels())))
            .without_devices(lowest(last(&ideal))),
        Check::of("second eigenvalue over the first").stated(speed.ratio),
        Check::of("photos needed according to that ratio").stated(speed.photos),
        Check::of("products with the matrix itself needed").stated(needed as f64),
    ];
    let power: Vec<f64> = patterns.iter().map(|x| 1.0 - overlap(x, reference)).collect();
    Ok(Reproduced {
        setting: format!(
            "a glossy sheet that is bent into a trough, {}, {PHOTOS} photos from white",
            stage.resolution
        ),
        checks,
        panels: panels(&stage, &patterns, reference),
        plots: vec![plot([&power, &krylov].map(|apart| counted(apart)))],
        photos: PHOTOS,
        ..Reproduced::of(Figure::Fig2, bench.rig())
    })
}

struct Speed {
    /// The second eigenvalue divided by the first.
    ratio: f64,
    /// The number of photos from white until the overlap is as required, predicted from the ratio.
    photos: f64,
}

impl Speed {
    /// The speed of power iteration from white, for the leading eigenvalues and the principal eigenvector of `pixels` pixels.
    fn of(values: &[f64], pixels: usize, principal: &[f64]) -> Self {
        let ratio = values[1] / values[0];
        let from = overlap(principal, &vec![1.0; pixels]).acos().tan();
        Self { ratio, photos: (from / ALIKE.acos().tan()).ln() / -ratio.ln() }
    }
}

/// The pattern after each photo, by Algorithm 1 in section 4 of the paper. As in figure 2, the first pattern is white.
fn iterate(operator: &mut dyn Adjoint) -> Result<Vec<Vec<f64>>> {
    let n = operator.cols();
    let mut recorded = Recorded::new(operator);
    let options = EigsOptions {
        count: 1,
        which: Which::LargestMagnitude,
        products: PHOTOS,
        tolerance: 0.0,
        method: EigsMethod::Power,
        start: Start::Given(vec![1.0; n]),
        ..EigsOptions::default()
    };
    eigs(&mut recorded, &options)?;
    Ok(recorded.products.into_iter().map(|product| unit(product.to)).collect())
}

fn last(patterns: &[Vec<f64>]) -> &[f64] {
    patterns.last().map_or(&[], Vec::as_slice)
}

/// One minus the overlap of the leading Ritz vector with the reference, after each photo of a Lanczos process from white.
fn lanczos(operator: &mut dyn Operator, reference: &[f64]) -> Result<Vec<f64>> {
    let mut process = Factorization::lanczos(&vec![1.0; operator.cols()], &[])?;
    let mut apart = Vec::new();
    for _ in 0..PHOTOS {
        process.expand(operator)?;
        let pairs = process.ritz(Which::LargestMagnitude, 1)?;
        apart.extend(pairs.first().map(|pair| 1.0 - overlap(&process.ritz_vector(pair), reference)));
    }
    Ok(apart)
}

/// The two leading eigenpairs by Lanczos on the matrix itself, run to convergence.
fn leading(operator: &mut dyn Operator) -> Result<Spectrum> {
    let options = EigsOptions { count: 2, products: 400, tolerance: 1e-12, ..EigsOptions::default() };
    let found = eigs(operator, &options)?;
    Ok(Spectrum { values: found.values, vectors: found.vectors })
}

/// The number of products of power iteration from white until the overlap is as required.
fn photos_needed(operator: &mut dyn Operator, reference: &[f64]) -> Result<usize> {
    let mut x = vec![1.0; operator.cols()];
    for photos in 1..=MOST {
        x = unit(product(operator, &x)?);
        if overlap(&x, reference) >= ALIKE {
            return Ok(photos);
        }
    }
    Ok(MOST)
}

/// The index of the largest entry.
fn brightest(pattern: &[f64]) -> usize {
    pattern.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1)).map_or(0, |(pixel, _)| pixel)
}

fn distance(resolution: Resolution, a: usize, b: usize) -> f64 {
    let apart =
        |of: fn(usize, usize) -> usize| of(a, resolution.width).abs_diff(of(b, resolution.width)) as f64;
    apart(|pixel, width| pixel % width).hypot(apart(|pixel, width| pixel / width))
}

/// The largest absolute entry.
fn largest(pattern: &[f64]) -> f64 {
    pattern.iter().fold(0.0, |most: f64, value| most.max(value.abs()))
}

/// The effective number of pixels of a pattern, `(Σ x²)² / Σ x⁴`: 1 for a single pixel, and all pixels for an even pattern.
fn sharing(pattern: &[f64]) -> f64 {
    let squares: Vec<f64> = pattern.iter().map(|value| value * value).collect();
    squares.iter().sum::<f64>().powi(2) / dot(&squares, &squares)
}

fn plot([power, krylov]: [Points; 2]) -> Plot {
    let caption = "How far the pattern is from the principal eigenvector (one minus overlap), and how far the best vector of the Krylov \
                  space of as many photos is.";
    let lines = [("power iteration", power), ("Krylov space", krylov)];
    Plot::logarithmic(caption, ["photos", "1 − overlap"], lines).marked(1.0 - ALIKE, "wanted")
}

fn panels(stage: &Stage, patterns: &[Vec<f64>], reference: &[f64]) -> Vec<Panel> {
    let mut panels = vec![stage.white_panel()];
    for photos in SHOWN {
        if let Some(pattern) = patterns.get(photos - 1) {
            let caption = format!("The pattern after {photos} photo{}", if photos == 1 { "" } else { "s" });
            panels.push(stage.panel(format!("power-{photos}"), caption, as_light(pattern)));
        }
    }
    panels.push(stage.panel("reference", "The principal eigenvector", as_light(reference)));
    panels
}

fn as_light(pattern: &[f64]) -> Content {
    let white = pattern.iter().copied().fold(0.0, f64::max);
    Content::Light { values: pattern.iter().map(|value| value.max(0.0)).collect(), white: Some(white) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_pixel_shares_its_light_with_none_and_an_even_pattern_with_all() {
        assert_eq!(sharing(&[0.0, 3.0, 0.0, 0.0]), 1.0);
        assert_eq!(sharing(&[2.0; 4]), 4.0);
    }

    #[test]
    fn the_ratio_of_eigenvalues_tells_the_photos_needed() {
        // For diag(1, ½) from (1, 1), tan θ is 1 and halves with each photo. It reaches tan arccos 0.999 = 0.0447 between 2^-4 and 2^-5.
        let speed = Speed::of(&[1.0, 0.5], 2, &[1.0, 0.0]);
        assert!((4.0..5.0).contains(&speed.photos), "{}", speed.photos);
    }
}
