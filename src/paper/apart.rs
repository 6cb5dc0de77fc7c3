//! Camera and projector apart: the transpose is photographed with the two exchanged.
//!
//! With the projector beside the camera `A` is not symmetric, and no photo of that arrangement is one of `Aᵀ`. By Helmholtz reciprocity the
//! exchanged arrangement photographs it: a projector where the camera was, and a camera where the projector was. So each step takes two photos,
//! one of either. Golub–Kahan bidiagonalization finds the singular vectors of `A` from them. `A Aᵀ` and `AᵀA` are symmetric, and pixels are
//! grouped by their graphs: those of the camera by the first, those of the projector by the second. Two pixels are neighbours in these graphs
//! where the same light reaches both.
//!
//! Direct light is kept: it is on no diagonal here, so that no photo tells it apart. It connects no regions.
//!
//! The virtual rig cannot exchange its devices by itself: a second one stands in front of the scene as traced with camera and projector
//! exchanged, by light paths of its own. How far the two traced scenes are from transposes of each other is stated.

use super::bench::{APART, Bench, Set, Stage};
use super::dense::{SingularTriplets, singular_triplets};
use super::figure::{Check, Content, Figure, Panel, Plot, Reproduced, Rig};
use super::groups::purity;
use crate::analysis::segment::segment;
use crate::analysis::{MASKED, SegmentOptions, Segmentation};
use crate::error::Result;
use crate::krylov::{Singular, SingularOptions, Start, dot, norm, singular};
use crate::operator::{Adjoint, Exchanged, Gram, Operator};
use crate::report::plot::{LinePlot, Series};
use crate::transport::Part;

const SIDE: usize = 100;
/// The side at which the dense decomposition of the matrix is affordable.
const DENSE: usize = 32;
/// Photos of either arrangement together.
const PHOTOS: usize = 50;
const COUNT: usize = 4;
const PURE: f64 = 0.99;

pub(super) fn reproduce(bench: &mut Bench) -> Result<Reproduced> {
    let (vectors, small) = singular_vectors(bench)?;
    let side = bench.side(SIDE);
    let (stage, exchanged) = (bench.stage(Set::Apart, side)?, bench.stage(Set::Exchanged, side)?);
    let mut both = arrangements(bench, &stage, &exchanged)?;
    let of_photos = segment(&mut Gram::of_photos(&mut *both), &asked(&stage))?;
    let of_patterns = segment(&mut Gram::of_patterns(&mut *both), &asked(&exchanged))?;
    let mut checks = vectors.checks;
    for (whose, found, truth) in
        [("camera", &of_photos, &stage.truth), ("projector", &of_patterns, &exchanged.truth)]
    {
        let labels = found.labels.first().map_or(&[][..], |(_, labels)| labels);
        let inside = purity(labels, &without_border(truth, side));
        checks.push(
            Check::at_least(
                format!("purity of two groups of the {whose}'s pixels, {PHOTOS} photos"),
                purity(labels, truth),
                PURE,
            )
            .because(format!(
                "The {whose}'s pixels are the cause: the border of the two sheets runs through a column of them, which sees both and is in either \
                 group by right. Without the pixels at the border the purity is {inside:.4}."
            )),
        );
        let second = found.eigenvalues.get(1).copied().unwrap_or(f64::NAN);
        checks.push(Check::stated(
            format!("second eigenvalue of the normalized cut, {whose}'s pixels"),
            second,
        ));
    }
    checks.push(Check::stated(
        "the exchanged scene's matrix, traced anew, off the transpose of the first, in a random photo",
        traced_apart(bench, &stage, &exchanged)?,
    ));
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

/// Photos of both arrangements: of a matrix and its transpose by an ideal rig, otherwise by two pairs of devices.
fn arrangements(bench: &mut Bench, stage: &Stage, exchanged: &Stage) -> Result<Box<dyn Adjoint>> {
    Ok(match bench.rig() {
        Rig::Ideal => Box::new(bench.truth(stage, Part::Full)?),
        Rig::Virtual => Box::new(Exchanged::in_one_unit(
            bench.photos(stage, Part::Full)?,
            bench.photos(exchanged, Part::Full)?,
        )?),
    })
}

/// Half the photos: each product of the graph is two.
fn asked(stage: &Stage) -> SegmentOptions {
    SegmentOptions {
        photos: PHOTOS / 2,
        tolerance: 0.0,
        starts: Some(1),
        resolution: Some(stage.resolution),
        groups: vec![2],
        ..SegmentOptions::default()
    }
}

/// The singular vectors that were found, and their comparison with the dense ones.
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
    // The rig's unit, by which its values are compared with those of the matrix.
    let white = vec![1.0; stage.pixels()];
    let mut photo = white.clone();
    both.apply(&white, &mut photo)?;
    let unit = photo.iter().sum::<f64>() / stage.white().iter().sum::<f64>();
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
    // The light of the best `COUNT` patterns that are orthogonal to each other, and that of the patterns found.
    let mut light = bench.truth(&stage, Part::Full)?;
    let mut carried = 0.0;
    for pattern in &found.right {
        light.apply(pattern, &mut photo)?;
        carried += dot(&photo, &photo);
    }
    let most: f64 = dense.values[..COUNT].iter().map(|value| value * value).sum();
    let overlap = |found: &[Vec<f64>], dense: &[Vec<f64>]| dot(&found[0], &dense[0]).abs();
    let turned = turned(&mut *both, &dense, unit)?;
    let mut checks = vec![
        Check::at_most(
            format!("error of the {COUNT} largest singular values, the worst, %"),
            100.0 * worst,
            5.0,
        ),
        Check::at_least(
            format!("light of the {COUNT} patterns found, over that of the best {COUNT}"),
            carried / most,
            0.95,
        ),
        Check::at_least(
            "overlap of the first right singular vector, a pattern, with the dense one",
            overlap(&found.right, &dense.right),
            0.99,
        )
        .because(turned.clone()),
        Check::at_least(
            "overlap of the first left singular vector, its photo, with the dense one",
            overlap(&found.left, &dense.left),
            0.99,
        )
        .because(turned),
    ];
    let stated = |what: &str, value: f64| Check::stated(what, value);
    checks.extend([
        stated("second singular value over the first", dense.values[1] / dense.values[0]),
        stated(
            "photos with the devices exchanged off the transpose of the others, on these vectors",
            found.disagreement,
        ),
    ]);
    let line = |name: &str, values: &[f64]| Series {
        name: name.into(),
        points: values.iter().enumerate().map(|(k, &value)| (k as f64 + 1.0, value)).collect(),
    };
    let plot = Plot {
        caption: format!(
            "The largest singular values: those of the dense matrix, and those from {PHOTOS} photos."
        ),
        lines: LinePlot {
            x_label: "singular value".into(),
            y_label: "σ".into(),
            series: vec![line("dense", &dense.values[..2 * COUNT]), line("from photos", &values)],
            ..LinePlot::default()
        },
    };
    Ok((Compared { found, checks, plot }, stage))
}

