//! The files and the page of low-rank relighting.

use std::fmt::Write;
use std::path::Path;

use super::colormap::{paint_signed, robust_range};
use super::html::{Block, Figure, Legend, Outcome, Report, Section, Verdict};
use super::manifest::Manifest;
use super::planes::{difference, percent};
use super::plot::{LinePlot, Series};
use super::run::{self, Files};
use super::tone::{develop, exposure};
use super::{atomic, picture};
use crate::error::Result;
use crate::image::Image;

/// What a low-rank model answered, with what belongs beside it.
#[derive(Clone, Debug)]
pub struct RelightingRun<'a> {
    /// The page's title.
    pub title: String,
    /// Photos that this run took.
    pub photos: usize,
    /// Photos that the model was captured from.
    pub rank: usize,
    /// What the values are in.
    pub unit: &'a str,
    /// Patterns relit.
    pub relit: &'a [Relit],
    /// Dual photographs: the scene as the projector would see it, lit from the camera.
    pub duals: &'a [Dual],
    /// Photos without their interreflections.
    pub reduced: &'a [Reduced],
    /// The model's error against the true matrix for each rank; empty where that is not known.
    pub curve: &'a [RankRow],
    /// Whether it is as good as was asked for.
    pub good: bool,
}

/// A pattern relit.
#[derive(Clone, Debug)]
pub struct Relit {
    /// The pattern's name.
    pub name: String,
    /// What is projected.
    pub pattern: Image,
    /// The photo by the model, ambient light included.
    pub relit: Image,
    /// The true photo, where the scene is simulated.
    pub truth: Option<Image>,
    /// `‖relit − true‖ / ‖true‖` of the projector's light, for each number of photos from 1; empty without the true photo.
    pub errors: Vec<f64>,
}

/// A dual photograph.
#[derive(Clone, Debug)]
pub struct Dual {
    /// The name of the pattern on the camera's side.
    pub name: String,
    /// `Aᵀ y`.
    pub image: Image,
    /// The relative error, where the scene is simulated.
    pub error: Option<f64>,
}

/// A photo without its interreflections.
#[derive(Clone, Debug)]
pub struct Reduced {
    /// The photo's name.
    pub name: String,
    /// The photo, without ambient light.
    pub photo: Image,
    /// `D A⁻¹ y` by the model.
    pub direct: Image,
    /// The same by the true matrix, where the scene is simulated.
    pub truth: Option<Image>,
    /// `‖direct − true‖ / ‖true‖`.
    pub error: Option<f64>,
    /// The share of the photo that the model left unexplained.
    pub residual: f64,
}

/// The model's error after so many photos, in the Frobenius norm of the global part of the matrix.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct RankRow {
    /// Photos.
    pub photos: usize,
    /// Of the model; with symmetry, where the rig has it.
    pub error: f64,
    /// Of `W Qᵀ` alone.
    pub one_sided: f64,
    /// The least that any matrix of this rank has.
    pub optimal: Option<f64>,
}

