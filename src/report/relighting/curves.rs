//! Error curves of a low-rank model over the number of photos.

use std::fmt::Write;

use super::Relighting;
use crate::analysis::low_rank::{RankRow, Relit};
use crate::error::Result;
use crate::report::html::{Block, Section};
use crate::report::planes::percent;
use crate::report::plot::{LinePlot, Series};
use crate::report::run::Files;

impl Relighting {
    /// Error of each relit photo after each photo of the capture.
    pub(super) fn errors_by_rank(&self, files: &mut Files<'_>) -> Result<Block> {
        let known: Vec<(usize, &Relit)> =
            self.relit.iter().enumerate().filter(|(_, relit)| relit.errors.len() > 1).collect();
        let mut csv = "photos".to_owned();
        for (index, _) in &known {
            // Writing to a string cannot fail.
            let _ = write!(csv, ",pattern_{}", index + 1);
        }
        csv.push('\n');
        for photos in 0..self.model.rank() {
            let _ = write!(csv, "{}", photos + 1);
            for (_, relit) in &known {
                let error = relit.errors.get(photos.min(relit.errors.len() - 1)).copied();
                let _ = write!(csv, ",{:e}", error.unwrap_or(f64::NAN));
            }
            csv.push('\n');
        }
        files.text("relighting-errors.csv", &csv)?;
        let series = |(index, relit): &(usize, &Relit)| Series {
            name: format!("{}: {}", index + 1, short(&relit.name)),
            points: relit.errors.iter().enumerate().map(|(k, &error)| ((k + 1) as f64, error)).collect(),
        };
        let plot = LinePlot {
            x_label: "photos".into(),
            y_label: "relative error of the photo".into(),
            logarithmic: true,
            series: known.iter().map(series).collect(),
            marks: Vec::new(),
        };
        let caption = "The relit photos' errors, had the capture ended after so many photos.";
        Ok(Block::Plot { svg: plot.render(), caption: caption.into() })
    }

    /// Error of the model matrix after each photo.
    pub(super) fn curve_section(&self, files: &mut Files<'_>) -> Result<Section> {
        let mut csv = "photos,error,one_sided_error,optimal_error\n".to_owned();
        for row in &self.curve {
            let optimal = row.optimal.map_or_else(String::new, |optimal| format!("{optimal:e}"));
            let _ = writeln!(csv, "{},{:e},{:e},{optimal}", row.photos, row.error, row.one_sided);
        }
        files.text("error-curve.csv", &csv)?;
        let line = |name: &str, of: fn(&RankRow) -> Option<f64>| Series {
            name: name.into(),
            points: self.curve.iter().filter_map(|row| Some((row.photos as f64, of(row)?))).collect(),
        };
        let plot = LinePlot {
            x_label: "photos (rank)".into(),
            y_label: "relative error of global light, Frobenius norm".into(),
            logarithmic: true,
            series: vec![
                line("the model", |row| Some(row.error)),
                line("W Qᵀ alone", |row| Some(row.one_sided)),
                line("the best of this rank", |row| row.optimal),
            ],
            marks: Vec::new(),
        };
        let marked = |row: &&RankRow| {
            [1, 2, 5, 10, 20, 40, 80, 160].contains(&row.photos) || row.photos == self.curve.len()
        };
        let row = |row: &RankRow| {
            vec![
                row.photos.to_string(),
                percent(row.error),
                percent(row.one_sided),
                row.optimal.map_or_else(|| "–".into(), percent),
                row.optimal.map_or_else(|| "–".into(), |optimal| format!("{:.3}", row.error / optimal)),
            ]
        };
        let table = Block::Table {
            headers: ["photos", "the model", "W Qᵀ alone", "best of this rank", "ratio to the best"]
                .map(String::from)
                .to_vec(),
            rows: self.curve.iter().filter(marked).map(row).collect(),
            caption: "Errors of the global part of the matrix, relative to it, in the Frobenius norm".into(),
        };
        Ok(Section {
            title: "Error by rank".into(),
            text: "Against the true matrix, whose own sampling noise has no low rank: no model comes near 0 here, and what counts is the ratio to the best one (by singular values).".into(),
            blocks: vec![Block::Plot { svg: plot.render(), caption: String::new() }, table],
        })
    }
}

/// The file name without its folders.
fn short(name: &str) -> &str {
    name.rsplit('/').next().unwrap_or(name)
}
