//! The page as HTML.

use std::collections::HashMap;
use std::sync::LazyLock;

use askama::Template;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;

use super::values::Embedded;
use super::{Block, FileLink, Legend, Number, Outcome, Report};
use crate::error::{Error, Result};
use crate::io::raster::Raster;
use crate::report::text;
use crate::report::web::{COLOR, FORMAT, Module, VALUES, VIEW, bundle};

/// The script modules of the page. Each module is listed after the modules that it imports.
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

/// The placeholder for the size of the page, since the size is known only after rendering.
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

    /// The data that the scripts need about a picture. The picture is given by its position, counted from 1.
    fn about(&self, section: &usize, block: &usize, number: &usize) -> &str {
        self.embedded.about([section - 1, block - 1, number - 1])
    }

    /// A sentence about the size of the page, and about where the values of its pictures are stored.
    fn size(&self) -> String {
        format!("This page takes {SIZE}. {}", self.embedded.sentence())
    }

    fn numpy(&self) -> String {
        numpy(&self.report.files)
    }

    fn address(&self, path: &str) -> String {
        address(path)
    }

    fn png(&self, picture: &Raster) -> askama::Result<String> {
        picture.encode_png().map(|png| self.base64(&png)).map_err(askama::Error::custom)
    }

    fn base64(&self, png: &[u8]) -> String {
        STANDARD.encode(png)
    }

    /// Removes the namespace of an SVG document, which inline SVG in HTML does not need. The page then contains no URL at all.
    fn inline(&self, svg: &str) -> String {
        svg.replacen(r#" xmlns="http://www.w3.org/2000/svg""#, "", 1)
    }

    /// The CSS class of a column: `number` if every cell is a number or empty, and at least one is a number.
    fn column(&self, rows: &[Vec<String>], column: usize) -> &'static str {
        let mut cells =
            rows.iter().filter_map(|row| row.get(column)).filter(|cell| !cell.is_empty()).peekable();
        if cells.peek().is_some() && cells.all(|cell| is_number(cell)) { "number" } else { "" }
    }

    /// Whether a table is wider than the 350 pixels of a phone. A letter has 7 pixels, and columns are 12 pixels apart. Text wraps between
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
        definitions(self.report.facts.iter().map(|(name, _)| name.as_str()))
    }

    fn meanings(&self, headers: &[String]) -> Vec<(&'static str, &'static str)> {
        definitions(headers.iter().map(String::as_str))
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

/// Whether the text of a cell is a number: `12`, `−0.5`, `3.1e-4`, `97.3 %`, `1.2 s`, `–` (none).
fn is_number(cell: &str) -> bool {
    let normal = cell.trim().replace('\u{2212}', "-");
    let first = normal.split_whitespace().next().unwrap_or_default().trim_end_matches('%');
    matches!(first, "–" | "—") || (first.parse::<f64>().is_ok() && normal.split_whitespace().count() <= 2)
}

/// A relative path as an address. Each byte of a special character is written as `%` and its hexadecimal code.
pub(super) fn address(path: &str) -> String {
    path.bytes()
        .map(|byte| match byte {
            b'a'..=b'z' | b'A'..=b'Z' | b'0'..=b'9' | b'-' | b'_' | b'.' | b'/' | b'~' => {
                char::from(byte).to_string()
            }
            byte => format!("%{byte:02X}"),
        })
        .collect()
}

fn numpy(files: &[FileLink]) -> String {
    let arrays: Vec<&FileLink> = files.iter().filter(|file| file.name.ends_with(".npy")).collect();
    if arrays.is_empty() {
        return String::new();
    }
    let mut lines = vec!["import json".to_owned(), "import numpy as np".to_owned(), String::new()];
    for file in arrays {
        let name = variable(file.name.trim_end_matches(".npy"));
        let about = if file.about.is_empty() { String::new() } else { format!("  # {}", file.about) };
        lines.push(format!("{name} = np.load(\"{}\"){about}", file.name));
    }
    if files.iter().any(|file| file.name == "run.json") {
        lines.push("run = json.load(open(\"run.json\"))".to_owned());
    }
    lines.join("\n")
}

/// A valid Python name.
fn variable(name: &str) -> String {
    let plain: String = name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
    if plain.starts_with(|c: char| c.is_ascii_digit()) { format!("_{plain}") } else { plain }
}

/// The page of the guide with all definitions, in tables of two columns.
const GLOSSARY: &str = include_str!("../../../guide/src/reference/glossary.md");

static DEFINITIONS: LazyLock<HashMap<&str, String>> = LazyLock::new(|| {
    let rows =
        GLOSSARY.lines().filter_map(|line| line.strip_prefix("| ")?.strip_suffix(" |")?.split_once(" | "));
    let terms = rows.filter(|(term, _)| !term.starts_with('`') && !term.starts_with("--"));
    // The glossary lists general terms of the field last. If a column has the same name as such a term, the definition of the column is
    // used.
    let mut found = HashMap::new();
    for (term, definition) in terms {
        found.entry(term).or_insert_with(|| plain(definition));
    }
    found
});

/// The definitions of those terms that have one. Each term occurs once.
fn definitions<'a>(terms: impl IntoIterator<Item = &'a str>) -> Vec<(&'static str, &'static str)> {
    let mut found: Vec<(&str, &str)> = Vec::new();
    for term in terms {
        let known =
            DEFINITIONS.get_key_value(term).or_else(|| DEFINITIONS.get_key_value(generic(term).as_str()));
        if let Some((&term, definition)) = known
            && !found.iter().any(|(other, _)| *other == term)
        {
            found.push((term, definition));
        }
    }
    found
}

