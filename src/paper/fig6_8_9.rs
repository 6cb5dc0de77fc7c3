//! Figures 6, 8 and 9: sheets behind a post, an egg carton, and the photos of its segmentation.
//!
//! In figure 6, patches that are occluded from each other are in separate groups, and patches that are apart in the photo are in one group.
//! The rims of two sheets occlude the sheets from each other, so the sheets exchange no light. A black post in front of the left sheet
//! divides this sheet into two patches in the photo. Light passes behind the post.
//!
//! In figure 8, an egg carton, empty and with eggs, is divided into ten groups. The 50 photos and their patterns are blurred.

use super::bench::{Bench, Set, Stage};
use super::figure::{Check, Figure, Panel, Plot, Reproduced, Strip, counted};
use super::groups::{asked, components, labels, panels, purity};
use crate::analysis::segment::segment;
use crate::analysis::{Blurred, MASKED, SegmentOptions, Segmentation, adjusted_rand_index};
use crate::error::{Error, Result};
use crate::image::Blur;
use crate::operator::Recorded;
use crate::transport::Part;

const PATCH_GROUPS: [usize; 3] = [2, 4, 6];
const PURE: f64 = 0.99;
/// The smallest size of a patch, as a fraction of the photo.
const PATCH: f64 = 0.01;
const LEFT_SHEET: u8 = 0;
const POST: u8 = 2;

pub(super) fn fig6(bench: &mut Bench) -> Result<Reproduced> {
    let stage = bench.stage(Set::Post, bench.side(SIDE))?;
    let options = asked(PHOTOS, &PATCH_GROUPS, stage.resolution);
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
        Check::of("purity of two groups: the sheets, which are occluded from each other")
            .at_least(purity(two, &sheets), PURE),
        Check::of("share of the patch left of the post in the group of its sheet")
            .at_least(of_group(left), PURE),
        Check::of("share of the patch right of the post in the same group").at_least(of_group(right), PURE),
        Check::of("patches of that group that are apart in the photo").at_least(large as f64, 2.0),
    ];
    for (groups, labels) in &found.labels[1..] {
        checks.push(Check::of(format!("purity of {groups} groups")).stated(purity(labels, &sheets)));
    }
    checks.push(Check::of("second eigenvalue of the normalized cut").stated(found.eigenvalues[1]));
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

/// The fraction of pixels in group 1, for each of the two patches of the left sheet: left and right of the post.
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

pub(super) const SIDE: usize = 128;
pub(super) const PHOTOS: usize = 50;
const GROUPS: usize = 10;
const EIGENVECTORS: usize = 20;
/// The standard deviation of the blur of patterns and photos, in pixels.
const BLUR: f64 = 1.0;
const CELLS: usize = 9;
/// Eigenvalues above this value indicate regions that exchange hardly any light.
const ONE: f64 = 0.99;

pub(super) fn fig8(bench: &mut Bench) -> Result<Reproduced> {
    let side = bench.side(SIDE);
    let (empty_stage, empty) = run(bench, Set::Carton, side, BLUR)?;
    let (_, sharp) = run(bench, Set::Carton, side, 0.0)?;
    let (egg_stage, eggs) = run(bench, Set::CartonEggs, side, BLUR)?;
    let (without, with) = (labels(&empty, GROUPS), labels(&eggs, GROUPS));
    let (nine_without, nine_with) = (labels(&empty, CELLS), labels(&eggs, CELLS));
    // Where rims meet, flat spots exchange light among only two or three pixels. They add eigenvalues near 1, which are excluded.
    let ones = |found: &Segmentation| {
        let at_one = found.eigenvalues.iter().enumerate().filter(|(_, value)| **value >= ONE);
        at_one.filter(|(index, _)| !found.embedding.is_local(*index)).count() as f64
    };
    let checks = vec![
        Check::of("purity of ten groups: the share of pixels in the cell that most of their group is in, empty").at_least(purity(without, &empty_stage.truth), 0.95),
        Check::of("adjusted Rand index of nine groups with the nine cells, empty").at_least(adjusted_rand_index(nine_without, &empty_stage.truth)?, 0.95),
        Check::of("adjusted Rand index of ten groups with eggs and ten without: they change").at_most(adjusted_rand_index(with, without)?, 0.9),
        Check::of("eigenvalues of 0.99 and more that tell of regions, empty").at_least(ones(&empty), CELLS as f64)
        .because(format!(
            "The blur carries light across the rims between cells. Without it, as many photos show {:.0} of them; with it, the gap after the \
             ninth still tells {} regions.",
            ones(&sharp),
            empty.regions.count
        )),
        Check::of("the same, empty, without blur").stated(ones(&sharp)),
        Check::of("the same, with eggs").at_most(ones(&eggs), (CELLS - 1) as f64),
        Check::of("independent regions that the light shows, empty").at_least(empty.regions.count as f64, CELLS as f64),
        Check::of("the same, from above").at_most(empty.regions.count as f64, CELLS as f64),
        Check::of("localized eigenvectors, empty").stated(empty.embedding.local() as f64),
        Check::of("adjusted Rand index of nine groups with the cells, with eggs").stated(adjusted_rand_index(nine_with, &egg_stage.truth)?),
    ];
    let panels = panels_of("empty", "Empty", &empty_stage, &empty)
        .chain(panels_of("eggs", "With eggs", &egg_stage, &eggs))
        .collect();
    Ok(Reproduced {
        setting: format!(
            "a carton of 3 × 3 cells, {}, {PHOTOS} photos and {EIGENVECTORS} eigenvectors each, blurred by {BLUR} pixel, from twelve \
             smooth patterns; the paper starts from one, which finds only some of the cells",
            empty_stage.resolution
        ),
        checks,
        panels,
        plots: vec![spectra(&empty, &eggs)],
        photos: empty.photos + eggs.photos,
        ..Reproduced::of(Figure::Fig8, bench.rig())
    })
}

