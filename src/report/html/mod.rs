//! `report.html`: one self-contained page with what a run found. Nothing is fetched from elsewhere; a small script enlarges
//! pictures and reads pixels out, and without it all is there to be read.

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

/// A page. All text is plain and is escaped.
#[derive(Clone, Debug, Default)]
pub struct Report {
    /// What was run on what, e.g. `segment · two rooms`.
    pub title: String,
    /// The answer in a sentence.
    pub verdict: Verdict,
    /// Names and values of what the reader should know first: photos, size, seed, time.
    pub facts: Vec<(String, String)>,
    /// The body.
    pub sections: Vec<Section>,
    /// Below everything, e.g. the command line that makes the same page again.
    pub footer: String,
}

/// The answer in a sentence, and whether it is good enough.
#[derive(Clone, Debug, Default)]
pub struct Verdict {
    /// How it is marked.
    pub outcome: Outcome,
    /// A sentence.
    pub sentence: String,
}

/// How good an answer is; the exit status says the same.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Outcome {
    /// As good as was asked for.
    #[default]
    Good,
    /// Done, but not good enough.
    Short,
    /// Not done.
    Failed,
}

/// A part of the page with its heading.
#[derive(Clone, Debug, Default)]
pub struct Section {
    /// The heading.
    pub title: String,
    /// A paragraph below it; may be empty.
    pub text: String,
    /// Pictures, plots and tables.
    pub blocks: Vec<Block>,
}

/// What stands in a section.
#[derive(Clone, Debug)]
pub enum Block {
    /// Pictures side by side.
    Figures(Vec<Figure>),
    /// One plot over the whole width.
    Plot {
        /// An SVG document, as [`plot`](super::plot) makes them. It is embedded as it is: never pass foreign text.
        svg: String,
        /// Below it; may be empty.
        caption: String,
    },
    /// A table; columns of numbers are aligned to the right.
    Table {
        /// One per column.
        headers: Vec<String>,
        /// Cells, row by row.
        rows: Vec<Vec<String>>,
        /// Above it; may be empty.
        caption: String,
    },
    /// What somebody says, beside what was measured.
    Claim {
        /// Who, and what.
        statement: [String; 2],
        /// What was measured, by whom or what.
        measured: Vec<Measured>,
    },
    /// Many small pictures in order.
    ContactSheet {
        /// Above them; may be empty.
        caption: String,
        /// All of them.
        sheet: Sheet,
    },
}

/// Numbers beside a statement.
#[derive(Clone, Debug, Default)]
pub struct Measured {
    /// By whom or what.
    pub title: String,
    /// How it was measured.
    pub text: String,
    /// Whether they are what was said, in a word or two.
    pub verdict: Verdict,
    /// One after the other.
    pub numbers: Vec<Number>,
}

/// A number with what it has to be.
#[derive(Clone, Debug, Default)]
pub struct Number {
    /// What it is, with its unit.
    pub what: String,
    /// The number.
    pub value: String,
    /// What it has to be, and by how much it is not; empty where it is only stated.
    pub wanted: String,
    /// How good it is; `None` where it is only stated.
    pub outcome: Option<Outcome>,
}

/// A picture, shown without smoothing so that small ones keep their pixels.
#[derive(Clone, Debug, Default)]
pub struct Figure {
    /// A PNG file's bytes.
    pub png: Vec<u8>,
    /// Below it.
    pub caption: String,
    /// What its colours mean.
    pub legend: Legend,
}

impl Report {
    /// The page's text. The same report gives the same bytes.
    ///
    /// # Errors
    /// [`Error::Numerical`] if the template refuses to be filled.
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

    /// Zoom and pixel read-out: what the page does not depend on.
    fn script(&self) -> &'static str {
        include_str!("../report.js")
    }

    fn base64(&self, png: &[u8]) -> String {
        STANDARD.encode(png)
    }

    /// Within HTML the namespace is understood, and the page then names no address at all.
    fn inline(&self, svg: &str) -> String {
        svg.replacen(r#" xmlns="http://www.w3.org/2000/svg""#, "", 1)
    }

    /// The class of a column: whether every cell in it is a number or empty, with at least one number.
    fn column(&self, rows: &[Vec<String>], column: usize) -> &'static str {
        let mut cells =
            rows.iter().filter_map(|row| row.get(column)).filter(|cell| !cell.is_empty()).peekable();
        if cells.peek().is_some() && cells.all(|cell| is_number(cell)) { "number" } else { "" }
    }

    /// Whether a table needs more width than a phone has: about 350 pixels, at 7 a letter and 12 between columns. Texts are broken,
    /// but not into less than 14 letters a line, nor within a word.
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

/// Whether a cell reads as a number: `12`, `−0.5`, `3.1e-4`, `97.3 %`, `1.2 s`, `–` (none).
fn is_number(cell: &str) -> bool {
    let normal = cell.trim().replace('\u{2212}', "-");
    let first = normal.split_whitespace().next().unwrap_or_default().trim_end_matches('%');
    matches!(first, "–" | "—") || (first.parse::<f64>().is_ok() && normal.split_whitespace().count() <= 2)
}
