//! Figure 6: patches that are apart in the photo share a group.

use super::bench::{Bench, Set};
use super::check::Check;
use super::components::components;
use super::figure::{Content, Figure, Panel, Reproduced};
use super::purity::purity;
use crate::analysis::SegmentOptions;
use crate::analysis::segment::segment;
use crate::error::Result;
use crate::krylov::keep_going;
use crate::transport::Part;

const SIDE: usize = 100;
const PHOTOS: usize = 50;
const GROUPS: [usize; 4] = [2, 4, 6, 10];
/// The least part of the photo that counts as a patch.
const PATCH: f64 = 0.01;

pub(super) fn reproduce(bench: &mut Bench<'_>) -> Result<Reproduced> {
    let side = bench.side(SIDE);
    let stage = bench.stage(Set::TwoSheets, side)?;
    let options = SegmentOptions {
        photos: PHOTOS,
        tolerance: 0.0,
        groups: GROUPS.to_vec(),
        ..SegmentOptions::default()
    };
    let found =
        bench.with_rig(&stage, Part::Global, |operator| segment(operator, &options, &mut keep_going))?;
    let mut checks = Vec::new();
    let mut panels = vec![Panel {
        name: "white".into(),
        caption: "The photo under white, W/(m² sr)".into(),
        resolution: stage.resolution,
        content: Content::Light { values: stage.photo(&vec![1.0; stage.pixels()]), white: None },
    }];
    let least = (PATCH * stage.pixels() as f64) as usize;
    let mut most = 0;
    for (groups, labels) in &found.labels {
        let patches = (0..*groups as u8).map(|group| {
            components(labels, group, stage.resolution).iter().filter(|part| part.len() >= least).count()
        });
        let apart = patches.filter(|&parts| parts > 1).count();
        most = most.max(apart);
        if *groups == 2 {
            checks.push(Check::at_least(
                "purity of two groups at 50 photos",
                purity(labels, &stage.truth),
                0.99,
            ));
        }
        checks.push(Check::stated(format!("groups with patches apart, of {groups}"), apart as f64));
        panels.push(Panel {
            name: format!("groups-{groups}"),
            caption: format!("{groups} groups"),
            resolution: stage.resolution,
            content: Content::Labels(labels.clone()),
        });
    }
    checks.insert(
        1,
        Check::at_least("groups with patches apart, the most at any number of groups", most as f64, 1.0),
    );
    for (index, vector) in found.eigenvectors.iter().enumerate().skip(1).take(4) {
        panels.push(Panel {
            name: format!("eigenvector-{}", index + 1),
            caption: format!("Eigenvector {}: λ = {:.4}", index + 1, found.eigenvalues[index]),
            resolution: stage.resolution,
            content: Content::Signed(vector.clone()),
        });
    }
    Ok(Reproduced {
        figure: Figure::Fig6,
        rig: bench.rig(),
        setting: format!("two-sheets, {}, {PHOTOS} photos, 10 eigenvectors", stage.resolution),
        checks,
        panels,
        plots: Vec::new(),
        strips: Vec::new(),
        photos: found.photos,
        seconds: 0.0,
    })
}
