//! `report.html`: one self-contained page with the results of a run. Scripts show values, zoom, flip and compare, but are not required.

mod legend;
mod page;
mod values;

use std::path::Path;

use crate::error::Result;
use crate::io::atomic;
use crate::io::raster::Raster;
pub(super) use legend::brief;
pub use legend::{Legend, Swatch};
pub use values::{Kind, MOST_BYTES, Values};

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
    /// Files of the run's folder that the page links to.
    pub files: Vec<FileLink>,
    /// The address of a page that contains the matrix and shows its rows; may be empty.
    pub paint: String,
    /// Text at the end, e.g. the command line that produces the same page again.
    pub footer: String,
}

/// The result in one sentence, and whether it is good enough.
#[derive(Clone, Debug, Default)]
pub struct Verdict {
    /// The quality of the result, which determines how the sentence is marked.
    pub outcome: Outcome,
    /// The sentence.
    pub sentence: String,
}

/// The quality of a result. The exit status agrees with it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Outcome {
    /// The result is as good as requested.
    #[default]
    Good,
    /// The command was completed, but the result is not good enough.
    Short,
    /// The command was not completed.
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
        /// An SVG document, as made by [`plot`](super::plot). It is embedded without escapes, so it must not contain text from elsewhere.
        svg: String,
        /// Text below the plot; may be empty.
        caption: String,
    },
    /// Small plots with the same axes beside one another.
    Multiples {
        /// Titles and SVG documents, as for [`Block::Plot`].
        plots: Vec<(String, String)>,
        /// Text below the plots; may be empty.
        caption: String,
    },
    /// Runs, with links to their pages.
    Runs(Vec<RunCard>),
    /// A table; columns of numbers are right-aligned.
    Table {
        /// One header per column.
        headers: Vec<String>,
        /// Cells, row by row.
        rows: Vec<Vec<String>>,
        /// Text above the table; may be empty.
        caption: String,
    },
    /// A statement from the literature, compared with our measurements.
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

impl Block {
    /// A table with one header for each column.
    pub fn table<H: Into<String>>(
        headers: impl IntoIterator<Item = H>,
        rows: Vec<Vec<String>>,
        caption: impl Into<String>,
    ) -> Self {
        let headers = headers.into_iter().map(Into::into).collect();
        Self::Table { headers, rows, caption: caption.into() }
    }
}

/// Measured numbers beside a statement.
#[derive(Clone, Debug, Default)]
pub struct Measured {
    /// The rig or method that was measured.
    pub title: String,
    /// The way in which the numbers were measured.
    pub text: String,
    /// Whether the numbers confirm the statement, in one or two words.
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
    /// The bound, and the distance by which the value misses it; empty if the value has no bound.
    pub wanted: String,
    /// Whether the value meets the bound; `None` without a bound.
    pub outcome: Option<Outcome>,
}

/// A picture, shown without interpolation so that small pictures keep sharp pixels.
#[derive(Clone, Debug, Default)]
pub struct Figure {
    /// The picture.
    pub picture: Raster,
    /// Text below the picture.
    pub caption: String,
    /// The meaning of the picture's colours.
    pub legend: Legend,
    /// The values of the picture's pixels; `None` if the page does not know them.
    pub values: Option<Values>,
    /// A short name; may be empty.
    pub name: String,
    /// The file that contains the values, and the index in its array, such as `eigenvectors.npy[3]`; may be empty.
    pub file: String,
    /// The quantity by which a slider selects pictures, e.g. `eigenvector`; empty for pictures that are always shown.
    pub series: String,
    /// The names of the pictures that the reader can flip to.
    pub flips: Vec<String>,
}

impl Figure {
    /// Sets the name, and the file that holds the values.
    #[must_use]
    pub fn named(self, name: impl Into<String>, file: impl Into<String>) -> Self {
        Self { name: name.into(), file: file.into(), ..self }
    }

    /// Adds the picture to the series of a slider.
    #[must_use]
    pub fn in_series(self, series: &str) -> Self {
        Self { series: series.to_owned(), ..self }
    }
}

/// The entry of a run on an index page.
#[derive(Clone, Debug, Default)]
pub struct RunCard {
    /// The run's folder, relative to the page.
    pub folder: String,
    /// The address of the run's page, relative to the index; empty if there is no page.
    pub page: String,
    /// The address of the run's picture, relative to the index; empty if there is no picture.
    pub picture: String,
    /// The state of the run, and the sentence about its result.
    pub verdict: Verdict,
    /// Facts such as verb, source, photos and time.
    pub facts: Vec<(String, String)>,
}

/// Pictures on one sheet, with their positions.
#[derive(Clone, Debug, Default)]
pub struct Sheet {
    /// Bytes of a PNG file.
    pub png: Vec<u8>,
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    /// The frames in order.
    pub frames: Vec<Frame>,
}

/// One frame: a pattern above its photo.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Frame {
    /// Left, top, width and height of each picture on the sheet, and its description.
    pub pictures: Vec<([usize; 4], String)>,
    /// Number of the photo, from 1.
    pub number: usize,
    /// The value of the photo's brightest colour.
    pub range: String,
}

/// A file of the run's folder.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct FileLink {
    /// The name, relative to the page.
    pub name: String,
    /// The content, such as `10 × 128 × 128, float64`; may be empty.
    pub about: String,
}

impl FileLink {
    /// A link to a file.
    pub fn new(name: impl Into<String>, about: impl Into<String>) -> Self {
        Self { name: name.into(), about: about.into() }
    }

    pub(super) fn address(&self) -> String {
        page::address(&self.name)
    }
}

impl Report {
    /// The page's HTML. Equal reports give equal bytes. Fails if the template cannot be rendered.
    pub fn render(&self) -> Result<String> {
        page::render(self)
    }

    /// Writes the page. Fails as [`Report::render`], or with [`Error::Write`](crate::Error::Write).
    pub fn write(&self, path: &Path) -> Result<()> {
        atomic::write_bytes(path, self.render()?.as_bytes())
    }
}
