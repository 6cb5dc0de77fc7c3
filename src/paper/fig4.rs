//! Figure 4: two groups that exchange no light, and horizontal cuts at six and ten groups.
//!
//! Two scenes are used, since they behave differently. Bent sheets, as real paper is, are cut into horizontal bands. The zigzag's
//! sheets have creases that are sharp at every scale. There the light has only four separated eigenvalues: two groups, each cut
//! in halves. With more groups it is cheaper to cut off the tips of the creases than to form bands (`guide/src/concepts/segmentation.md`); the
//! value of the cut measures that.

use std::ops::ControlFlow;

use super::bench::Bench;
use super::check::Check;
use super::figure::{Content, Figure, Panel, Plot, Reproduced};
use super::groups::panels;
use super::purity::{bands, purity, straight_bands};
use super::stage::{Set, Stage};
use crate::analysis::segment::{evidence, segment};
use crate::analysis::{Capture, SegmentOptions, Segmentation};
use crate::error::Result;
use crate::observer::{OnStep, Step};
use crate::operator::{Observed, Operator};
use crate::report::plot::{LinePlot, Series};
use crate::transport::Part;

const SIDE: usize = 100;
const PHOTOS: usize = 50;
const PURE: f64 = 0.99;
/// Required share of pixels in their row's majority group: borders are noisy and may be bent.
const HORIZONTAL: f64 = 0.9;
/// Group counts for the zigzag: the paper's, and four for its halves.
const FOLDED: [usize; 4] = [2, 4, 6, 10];
const BENT: [usize; 2] = [6, 10];

pub(super) fn reproduce(bench: &mut Bench) -> Result<Reproduced> {
    let side = bench.side(SIDE);
    let stage = bench.stage(Set::Zigzag, side)?;
    let (found, curve) = segment_step_by_step(&mut bench.photos(&stage, Part::Global)?, &stage)?;
    let bent_stage = bench.stage(Set::TwoSheets, side)?;
    let bent = segment(&mut bench.photos(&bent_stage, Part::Global)?, &asked(&BENT))?;
    let [mut light, mut bent_light] =
        [bench.truth(&stage, Part::Global)?, bench.truth(&bent_stage, Part::Global)?];

    let mut checks = vec![
        Check::at_least("purity of two groups at 50 photos", purity(labels(&found, 2), &stage.truth), PURE),
        Check::at_most("fewest photos from which on the purity stays there", fewest(&curve), 12.0),
    ];
    for groups in BENT {
        checks.extend(are_bands("bent sheets", groups, &bent, &bent_stage));
        checks.push(is_cheap("bent sheets", groups, &bent, (&bent_stage, &mut bent_light))?);
    }
    checks.extend(are_bands("folded sheets", 4, &found, &stage));
    for groups in BENT {
        checks.push(is_cheap("folded sheets", groups, &found, (&stage, &mut light))?);
        let [count, share] = are_bands("folded sheets", groups, &found, &stage);
        checks.extend([count, share].map(|check| Check::stated(check.what, check.value)));
    }
    let value = |index: usize| found.eigenvalues.get(index).copied().unwrap_or(f64::NAN);
    checks.extend([
        Check::stated("folded sheets: second eigenvalue of the normalized cut", value(1)),
        Check::stated("fourth eigenvalue, of the halves", value(3)),
        Check::stated("fifth eigenvalue, below 0.79 where the crease's are not separate", value(4)),
    ]);
    let bent_panels = bent.labels.iter().map(|(groups, labels)| {
        let caption = format!("{groups} groups of sheets that are bent instead of folded");
        bent_stage.panel(format!("bent-groups-{groups}"), caption, Content::Labels(labels.clone()))
    });
    Ok(Reproduced {
        setting: format!(
            "zigzag and two-sheets, {}, {PHOTOS} photos and 10 eigenvectors each",
            stage.resolution
        ),
        checks,
        panels: panels(&stage, &found, 4).into_iter().map(folded).chain(bent_panels).collect(),
        plots: vec![plot(curve)],
        photos: found.photos + bent.photos,
        ..Reproduced::of(Figure::Fig4, bench.rig())
    })
}

