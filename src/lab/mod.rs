//! The laboratory: one door to a scene, a rig, the folder of an earlier run, or a matrix.
//!
//! [`Lab::open`] takes a path and tells by its extension what it is. A laboratory takes photos ([`Lab::photo`]), hands out its light
//! transport as a linear operator for the Krylov methods ([`Lab::operator`]), and writes what was found ([`Lab::save`]): arrays,
//! pictures, `run.json` and `report.html`.
//!
//! ```no_run
//! use krylux::krylov::{EigsOptions, eigs};
//! use krylux::analysis::{SegmentOptions, segment::segment};
//! use krylux::transport::Part;
//!
//! # fn main() -> krylux::Result<()> {
//! let mut lab = krylux::open("assets/scenes/zigzag/scene.glb")?;
//! let mut global = lab.operator(Part::Global)?;
//! let pairs = eigs(&mut global, &EigsOptions { count: 4, ..EigsOptions::default() })?;
//! let groups = segment(&mut global, &SegmentOptions::groups([2, 6]))?;
//! lab.save("out", &groups)?;
//! # let _ = pairs;
//! # Ok(())
//! # }
//! ```
//!
//! [`Lab::builder`] sets what differs from the defaults: pixels, light paths, channels, a folder whose journal keeps every photo, an
//! [`Observer`](crate::observer::Observer) that is told of progress and can stop everything.

mod answers;
mod builder;
mod folder;
mod journal;
mod matrix;
mod measured;
mod model;
mod notes;
mod observing;
mod operator;
mod rig;
mod run;
mod saving;
mod scene;
mod settings;
mod source;
pub mod text;
mod through_rig;
mod transport;
mod verbs;
mod virtual_scene;

use std::path::Path;
use std::sync::{Arc, Mutex};
use std::time::Instant;

pub use answers::{
    Answer, Compensated, Eigenpairs, ProbedLight, Relighting, Saved, Scored, Separated, Solved,
};
pub use builder::LabBuilder;
pub use folder::{RunFolder, RunOptions};
pub use model::open_model;
pub(crate) use observing::Log;
pub use observing::SharedObserver;
pub use operator::LabOperator;
pub use rig::RigSource;
pub use settings::{CacheChoice, ChannelChoice, OperatorChoice, Settings, TraceOverrides};
pub use source::SourceKind;
pub use verbs::{
    BLOCK, Calibrated, ColorMixing, CompensateAnswer, CompensateRequest, MatrixRequest, Questions,
    RelightRequest, SeparateRequest, SinglePhoto,
};

pub use crate::analysis::segment::Truth;
use crate::error::{Error, Result};
use crate::image::{Image, Resolution};
use crate::measure::RigRecord;
use crate::observer::{Estimate, Step};
use crate::operator::{Operator, Symmetry};
use crate::render::{TraceSettings, TraceSummary, Tracer};
use crate::report::contact_sheet::ContactSheet;
use crate::scene::Scene;
use crate::sparse::Csr;
use crate::transport::{Assembled, Channels, Noise, Part};
use matrix::MatrixSource;
use operator::lock;
use source::Source;
use transport::LightTransport;

/// Opens a scene (`.glb`, `.gltf`, `.obj`), a rig file (`.toml`), the folder of an earlier run, or a matrix (`.npz`, `.mtx`, `.npy`).
///
/// # Errors
/// As [`Lab::open`].
pub fn open(path: impl AsRef<Path>) -> Result<Lab> {
    Lab::open(path)
}

/// An open laboratory.
///
/// Nothing is traced and no photo is taken before one is asked for. A laboratory and everything that it hands out can be sent to another
/// thread.
pub struct Lab {
    source: Source,
    settings: Settings,
    channels: Channels,
    observer: SharedObserver,
    /// Opened when it is first needed.
    transport: Option<Arc<Mutex<LightTransport>>>,
    sheet: Arc<Mutex<ContactSheet>>,
    /// Labels that the run's journal shall keep.
    kept_truth: Option<Truth>,
    /// Whether the photos of the run go to its journal.
    keeps_photos: bool,
    run: Option<RunFolder>,
}

