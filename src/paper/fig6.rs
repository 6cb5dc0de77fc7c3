//! Figure 6: patches that are occluded from each other are groups of their own, and patches that are apart in the photo share one.
//!
//! The two sheets are occluded from each other by their rims, so that they exchange no light. A black post in front of the left sheet divides
//! it into two patches in the photo, behind which light passes.

use super::bench::Bench;
use super::check::Check;
use super::components::components;
use super::figure::{Figure, Reproduced};
use super::groups::panels;
use super::purity::purity;
use super::stage::{Set, Stage};
use crate::analysis::segment::segment;
use crate::analysis::{MASKED, SegmentOptions};
use crate::error::Result;
use crate::transport::Part;

const SIDE: usize = 128;
const PHOTOS: usize = 50;
const GROUPS: [usize; 3] = [2, 4, 6];
const PURE: f64 = 0.99;
/// Minimum size of a patch, as a share of the photo.
const PATCH: f64 = 0.01;
/// Regions of the scene.
const LEFT_SHEET: u8 = 0;
const POST: u8 = 2;

pub(super) fn reproduce(bench: &mut Bench) -> Result<Reproduced> {
    let stage = bench.stage(Set::Post, bench.side(SIDE))?;
    let options = SegmentOptions {
        photos: PHOTOS,
        tolerance: 0.0,
        groups: GROUPS.to_vec(),
        starts: Some(1),
        resolution: Some(stage.resolution),
        ..SegmentOptions::default()
    };
    let found = segment(&mut bench.photos(&stage, Part::Global)?, &options)?;
    let two = &found.labels[0].1;
    // The post reflects no light and belongs to no group.
    let sheets: Vec<u8> =
        stage.truth.iter().map(|&region| if region == POST { MASKED } else { region }).collect();
    let [left, right] = shares(two, &stage);
    let group = if left + right >= 1.0 { 1 } else { 0 };
    let of_group = |share: f64| if group == 1 { share } else { 1.0 - share };
    let least = (PATCH * stage.pixels() as f64) as usize;
    let large = components(two, group, stage.resolution).iter().filter(|patch| patch.len() >= least).count();
    let mut checks = vec![
        Check::at_least(
            "purity of two groups: the sheets, which are occluded from each other",
            purity(two, &sheets),
            PURE,
        ),
        Check::at_least(
            "share of the patch left of the post in the group of its sheet",
            of_group(left),
            PURE,
        ),
        Check::at_least("share of the patch right of the post in the same group", of_group(right), PURE),
        Check::at_least("patches of that group that are apart in the photo", large as f64, 2.0),
    ];
    for (groups, labels) in &found.labels[1..] {
        checks.push(Check::stated(format!("purity of {groups} groups"), purity(labels, &sheets)));
    }
    checks.push(Check::stated("second eigenvalue of the normalized cut", found.eigenvalues[1]));
    Ok(Reproduced {
        setting: format!(
            "two sheets that are occluded from each other, one of them behind a post, {}, {PHOTOS} photos, 10 eigenvectors",
            stage.resolution
        ),
        checks,
        panels: panels(&stage, &found, 2),
        photos: found.photos,
        ..Reproduced::of(Figure::Fig6, bench.rig())
    })
}

/// The shares of group 1 in the patches of the left sheet on the left and on the right of the post.
fn shares(labels: &[u8], stage: &Stage) -> [f64; 2] {
    let width = stage.resolution.width;
    let post = stage.truth.iter().position(|&region| region == POST).map_or(width, |pixel| pixel % width);
    let share = |is_left: bool| {
        let pixels = (0..labels.len())
            .filter(|&pixel| stage.truth[pixel] == LEFT_SHEET && labels[pixel] != MASKED)
            .filter(|pixel| (pixel % width < post) == is_left);
        let (ones, all) = pixels
            .fold((0_usize, 0_usize), |(ones, all), pixel| (ones + usize::from(labels[pixel] == 1), all + 1));
        ones as f64 / all as f64
    };
    [share(true), share(false)]
}
