//! `report.html`: one self-contained page with what a run found. Nothing is fetched from elsewhere; a small script enlarges
//! pictures and reads pixels out, and without it all is there to be read.

use std::path::Path;

use askama::Template;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;

use super::{atomic, colormap, palette, srgb};
use crate::error::{Error, Result};

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
    Strip {
        /// Above them; may be empty.
        caption: String,
        /// One after the other.
        frames: Vec<Frame>,
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

/// Pictures one below the other, with a caption.
#[derive(Clone, Debug, Default)]
pub struct Frame {
    /// PNG files' bytes.
    pub pngs: Vec<Vec<u8>>,
    /// A word or a number.
    pub caption: String,
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

/// What the colours of a figure mean.
#[derive(Clone, Debug, Default)]
pub enum Legend {
    /// They need no explanation.
    #[default]
    None,
    /// Colours with names.
    Swatches(Vec<Swatch>),
    /// A continuous scale.
    Scale {
        /// The colours from left to right.
        colors: Vec<[u8; 3]>,
        /// Numbers below it, from left to right.
        labels: Vec<String>,
    },
}

/// A colour and its name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Swatch {
    /// sRGB.
    pub color: [u8; 3],
    /// What it stands for.
    pub text: String,
}

impl Legend {
    /// The groups of a label image with their share of its pixels: `group 1: 34 %`. Masked pixels come last.
    pub fn of_labels(labels: &[u8]) -> Self {
        let mut counts = [0_usize; 256];
        for &label in labels {
            counts[usize::from(label)] += 1;
        }
        let swatch = |(label, count): (u8, usize)| {
            let name = match label {
                palette::MASKED_LABEL => "masked".into(),
                label => format!("group {}", u32::from(label) + 1),
            };
            let text = format!("{name}: {}", percent(count as f64 / labels.len() as f64));
            Swatch { color: palette::label_color(label), text }
        };
        Self::Swatches((0..=255).zip(counts).filter(|&(_, count)| count > 0).map(swatch).collect())
    }

    /// The scale of [`colormap::paint_signed`], −`range` to `range`.
    pub fn signed(range: f64) -> Self {
        let colors = (-8..=8).map(|step| colormap::signed_color(f64::from(step) / 8.0)).collect();
        let end = brief(range);
        Self::Scale { colors, labels: vec![format!("\u{2212}{end}"), "0".into(), end] }
    }

    /// The scale of [`develop`](super::tone::develop) for gray light, 0 to `white`.
    pub fn light(white: f64) -> Self {
        let gray = |step: i32| [srgb::encode_srgb(step as f32 / 16.0); 3];
        Self::Scale { colors: (0..=16).map(gray).collect(), labels: vec!["0".into(), brief(white)] }
    }

    /// The scale of [`colormap::paint_sequential`], `low` to `high`.
    pub fn sequential(low: f64, high: f64) -> Self {
        let colors = (0..=16).map(|step| colormap::sequential_color(f64::from(step) / 16.0)).collect();
        Self::Scale { colors, labels: vec![brief(low), brief(high)] }
    }
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
        include_str!("report.js")
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

/// `34 %`, and more digits where these would be lost.
fn percent(fraction: f64) -> String {
    match 100.0 * fraction {
        percent if (99.5..100.0).contains(&percent) => format!("{percent:.1}\u{202f}%"),
        percent if percent >= 1.0 => format!("{percent:.0}\u{202f}%"),
        percent if percent >= 0.01 => format!("{percent:.2}\u{202f}%"),
        _ => "<\u{202f}0.01\u{202f}%".into(),
    }
}

/// A number for a legend: three significant digits.
pub(super) fn brief(value: f64) -> String {
    let text = match value.abs() {
        0.0 => "0".into(),
        size if (1e-3..1e4).contains(&size) => {
            let decimals = (2.0 - size.log10().floor()).clamp(0.0, 5.0) as usize;
            format!("{value:.decimals$}")
        }
        _ => format!("{value:.2e}"),
    };
    text.replace('-', "\u{2212}")
}
