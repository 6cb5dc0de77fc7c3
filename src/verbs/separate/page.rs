//! The files and the report page of a separation into direct and global light.

use std::fmt::Write;

use super::Separated;
use crate::analysis::planes::{Planes, sum};
use crate::analysis::separate::ComparisonRow;
use crate::error::Result;
use crate::finding::Ratio;
use crate::image::Image;
use crate::io::picture;
use crate::io::raster::exposure;
use crate::report::figure;
use crate::report::html::Block;
use crate::report::plot;
use crate::report::run::AnswerPage;
use crate::report::text::percentage;

impl Separated {
    /// Writes images and `errors.csv`. The `.png` files of direct and global light share one exposure.
    pub(super) fn show_on(&self, page: &mut AnswerPage<'_>) -> Result<()> {
        let image = |planes: &Planes| Image::from_planes(self.resolution, planes);
        let scale = exposure(&image(&sum(&self.direct, &self.global))?);
        let mut figures = Vec::new();
        for layer in self.layers() {
            figures.push(page.light(layer.file, &image(layer.planes)?, scale, layer.caption));
        }
        if self.truth.is_some() {
            figure::flip(&mut figures, &["direct", "exact"]);
        }
        let text = format!("Under an all-ones pattern, in {}; all developed alike.", page.unit);
        page.section("Where the light comes from", text, [Block::Figures(figures)]);
        let mut errors = Vec::new();
        if let Some(truth) = &self.truth {
            errors.push(page.difference(&self.direct, truth, "Direct light found less exact")?);
        }
        for layer in self.standard_errors() {
            let planes = image(layer.planes)?;
            page.files.later(&format!("{}.npy", layer.file), move |path| picture::write(path, &planes));
            errors.push(page.errors(layer.planes, layer.caption)?);
        }
        if !errors.is_empty() {
            let text = "Light that comes back to its own pixel, or to its neighbours, cannot be distinguished from direct light by patterns.";
            page.section("How right it is", text, [Block::Figures(errors)]);
        }
        if !self.comparison.is_empty() {
            page.files.text("errors.csv", self.csv());
            self.compared(page);
        }
        page.contact_sheet("Those of the method come first, those that tell near from far last.")?;
        page.fact("Method", &self.method);
        if let Some(reach) = &self.near_far {
            let error = reach.error.map_or(String::new(), |error| format!(", error {}", percentage(error)));
            let text = format!("{} photos, noise {}{error}", reach.photos, percentage(reach.noise));
            page.fact("Near indirect light by probing", text);
        }
        Ok(())
    }

    fn csv(&self) -> String {
        let mut text = "method,setting,photos,direct_error,global_error\n".to_owned();
        for row in &self.comparison {
            let field = |error: Ratio| error.value().map_or(String::new(), |error| format!("{error:e}"));
            let [direct, global] = [row.error, row.global_error].map(field);
            // Writing to a string cannot fail.
            let _ = writeln!(text, "{},\"{}\",{},{direct},{global}", row.method, row.setting, row.photos);
        }
        text
    }

    fn compared(&self, page: &mut AnswerPage<'_>) {
        let mut names: Vec<&'static str> = Vec::new();
        for row in &self.comparison {
            if !names.contains(&row.method) {
                names.push(row.method);
            }
        }
        let line = |name: &&str| {
            let rows = self.comparison.iter().filter(|row| row.method == *name);
            let points = rows.filter_map(|row| Some((row.photos as f64, row.error.value()?)));
            plot::line(*name, points)
        };
        let lines = names.iter().map(line).collect();
        let plot = plot::lines(["photos", "relative error of the direct light"], lines, "");
        let row = |row: &ComparisonRow| {
            vec![
                row.setting.clone(),
                row.photos.to_string(),
                percentage(row.error),
                percentage(row.global_error),
            ]
        };
        let table = Block::table(
            ["method", "photos", "direct", "global"],
            self.comparison.iter().map(row).collect(),
            "Errors of direct and global light, relative to the exact ones",
        );
        let text = "Against the exact first bounce. Random patterns are right on average for the light that comes back to its own pixel, and their noise falls with more of them; checkerboards and sinusoids keep what is as sharp as they are; the patterns of one capture all carry the signs of its start, so that more of them hardly help.";
        page.section("Every method at several photo counts", text, [plot, table]);
    }
}