impl Lab {
    /// Opens a source with default settings.
    ///
    /// # Errors
    /// [`Error::Read`], [`Error::Data`], [`Error::Scene`] naming the file that cannot be used; [`Error::Device`] where a scene has to be
    /// traced and there is no graphics device.
    pub fn open(path: impl AsRef<Path>) -> Result<Self> {
        Self::builder(path).open()
    }

    /// Opens a source with settings.
    pub fn builder(path: impl AsRef<Path>) -> LabBuilder {
        LabBuilder::new(path.as_ref())
    }

    /// A laboratory around a scene that a program made, for example a loaded one with another material.
    pub fn builder_of_scene(scene: Scene) -> LabBuilder {
        LabBuilder::of_scene(scene)
    }

    /// A laboratory around a matrix that a program made; `name` is used in titles.
    pub fn of_matrix(matrix: Csr, name: impl Into<String>) -> Self {
        let source = Source::Matrix(MatrixSource::new(matrix, name.into()));
        Self::new(source, Settings::default(), SharedObserver::default())
    }

    fn new(source: Source, settings: Settings, observer: SharedObserver) -> Self {
        let channels = source.channels(settings.channels);
        let sizes = [source.projector_resolution(), source.resolution()];
        let sheet = Arc::new(Mutex::new(ContactSheet::new(sizes, channels.count())));
        Self {
            source,
            settings,
            channels,
            observer,
            transport: None,
            sheet,
            kept_truth: None,
            keeps_photos: true,
            run: None,
        }
    }

    /// The kind of source.
    pub fn kind(&self) -> SourceKind {
        match self.source {
            Source::Scene(_) => SourceKind::Scene,
            Source::Rig(_) => SourceKind::Rig,
            Source::Run(_) | Source::Model(_) => SourceKind::Run,
            Source::Matrix(_) => SourceKind::Matrix,
        }
    }

    /// A short name, for folders and titles.
    pub fn name(&self) -> String {
        self.source.name()
    }

    /// Pixels of photos. A matrix of `n` rows has `n×1`.
    pub fn resolution(&self) -> Resolution {
        self.source.resolution()
    }

    /// Pixels of patterns.
    pub fn projector_resolution(&self) -> Resolution {
        self.source.projector_resolution()
    }

    /// Gray or coloured photos.
    pub fn channels(&self) -> Channels {
        self.channels
    }

    /// The unit of photos' values: W/(m² sr) for scenes, DN/s for rigs.
    pub fn unit(&self) -> &str {
        self.source.unit()
    }

    /// Seeds starting vectors and every other choice by chance outside of the tracer.
    pub fn seed(&self) -> u64 {
        self.settings.trace.vector_seed()
    }

    /// The settings that it was opened with.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Who watches.
    pub fn observer(&self) -> &SharedObserver {
        &self.observer
    }

    /// Photos that the run that is the source was allowed to take, if it came to its end: the default budget of further questions.
    pub fn photos_of_run(&self) -> Option<usize> {
        match &self.source {
            Source::Run(run) => run.photos,
            _ => None,
        }
    }

    /// The folder of the run that is the source.
    pub fn folder_of_run(&self) -> Option<&Path> {
        match &self.source {
            Source::Run(run) => Some(&run.folder),
            _ => None,
        }
    }

    /// The scene, also the one behind a virtual rig.
    ///
    /// # Errors
    /// [`Error::Data`] where there is none.
    pub fn scene(&self) -> Result<&Scene> {
        Ok(&self.scene_source()?.scene)
    }

    /// Lets `work` use the tracer of the scene.
    ///
    /// # Errors
    /// [`Error::Data`] where there is no scene.
    pub fn with_tracer<T>(&self, work: impl FnOnce(&mut Tracer) -> T) -> Result<T> {
        Ok(work(&mut self.scene_source()?.tracer()))
    }

    /// The rig, where the source is a rig file.
    pub fn rig(&self) -> Option<&RigSource> {
        match &self.source {
            Source::Rig(rig) => Some(rig),
            _ => None,
        }
    }

