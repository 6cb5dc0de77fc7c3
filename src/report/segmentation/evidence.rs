//! Photos of single groups that are lit alone, and the light that the groups exchange.

use crate::analysis::Evidence;
use crate::error::Result;
use crate::io::raster::exposure;
use crate::report::figure;
use crate::report::html::{Block, Section};
use crate::report::run::Run;
use crate::report::spectrum::narrowed;

pub(super) fn section(run: &Run<'_>, evidence: &Evidence) -> Result<Section> {
    let percent = |share: f64| format!("{:.2} %", 100.0 * share);
    let kept = evidence.kept();
    let figures = evidence.photos.iter().zip(&kept).enumerate().map(|(group, (photo, kept))| {
        let photo = narrowed(run.resolution, photo)?;
        let caption = format!("Group {group} lit alone: it keeps {} of its light", percent(*kept));
        let file = format!("evidence-{}.npy[{group}]", evidence.groups);
        let figure = figure::light(&photo, exposure(&photo), run.unit, caption)?;
        Ok(figure.named(format!("light of group {group}"), file).in_series("group lit alone"))
    });
    let row = |(group, shares): (usize, &Vec<f64>)| {
        std::iter::once(format!("group {group}")).chain(shares.iter().map(|share| percent(*share))).collect()
    };
    let table = Block::Table {
        headers: std::iter::once("arrives in".to_owned())
            .chain((0..evidence.groups).map(|group| format!("from {group}")))
            .collect(),
        rows: evidence.exchange.iter().enumerate().map(row).collect(),
        caption: "Where the light of each group goes; columns add up to 100 %".into(),
    };
    Ok(Section {
        title: format!("Evidence for {} groups", evidence.groups),
        text: format!(
            "Each group was lit alone, in its own photo; each picture is developed by itself, and direct light is left out where it was for the groups. What is dark receives nothing from the group. The cut's value, light that leaves its group in shares of each group's light, added up, is {:.4}.",
            evidence.cut()
        ),
        blocks: vec![Block::Figures(figures.collect::<Result<_>>()?), table],
    })
}
