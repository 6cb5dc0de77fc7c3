//! Figure 6: patches that are apart in the photo share a group.

use super::bench::Bench;
use super::check::Check;
use super::components::components;
use super::figure::{Figure, Reproduced};
use super::groups::panels;
use super::stage::{Set, Stage};
use crate::analysis::SegmentOptions;
use crate::analysis::segment::segment;
use crate::error::Result;
use crate::transport::Part;

const SIDE: usize = 100;
const PHOTOS: usize = 50;
const GROUPS: [usize; 3] = [2, 4, 6];
/// Minimum size of a patch, as a share of the photo.
const PATCH: f64 = 0.01;

pub(super) fn reproduce(bench: &mut Bench) -> Result<Reproduced> {
    let side = bench.side(SIDE);
    let stage = bench.stage(Set::FacingSheets, side)?;
    let options = SegmentOptions {
        photos: PHOTOS,
        tolerance: 0.0,
        groups: GROUPS.to_vec(),
        starts: Some(1),
        ..SegmentOptions::default()
    };
    let found = segment(&mut bench.photos(&stage, Part::Global)?, &options)?;
    let mut checks = Vec::new();
    for (groups, labels) in &found.labels {
        let apart = (0..*groups as u8).filter(|&group| is_apart(labels, group, &stage)).count() as f64;
        let what = format!("groups of {groups} with a patch on either sheet, apart in the photo");
        checks.push(match groups {
            2 => Check::at_least(what, apart, 2.0),
            _ => Check::stated(what, apart),
        });
    }
    checks.push(Check::stated("second eigenvalue of the normalized cut", found.eigenvalues[1]));
    Ok(Reproduced {
        setting: format!(
            "two sheets that face each other, {}, {PHOTOS} photos, 10 eigenvectors",
            stage.resolution
        ),
        checks,
        panels: panels(&stage, &found, 2),
        photos: found.photos,
        ..Reproduced::of(Figure::Fig6, bench.rig())
    })
}

/// Whether the group's two largest components are patches on different sheets.
fn is_apart(labels: &[u8], group: u8, stage: &Stage) -> bool {
    let least = (PATCH * stage.pixels() as f64) as usize;
    let parts = components(labels, group, stage.resolution);
    match parts.as_slice() {
        [first, second, ..] => second.len() >= least && stage.truth[first[0]] != stage.truth[second[0]],
        _ => false,
    }
}
