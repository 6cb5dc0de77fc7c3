//! Low-rank relighting.

use crate::analysis::low_rank::{
    DirectPart, LowRankCapture, SavedModel, capture_channels, diagonal_of, rank_curve, smooth_starts,
};
use crate::analysis::planes::{Planes, difference};
use crate::error::{Error, Result};
use crate::image::Image;
use crate::lab::Relighting;
use crate::lab::{Lab, LabOperator, SourceKind};
use crate::sparse::Csr;
use crate::transport::Part;

/// Patterns of a capture that are chosen before any photo is projected back: enough to tell the twelve cups of a carton apart.
pub const BLOCK: usize = 12;

/// What is asked of a capture.
#[derive(Clone, Debug)]
pub struct RelightRequest {
    /// Photos of the capture.
    pub photos: usize,
    /// Patterns that are chosen before any photo is projected back: white, and smooth random ones. 1 is white alone.
    pub block: usize,
    /// What the model is asked.
    pub questions: Questions,
    /// The largest error of a relit photo that is good enough.
    pub max_error: Option<f64>,
}

/// What a model is asked, each by name.
#[derive(Clone, Debug, Default)]
pub struct Questions {
    /// Patterns of the projector's pixels to relight with.
    pub patterns: Vec<(String, Image)>,
    /// Patterns of the camera's pixels, for dual photographs.
    pub duals: Vec<(String, Image)>,
    /// Photos to take the interreflections out of, with the ambient light.
    pub photographs: Vec<(String, Planes)>,
}

impl Lab {
    /// Captures the light transport in a few dozen photos and asks the model. The model is written into the folder of the open run as soon as
    /// it is there. The photos of a scene are not kept in a journal: a simulator is also asked for the truth.
    ///
    /// # Errors
    /// As [`capture_channels`] and [`Lab::operators`].
    pub fn relight(&mut self, request: &RelightRequest) -> Result<Relighting> {
        self.allow_photos(request.photos);
        if self.kind() == SourceKind::Scene {
            self.without_journal();
        }
        let model = self.capture(request)?;
        let mut answer = Relighting::new(model, 0);
        answer.photos = answer.model.rank();
        answer.max_error = request.max_error;
        if let Some(run) = self.run() {
            answer.files = Some(answer.model.write(&run.path)?);
        }
        answer.curve = self.timed("error curve", |lab| lab.rank_curve(&answer.model))?;
        self.timed("relighting", |lab| lab.answer_questions(&mut answer, &request.questions))?;
        Ok(answer)
    }

    /// Asks the model of the run that is the source; no photo is taken.
    ///
    /// # Errors
    /// As [`Lab::model`].
    pub fn relight_run(&mut self, questions: &Questions) -> Result<Relighting> {
        let mut answer = Relighting::new(self.model()?, 0);
        // A model that is in a folder already is not copied.
        if self.has_saved_model() {
            answer.files = Some(Vec::new());
        }
        self.timed("relighting", |_| {
            let none: [Option<Vec<LabOperator>>; 2] = [None, None];
            answer_questions(&mut answer, questions, none)
        })?;
        Ok(answer)
    }

    fn capture(&mut self, request: &RelightRequest) -> Result<SavedModel> {
        let (resolution, projector) = (self.resolution(), self.projector_resolution());
        if resolution.pixels() != projector.pixels() {
            return Err(Error::Option {
                option: "--projector-size".into(),
                fault: format!(
                    "the camera has {resolution} pixels and the projector {projector}, but a Krylov process projects its photos"
                ),
                help: "give both as many pixels".into(),
            });
        }
        self.transport()?;
        let (name, unit) = (self.name(), self.unit().to_owned());
        let seed = self.seed();
        let channels = self.photos(|lab| {
            let ambient = lab.ambient()?;
            let direct = lab.direct_parts()?;
            // A capture starts with no more patterns than it takes photos, or than there are pixels.
            let block = request.block.min(request.photos).min(projector.pixels());
            let beside = smooth_starts(projector, block.max(1) - 1, seed);
            let options = LowRankCapture { photos: request.photos, start: None, beside };
            lab.expect(request.photos);
            let mut operators = lab.operators(Part::Global)?;
            Ok((ambient, capture_channels(&mut operators, direct, &options)?))
        });
        let (ambient, channels) = channels?;
        Ok(SavedModel { channels, ambient, resolution, projector, unit, source: name })
    }

