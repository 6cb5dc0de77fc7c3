//! `report.html`: one self-contained page with the results of a run. The page loads nothing from elsewhere. A small script zooms
//! pictures and reads out pixels; everything else works without it.

mod definitions;
mod legend;
mod sheet;

use std::path::Path;

use askama::Template;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;

use crate::error::{Error, Result};
use crate::io::atomic;
pub(super) use legend::brief;
pub use legend::{Legend, Swatch};
pub use sheet::{Frame, Sheet};

/// A page. All text is plain text and is escaped.
#[derive(Clone, Debug, Default)]
pub struct Report {
    /// The command and its subject, e.g. `segment · two rooms`.
    pub title: String,
    /// The result in one sentence.
    pub verdict: Verdict,
    /// Names and values of the run's main facts: photos, size, seed, time.
    pub facts: Vec<(String, String)>,
    /// The body.
    pub sections: Vec<Section>,
    /// Text at the end, e.g. the command line that produces the same page again.
    pub footer: String,
}

/// The result in one sentence, and whether it is good enough.
#[derive(Clone, Debug, Default)]
pub struct Verdict {
    /// Selects how the sentence is marked.
    pub outcome: Outcome,
    /// The sentence.
    pub sentence: String,
}

/// How good a result is; the exit status says the same.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Outcome {
    /// As good as requested.
    #[default]
    Good,
    /// Completed, but not good enough.
    Short,
    /// Not completed.
    Failed,
}

/// A section of the page.
#[derive(Clone, Debug, Default)]
pub struct Section {
    /// The heading.
    pub title: String,
    /// A paragraph below the heading; may be empty.
    pub text: String,
    /// Pictures, plots and tables.
    pub blocks: Vec<Block>,
}

/// A block of a section.
#[derive(Clone, Debug)]
pub enum Block {
    /// Pictures beside one another.
    Figures(Vec<Figure>),
    /// One plot over the full width.
    Plot {
        /// An SVG document, as made by [`plot`](super::plot). It is embedded unescaped: never pass text from elsewhere.
        svg: String,
        /// Text below the plot; may be empty.
        caption: String,
    },
    /// A table; columns of numbers are right-aligned.
    Table {
        /// One header per column.
        headers: Vec<String>,
        /// Cells, row by row.
        rows: Vec<Vec<String>>,
        /// Text above the table; may be empty.
        caption: String,
    },
    /// A statement from the literature beside our measurements.
    Claim {
        /// The source and the statement.
        statement: [String; 2],
        /// Our measurements.
        measured: Vec<Measured>,
    },
    /// Many small pictures in order.
    ContactSheet {
        /// Text above the pictures; may be empty.
        caption: String,
        /// The pictures.
        sheet: Sheet,
    },
}

/// Measured numbers beside a statement.
#[derive(Clone, Debug, Default)]
pub struct Measured {
    /// Which rig or method measured.
    pub title: String,
    /// How it was measured.
    pub text: String,
    /// Whether the numbers confirm the statement, in a word or two.
    pub verdict: Verdict,
    /// The numbers in order.
    pub numbers: Vec<Number>,
}

/// A measured number with its bound.
#[derive(Clone, Debug, Default)]
pub struct Number {
    /// Quantity and unit.
    pub what: String,
    /// The value, formatted.
    pub value: String,
    /// The bound and by how much the value misses it; empty if the value has no bound.
    pub wanted: String,
    /// Whether the value meets the bound; `None` if it has no bound.
    pub outcome: Option<Outcome>,
}

/// A picture, shown without interpolation so that small pictures keep sharp pixels.
#[derive(Clone, Debug, Default)]
pub struct Figure {
    /// Bytes of a PNG file.
    pub png: Vec<u8>,
    /// Text below the picture.
    pub caption: String,
    /// The meaning of its colours.
    pub legend: Legend,
}

impl Report {
    /// The page's HTML. Equal reports give equal bytes.
    ///
    /// # Errors
    /// [`Error::Numerical`] if the template cannot be rendered.
    pub fn render(&self) -> Result<String> {
        Page { report: self }
            .render()
            .map_err(|error| Error::Numerical(format!("the report's template: {error}")))
    }

    /// Writes the page.
    ///
    /// # Errors
    /// As [`Report::render`], and [`Error::Write`].
    pub fn write(&self, path: &Path) -> Result<()> {
        atomic::write_bytes(path, self.render()?.as_bytes())
    }
}

#[derive(Template)]
#[template(path = "report.html", config = "src/report/askama.toml")]
struct Page<'a> {
    report: &'a Report,
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

    /// Zoom and pixel read-out; the page also works without this script.
    fn script(&self) -> &'static str {
        include_str!("../report.js")
    }

    fn base64(&self, png: &[u8]) -> String {
        STANDARD.encode(png)
    }

    /// Inline SVG in HTML needs no namespace; without it the page contains no URL at all.
    fn inline(&self, svg: &str) -> String {
        svg.replacen(r#" xmlns="http://www.w3.org/2000/svg""#, "", 1)
    }

    /// CSS class of a column: `number` if every cell is a number or empty, and at least one is a number.
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

    /// What the facts at the top of the page mean.
    fn meanings_of_facts(&self) -> Vec<(&'static str, &'static str)> {
        definitions::definitions(self.report.facts.iter().map(|(name, _)| name.as_str()))
    }

    /// What the columns of a table mean.
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
