//! Figure 8: an egg carton, empty and with eggs, in ten groups from 50 photos that are blurred on both sides.

use super::bench::Bench;
use super::check::Check;
use super::figure::{Figure, Panel, Plot, Reproduced};
use super::groups::panels;
use super::purity::purity;
use super::stage::{Set, Stage};
use crate::analysis::segment::segment;
use crate::analysis::{Blurred, SegmentOptions, Segmentation, adjusted_rand_index};
use crate::error::Result;
use crate::image::Blur;
use crate::report::plot::{LinePlot, Series};
use crate::transport::Part;

pub(super) const SIDE: usize = 128;
pub(super) const PHOTOS: usize = 50;
/// The groups of the paper's figure.
const GROUPS: usize = 10;
const EIGENVECTORS: usize = 20;
/// Standard deviation of the blur of patterns and photos, in pixels.
pub(super) const BLUR: f64 = 1.0;
pub(super) const CELLS: usize = 9;
/// Eigenvalues this close to 1 indicate regions that exchange hardly any light.
const ONE: f64 = 0.99;

pub(super) fn reproduce(bench: &mut Bench) -> Result<Reproduced> {
    let side = bench.side(SIDE);
    let (empty_stage, empty) = run(bench, Set::Carton, side, BLUR)?;
    let (_, sharp) = run(bench, Set::Carton, side, 0.0)?;
    let (egg_stage, eggs) = run(bench, Set::CartonEggs, side, BLUR)?;
    let labels = |groups: usize| {
        let of = |found: &Segmentation| {
            found.labels.iter().find(|(of, _)| *of == groups).map_or(Vec::new(), |(_, labels)| labels.clone())
        };
        [of(&empty), of(&eggs)]
    };
    let [without, with] = labels(GROUPS);
    let [nine_without, nine_with] = labels(CELLS);
    // Flat spots where rims meet exchange light among two or three pixels only. They add eigenvalues at one, which are excluded.
    let ones = |found: &Segmentation| {
        let at_one = found.eigenvalues.iter().enumerate().filter(|(_, value)| **value >= ONE);
        at_one.filter(|(index, _)| !found.embedding.is_local(*index)).count() as f64
    };
    let checks = vec![
        Check::at_least(
            "purity of ten groups: the share of pixels in the cell that most of their group is in, empty",
            purity(&without, &empty_stage.truth),
            0.95,
        ),
        Check::at_least(
            "adjusted Rand index of nine groups with the nine cells, empty",
            adjusted_rand_index(&nine_without, &empty_stage.truth)?,
            0.95,
        ),
        Check::at_most(
            "adjusted Rand index of ten groups with eggs and ten without: they change",
            adjusted_rand_index(&with, &without)?,
            0.9,
        ),
        Check::at_least(
            "eigenvalues of 0.99 and more that tell of regions, empty",
            ones(&empty),
            CELLS as f64,
        )
        .because(format!(
            "The blur carries light across the rims between cells. Without it, as many photos show {:.0} of them; with it, the gap after the \
             ninth still tells {} regions.",
            ones(&sharp),
            empty.regions.count
        )),
        Check::stated("the same, empty, without blur", ones(&sharp)),
        Check::at_most("the same, with eggs", ones(&eggs), (CELLS - 1) as f64),
        Check::at_least("independent regions that the light shows, empty", empty.regions.count as f64, CELLS as f64),
        Check::at_most("the same, from above", empty.regions.count as f64, CELLS as f64),
        Check::stated("localized eigenvectors, empty", empty.embedding.local() as f64),
        Check::stated(
            "adjusted Rand index of nine groups with the cells, with eggs",
            adjusted_rand_index(&nine_with, &egg_stage.truth)?,
        ),
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
    let spectrum = |name: &str, found: &Segmentation| Series {
        name: name.into(),
        points: found.eigenvalues.iter().enumerate().map(|(k, value)| (k as f64 + 1.0, *value)).collect(),
    };
    Plot {
        caption:
            "Eigenvalues of the normalized cut: as many near one as there are cells that exchange no light, beside those of a few pixels."
                .into(),
        lines: LinePlot {
            x_label: "eigenvector".into(),
            y_label: "eigenvalue λ".into(),
            series: vec![spectrum("empty", empty), spectrum("with eggs", eggs)],
            ..LinePlot::default()
        },
    }
}

fn run(bench: &mut Bench, set: Set, side: usize, blur: f64) -> Result<(std::sync::Arc<Stage>, Segmentation)> {
    let stage = bench.stage(set, side)?;
    let mut operator = bench.photos(&stage, Part::Global)?;
    let found = match Blur::new(stage.resolution, blur) {
        Some(blur) => segment(&mut Blurred::new(&mut operator, blur)?, &asked(&stage))?,
        None => segment(&mut operator, &asked(&stage))?,
    };
    Ok((stage, found))
}

/// What is asked of the photos of a carton.
pub(super) fn asked(stage: &Stage) -> SegmentOptions {
    SegmentOptions {
        photos: PHOTOS,
        tolerance: 0.0,
        eigenvectors: EIGENVECTORS,
        groups: vec![GROUPS, CELLS],
        resolution: Some(stage.resolution),
        ..SegmentOptions::default()
    }
}

/// The panels of one carton, with its name and caption prefixed.
fn panels_of(name: &str, what: &str, stage: &Stage, found: &Segmentation) -> impl Iterator<Item = Panel> {
    panels(stage, found, 0).into_iter().map(move |panel| Panel {
        name: format!("{name}-{}", panel.name),
        caption: format!("{what}: {}", panel.caption),
        ..panel
    })
}
