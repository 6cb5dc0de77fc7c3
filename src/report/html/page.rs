//! The page as HTML.

use askama::Template;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;

use super::values::Embedded;
use super::{Block, Legend, Number, Outcome, Report, definitions, files};
use crate::error::{Error, Result};
use crate::report::text;
use crate::report::web::{COLOR, FORMAT, Module, VALUES, VIEW, bundle};

/// The modules of the page. Each follows those that it imports.
const MODULES: [Module; 12] = [
    FORMAT,
    COLOR,
    VIEW,
    VALUES,
    ("figure.js", include_str!("../web/figure.js")),
    ("pixel.js", include_str!("../web/pixel.js")),
    ("readout.js", include_str!("../web/readout.js")),
    ("viewer.js", include_str!("../web/viewer.js")),
    ("toolbar.js", include_str!("../web/toolbar.js")),
    ("curves.js", include_str!("../web/curves.js")),
    ("scatter.js", include_str!("../web/scatter.js")),
    ("report.js", include_str!("../web/report.js")),
];

/// The placeholder for the size of the page, which is known after rendering.
const SIZE: &str = "\u{1}size\u{1}";

pub(super) fn render(report: &Report) -> Result<String> {
    let page = Page { report, embedded: Embedded::new(report) };
    let html = page.render().map_err(|error| Error::Numerical(format!("the report's template: {error}")))?;
    let size = text::bytes(html.len() as u64);
    Ok(html.replacen(SIZE, &size, 1))
}

#[derive(Template)]
#[template(path = "report.html", config = "src/report/askama.toml")]
struct Page<'a> {
    report: &'a Report,
    embedded: Embedded,
}

impl Page<'_> {
    fn outcome(&self, outcome: &Outcome) -> &'static str {
        match outcome {
            Outcome::Good => "good",
            Outcome::Short => "short",
            Outcome::Failed => "failed",
        }
    }

    fn outcome_of(&self, number: &Number) -> &'static str {
        number.outcome.as_ref().map_or("stated", |outcome| self.outcome(outcome))
    }

    fn style(&self) -> &'static str {
        include_str!("../report.css")
    }

    fn script(&self) -> String {
        bundle(&MODULES)
    }

    /// The data about a picture for the scripts, by its place, counted from 1.
    fn about(&self, section: &usize, block: &usize, number: &usize) -> &str {
        self.embedded.about([section - 1, block - 1, number - 1])
    }

    /// A sentence about the size of the page and the place of its pictures' values.
    fn size(&self) -> String {
        format!("This page takes {SIZE}. {}", self.embedded.sentence())
    }

    fn numpy(&self) -> String {
        files::numpy(&self.report.files)
    }

    fn address(&self, path: &str) -> String {
        files::address(path)
    }

    fn base64(&self, png: &[u8]) -> String {
        STANDARD.encode(png)
    }

    /// Inline SVG in HTML needs no namespace. Without it the page contains no URL at all.
    fn inline(&self, svg: &str) -> String {
        svg.replacen(r#" xmlns="http://www.w3.org/2000/svg""#, "", 1)
    }

    /// The CSS class of a column: `number` if every cell is a number or empty, and at least one is a number.
    fn column(&self, rows: &[Vec<String>], column: usize) -> &'static str {
        let mut cells =
            rows.iter().filter_map(|row| row.get(column)).filter(|cell| !cell.is_empty()).peekable();
        if cells.peek().is_some() && cells.all(|cell| is_number(cell)) { "number" } else { "" }
    }

    /// Whether a table is wider than a phone's 350 pixels, at 7 pixels per letter and 12 between columns. Text wraps between
    /// words, to lines of at least 14 letters.
    fn is_wide(&self, headers: &[String], rows: &[Vec<String>]) -> bool {
        let length = |text: &str| text.chars().count();
        let column = |index: usize| {
            let cells = || rows.iter().filter_map(move |row| row.get(index));
            let widest = if self.column(rows, index) == "number" {
                cells().map(|cell| length(cell)).max()
            } else {
                let word = |cell: &String| cell.split_whitespace().map(length).max().unwrap_or(0);
                cells().map(|cell| word(cell).max(length(cell).min(14))).max()
            };
            widest.unwrap_or(0).max(length(&headers[index]))
        };
        (0..headers.len()).map(|index| 7 * column(index) + 12).sum::<usize>() > 350
    }

    fn meanings_of_facts(&self) -> Vec<(&'static str, &'static str)> {
        definitions::definitions(self.report.facts.iter().map(|(name, _)| name.as_str()))
    }

    fn meanings(&self, headers: &[String]) -> Vec<(&'static str, &'static str)> {
        definitions::definitions(headers.iter().map(String::as_str))
    }

    fn header<'a>(&self, headers: &'a [String], column: usize) -> &'a str {
        headers.get(column).map_or("", String::as_str)
    }

    fn gradient(&self, colors: &[[u8; 3]]) -> String {
        let colors: Vec<String> = colors.iter().map(|&color| self.css(color)).collect();
        format!("linear-gradient(to right, {})", colors.join(", "))
    }

    fn css(&self, [red, green, blue]: [u8; 3]) -> String {
        format!("#{red:02x}{green:02x}{blue:02x}")
    }
}

/// Whether a cell is a number: `12`, `−0.5`, `3.1e-4`, `97.3 %`, `1.2 s`, `–` (none).
fn is_number(cell: &str) -> bool {
    let normal = cell.trim().replace('\u{2212}', "-");
    let first = normal.split_whitespace().next().unwrap_or_default().trim_end_matches('%');
    matches!(first, "–" | "—") || (first.parse::<f64>().is_ok() && normal.split_whitespace().count() <= 2)
}