/// The general form of a term with numbers or letters: `from 3` becomes `from N`, `u7` becomes `uN`, and the pixel `C` becomes `A, B, …`.
fn generic(term: &str) -> String {
    let is_number = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    match term.strip_prefix('u') {
        Some(rest) if is_number(rest) => "uN".into(),
        _ if term.len() == 1 && term.bytes().all(|byte| byte.is_ascii_uppercase()) => "A, B, …".into(),
        _ => {
            let words = term.split(' ').map(|word| if is_number(word) { "N" } else { word });
            words.collect::<Vec<_>>().join(" ")
        }
    }
}

/// Markdown as plain text. A link becomes its words.
fn plain(markdown: &str) -> String {
    let mut text = String::new();
    let mut rest = markdown;
    while let Some((before, after)) = rest.split_once("](") {
        text += before;
        rest = after.split_once(')').map_or("", |(_, rest)| rest);
    }
    (text + rest).replace(['[', '`', '*'], "")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arrays_are_loaded_by_names_that_python_takes() {
        let files = ["labels-2.npy", "white.png", "3d/model.npy", "run.json"]
            .map(|name| FileLink::new(name, "2 × 2"));
        let lines = numpy(&files);
        assert!(
            lines.contains("labels_2 = np.load(\"labels-2.npy\")  # 2 × 2\n_3d_model = np.load("),
            "{lines}"
        );
        assert!(!lines.contains("png") && lines.ends_with("run = json.load(open(\"run.json\"))"));
        assert_eq!(numpy(&files[1..2]), "");
    }

    #[test]
    fn addresses_hold_no_letters_that_mean_something_else() {
        assert_eq!(address("a b/ü#1.npy"), "a%20b/%C3%BC%231.npy");
    }

    #[test]
    fn terms_with_numbers_are_defined_once() {
        let found = definitions(["photos", "from 1", "from 2", "u3", "no such figure", "B"]);
        let terms: Vec<&str> = found.iter().map(|(term, _)| *term).collect();
        assert_eq!(terms, ["photos", "from N", "uN", "A, B, …"]);
        assert_eq!(found[0].1, "photos that the row's answer took");
    }

    #[test]
    fn links_keep_their_words() {
        assert_eq!(plain("a [link](b.md#c) of `x` ([how](d.md))"), "a link of x (how)");
    }
}
