//! The laboratory, one interface to four kinds of sources: a scene, a rig, the folder of an earlier run, or a matrix.
//!
//! [`Lab::open`] takes a path and recognizes the kind of source by the extension. A laboratory takes photos ([`Lab::photo`]). It provides
//! the light transport as a linear operator for the Krylov methods ([`Lab::operator`]). It saves an answer ([`Lab::save`]) as arrays,
//! pictures, `run.json` and `report.html`.
//!
//! ```no_run
//! use krylux::krylov::{EigsOptions, eigs};
//! use krylux::transport::Part;
//! use krylux::verbs::Segment;
//!
//! # fn main() -> krylux::Result<()> {
//! let mut lab = krylux::open("assets/scenes/zigzag/scene.glb")?;
//! let mut global = lab.operator(Part::Global)?;
//! let pairs = eigs(&mut global, &EigsOptions { count: 4, ..EigsOptions::default() })?;
//! let groups = lab.ask(&Segment { groups: vec![2, 6], ..Segment::default() })?;
//! lab.save("out", &groups)?;
//! # let _ = pairs;
//! # Ok(())
//! # }
//! ```
//!
//! [`Lab::builder`] changes the defaults: pixels, light paths, channels, a folder whose journal keeps every photo, and an
//! [`Observer`](crate::observer::Observer) that receives progress and can stop all work.

mod builder;
mod calibration;
mod folder;
mod kept;
mod layout;
mod light;
mod look;
mod matrix;
mod measured;
mod model;
mod notes;
mod observing;
mod operator;
mod photos;
mod replaced;
mod run_model;
mod saving;
mod settings;
mod shards;
mod source;
#[cfg(test)]
mod tests_of_rigs;
mod through_rig;
mod traced;
mod transport;
mod verb;
mod verification;

use std::path::Path;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

pub use builder::LabBuilder;
use builder::Origin;
pub use folder::{RunFolder, RunOptions};
pub use kept::{KeptPhotos, KeptRun};
pub use look::look;
pub use matrix::ExportedMatrix;
pub(crate) use observing::Log;
pub use observing::SharedObserver;
pub use operator::LabOperator;
pub use photos::SinglePhoto;
pub(crate) use run_model::model_shape;
pub use run_model::open_model;
pub use settings::{
    CacheChoice, ChannelChoice, OperatorChoice, OperatorSettings, Settings, TraceOverrides, View,
};
pub(crate) use settings::{byte_count, first_given, number, size};
pub use shards::{JoinedShards, Scaling, TracedShard, join_shards};
pub(crate) use source::not_a_rig;
pub use source::{RigSource, SourceKind};
pub use verb::{Answer, GivenArray, Saved, Verb, Verified};

pub use crate::analysis::segment::Truth;
use crate::error::{Error, Result};
use crate::finding::Finding;
use crate::image::Resolution;
use crate::io::sparse::MatrixFile;
use crate::render::TraceSettings;
use crate::report::contact_sheet::ContactSheet;
pub use crate::report::text;
use crate::scene::{EditableScene, Scene};
use crate::transport::Channels;
use source::{SceneSource, Source};
use transport::LightTransport;

/// Opens a scene (`.glb`, `.gltf`, `.obj`), a rig file (`.toml`), a run's folder, or a matrix (`.npz`, `.mtx`, `.npy`). See [`Lab::open`].
pub fn open(path: impl AsRef<Path>) -> Result<Lab> {
    Lab::open(path)
}

/// An open laboratory.
///
/// It traces the scene or takes photos only on request. A laboratory and everything that it returns can be sent to another thread.
pub struct Lab {
    source: Source,
    settings: Settings,
    channels: Channels,
    observer: SharedObserver,
    transport: Option<Arc<Mutex<LightTransport>>>,
    sheet: Arc<Mutex<ContactSheet>>,
    kept_truth: Option<Truth>,
    keeps_photos: bool,
    /// Whether the request examines the faults of a rig. Then a rig is accepted even if its camera does not see the projector, or if its
    /// light is not proportional to the projected levels.
    audits: bool,
    run: Option<RunFolder>,
    /// Findings about the rig from the photos of the last verb.
    findings: Vec<Finding>,
}

impl Lab {
    /// Opens a source with default settings.
    ///
    /// # Errors
    /// [`Error::Read`], [`Error::Data`] or [`Error::Scene`] naming the file; [`Error::Device`] without a graphics device for tracing.
    pub fn open(path: impl AsRef<Path>) -> Result<Self> {
        Self::builder(path).open()
    }

    /// Opens a source with settings.
    pub fn builder(path: impl AsRef<Path>) -> LabBuilder {
        LabBuilder::of(Origin::File(path.as_ref().to_path_buf()))
    }

    /// A laboratory around a scene that a program made, for example a loaded scene with another material.
    pub fn builder_of_scene(scene: Scene) -> LabBuilder {
        LabBuilder::of(Origin::Scene(Box::new(scene)))
    }

    /// A laboratory around a scene that a program made or changed. A run keeps the scene as `scene.glb` in its folder. What is the same in the
    /// scene that was opened before is used again: the search tree, the compiled kernels, and matrices in the cache.
    pub fn builder_of_editable(scene: impl Into<Arc<EditableScene>>) -> LabBuilder {
        LabBuilder::of(Origin::Editable(scene.into()))
    }

    /// A laboratory around a matrix that a program made, with settings. `name` is used in titles.
    pub fn builder_of_matrix(matrix: impl Into<MatrixFile>, name: impl Into<String>) -> LabBuilder {
        LabBuilder::of(Origin::Matrix(Box::new(matrix.into()), name.into()))
    }

