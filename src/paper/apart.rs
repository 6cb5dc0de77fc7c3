//! Light transport with camera and projector apart. Photos with the two devices exchanged give the transpose.
//!
//! If the projector is beside the camera, `A` is not symmetric, and no photo of this arrangement shows `Aᵀ`. By Helmholtz reciprocity, the
//! exchanged arrangement shows `Aᵀ`: the projector is where the camera was, and the camera is where the projector was. Each step therefore
//! takes two photos, one with each arrangement. From these photos, Golub–Kahan bidiagonalization finds the singular vectors of `A`. The
//! matrices `A Aᵀ` and `AᵀA` are symmetric. The graph of `A Aᵀ` groups the camera's pixels, and the graph of `AᵀA` the projector's. Two
//! pixels are neighbours in these graphs if the same light reaches both.
//!
//! Direct light is kept. Photos cannot separate it here, since its matrix is not diagonal. It connects no regions.
//!
//! The virtual rig cannot exchange its own devices. A second rig therefore uses the scene traced with camera and projector exchanged, by
//! other light paths. The report states how far the two traced matrices are from transposes of each other.

use super::bench::{APART, Bench, Set, Stage};
use super::check::Check;
use super::figure::{Content, Figure, Panel, Plot, Reproduced, Rig, counted};
use super::groups::{asked, labels, purity, random_labels};
use super::vectors::{minus, product, singular_triplets};
use crate::analysis::segment::segment;
use crate::analysis::{MASKED, Segmentation};
use crate::error::Result;
use crate::krylov::{Singular, SingularOptions, Start, dot, norm, singular};
use crate::operator::{Adjoint, Exchanged, Gram};
use crate::transport::Part;

const SIDE: usize = 100;
/// The largest side for which the dense decomposition of the matrix is affordable.
const DENSE: usize = 32;
const PHOTOS: usize = 50;
const COUNT: usize = 4;
const PURE: f64 = 0.99;

pub(super) fn reproduce(bench: &mut Bench) -> Result<Reproduced> {
    let (vectors, small) = singular_vectors(bench)?;
    let side = bench.side(SIDE);
    let (stage, exchanged) = (bench.stage(Set::Apart, side)?, bench.stage(Set::Exchanged, side)?);
    let mut both = arrangements(bench, &stage, &exchanged)?;
    // Each product with the matrix of the graph takes two photos.
    let of_photos = segment(&mut Gram::of_photos(&mut *both), &asked(PHOTOS / 2, &[2], stage.resolution))?;
    let of_patterns =
        segment(&mut Gram::of_patterns(&mut *both), &asked(PHOTOS / 2, &[2], exchanged.resolution))?;
    let mut checks = vectors.checks;
    for (whose, found, truth) in
        [("camera", &of_photos, &stage.truth), ("projector", &of_patterns, &exchanged.truth)]
    {
        let labels = labels(found, 2);
        checks.push(
            Check::of(format!("purity of two groups of the {whose}'s pixels, {PHOTOS} photos"))
                .at_least(purity(labels, truth), PURE)
                .refutes("random labels", purity(&random_labels(truth, 2), truth))
                .without(
                    "Without the pixels along the border of the two sheets",
                    purity(labels, &without_border(truth, side)),
                ),
        );
        let second = found.eigenvalues.get(1).copied().unwrap_or(f64::NAN);
        checks.push(
            Check::of(format!("second eigenvalue of the normalized cut, {whose}'s pixels")).stated(second),
        );
    }
    checks.push(
        Check::of(
            "the exchanged scene's matrix, traced anew, off the transpose of the first, in a random photo",
        )
        .stated(traced_apart(bench, &stage, &exchanged)?),
    );
    let mut panels = groups(&stage, &of_photos, "camera");
    panels.extend(groups(&exchanged, &of_patterns, "projector"));
    panels.extend(pictures(&small, &vectors.found));
    Ok(Reproduced {
        setting: format!(
            "zigzag with the projector {:.0} cm to the right of the camera, direct light kept, {PHOTOS} photos of which every second has the \
             devices exchanged; singular vectors at {}, groups at {}",
            100.0 * APART,
            small.resolution,
            stage.resolution,
        ),
        checks,
        panels,
        plots: vec![vectors.plot],
        photos: vectors.found.stats.products + 2 * (of_photos.photos + of_patterns.photos),
        ..Reproduced::of(Figure::Apart, bench.rig())
    })
}

/// Operators of both arrangements. An ideal rig uses a matrix and its transpose. Other rigs use two pairs of devices.
fn arrangements(bench: &mut Bench, stage: &Stage, exchanged: &Stage) -> Result<Box<dyn Adjoint>> {
    Ok(match bench.rig() {
        Rig::Ideal => Box::new(bench.truth(stage, Part::Full)?),
        Rig::Virtual => Box::new(Exchanged::in_one_unit(
            bench.photos(stage, Part::Full)?,
            bench.photos(exchanged, Part::Full)?,
        )?),
    })
}

struct Compared {
    found: Singular,
    checks: Vec<Check>,
    plot: Plot,
}

