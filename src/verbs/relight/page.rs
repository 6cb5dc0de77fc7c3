//! The files and the report page of low-rank relighting.

use std::fmt::Write;

use super::Relighting;
use crate::analysis::low_rank::{RankRow, Relit};
use crate::error::Result;
use crate::io::raster::exposure;
use crate::report::figure;
use crate::report::html::Block;
use crate::report::plot;
use crate::report::run::AnswerPage;
use crate::report::text::percentage;

impl Relighting {
    /// Writes images, `error-curve.csv` and `relighting-errors.csv`. Relit and true photos share one exposure.
    pub(super) fn show_on(&self, page: &mut AnswerPage<'_>) -> Result<()> {
        self.relit(page)?;
        self.curve(page)?;
        self.reduced(page)?;
        self.duals(page)?;
        page.contact_sheet("White and smooth random patterns come first, then photos that are projected back. Direct light, which is kept apart, is not in them.")?;
        page.fact("Rank of the model", self.model.rank());
        Ok(())
    }

    fn relit(&self, page: &mut AnswerPage<'_>) -> Result<()> {
        let mut figures = Vec::new();
        for (relit, number) in self.relit.iter().zip(1..) {
            let scale = exposure(relit.truth.as_ref().unwrap_or(&relit.relit));
            let [pattern, own, other] = ["pattern", "relit", "true"].map(|name| format!("{name}-{number}"));
            let figure = figure::pattern(&relit.pattern, format!("Pattern {number}: {}", relit.name));
            figures.push(page.picture(&pattern, figure.named(&pattern, "")));
            let caption = match relit.errors.last() {
                Some(error) => format!("within {}", percentage(*error)),
                None => format!("about {} off, by what the photos leave open", percentage(relit.stated)),
            };
            figures.push(page.light(&own, &relit.relit, scale, format!("Relit {number}: {caption}")));
            let Some(truth) = &relit.truth else { continue };
            figures.push(page.light(&other, truth, scale, format!("True photo {number}")));
            figure::flip(&mut figures, &[&own, &other]);
            let caption = format!("Relit {number} less true");
            figures.push(page.difference(&relit.relit.planes(), &truth.planes(), caption)?);
        }
        let mut blocks = vec![Block::Figures(figures)];
        if self.relit.iter().any(|relit| relit.errors.len() > 1) {
            blocks.push(self.errors_by_rank(page)?);
        }
        page.section("Relit", "Direct light is kept apart, and exact; of global light the model knows what its photos told it. No photo of these patterns was taken for it.", blocks);
        Ok(())
    }

    fn reduced(&self, page: &mut AnswerPage<'_>) -> Result<()> {
        let mut figures = Vec::new();
        for (reduced, number) in self.reduced.iter().zip(1..) {
            let scale = exposure(&reduced.photo);
            let caption = format!("Photo {number}: {}", reduced.name);
            figures.push(figure::light(&reduced.photo, scale, &page.unit, caption));
            let error =
                reduced.error.map_or(String::new(), |error| format!(": within {}", percentage(error)));
            let caption = format!("Direct light alone {number}{error}");
            figures.push(page.light(&format!("direct-only-{number}"), &reduced.direct, scale, caption));
            let Some(truth) = &reduced.truth else { continue };
            let caption = format!("True direct light {number}");
            figures.push(page.light(&format!("direct-only-true-{number}"), truth, scale, caption));
            let caption = format!("Direct light {number} less true");
            figures.push(page.difference(&reduced.direct.planes(), &truth.planes(), caption)?);
        }
        if !figures.is_empty() {
            let text = "A photo taken under an unknown pattern, and what it would be if light bounced only once: D A⁻¹ y, by the model.";
            page.section("Without interreflections", text, [Block::Figures(figures)]);
        }
        Ok(())
    }

    fn duals(&self, page: &mut AnswerPage<'_>) -> Result<()> {
        let mut figures = Vec::new();
        for (dual, number) in self.duals.iter().zip(1..) {
            let error = dual.error.map_or(String::new(), |error| format!(": within {}", percentage(error)));
            let caption = format!("Lit from the camera by {}{error}", dual.name);
            let file = format!("dual-{number}");
            figures.push(page.light(&file, &dual.image, exposure(&dual.image), caption));
        }
        if !figures.is_empty() {
            let text = "The scene as the projector would see it, were it the camera: Aᵀ y. Of a coaxial rig this is what the camera sees.";
            page.section("Dual photographs", text, [Block::Figures(figures)]);
        }
        Ok(())
    }

    /// The error of each relit photo after each photo of the capture.
    fn errors_by_rank(&self, page: &mut AnswerPage<'_>) -> Result<Block> {
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
        page.files.text("relighting-errors.csv", csv);
        let line = |(index, relit): &(usize, &Relit)| {
            let errors = relit.errors.iter().zip(1..).map(|(&error, photos)| (f64::from(photos), error));
            plot::line(format!("{}: {}", index + 1, short(&relit.name)), errors)
        };
        let caption = "The relit photos' errors, had the capture ended after so many photos.";
        let axes = ["photos", "relative error of the photo"];
        Ok(plot::lines(axes, known.iter().map(line).collect(), caption))
    }

    /// Writes the plot of the model matrix's error after each photo.
    fn curve(&self, page: &mut AnswerPage<'_>) -> Result<()> {
        if self.curve.is_empty() {
            return Ok(());
        }
        let mut csv = "photos,error,one_sided_error,optimal_error\n".to_owned();
        for row in &self.curve {
            let optimal = row.optimal.map_or_else(String::new, |optimal| format!("{optimal:e}"));
            let _ = writeln!(csv, "{},{:e},{:e},{optimal}", row.photos, row.error, row.one_sided);
        }
        page.files.text("error-curve.csv", csv);
        let line = |name: &str, of: fn(&RankRow) -> Option<f64>| {
            plot::line(name, self.curve.iter().filter_map(|row| Some((row.photos as f64, of(row)?))))
        };
        let lines = vec![
            line("the model", |row| Some(row.error)),
            line("W Qᵀ alone", |row| Some(row.one_sided)),
            line("the best of this rank", |row| row.optimal),
        ];
        let axes = ["photos (rank)", "relative error of global light, Frobenius norm"];
        let plot = plot::lines(axes, lines, "");
        let marked = |row: &&RankRow| {
            [1, 2, 5, 10, 20, 40, 80, 160].contains(&row.photos) || row.photos == self.curve.len()
        };
        let row = |row: &RankRow| {
            vec![
                row.photos.to_string(),
                percentage(row.error),
                percentage(row.one_sided),
                row.optimal.map_or_else(|| "–".into(), percentage),
                row.optimal.map_or_else(|| "–".into(), |optimal| format!("{:.3}", row.error / optimal)),
            ]
        };
        let table = Block::table(
            ["photos", "the model", "W Qᵀ alone", "best of this rank", "ratio to the best"],
            self.curve.iter().filter(marked).map(row).collect(),
            "Errors of the global part of the matrix, relative to it, in the Frobenius norm",
        );
        let text = "Against the true matrix, whose own sampling noise has no low rank: no model comes near 0 here, and what counts is the ratio to the best one (by singular values).";
        page.section("Error by rank", text, [plot, table]);
        Ok(())
    }
}

fn short(name: &str) -> &str {
    name.rsplit('/').next().unwrap_or(name)
}