    /// A laboratory around a rig whose file a program wrote. A run keeps `text`, the content of the file. `name` replaces the file's path.
    pub fn builder_of_rig(name: impl AsRef<Path>, text: impl Into<String>) -> LabBuilder {
        LabBuilder::of_rig(name.as_ref(), text.into())
    }

    fn new(source: Source, settings: Settings, observer: SharedObserver) -> Self {
        let (channels, findings) = (source.channels(settings.channels), source.findings());
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
            audits: false,
            run: None,
            findings,
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

    /// Whether it is known which pictures photos and patterns are. It is not known for a matrix that came without their sizes.
    pub fn has_pictures(&self) -> bool {
        !matches!(&self.source, Source::Matrix(matrix) if !matrix.has_pictures())
    }

    /// Why no light is independent of an answer; `None` if there may be such light.
    pub fn has_no_other_light(&self) -> Option<&'static str> {
        match self.source {
            Source::Scene(_) | Source::Rig(_) => None,
            Source::Run(_) | Source::Model(_) => {
                Some("a finished run has no other photos; ask the scene or the rig")
            }
            Source::Matrix(_) => {
                Some("a matrix has no light paths of another seed; ask the scene or the rig")
            }
        }
    }

    /// Whether the direct light is known separately, without photos.
    pub fn knows_direct(&self) -> bool {
        match &self.source {
            Source::Scene(_) => true,
            Source::Matrix(matrix) => matrix.has_direct(),
            Source::Rig(_) | Source::Run(_) | Source::Model(_) => false,
        }
    }

    /// Refuses a matrix that came without the sizes of its pictures, for `what`, which needs to know neighbouring pixels.
    ///
    /// # Errors
    /// [`Error::Option`].
    pub fn require_pictures(&self, what: &str) -> Result<()> {
        if self.has_pictures() {
            return Ok(());
        }
        let [rows, columns] = [self.resolution(), self.projector_resolution()].map(Resolution::pixels);
        let fault = format!(
            "{} has {rows} rows and {columns} columns, and does not say which pictures they are; {what} needs to know",
            self.name()
        );
        Err(Error::option("--size", fault).help(
            "give the size of photos (--size WIDTHxHEIGHT), and that of patterns if it is another one (--projector-size WIDTHxHEIGHT)",
        ))
    }

    /// The resolution of photos. For a matrix of `n` rows whose pictures are not known, it is `n×1`.
    pub fn resolution(&self) -> Resolution {
        self.source.resolution()
    }

    /// The resolution of patterns.
    pub fn projector_resolution(&self) -> Resolution {
        self.source.projector_resolution()
    }

    /// Whether photos are gray or coloured.
    pub fn channels(&self) -> Channels {
        self.channels
    }

    /// The unit of photos' values: W/(m² sr) for scenes, DN/s for rigs.
    pub fn unit(&self) -> &str {
        self.source.unit()
    }

    /// The seed of starting vectors and of every other random choice outside of the tracer.
    pub fn seed(&self) -> u64 {
        self.settings.trace.vector_seed()
    }

    /// The settings that the laboratory was opened with.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// The observer.
    pub fn observer(&self) -> &SharedObserver {
        &self.observer
    }

    /// The number of photos that the source's run was allowed to take, if the run was completed: the default budget of later requests.
    pub fn photos_of_run(&self) -> Option<usize> {
        match &self.source {
            Source::Run(run) => run.photos,
            _ => None,
        }
    }

    /// The folder of the source, if the source is a run.
    pub fn folder_of_run(&self) -> Option<&Path> {
        match &self.source {
            Source::Run(run) => Some(&run.folder),
            _ => None,
        }
    }

    /// The scene that is the source, or the scene in front of a virtual rig.
    ///
    /// # Errors
    /// [`Error::Data`] if there is none.
    pub fn scene(&self) -> Result<&Scene> {
        Ok(&self.scene_source()?.scene)
    }

    /// The trace settings of [`Lab::scene`], if there is a scene.
    pub fn trace_settings(&self) -> Option<TraceSettings> {
        self.scene_source().ok().map(|scene| scene.settings)
    }

    /// The rig, if the source is a rig file.
    pub fn rig(&self) -> Option<&RigSource> {
        match &self.source {
            Source::Rig(rig) => Some(rig),
            _ => None,
        }
    }

    /// The standard deviation, in pixels, of the blur of patterns and photos for a rig whose camera has too few pixels; 0 for no blur.
    pub(crate) fn blur(&self) -> f64 {
        self.source.blur()
    }

    /// Whether a model computes the photos. The model was made from the photos of an earlier run.
    pub(crate) fn is_model(&mut self) -> Result<bool> {
        Ok(lock(self.transport()?).is_model())
    }

    pub(crate) fn add_findings(&mut self, more: impl IntoIterator<Item = Finding>) {
        crate::finding::merge(&mut self.findings, more);
    }

    fn scene_source(&self) -> Result<&SceneSource> {
        match &self.source {
            Source::Scene(scene) => Ok(scene),
            Source::Rig(rig) => rig.scene(),
            Source::Run(run) => {
                Err(Error::data(&run.note.path, "a run has photos of it, but not the scene itself")
                    .help("give the scene"))
            }
            Source::Matrix(_) | Source::Model(_) => {
                Err(Error::data(self.name(), "there is no scene behind it").help("give the scene"))
            }
        }
    }
}

/// Locks a mutex. A panic of another thread is ignored: the value is still intact, since every change is one assignment.
fn lock<T: ?Sized>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
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