fn singular_vectors(bench: &mut Bench) -> Result<(Compared, std::sync::Arc<Stage>)> {
    let side = DENSE.min(bench.side(SIDE));
    let (stage, exchanged) = (bench.stage(Set::Apart, side)?, bench.stage(Set::Exchanged, side)?);
    let dense = singular_triplets(&bench.lab(&stage)?.matrix(Part::Full, 0)?, PHOTOS)?;
    let mut both = arrangements(bench, &stage, &exchanged)?;
    // The rig's counts for one unit of the matrix.
    let white = vec![1.0; stage.pixels()];
    let unit = stage.reading(&product(&mut *both, &white)?);
    let options = SingularOptions {
        count: COUNT,
        products: PHOTOS,
        tolerance: 0.0,
        start: Start::Given(white),
        ..SingularOptions::default()
    };
    let found = singular(&mut *both, &options)?;
    let values: Vec<f64> = found.values.iter().map(|value| value / unit).collect();
    let off = |(found, dense): (&f64, &f64)| (found - dense).abs() / dense;
    let worst = values.iter().zip(&dense.values).map(off).fold(0.0, f64::max);
    // The light of the patterns found is compared with the light of the best `COUNT` orthogonal patterns.
    let mut light = bench.truth(&stage, Part::Full)?;
    let mut carried = 0.0;
    for pattern in &found.right {
        let photo = product(&mut light, pattern)?;
        carried += dot(&photo, &photo);
    }
    let most: f64 = dense.values[..COUNT].iter().map(|value| value * value).sum();
    let overlap = |found: &[Vec<f64>], dense: &[Vec<f64>], index: usize| dot(&found[index], &dense[0]).abs();
    // The same photos of the matrix itself, which has no devices.
    let ideal = singular(&mut bench.truth(&stage, Part::Full)?, &options)?;
    let mut random = 0.0;
    for pattern in Start::default().block(stage.pixels(), COUNT) {
        let photo = product(&mut light, &super::vectors::unit(pattern))?;
        random += dot(&photo, &photo);
    }
    let even = |values: &[f64]| (values[0] - values[1]).abs() / values[1];
    let vector = |what: &str, found: [&[Vec<f64>]; 2], dense: &[Vec<f64>]| {
        Check::of(format!("overlap of the first {what}, with the dense one"))
            .at_least(overlap(found[0], dense, 0), 0.99)
            .refutes("the second one", overlap(found[0], dense, 1))
            .without_devices(overlap(found[1], dense, 0))
    };
    let checks = vec![
        Check::of(format!("error of the {COUNT} largest singular values, the worst, %"))
            .at_most(100.0 * worst, 1.0)
            .refutes("the first value in place of the second", 100.0 * even(&dense.values)),
        Check::of(format!("light of the {COUNT} patterns found, over that of the best {COUNT}"))
            .at_least(carried / most, 0.95)
            .refutes("random patterns", random / most),
        vector("right singular vector, a pattern", [&found.right, &ideal.right], &dense.right),
        vector("left singular vector, its photo", [&found.left, &ideal.left], &dense.left),
        Check::of("second singular value over the first").stated(dense.values[1] / dense.values[0]),
        Check::of("photos with the devices exchanged off the transpose of the others, on these vectors")
            .stated(found.disagreement),
    ];
    let plot = Plot::linear(
        format!("The largest singular values: those of the dense matrix, and those from {PHOTOS} photos."),
        ["singular value", "σ"],
        [("dense", counted(&dense.values[..2 * COUNT])), ("from photos", counted(&values))],
    );
    Ok((Compared { found, checks, plot }, stage))
}

/// The deviation `‖B x − Aᵀx‖ / ‖Aᵀx‖` for random signs `x`. `A` is the matrix of the scene, and `B` the matrix with the devices exchanged.
fn traced_apart(bench: &mut Bench, stage: &Stage, exchanged: &Stage) -> Result<f64> {
    let signs = Start::default().vector(stage.pixels());
    let mut transposed = signs.clone();
    bench.truth(stage, Part::Full)?.apply_adjoint(&signs, &mut transposed)?;
    let anew = product(&mut bench.truth(exchanged, Part::Full)?, &signs)?;
    Ok(norm(&minus(&transposed, &anew)) / norm(&transposed))
}

/// The true regions, without pixels that have a left or right neighbour in another region.
fn without_border(truth: &[u8], width: usize) -> Vec<u8> {
    let is_inside = |at: usize| {
        let (row, column) = (at / width * width, at % width);
        let near = column.saturating_sub(1)..=(column + 1).min(width - 1);
        near.into_iter().all(|column| truth[row + column] == truth[at])
    };
    (0..truth.len()).map(|at| if is_inside(at) { truth[at] } else { MASKED }).collect()
}

fn groups(stage: &Stage, found: &Segmentation, whose: &str) -> Vec<Panel> {
    let seen = Content::Light { values: stage.white(), white: None };
    let caption = format!("White from the other device, by the {whose}'s pixels, W/(m² sr)");
    let white = stage.panel(format!("{whose}-white"), caption, seen);
    let groups = found.labels.iter().map(|(groups, labels)| {
        let caption = format!("{groups} groups of the {whose}'s pixels");
        stage.panel(format!("{whose}-groups-{groups}"), caption, Content::Labels(labels.clone()))
    });
    std::iter::once(white).chain(groups).collect()
}

fn pictures(stage: &Stage, found: &Singular) -> Vec<Panel> {
    let two = |list: &[Vec<f64>], name: &str, what: &str| -> Vec<Panel> {
        let one = |(k, vector): (usize, &Vec<f64>)| {
            let caption = format!("{what} {}", k + 1);
            stage.panel(format!("{name}-{}", k + 1), caption, Content::Signed(vector.clone()))
        };
        list.iter().take(2).enumerate().map(one).collect()
    };
    let mut panels = two(&found.right, "right", "Right singular vector, a pattern,");
    panels.extend(two(&found.left, "left", "Left singular vector, its photo,"));
    panels
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_at_a_border_along_the_columns_are_left_out() {
        #[rustfmt::skip]
        let truth = [
            0, 0, 0, 1, 1,
            0, 0, 1, 1, 1,
        ];
        #[rustfmt::skip]
        let inside = [
            0, 0, MASKED, MASKED, 1,
            0, MASKED, MASKED, 1, 1,
        ];
        assert_eq!(without_border(&truth, 5), inside);
    }
}
