//! Pictures of a segmentation.

use super::figure::{Content, Panel};
use super::stage::Stage;
use crate::analysis::Segmentation;

/// The photo under white, the groups, and `eigenvectors` eigenvectors after the first, which is constant.
pub(super) fn panels(stage: &Stage, found: &Segmentation, eigenvectors: usize) -> Vec<Panel> {
    let panel = |name: String, caption: String, content: Content| Panel {
        name,
        caption,
        resolution: stage.resolution,
        content,
    };
    let white = stage.photo(&vec![1.0; stage.pixels()]);
    let mut panels = vec![panel(
        "white".into(),
        "The photo under white, W/(m² sr)".into(),
        Content::Light { values: white, white: None },
    )];
    for (groups, labels) in &found.labels {
        panels.push(panel(
            format!("groups-{groups}"),
            format!("{groups} groups"),
            Content::Labels(labels.clone()),
        ));
    }
    for (index, vector) in found.eigenvectors.iter().enumerate().skip(1).take(eigenvectors) {
        panels.push(panel(
            format!("eigenvector-{}", index + 1),
            format!("Eigenvector {}: λ = {:.4}", index + 1, found.eigenvalues[index]),
            Content::Signed(vector.clone()),
        ));
    }
    panels
}