    fn scene_source(&self) -> Result<&scene::SceneSource> {
        match &self.source {
            Source::Scene(scene) => Ok(scene),
            Source::Rig(rig) => rig.scene(),
            Source::Run(run) => Err(Error::Data {
                path: run.note.path.clone(),
                fault: "a run has photos of it, but not the scene itself".into(),
                help: "give the scene".into(),
            }),
            Source::Matrix(_) | Source::Model(_) => Err(Error::Data {
                path: self.name().into(),
                fault: "there is no scene behind it".into(),
                help: "give the scene".into(),
            }),
        }
    }

    /// The region that the centre of each pixel of a scene sees, row by row; 255 is a pixel that sees none.
    ///
    /// # Errors
    /// [`Error::Data`] where there is no scene; [`Error::Scene`] for more than 255 regions.
    pub fn labels(&self) -> Result<Vec<u8>> {
        self.scene_source()?.labels(self.resolution())
    }

    /// The true labels of the scene's author, where there are any.
    ///
    /// # Errors
    /// As [`Lab::labels`].
    pub fn truth(&self) -> Result<Option<Truth>> {
        self.source.truth()
    }

    /// The true labels that [`Lab::segment`] asked for, or else [`Lab::truth`].
    ///
    /// # Errors
    /// As [`Lab::labels`].
    pub fn known_truth(&self) -> Result<Option<Truth>> {
        match &self.kept_truth {
            Some(truth) => Ok(Some(truth.clone())),
            None => self.truth(),
        }
    }

    /// Lets the journal of the run keep the true labels, so that a replay of the run knows them. Call it before the first photo.
    pub(crate) fn keep_truth(&mut self, truth: Option<&Truth>) {
        self.kept_truth = truth.cloned();
    }

    /// One part of the light transport, as a linear operator: the first channel.
    ///
    /// # Errors
    /// What keeps the scene from being traced, the rig from being opened or the run from being read.
    pub fn operator(&mut self, part: Part) -> Result<LabOperator> {
        self.channel_operator(part, 0)
    }

    /// One part of the light transport, as a linear operator for each channel.
    ///
    /// # Errors
    /// As [`Lab::operator`].
    pub fn operators(&mut self, part: Part) -> Result<Vec<LabOperator>> {
        let channels = lock(self.transport()?).shape().channels;
        (0..channels).map(|channel| self.channel_operator(part, channel)).collect()
    }

    fn channel_operator(&mut self, part: Part, channel: usize) -> Result<LabOperator> {
        let transport = Arc::clone(self.transport()?);
        Ok(LabOperator::new(&transport, part, channel, &self.observer, Some(&self.sheet)))
    }

    /// As [`Lab::operators`], for products that are not photos of the run: comparisons with a truth. They are neither shown nor recorded.
    ///
    /// # Errors
    /// As [`Lab::operator`].
    pub fn reference_operators(&mut self, part: Part) -> Result<Vec<LabOperator>> {
        let transport = Arc::clone(self.transport()?);
        let channels = lock(&transport).shape().channels;
        let operator = |channel| LabOperator::new(&transport, part, channel, &self.observer, None);
        Ok((0..channels).map(operator).collect())
    }

    /// The light transport, opened now if it is not.
    fn transport(&mut self) -> Result<&Arc<Mutex<LightTransport>>> {
        let transport = match self.transport.take() {
            Some(transport) => transport,
            None => {
                let start = Instant::now();
                let run = self.run.as_ref().filter(|_| self.keeps_photos);
                let run = run.map(|run| (run, self.kept_truth.as_ref()));
                let opened =
                    LightTransport::open(&self.source, &self.settings, self.channels, run, &self.observer)?;
                self.prepared(&opened, start);
                Arc::new(Mutex::new(opened))
            }
        };
        Ok(self.transport.insert(transport))
    }

    /// From now on photos are not kept in the journal of the run.
    fn without_journal(&mut self) -> Result<()> {
        if self.keeps_photos && self.run.is_some() {
            self.transport = None;
        }
        self.keeps_photos = false;
        Ok(())
    }

