//! Figure 8: an egg carton, empty and with eggs, with 100 photos and 20 eigenvectors.

use super::bench::Bench;
use super::check::Check;
use super::figure::{Figure, Panel, Plot, Reproduced};
use super::groups::panels;
use super::stage::{Set, Stage};
use crate::analysis::segment::segment;
use crate::analysis::{SegmentOptions, Segmentation, adjusted_rand_index};
use crate::error::Result;
use crate::report::plot::{LinePlot, Series};
use crate::transport::Part;

const SIDE: usize = 128;
const PHOTOS: usize = 100;
const EIGENVECTORS: usize = 20;
const CELLS: usize = 9;
/// Eigenvalues this close to 1 indicate regions that exchange hardly any light.
const ONE: f64 = 0.99;

pub(super) fn reproduce(bench: &mut Bench) -> Result<Reproduced> {
    let side = bench.side(SIDE);
    let (empty_stage, empty) = run(bench, Set::Carton, side)?;
    let (egg_stage, eggs) = run(bench, Set::CartonEggs, side)?;
    let [without, with] = [&empty, &eggs].map(|found| found.labels[0].1.as_slice());
    // Flat spots where rims meet exchange light among two or three pixels only. They add eigenvalues at one, which are excluded.
    let ones = |found: &Segmentation| {
        let at_one = found.eigenvalues.iter().enumerate().filter(|(_, value)| **value >= ONE);
        at_one.filter(|(index, _)| !found.embedding.is_local(*index)).count() as f64
    };
    let checks = vec![
        Check::at_least(
            "adjusted Rand index of nine groups with the nine cells, empty",
            adjusted_rand_index(without, &empty_stage.truth)?,
            0.95,
        ),
        Check::at_most(
            "adjusted Rand index of nine groups with eggs and nine without: they change",
            adjusted_rand_index(with, without)?,
            0.9,
        ),
        Check::at_least(
            "eigenvalues of 0.99 and more that tell of regions, empty",
            ones(&empty),
            CELLS as f64,
        ),
        Check::at_most("the same, with eggs", ones(&eggs), (CELLS - 1) as f64),
        Check::stated("independent regions that the light shows, empty", empty.regions.count as f64),
        Check::stated("localized eigenvectors, empty", empty.embedding.local() as f64),
        Check::stated(
            "adjusted Rand index with the cells, with eggs",
            adjusted_rand_index(with, &egg_stage.truth)?,
        ),
    ];
    let spectrum = |name: &str, found: &Segmentation| Series {
        name: name.into(),
        points: found.eigenvalues.iter().enumerate().map(|(k, value)| (k as f64 + 1.0, *value)).collect(),
    };
    let panels = panels_of("empty", "Empty", &empty_stage, &empty)
        .chain(panels_of("eggs", "With eggs", &egg_stage, &eggs))
        .collect();
    Ok(Reproduced {
        setting: format!(
            "a carton of 3 × 3 cells, {}, {PHOTOS} photos and {EIGENVECTORS} eigenvectors each, from twelve smooth \
             patterns; the paper starts from one, which finds only some of the cells",
            empty_stage.resolution
        ),
        checks,
        panels,
        plots: vec![Plot {
            caption:
                "Eigenvalues of the normalized cut: as many at one as there are cells that exchange no light, beside those of a few pixels."
                    .into(),
            lines: LinePlot {
                x_label: "eigenvector".into(),
                y_label: "eigenvalue λ".into(),
                series: vec![spectrum("empty", &empty), spectrum("with eggs", &eggs)],
                ..LinePlot::default()
            },
        }],
        photos: empty.photos + eggs.photos,
        ..Reproduced::of(Figure::Fig8, bench.rig())
    })
}

fn run(bench: &mut Bench, set: Set, side: usize) -> Result<(std::sync::Arc<Stage>, Segmentation)> {
    let stage = bench.stage(set, side)?;
    let options = SegmentOptions {
        photos: PHOTOS,
        tolerance: 0.0,
        eigenvectors: EIGENVECTORS,
        groups: vec![CELLS, EIGENVECTORS],
        resolution: Some(stage.resolution),
        ..SegmentOptions::default()
    };
    let found = segment(&mut bench.photos(&stage, Part::Global)?, &options)?;
    Ok((stage, found))
}

/// The panels of one carton, with its name and caption prefixed.
fn panels_of(name: &str, what: &str, stage: &Stage, found: &Segmentation) -> impl Iterator<Item = Panel> {
    panels(stage, found, 0).into_iter().map(move |panel| Panel {
        name: format!("{name}-{}", panel.name),
        caption: format!("{what}: {}", panel.caption),
        ..panel
    })
}