    /// The direct light of each channel: a diagonal where it is one.
    fn direct_parts(&mut self) -> Result<Vec<DirectPart>> {
        if let Some(diagonals) = self.direct_diagonal()? {
            return Ok(diagonals.into_iter().map(DirectPart::Diagonal).collect());
        }
        if let Some(parts) = self.measured_direct()? {
            return Ok(parts);
        }
        match self.traced_matrices(Part::Direct)? {
            Some(matrices) => Ok(matrices.into_iter().map(DirectPart::Matrix).collect()),
            None => self.reference_operators(Part::Direct)?.iter_mut().map(|of| diagonal_of(of)).collect(),
        }
    }

    /// The direct light of a rig, which its lenses spread.
    fn measured_direct(&mut self) -> Result<Option<Vec<DirectPart>>> {
        self.with_measurement(|measurement| {
            let channels = 0..measurement.channels();
            channels.map(|channel| direct_part(measurement.direct_rows(channel)?)).collect()
        })
    }

    fn rank_curve(&mut self, model: &SavedModel) -> Result<Vec<crate::analysis::low_rank::RankRow>> {
        let Some(matrices) = self.traced_matrices(Part::Global)? else { return Ok(Vec::new()) };
        rank_curve(&model.channels, &matrices, &mut self.reference_operators(Part::Global)?)
    }

    /// Asks the model, and for the truth light paths of another seed: the noise of the captured photos is in the model. Interreflections are
    /// removed by hundreds of products, which only the scene's own matrix can take.
    fn answer_questions(&mut self, answer: &mut Relighting, questions: &Questions) -> Result<()> {
        let full = self.independent_operators(Part::Full)?;
        let global = match self.assembled()? {
            Some(_) => Some(self.reference_operators(Part::Global)?),
            None => None,
        };
        answer_questions(answer, questions, [full, global])
    }
}

/// The direct light with these rows.
fn direct_part(rows: Vec<Vec<(u32, f64)>>) -> Result<DirectPart> {
    let is_diagonal =
        |(pixel, row): (usize, &Vec<(u32, f64)>)| row.iter().all(|entry| entry.0 as usize == pixel);
    if rows.iter().enumerate().all(is_diagonal) {
        let own = |row: &Vec<(u32, f64)>| row.iter().map(|entry| entry.1).sum();
        return Ok(DirectPart::Diagonal(rows.iter().map(own).collect()));
    }
    let mut starts = vec![0];
    rows.iter().for_each(|row| starts.push(starts[starts.len() - 1] + row.len()));
    let (columns, weights) = rows.iter().flatten().copied().unzip();
    Csr::new(rows.len(), starts, columns, weights).map(DirectPart::Matrix)
}

/// `[full, global]` are operators of the truth, where it is known.
fn answer_questions(
    answer: &mut Relighting,
    questions: &Questions,
    [mut full, mut global]: [Option<Vec<LabOperator>>; 2],
) -> Result<()> {
    let model = &answer.model;
    for (name, pattern) in &questions.patterns {
        answer.relit.push(model.relight(name, pattern.clone(), full.as_deref_mut())?);
    }
    for (name, pattern) in &questions.duals {
        answer.duals.push(model.dual(name.clone(), pattern, full.as_deref_mut())?);
    }
    for (name, photo) in &questions.photographs {
        let photo = difference(photo, &model.ambient.planes());
        answer.reduced.push(model.reduce(name.clone(), &photo, global.as_deref_mut())?);
    }
    Ok(())
}