    /// Announces how many photos of each channel are about to be taken.
    fn expect(&self, photos: usize) {
        let total = (photos * self.channels.count()) as u64;
        let step = Step { stage: "photos", done: 0, total, estimate: Estimate::None };
        // Whether to go on is asked with the first photo.
        let _ = self.observer.0.step(&step);
    }

    /// Runs `work`, which takes photos; records how long it took and what they have cost on a rig. The costs are of interest above all when
    /// it failed.
    fn photos<T>(&mut self, work: impl FnOnce(&mut Self) -> Result<T>) -> Result<T> {
        self.photos_with(|_| true, work)
    }

    /// As [`Self::photos`]; `is_complete` says whether the photos are enough to know noise and drift.
    fn photos_with<T>(
        &mut self,
        is_complete: impl FnOnce(&T) -> bool,
        work: impl FnOnce(&mut Self) -> Result<T>,
    ) -> Result<T> {
        let found = self.timed("photos", work);
        let is_complete = found.as_ref().is_ok_and(is_complete);
        let record = match &self.transport {
            Some(transport) => lock(transport).record(is_complete)?,
            None => None,
        };
        if let Some(rig) = record {
            self.observer.costs(&rig);
            if let Some(run) = &mut self.run {
                run.manifest.rig = Some(rig);
            }
        }
        found
    }

    /// Records how long the light transport took to open, and what is known of its matrix.
    fn prepared(&mut self, transport: &LightTransport, start: Instant) {
        let Some(run) = &mut self.run else { return };
        run.manifest.record(self.source.preparation(), start.elapsed());
        if let Some(traced) = transport.assembled() {
            run.manifest.noise = traced.noise.as_ref().map(Into::into);
            let on = if traced.is_on_gpu() {
                crate::io::manifest::ProductsOn::Device
            } else {
                crate::io::manifest::ProductsOn::Cpu
            };
            run.manifest.products = Some(on);
        }
    }

    /// The photo of a pattern, in [`Lab::unit`], with the ambient light. A rig's photo is without it unless the rig file says otherwise. A
    /// pattern of one channel lights all channels.
    ///
    /// # Errors
    /// [`Error::Dimension`] when the pattern does not have the pixels or channels of the projector; those of [`Lab::operator`].
    pub fn photo(&mut self, pattern: &Image) -> Result<Image> {
        lock(self.transport()?).photograph(pattern)
    }

    /// As [`Lab::photo`], with the standard error of each sample where the source knows it.
    ///
    /// # Errors
    /// As [`Lab::photo`].
    pub fn photo_with_error(&mut self, pattern: &Image) -> Result<(Image, Option<Image>)> {
        lock(self.transport()?).photograph_with_error(pattern)
    }

    /// The photo under an all-ones pattern.
    ///
    /// # Errors
    /// As [`Lab::operator`].
    pub fn white(&mut self) -> Result<Image> {
        lock(self.transport()?).white()
    }

    /// The photo without projector.
    ///
    /// # Errors
    /// As [`Lab::operator`].
    pub fn ambient(&mut self) -> Result<Image> {
        lock(self.transport()?).ambient()
    }

    /// Photos of red, green and blue alone, in each of the camera's channels, without ambient light: `[primary][channel][pixel]`.
    ///
    /// # Errors
    /// [`Error::Option`] where projector or camera is gray; those of [`Lab::operator`].
    pub fn primaries(&mut self) -> Result<[[Vec<f64>; 3]; 3]> {
        lock(self.transport()?).primaries()
    }

    /// Whether the light transport matrix is symmetric: that of a coaxial rig.
    ///
    /// # Errors
    /// As [`Lab::operator`].
    pub fn is_symmetric(&mut self) -> Result<bool> {
        Ok(lock(self.transport()?).shape().symmetry == Symmetry::Symmetric)
    }

    /// Whether photos cost nothing but computing: those of everything but a rig.
    ///
    /// # Errors
    /// As [`Lab::operator`].
    pub fn is_simulated(&mut self) -> Result<bool> {
        Ok(lock(self.transport()?).is_simulated())
    }