/// Marks the captions of group images as those of the folded sheets.
fn folded(mut panel: Panel) -> Panel {
    if matches!(panel.content, Content::Labels(_)) {
        panel.caption += " of folded sheets";
    }
    panel
}

fn asked(groups: &[usize]) -> SegmentOptions {
    SegmentOptions {
        photos: PHOTOS,
        tolerance: 0.0,
        starts: Some(1),
        groups: groups.to_vec(),
        ..SegmentOptions::default()
    }
}

fn labels(found: &Segmentation, groups: usize) -> &[u8] {
    found.labels.iter().find(|(of, _)| *of == groups).map_or(&[], |(_, labels)| labels)
}

/// Checks that each group spans a sheet's width and that the borders run along the rows.
fn are_bands(what: &str, groups: usize, segmentation: &Segmentation, stage: &Stage) -> [Check; 2] {
    let found = bands(labels(segmentation, groups), &stage.truth, stage.resolution);
    [
        Check::at_least(
            format!("{what}: groups that are horizontal bands, of {groups}"),
            found.count as f64,
            groups as f64,
        ),
        Check::at_least(
            format!("{what}: share of pixels in the group of most of their row, {groups} groups"),
            found.share,
            HORIZONTAL,
        ),
    ]
}

/// Checks that the groups solve the stated problem: their cut costs no more than the cut of straight bands.
fn is_cheap(
    what: &str,
    groups: usize,
    found: &Segmentation,
    (stage, light): (&Stage, &mut dyn Operator),
) -> Result<Check> {
    let straight = straight_bands(&found.degree, &found.mask, &stage.truth, groups, stage.resolution);
    let mut cut = |labels: &[u8]| -> Result<f64> { Ok(evidence(light, labels)?.cut()) };
    let ratio = cut(labels(found, groups))? / cut(&straight)?;
    Ok(Check::at_most(format!("{what}: the cut of {groups} groups over that of straight bands"), ratio, 1.0))
}

/// The segmentation at the full number of photos, and the purity of two groups after 4 to 20 photos and at the end. All come from
/// one capture that is interrupted, evaluated and continued.
fn segment_step_by_step(
    operator: &mut dyn Operator,
    stage: &Stage,
) -> Result<(Segmentation, Vec<(f64, f64)>)> {
    let mut capture = Capture::new(asked(&FOLDED))?;
    let mut curve = Vec::new();
    for photos in 4..=20 {
        let observer =
            OnStep::new(
                |step: &Step<'_>| {
                    if step.done >= photos { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
                },
            );
        capture.run(&mut Observed::new(operator, &observer))?;
        let two = capture.regrouped(&[2])?;
        curve.push((two.photos as f64, purity(labels(&two, 2), &stage.truth)));
    }
    capture.run(operator)?;
    let found = capture.segmentation()?;
    curve.push((found.photos as f64, purity(labels(&found, 2), &stage.truth)));
    Ok((found, curve))
}

/// The smallest number of photos from which on the purity stays sufficient; infinite if the last one is insufficient.
fn fewest(curve: &[(f64, f64)]) -> f64 {
    let from = curve.iter().rposition(|&(_, purity)| purity.is_nan() || purity < PURE).map_or(0, |at| at + 1);
    curve.get(from).map_or(f64::INFINITY, |&(photos, _)| photos)
}

fn plot(points: Vec<(f64, f64)>) -> Plot {
    Plot {
        caption: "Purity of two groups if the photos had ended there.".into(),
        lines: LinePlot {
            x_label: "photos".into(),
            y_label: "purity".into(),
            series: vec![Series { name: "two groups".into(), points }],
            marks: vec![(PURE, "wanted".into())],
            ..LinePlot::default()
        },
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
