//! Files and report page of low-rank relighting.

mod curves;

use std::fmt::Write;

use super::colormap::robust_range;
use super::figure;
use super::html::{Block, Figure, Section};
use super::planes::{difference, percent};
use super::run::{Files, Run};
use crate::analysis::low_rank::{Dual, RankRow, Reduced, Relit, SavedModel};
use crate::error::Result;
use crate::finding::{Finding, Grade, Ratio};
use crate::image::Image;
use crate::io::raster::exposure;

/// A captured model and what it answered.
#[derive(Clone, Debug)]
pub struct Relighting {
    /// The model.
    pub model: SavedModel,
    /// Photos that this run took.
    pub photos: usize,
    /// Relit patterns.
    pub relit: Vec<Relit>,
    /// Dual photographs.
    pub duals: Vec<Dual>,
    /// Photos without interreflections.
    pub reduced: Vec<Reduced>,
    /// The model's error for each number of photos, where the matrix is known.
    pub curve: Vec<RankRow>,
    /// The largest error of a relit photo that is good enough, where there is one.
    pub max_error: Option<f64>,
    /// Files of the model that are in the folder of the run already; `None` where the model is still to be written there.
    pub files: Option<Vec<String>>,
}

impl Relighting {
    /// A model of which nothing was asked.
    pub fn new(model: SavedModel, photos: usize) -> Self {
        Self {
            model,
            photos,
            relit: Vec::new(),
            duals: Vec::new(),
            reduced: Vec::new(),
            curve: Vec::new(),
            max_error: None,
            files: None,
        }
    }

    /// The largest error of a relit photo, where it is known.
    pub fn worst(&self) -> Option<f64> {
        self.relit.iter().filter_map(|relit| relit.errors.last().copied()).reduce(f64::max)
    }

    /// Whether it is as good as was asked for.
    pub fn is_good(&self) -> bool {
        match (self.max_error, self.worst()) {
            (Some(most), Some(worst)) => worst <= most,
            _ => true,
        }
    }

    /// Whether it is as good as was asked for, as a finding.
    pub fn findings(&self) -> Vec<Finding> {
        let (Some(most), Some(worst)) = (self.max_error, self.worst()) else { return Vec::new() };
        let grade = if worst <= most { Grade::Ok } else { Grade::Fails };
        let found = format!("within {} of the true photos", percent(worst));
        vec![Finding::graded(
            "relit photos",
            grade,
            found,
            format!("within {}", percent(most)),
            "give more --photos",
        )]
    }

    /// Writes images, `error-curve.csv`, `relighting-errors.csv` and `report.html` into the run's folder and returns
    /// their names. Relit and true photos share one exposure.
    ///
    /// # Errors
    /// [`crate::Error::Write`] naming the file.
    pub fn write(&self, run: &Run<'_>) -> Result<Vec<String>> {
        let mut files = Files::new(run.folder);
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
        sections.extend(run.photos(ORDER)?);
        let more = [("Rank of the model", self.model.rank().to_string())];
        files.finish(run.page((self.findings(), self.sentence()), self.photos, more, sections))
    }

    /// The result in one or two sentences.
    pub fn sentence(&self) -> String {
        let count = match self.relit.len() {
            1 => "1 pattern".to_owned(),
            count => format!("{count} patterns"),
        };
        let mut text = format!("A model from {} photos relit {count}", self.model.rank());
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
            let of = Ratio::of(row.error, optimal, 0.0);
            let _ =
                write!(text, " Its error as a matrix is {of} of the best that any matrix of that rank has.");
        }
        text
    }

    fn relit_section(&self, files: &mut Files<'_>) -> Result<Section> {
        let mut figures = Vec::new();
        for (index, relit) in self.relit.iter().enumerate() {
            let number = index + 1;
            let scale = exposure(relit.truth.as_ref().unwrap_or(&relit.relit));
            let pattern = figure::pattern(&relit.pattern, format!("Pattern {number}: {}", relit.name))?
                .named(format!("pattern-{number}"), String::new());
            files.picture(&format!("pattern-{number}"), &pattern)?;
            figures.push(pattern);
            let caption = match relit.errors.last() {
                Some(error) => format!("Relit {number}: within {}", percent(*error)),
                None => format!(
                    "Relit {number}: about {} off, by what the photos leave open",
                    percent(relit.stated)
                ),
            };
            let [own, other] = ["relit", "true"].map(|name| format!("{name}-{number}"));
            let found = self.image(files, &own, &relit.relit, scale, caption)?;
            if let Some(truth) = &relit.truth {
                let caption = format!("True photo {number}");
                let truth = self.image(files, &other, truth, scale, caption)?.flipped_with([&own]);
                figures.extend([found.flipped_with([&other]), truth]);
            } else {
                figures.push(found);
            }
            if let Some(truth) = &relit.truth {
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

    fn reduced_section(&self, files: &mut Files<'_>) -> Result<Section> {
        let mut figures = Vec::new();
        for (index, reduced) in self.reduced.iter().enumerate() {
            let number = index + 1;
            let scale = exposure(&reduced.photo);
            let caption = format!("Photo {number}: {}", reduced.name);
            figures.push(figure::light(&reduced.photo, scale, &self.model.unit, caption)?);
            let caption = match reduced.error {
                Some(error) => format!("Direct light alone {number}: within {}", percent(error)),
                None => format!("Direct light alone {number}"),
            };
            let name = format!("direct-only-{number}");
            figures.push(self.image(files, &name, &reduced.direct, scale, caption)?);
            if let Some(truth) = &reduced.truth {
                let caption = format!("True direct light {number}");
                let name = format!("direct-only-true-{number}");
                figures.push(self.image(files, &name, truth, scale, caption)?);
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
            figures.push(self.image(files, &format!("dual-{number}"), &dual.image, scale, caption)?);
        }
        Ok(Section {
            title: "Dual photographs".into(),
            text: "The scene as the projector would see it, were it the camera: Aᵀ y. Of a coaxial rig this is what the camera sees.".into(),
            blocks: vec![Block::Figures(figures)],
        })
    }

    fn error(&self, found: &Image, truth: &Image, caption: String) -> Result<Figure> {
        let error = difference(&found.planes(), &truth.planes());
        figure::signed(found.resolution(), &error, robust_range(&error, None), &self.model.unit, caption)
    }

    /// Writes an image in all three formats; `scale` is the exposure of the `.png`.
    fn image(
        &self,
        files: &mut Files<'_>,
        name: &str,
        image: &Image,
        scale: f32,
        caption: String,
    ) -> Result<Figure> {
        files.image(name, image)?;
        let figure = figure::light(image, scale, &self.model.unit, caption)?;
        files.picture(name, &figure)?;
        Ok(figure.named(name, format!("{name}.npy")))
    }
}

/// Explains the order of the photos.
const ORDER: &str = "White and smooth random patterns come first, then photos that are projected back. Direct light, which is kept apart, is not in them.";