    /// The traced scene, where photos are products with its matrix: the matrix, the ambient light, the noise. It is shared, not copied.
    ///
    /// # Errors
    /// As [`Lab::operator`].
    pub fn assembled(&mut self) -> Result<Option<Arc<Assembled>>> {
        Ok(lock(self.transport()?).assembled().cloned())
    }

    /// One part and channel of the light transport matrix, `rows × cols`, without a photo: that of a scene or of a matrix file. A rig's is
    /// photographed column by column: [`crate::analysis::brute_force`].
    ///
    /// # Errors
    /// [`Error::Option`] where the source has no matrix; those of [`Lab::operator`].
    pub fn matrix(&mut self, part: Part, channel: usize) -> Result<Csr> {
        if let Source::Matrix(source) = &self.source {
            return match part {
                Part::Full => Ok(source.matrix.clone()),
                _ => crate::transport::ExplicitMatrix::part_of(&source.matrix, part),
            };
        }
        match self.assembled()? {
            Some(traced) => traced.matrix.to_csr(part, channel),
            None => Err(Error::Option {
                option: "SOURCE".into(),
                fault: "this source takes photos, and has no matrix in memory".into(),
                help: "photograph the matrix column by column, or open a scene with the replay operator"
                    .into(),
            }),
        }
    }

    /// The direct light of each channel, where a traced matrix has it as a diagonal.
    ///
    /// # Errors
    /// As [`Lab::operator`].
    pub fn direct_diagonal(&mut self) -> Result<Option<Vec<Vec<f64>>>> {
        Ok(self.assembled()?.and_then(|traced| transport::direct_diagonal(&traced)))
    }

    /// The noise of the traced matrix, where it is known.
    ///
    /// # Errors
    /// As [`Lab::operator`].
    pub fn noise(&mut self) -> Result<Option<Noise>> {
        Ok(self.assembled()?.and_then(|traced| traced.noise.clone()))
    }

    /// What the tracing of the matrix took, where there is one.
    ///
    /// # Errors
    /// As [`Lab::operator`].
    pub fn trace_summary(&mut self) -> Result<Option<TraceSummary>> {
        Ok(self.assembled()?.map(|traced| traced.summary))
    }

    /// How the scene is traced, also the one behind a virtual rig.
    pub fn trace_settings(&self) -> Option<TraceSettings> {
        self.scene_source().ok().map(|scene| scene.settings)
    }

    /// What a rig has cost so far, with the noise and drift that its photos show; `None` for other sources.
    ///
    /// # Errors
    /// As [`Lab::operator`].
    pub fn costs(&mut self) -> Result<Option<RigRecord>> {
        lock(self.transport()?).record(true)
    }

    /// Lets `work` use the rig's measurement, where photos are of a rig.
    ///
    /// # Errors
    /// As [`Lab::operator`], and those of `work`.
    pub fn with_measurement<T>(
        &mut self,
        work: impl FnOnce(&mut crate::measure::Measurement) -> Result<T>,
    ) -> Result<Option<T>> {
        let mut transport = lock(self.transport()?);
        transport.rig().map(|rig| work(&mut rig.measurement)).transpose()
    }

    /// Every photo so far, as small pictures.
    pub fn contact_sheet(&self) -> ContactSheet {
        lock(&self.sheet).clone()
    }

    /// Products of the direct light with white, one for each channel.
    pub(crate) fn white_of(&mut self, part: Part) -> Result<Vec<Vec<f64>>> {
        let white = |mut operator: LabOperator| -> Result<Vec<f64>> {
            let mut photo = vec![0.0; operator.rows()];
            operator.apply(&vec![1.0; operator.cols()], &mut photo)?;
            Ok(photo)
        };
        self.reference_operators(part)?.into_iter().map(white).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn laboratories_and_operators_can_move_to_another_thread() {
        fn is_send<T: Send>() {}
        is_send::<Lab>();
        is_send::<LabOperator>();
        is_send::<crate::sparse::SparseOperator>();
        is_send::<crate::analysis::LowRank>();
        is_send::<crate::transport::MatrixOperator<'_>>();
        is_send::<crate::operator::Closure<fn(&[f64], &mut [f64]) -> Result<()>>>();
    }
}