impl RelightingRun<'_> {
    /// Writes images, `error-curve.csv`, `relighting-errors.csv` and `report.html` into `folder`; `seconds` is what the run took so
    /// far. Returns the files' names. Relit and true photos are developed alike.
    ///
    /// # Errors
    /// [`crate::Error::Write`] naming the file.
    pub fn write(&self, folder: &Path, manifest: &Manifest, seconds: f64) -> Result<Vec<String>> {
        let mut files = Files::new(folder);
        let mut sections = vec![self.relit_section(&mut files)?];
        if !self.curve.is_empty() {
            sections.push(self.curve_section(&mut files)?);
        }
        if !self.reduced.is_empty() {
            sections.push(self.reduced_section(&mut files)?);
        }
        if !self.duals.is_empty() {
            sections.push(self.dual_section(&mut files)?);
        }
        let more = [("Rank of the model", self.rank.to_string())];
        let report = Report {
            title: self.title.clone(),
            verdict: Verdict {
                outcome: if self.good { Outcome::Good } else { Outcome::Short },
                sentence: self.sentence(),
            },
            facts: run::facts(manifest, self.photos, more, seconds),
            sections,
            footer: manifest.command.join(" "),
        };
        report.write(&files.path("report.html"))?;
        Ok(files.names)
    }

    /// How it ended, in a sentence or two.
    pub fn sentence(&self) -> String {
        let count = match self.relit.len() {
            1 => "1 pattern".to_owned(),
            count => format!("{count} patterns"),
        };
        let mut text = format!("A model from {} photos relit {count}", self.rank);
        if self.photos == 0 {
            text += " at no further photo";
        }
        match self.worst() {
            Some(worst) => {
                let _ = write!(text, ", at worst within {} of the true photo.", percent(worst));
            }
            None => text.push('.'),
        }
        if let Some(row) = self.curve.last()
            && let Some(optimal) = row.optimal
        {
            let _ = write!(
                text,
                " Its error as a matrix is {:.3} of the best that any matrix of that rank has.",
                row.error / optimal
            );
        }
        text
    }

    /// The greatest error of all relit photos, where it is known.
    pub fn worst(&self) -> Option<f64> {
        self.relit.iter().filter_map(|relit| relit.errors.last().copied()).reduce(f64::max)
    }

    fn relit_section(&self, files: &mut Files<'_>) -> Result<Section> {
        let mut figures = Vec::new();
        for (index, relit) in self.relit.iter().enumerate() {
            let number = index + 1;
            let scale = exposure(relit.truth.as_ref().unwrap_or(&relit.relit));
            let pattern = develop(&relit.pattern, 1.0).encode_png()?;
            atomic::write_bytes(&files.path(&format!("pattern-{number}.png")), &pattern)?;
            figures.push(plain(pattern, format!("Pattern {number}: {}", relit.name)));
            let caption = match relit.errors.last() {
                Some(error) => format!("Relit {number}: within {}", percent(*error)),
                None => format!("Relit {number}"),
            };
            figures.push(image(files, &format!("relit-{number}"), &relit.relit, scale, caption)?);
            if let Some(truth) = &relit.truth {
                let caption = format!("True photo {number}");
                figures.push(image(files, &format!("true-{number}"), truth, scale, caption)?);
                figures.push(self.error(&relit.relit, truth, format!("Relit {number} less true"))?);
            }
        }
        let mut blocks = vec![Block::Figures(figures)];
        if self.relit.iter().any(|relit| relit.errors.len() > 1) {
            blocks.push(self.errors_by_rank(files)?);
        }
        Ok(Section {
            title: "Relit".into(),
            text: "Direct light is kept apart, and exact; of global light the model knows what its photos told it. No photo of these patterns was taken for it.".into(),
            blocks,
        })
    }

    fn errors_by_rank(&self, files: &mut Files<'_>) -> Result<Block> {
        let known: Vec<(usize, &Relit)> =
            self.relit.iter().enumerate().filter(|(_, relit)| relit.errors.len() > 1).collect();
        let mut csv = "photos".to_owned();
        for (index, _) in &known {
            // Writing to a string cannot fail.
            let _ = write!(csv, ",pattern_{}", index + 1);
        }
        csv.push('\n');
        for photos in 0..self.rank {
            let _ = write!(csv, "{}", photos + 1);
            for (_, relit) in &known {
                let error = relit.errors.get(photos.min(relit.errors.len() - 1)).copied();
                let _ = write!(csv, ",{:e}", error.unwrap_or(f64::NAN));
            }
            csv.push('\n');
        }
        atomic::write_bytes(&files.path("relighting-errors.csv"), csv.as_bytes())?;
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

    fn curve_section(&self, files: &mut Files<'_>) -> Result<Section> {
        let mut csv = "photos,error,one_sided_error,optimal_error\n".to_owned();
        for row in self.curve {
            let optimal = row.optimal.map_or_else(String::new, |optimal| format!("{optimal:e}"));
            let _ = writeln!(csv, "{},{:e},{:e},{optimal}", row.photos, row.error, row.one_sided);
        }
        atomic::write_bytes(&files.path("error-curve.csv"), csv.as_bytes())?;
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

    fn reduced_section(&self, files: &mut Files<'_>) -> Result<Section> {
        let mut figures = Vec::new();
        for (index, reduced) in self.reduced.iter().enumerate() {
            let number = index + 1;
            let scale = exposure(&reduced.photo);
            let png = develop(&reduced.photo, scale).encode_png()?;
            figures.push(plain(png, format!("Photo {number}: {}", reduced.name)));
            let caption = match reduced.error {
                Some(error) => format!("Direct light alone {number}: within {}", percent(error)),
                None => format!("Direct light alone {number}"),
            };
            figures.push(image(files, &format!("direct-only-{number}"), &reduced.direct, scale, caption)?);
            if let Some(truth) = &reduced.truth {
                let caption = format!("True direct light {number}");
                figures.push(image(files, &format!("direct-only-true-{number}"), truth, scale, caption)?);
                let caption = format!("Direct light {number} less true");
                figures.push(self.error(&reduced.direct, truth, caption)?);
            }
        }
        Ok(Section {
            title: "Without interreflections".into(),
            text: "A photo taken under an unknown pattern, and what it would be if light bounced only once: D A⁻¹ y, by the model.".into(),
            blocks: vec![Block::Figures(figures)],
        })
    }

    fn dual_section(&self, files: &mut Files<'_>) -> Result<Section> {
        let mut figures = Vec::new();
        for (index, dual) in self.duals.iter().enumerate() {
            let number = index + 1;
            let caption = match dual.error {
                Some(error) => format!("Lit from the camera by {}: within {}", dual.name, percent(error)),
                None => format!("Lit from the camera by {}", dual.name),
            };
            let scale = exposure(&dual.image);
            figures.push(image(files, &format!("dual-{number}"), &dual.image, scale, caption)?);
        }
        Ok(Section {
            title: "Dual photographs".into(),
            text: "The scene as the projector would see it, were it the camera: Aᵀ y. Of a coaxial rig this is what the camera sees.".into(),
            blocks: vec![Block::Figures(figures)],
        })
    }

    fn error(&self, found: &Image, truth: &Image, caption: String) -> Result<Figure> {
        let error = difference(&found.planes(), &truth.planes());
        let range = robust_range(&error, None);
        Ok(Figure {
            png: paint_signed(found.resolution(), &error, None, range)?.encode_png()?,
            caption: format!("{caption}, {}", self.unit),
            legend: Legend::signed(range),
        })
    }
}

fn plain(png: Vec<u8>, caption: String) -> Figure {
    Figure { png, caption, legend: Legend::None }
}

/// Writes an image in all three formats, developed by `scale` for people.
fn image(files: &mut Files<'_>, name: &str, image: &Image, scale: f32, caption: String) -> Result<Figure> {
    for extension in ["npy", "exr"] {
        picture::write(&files.path(&format!("{name}.{extension}")), image)?;
    }
    let png = develop(image, scale).encode_png()?;
    atomic::write_bytes(&files.path(&format!("{name}.png")), &png)?;
    Ok(plain(png, caption))
}

/// A file's name without its folders.
fn short(name: &str) -> &str {
    name.rsplit('/').next().unwrap_or(name)
}
