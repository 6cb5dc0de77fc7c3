//! Figure 4: two groups where no light is exchanged, and horizontal cuts at six and ten.

use std::ops::ControlFlow;

use super::bench::Bench;
use super::check::Check;
use super::figure::{Content, Curve, Curves, Figure, Panel, Reproduced};
use super::groups::panels;
use super::purity::{bands, purity};
use super::stage::{Set, Stage};
use crate::analysis::segment::segment;
use crate::analysis::{Capture, SegmentOptions, Segmentation};
use crate::error::Result;
use crate::krylov::keep_going;
use crate::operator::Operator;
use crate::transport::Part;

const SIDE: usize = 100;
const PHOTOS: usize = 50;
const PURE: f64 = 0.99;
/// Pixels that belong to the group of most of their row: borders are noisy, and may be bent.
const HORIZONTAL: f64 = 0.9;

pub(super) fn reproduce(bench: &mut Bench<'_>) -> Result<Reproduced> {
    let side = bench.side(SIDE);
    let stage = bench.stage(Set::Zigzag, side)?;
    let (found, curve) =
        bench.with_rig(&stage, Part::Global, |operator| segment_step_by_step(operator, &stage))?;
    let labels = |groups: usize| {
        found.labels.iter().find(|(k, _)| *k == groups).map_or(&[][..], |(_, labels)| labels.as_slice())
    };
    let fewest = fewest(&curve);
    let mut checks = vec![
        Check::at_least("purity of two groups at 50 photos", purity(labels(2), &stage.truth), PURE),
        Check::at_most("fewest photos from which on the purity stays there", fewest, 12.0),
    ];
    for groups in [6, 10] {
        checks.extend(are_bands("", groups, labels(groups), &stage));
    }
    // A crease as sharp as the zigzag's exchanges most of its light within itself; a sheet that is bent does not.
    let bent_stage = bench.stage(Set::TwoSheets, side)?;
    let options = SegmentOptions { photos: PHOTOS, tolerance: 0.0, ..SegmentOptions::default() };
    let bent =
        bench.with_rig(&bent_stage, Part::Global, |operator| segment(operator, &options, &mut keep_going))?;
    let mut bent_panels = Vec::new();
    for (groups, labels) in bent.labels.iter().filter(|(groups, _)| *groups > 2) {
        checks.extend(are_bands("bent sheets: ", *groups, labels, &bent_stage));
        bent_panels.push(Panel {
            name: format!("bent-groups-{groups}"),
            caption: format!("{groups} groups of sheets that are bent instead of folded"),
            resolution: bent_stage.resolution,
            content: Content::Labels(labels.clone()),
        });
    }
    checks.extend([
        Check::stated("second eigenvalue of the normalized cut", found.eigenvalues[1]),
        Check::stated("third eigenvalue", found.eigenvalues.get(2).copied().unwrap_or(f64::NAN)),
    ]);
    Ok(Reproduced {
        figure: Figure::Fig4,
        rig: bench.rig(),
        setting: format!(
            "zigzag and two-sheets, {}, {PHOTOS} photos and 10 eigenvectors each",
            stage.resolution
        ),
        checks,
        panels: panels(&stage, &found, 4).into_iter().chain(bent_panels).collect(),
        plots: vec![plot(curve)],
        strips: Vec::new(),
        photos: found.photos + bent.photos,
        seconds: 0.0,
    })
}

/// Whether each group spans a sheet's width, and borders run along the rows.
fn are_bands(what: &str, groups: usize, labels: &[u8], stage: &Stage) -> [Check; 2] {
    let found = bands(labels, &stage.truth, stage.resolution);
    [
        Check::at_least(
            format!("{what}groups that are horizontal bands, of {groups}"),
            found.count as f64,
            groups as f64,
        ),
        Check::at_least(
            format!("{what}share of pixels in the group of most of their row, {groups} groups"),
            found.share,
            HORIZONTAL,
        ),
    ]
}

/// The segmentation at the full number of photos, and the purity of two groups after each photo until then. All are from
/// one capture, stopped and gone on with.
fn segment_step_by_step(
    operator: &mut dyn Operator,
    stage: &Stage,
) -> Result<(Segmentation, Vec<(f64, f64)>)> {
    let options = SegmentOptions { photos: PHOTOS, tolerance: 0.0, ..SegmentOptions::default() };
    let mut curve = Vec::new();
    for photos in 4..=20 {
        // Stopping changes nothing, and a capture made anew takes the same photos.
        let two = SegmentOptions { groups: vec![2], photos, ..options.clone() };
        let mut short = Capture::new(two)?;
        short.run(operator, &mut |step| {
            if step.products >= photos { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        })?;
        curve.push((photos as f64, purity(&short.segmentation()?.labels[0].1, &stage.truth)));
    }
    let mut capture = Capture::new(options)?;
    capture.run(operator, &mut keep_going)?;
    let found = capture.segmentation()?;
    let last = found.labels.iter().find(|(groups, _)| *groups == 2);
    curve.push((found.photos as f64, last.map_or(f64::NAN, |(_, labels)| purity(labels, &stage.truth))));
    Ok((found, curve))
}

/// The first number of photos from which on every purity is high enough; infinite if the last is not.
fn fewest(curve: &[(f64, f64)]) -> f64 {
    let from = curve.iter().rposition(|&(_, purity)| purity.is_nan() || purity < PURE).map_or(0, |at| at + 1);
    curve.get(from).map_or(f64::INFINITY, |&(photos, _)| photos)
}

fn plot(points: Vec<(f64, f64)>) -> Curves {
    Curves {
        caption: "Purity of two groups if the photos had ended there.".into(),
        x_label: "photos".into(),
        y_label: "purity".into(),
        logarithmic: false,
        lines: vec![Curve { name: "two groups".into(), points }],
        marks: vec![(PURE, "wanted".into())],
    }
}

#[cfg(test)]
mod tests {
    use super::fewest;

    #[test]
    fn fewest_photos_are_those_after_the_last_impure_ones() {
        assert_eq!(fewest(&[(4.0, 0.5), (5.0, 1.0), (6.0, 0.9), (7.0, 0.99), (50.0, 1.0)]), 7.0);
        assert_eq!(fewest(&[(4.0, 1.0), (50.0, 1.0)]), 4.0);
        assert_eq!(fewest(&[(4.0, 1.0), (50.0, 0.7)]), f64::INFINITY);
    }
}
