//! Files and report page of an audit.

use super::colormap::{paint_sequential, paint_signed, robust_range, sequential_color};
use super::html::{Block, Figure, Kind, Legend, Report, Section, Swatch, Values};
use super::run::{Files, Run, table};
use crate::bench::audit::Audit;
use crate::error::{Error, Result};

/// Writes `audit.json`, arrays, pictures and `report.html` into the run's folder and returns their names.
pub fn write(found: &Audit, run: &Run<'_>) -> Result<Vec<String>> {
    let mut files = Files::new(run.folder);
    let text = serde_json::to_string_pretty(&found.checks)
        .map_err(|error| Error::writing(run.folder.join("audit.json"))(error.into()))?;
    files.text("audit.json", &format!("{text}\n"))?;
    let size = [found.resolution.height, found.resolution.width];
    for (name, values) in [("white", &found.white), ("direct-share", &found.direct_share)] {
        if !values.is_empty() {
            files.array(name, &size, values)?;
        }
    }
    let pictures = pictures(found, run.unit)?;
    for (name, figure) in &pictures {
        files.picture(name, figure)?;
    }
    let figures = pictures.into_iter().map(|(_, figure)| figure).collect();
    files.finish(page(found, run, figures))
}

fn pictures(found: &Audit, unit: &str) -> Result<Vec<(&'static str, Figure)>> {
    let mut pictures = Vec::new();
    if !found.white.is_empty() {
        let top = found.white.iter().copied().fold(0.0, f64::max);
        pictures.push((
            "white",
            Figure {
                png: paint_sequential(found.resolution, &found.white, None, (0.0, top))?.encode_png()?,
                caption: "The photo under white".into(),
                legend: Legend::sequential(0.0, top).with_unit(unit),
                values: Some(Values::of_numbers(found.resolution, Kind::Number, &found.white, unit)),
                ..Figure::default()
            }
            .named("white", "white.npy"),
        ));
    }
    if !found.additivity.is_empty() {
        let range = robust_range(&found.additivity, None);
        pictures.push((
            "additivity",
            Figure {
                png: paint_signed(found.resolution, &found.additivity, None, range)?.encode_png()?,
                caption: "Two halves of white less white".into(),
                legend: Legend::signed(range).with_unit("of white's mean"),
                values: Some(Values::of_numbers(
                    found.resolution,
                    Kind::Number,
                    &found.additivity,
                    "of white's mean",
                )),
                ..Figure::default()
            }
            .named("additivity", ""),
        ));
    }
    if !found.shadow.is_empty() {
        let shadow: Vec<f64> = found.shadow.iter().map(|&shadow| f64::from(u8::from(shadow))).collect();
        pictures.push((
            "shadow",
            Figure {
                png: paint_sequential(found.resolution, &shadow, None, (0.0, 1.0))?.encode_png()?,
                caption: "Direct shadows: what the camera sees, but the projector does not light".into(),
                legend: Legend::Swatches(
                    [(0.0, "lit"), (1.0, "in shadow")]
                        .map(|(value, text)| Swatch { color: sequential_color(value), text: text.into() })
                        .to_vec(),
                ),
                values: Some(Values::of_numbers(found.resolution, Kind::Number, &shadow, "")),
                ..Figure::default()
            }
            .named("shadow", ""),
        ));
    }
    Ok(pictures)
}

fn page(found: &Audit, run: &Run<'_>, figures: Vec<Figure>) -> Report {
    let mut sections = vec![Section {
        title: "Pictures".into(),
        text: String::new(),
        blocks: vec![Block::Figures(figures)],
    }];
    if !found.devices.is_empty() {
        sections.push(Section {
            title: "Devices".into(),
            text: "What projector and camera do without being asked, and what is in the way of their light. It may be why a check fails; it does not \
                   fail the audit by itself."
                .into(),
            blocks: vec![table(&found.devices)],
        });
    }
    run.page((found.findings(), found.sentence()), found.photos, [], sections)
}
