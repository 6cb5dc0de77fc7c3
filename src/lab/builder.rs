//! The builder that opens a laboratory with settings.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::folder::RunOptions;
use super::settings::{ChannelChoice, OperatorChoice, Settings};
use super::source::{Handed, MatrixSource, SceneSource, Source, SourceKind, check_settings, not_a_rig};
use super::{Lab, RigSource, SharedObserver};
use crate::error::Result;
use crate::image::Resolution;
use crate::io::sparse::MatrixFile;
use crate::rig::DeviceOpener;
use crate::scene::{EditableScene, Scene};

/// Settings for a laboratory that is not open yet: see [`Lab::builder`].
#[derive(Clone)]
pub struct LabBuilder {
    origin: Origin,
    settings: Settings,
    observer: SharedObserver,
    run: Option<RunOptions>,
    program: Handed,
}

#[derive(Clone)]
pub(super) enum Origin {
    File(PathBuf),
    Scene(Box<Scene>),
    Editable(Arc<EditableScene>),
    Matrix(Box<MatrixFile>, String),
}

impl LabBuilder {
    pub(super) fn of_rig(name: &Path, text: String) -> Self {
        let mut builder = Self::of(Origin::File(name.to_path_buf()));
        builder.program.text = Some(text);
        builder
    }

    pub(super) fn of(origin: Origin) -> Self {
        let (settings, observer, program) = Default::default();
        Self { origin, settings, observer, run: None, program }
    }

    /// Replaces all settings at once.
    #[must_use]
    pub fn settings(mut self, settings: Settings) -> Self {
        self.settings = settings;
        self
    }

    /// The resolution of camera and projector, for a scene or for the scene of a virtual rig; 128×128 by default. For a matrix,
    /// the size of its photos.
    #[must_use]
    pub fn size(mut self, width: usize, height: usize) -> Self {
        self.settings.trace.resolution = Some(Resolution::new(width, height));
        self
    }

    /// Light paths per camera pixel; 64 by default.
    #[must_use]
    pub fn samples(mut self, samples: u32) -> Self {
        self.settings.trace.samples = Some(samples);
        self
    }

    /// Selects the random numbers of the tracer and of starting vectors; 0 by default.
    #[must_use]
    pub fn seed(mut self, seed: u32) -> Self {
        self.settings.trace.seed = Some(seed);
        self
    }

    /// Gray (the default) or coloured photos.
    #[must_use]
    pub fn channels(mut self, channels: impl Into<ChannelChoice>) -> Self {
        self.settings.channels = channels.into();
        self
    }

    /// Part of the name of the graphics adapter to use.
    #[must_use]
    pub fn adapter(mut self, name: impl Into<String>) -> Self {
        self.settings.adapter = Some(name.into());
        self
    }

    /// How the photos of a scene are computed.
    #[must_use]
    pub fn operator(mut self, operator: OperatorChoice) -> Self {
        self.settings.operator.choice = operator;
        self
    }

    /// The folder for the run. Every photo is stored in its journal before the photo is used, and [`Lab::save`] writes into this folder.
    #[must_use]
    pub fn folder(mut self, folder: impl Into<PathBuf>) -> Self {
        self.run.get_or_insert_default().folder = Some(folder.into());
        self
    }

    /// The options of the run. They name its folder, and say whether the folder may hold an earlier run.
    #[must_use]
    pub fn run(self, run: RunOptions) -> Self {
        Self { run: Some(run), ..self }
    }

    /// The opener of the devices, for a rig file of `kind = "program"`.
    #[must_use]
    pub fn devices(mut self, opener: DeviceOpener) -> Self {
        self.program.opener = Some(opener);
        self
    }

    /// Allows the programs that a rig file names to run, wherever the file is. The author of the file chooses these programs, so by default
    /// they run only for files in the user's own folder ([`own_folder`](crate::measure::own_folder)).
    #[must_use]
    pub fn allow_programs(mut self, allowed: bool) -> Self {
        self.program.allows_programs = allowed;
        self
    }

    /// The observer, which receives progress, messages and photos, and can stop all work.
    #[must_use]
    pub fn observer(mut self, observer: impl Into<SharedObserver>) -> Self {
        self.observer = observer.into();
        self
    }

    /// Opens the source.
    ///
    /// # Errors
    /// The errors of [`Lab::open`], and [`crate::Error::Option`] for a setting that does not apply to the source.
    pub fn open(self) -> Result<Lab> {
        let source = match self.origin {
            Origin::File(path) => Source::open(&path, &self.program, &self.settings, &self.observer)?,
            Origin::Scene(scene) => {
                Source::Scene(SceneSource::in_memory(*scene, &self.settings, &self.observer)?)
            }
            Origin::Editable(scene) => {
                Source::Scene(SceneSource::editable(scene, &self.settings, &self.observer)?)
            }
            Origin::Matrix(matrix, name) => {
                check_settings(SourceKind::Matrix, Path::new(&name), &self.settings)?;
                Source::Matrix(MatrixSource::new(*matrix, Path::new(&name), &self.settings)?)
            }
        };
        let mut lab = Lab::new(source, self.settings, self.observer);
        if let Some(run) = &self.run {
            lab.begin_run("run", run)?;
        }
        Ok(lab)
    }

    /// Opens a rig file without its calibration. The devices are treated as ideal until they are calibrated. Fails as [`Lab::open`].
    pub fn open_uncalibrated_rig(&self) -> Result<RigSource> {
        match &self.origin {
            Origin::File(path) => {
                RigSource::uncalibrated(path, &self.program, &self.settings, &self.observer)
            }
            Origin::Scene(scene) => Err(not_a_rig(&scene.path)),
            Origin::Editable(scene) => Err(not_a_rig(Path::new(&scene.name))),
            Origin::Matrix(_, name) => Err(not_a_rig(Path::new(name))),
        }
    }
}