/// Why the first vectors may be turned: the error of the rig's photo of the dense one, against the gap to the next singular value.
fn turned(both: &mut dyn Adjoint, dense: &SingularTriplets, unit: f64) -> Result<String> {
    let mut photo = vec![0.0; both.rows()];
    both.apply(&dense.right[0], &mut photo)?;
    let off: Vec<f64> =
        photo.iter().zip(&dense.left[0]).map(|(y, u)| y / unit - dense.values[0] * u).collect();
    let (error, gap) = (norm(&off) / dense.values[0], 1.0 - dense.values[1] / dense.values[0]);
    Ok(format!(
        "The devices are the cause: their photo of the dense pattern is off by {error:.4} of it, and the gap to the next singular value, that of the \
         other sheet, is {gap:.4} of the largest. An error of the matrix may turn the vectors by the ratio of the two (Wedin); the light that \
         the patterns found carry is nearly that of the best all the same."
    ))
}

/// `‖B x − Aᵀx‖ / ‖Aᵀx‖` for random signs `x`, with the matrix `A` of the scene and that `B` of the scene with the devices exchanged.
fn traced_apart(bench: &mut Bench, stage: &Stage, exchanged: &Stage) -> Result<f64> {
    let signs = Start::default().vector(stage.pixels());
    let (mut transposed, mut anew) = (signs.clone(), signs.clone());
    bench.truth(stage, Part::Full)?.apply_adjoint(&signs, &mut transposed)?;
    bench.truth(exchanged, Part::Full)?.apply(&signs, &mut anew)?;
    let off: Vec<f64> = transposed.iter().zip(&anew).map(|(a, b)| a - b).collect();
    Ok(norm(&off) / norm(&transposed))
}

/// The true regions without the pixels whose neighbour to the left or right is of another region.
fn without_border(truth: &[u8], width: usize) -> Vec<u8> {
    let is_inside = |at: usize| {
        let (row, column) = (at / width * width, at % width);
        let near = column.saturating_sub(1)..=(column + 1).min(width - 1);
        near.into_iter().all(|column| truth[row + column] == truth[at])
    };
    (0..truth.len()).map(|at| if is_inside(at) { truth[at] } else { MASKED }).collect()
}

/// What a device sees, and the groups of its pixels.
fn groups(stage: &Stage, found: &Segmentation, whose: &str) -> Vec<Panel> {
    let seen = Content::Light { values: stage.white(), white: None };
    let mut panels = vec![stage.panel(
        format!("{whose}-white"),
        format!("White from the other device, by the {whose}'s pixels, W/(m² sr)"),
        seen,
    )];
    for (groups, labels) in &found.labels {
        let caption = format!("{groups} groups of the {whose}'s pixels");
        panels.push(stage.panel(
            format!("{whose}-groups-{groups}"),
            caption,
            Content::Labels(labels.clone()),
        ));
    }
    panels
}

/// The first two pairs of singular vectors.
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
