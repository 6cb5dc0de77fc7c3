//! Pictures of a segmentation.

use super::figure::{Content, Panel};
use super::stage::Stage;
use crate::analysis::Segmentation;
use crate::lab::text::decimal;

/// The photo under white, the groups, and `eigenvectors` eigenvectors after the first, which is constant.
pub(super) fn panels(stage: &Stage, found: &Segmentation, eigenvectors: usize) -> Vec<Panel> {
    let white = Content::Light { values: stage.white(), white: None };
    let mut panels = vec![stage.panel("white", "The photo under white, W/(m² sr)", white)];
    for (groups, labels) in &found.labels {
        let groups_are = Content::Labels(labels.clone());
        panels.push(stage.panel(format!("groups-{groups}"), format!("{groups} groups"), groups_are));
    }
    for (index, vector) in found.eigenvectors.iter().enumerate().skip(1).take(eigenvectors) {
        let caption = format!("Eigenvector {}: λ = {}", index + 1, decimal(found.eigenvalues[index], 4));
        let name = format!("eigenvector-{}", index + 1);
        panels.push(stage.panel(name, caption, Content::Signed(vector.clone())));
    }
    panels
}