fn spectra(empty: &Segmentation, eggs: &Segmentation) -> Plot {
    Plot::linear(
        "Eigenvalues of the normalized cut: as many near one as there are cells that exchange no light, beside those of a few pixels.",
        ["eigenvector", "eigenvalue λ"],
        [("empty", counted(&empty.eigenvalues)), ("with eggs", counted(&eggs.eigenvalues))],
    )
}

fn run(bench: &mut Bench, set: Set, side: usize, blur: f64) -> Result<(std::sync::Arc<Stage>, Segmentation)> {
    let stage = bench.stage(set, side)?;
    let mut operator = bench.photos(&stage, Part::Global)?;
    let found = match Blur::new(stage.resolution, blur) {
        Some(blur) => segment(&mut Blurred::new(&mut operator, blur)?, &asked_of_carton(&stage))?,
        None => segment(&mut operator, &asked_of_carton(&stage))?,
    };
    Ok((stage, found))
}

fn asked_of_carton(stage: &Stage) -> SegmentOptions {
    SegmentOptions {
        photos: PHOTOS,
        tolerance: 0.0,
        eigenvectors: EIGENVECTORS,
        groups: vec![GROUPS, CELLS],
        resolution: Some(stage.resolution),
        ..SegmentOptions::default()
    }
}

fn panels_of(name: &str, what: &str, stage: &Stage, found: &Segmentation) -> impl Iterator<Item = Panel> {
    panels(stage, found, 0).into_iter().map(move |panel| Panel {
        name: format!("{name}-{}", panel.name),
        caption: format!("{what}: {}", panel.caption),
        ..panel
    })
}

pub(super) fn fig9(bench: &mut Bench) -> Result<Reproduced> {
    let stage = bench.stage(Set::Carton, bench.side(SIDE))?;
    let mut operator = bench.photos(&stage, Part::Global)?;
    // The recorder receives the pattern that is really projected, and its photo before the second blur.
    let mut recorded = Recorded::new(&mut operator);
    let blur = Blur::new(stage.resolution, BLUR).ok_or(Error::Interrupted)?;
    let found = segment(&mut Blurred::new(&mut recorded, blur)?, &asked_of_carton(&stage))?;
    let shots = recorded.products;
    let nine = labels(&found, CELLS);
    Ok(Reproduced {
        setting: format!("the empty carton, {}, the run of figure 8", stage.resolution),
        checks: vec![
            Check::of(format!("adjusted Rand index of the nine groups that these {PHOTOS} photos give")).at_least(adjusted_rand_index(nine, &stage.truth)?, 0.95),
            Check::of("photos taken, white included").stated(shots.len() as f64),
        ],
        strips: vec![Strip {
            caption: "Above what is projected, below its photo without direct light; blue is negative. The first is white, and those after \
                      it begin with the smooth patterns that the process starts from."
                .into(),
            resolution: stage.resolution,
            photos: shots,
        }],
        photos: found.photos,
        ..Reproduced::of(Figure::Fig9, bench.rig())
    })
}
