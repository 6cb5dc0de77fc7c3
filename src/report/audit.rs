//! Files and report page of an audit.

use std::path::Path;

use super::colormap::{paint_sequential, paint_signed, robust_range, sequential_color};
use super::html::{Block, Figure, Legend, Outcome, Report, Section, Swatch, Verdict};
use super::run::{self, Files};
use crate::analysis::audit::{self, Audit};
use crate::error::{Error, Result};
use crate::io::{atomic, npy};
use crate::measure::RunManifest;

/// A finished audit and the context that its report needs.
#[derive(Clone, Debug)]
pub struct AuditRun<'a> {
    /// The page's title.
    pub title: String,
    /// The result.
    pub found: &'a Audit,
    /// Unit of the photos' values.
    pub unit: &'a str,
}

impl AuditRun<'_> {
    /// Writes `audit.json`, arrays, pictures and `report.html` into `folder` and returns their names. `seconds` is the run's
    /// duration so far.
    ///
    /// # Errors
    /// [`crate::Error::Write`] naming the file.
    pub fn write(&self, folder: &Path, manifest: &RunManifest, seconds: f64) -> Result<Vec<String>> {
        let mut files = Files::new(folder);
        let path = files.path("audit.json");
        let text = serde_json::to_string_pretty(&self.found.checks)
            .map_err(|error| Error::writing(&path)(error.into()))?;
        atomic::write_bytes(&path, format!("{text}\n").as_bytes())?;
        let size = [self.found.resolution.height, self.found.resolution.width];
        for (name, values) in [("white", &self.found.white), ("direct-share", &self.found.direct_share)] {
            if !values.is_empty() {
                npy::write_npy(&files.path(&format!("{name}.npy")), &size, values)?;
            }
        }
        let pictures = self.pictures()?;
        for (name, figure) in &pictures {
            atomic::write_bytes(&files.path(&format!("{name}.png")), &figure.png)?;
        }
        let figures = pictures.into_iter().map(|(_, figure)| figure).collect();
        self.page(figures, manifest, seconds).write(&files.path("report.html"))?;
        Ok(files.names)
    }

    fn pictures(&self) -> Result<Vec<(&'static str, Figure)>> {
        let found = self.found;
        let mut pictures = Vec::new();
        if !found.white.is_empty() {
            let top = found.white.iter().copied().fold(0.0, f64::max);
            pictures.push((
                "white",
                Figure {
                    png: paint_sequential(found.resolution, &found.white, None, (0.0, top))?.encode_png()?,
                    caption: "The photo under white".into(),
                    legend: Legend::sequential(0.0, top).with_unit(self.unit),
                },
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
                },
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
                },
            ));
        }
        Ok(pictures)
    }

    fn page(&self, figures: Vec<Figure>, manifest: &RunManifest, seconds: f64) -> Report {
        let found = self.found;
        let percent =
            |share: f64| if share.is_finite() { format!("{:.3} %", 100.0 * share) } else { "–".into() };
        let rows = found.checks.iter().map(|check| {
            let verdict = match check.verdict {
                audit::Verdict::Passes => "passes",
                audit::Verdict::Fails => "fails",
                audit::Verdict::Told => "",
            };
            vec![
                check.name.to_owned(),
                verdict.to_owned(),
                percent(check.figure),
                percent(check.error),
                percent(check.bound),
                check.meaning.clone(),
            ]
        });
        let headers = ["Check", "Verdict", "Figure", "Standard error", "At most", "What it means"];
        Report {
            title: self.title.clone(),
            verdict: Verdict {
                outcome: if found.passed() { Outcome::Good } else { Outcome::Short },
                sentence: found.sentence(),
            },
            facts: run::facts(manifest, found.photos, [], seconds),
            sections: vec![
                Section {
                    title: "Checks".into(),
                    text: "A check fails when its figure lies beyond the bound by more than three standard errors.".into(),
                    blocks: vec![Block::Table {
                        headers: headers.map(str::to_owned).to_vec(),
                        rows: rows.collect(),
                        caption: String::new(),
                    }],
                },
                Section {
                    title: "Pictures".into(),
                    text: String::new(),
                    blocks: vec![Block::Figures(figures)],
                },
            ],
            footer: manifest.command.join(" "),
        }
    }
}
