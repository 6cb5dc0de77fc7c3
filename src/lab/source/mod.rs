//! The sources of photos, and the facts that are known about each.

mod matrix;
mod model;
mod rig;
mod run;
mod scene;
mod virtual_scene;

use std::path::Path;

use crate::error::{Error, Result};
use crate::finding::Finding;
use crate::image::Resolution;
use crate::io::manifest::SourceFile;
use crate::io::{model as saved_model, sparse};
use crate::journal::Journal;
use crate::lab::layout::{journal_folder, short_name};
use crate::lab::notes::{Kind, SourceNote};
use crate::lab::settings::{ChannelChoice, Settings};
use crate::lab::{SharedObserver, Truth};
use crate::measure::{RunManifest, is_captures};
use crate::transport::Channels;
pub(in crate::lab) use matrix::{ExplicitParts, MatrixSource};
pub(in crate::lab) use model::{ModelParts, ModelSource};
pub(in crate::lab) use rig::Handed;
pub use rig::RigSource;
pub(in crate::lab) use run::{RunPhotos, RunSource};
pub(in crate::lab) use scene::SceneSource;

/// An open source. It traces nothing and takes no photo before its light transport is requested.
pub(in crate::lab) enum Source {
    /// A scene file, with the camera and projector that stand in it.
    Scene(SceneSource),
    Rig(Box<RigSource>),
    /// The folder of a run with a journal.
    Run(Box<RunSource>),
    /// The folder of a run that left a model but no journal, or captures of others, from which a model is made.
    Model(Box<ModelSource>),
    Matrix(MatrixSource),
}

/// The kind of source, as [`SourceKind::of`] recognizes it from a path.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SourceKind {
    /// A scene: `.glb`, `.gltf` or `.obj`.
    Scene,
    /// A rig file: `.toml`.
    Rig,
    /// The folder of an earlier run, or of captures.
    Run,
    /// A matrix: `.npz`, `.npy`, `.mtx`, `.mtx.gz` or `.mat`.
    Matrix,
}

impl SourceKind {
    /// The kind, by the path's extension. A folder is a run. Any other extension counts as a scene; its loader reports the known formats.
    pub fn of(path: &Path) -> Self {
        if path.is_dir() {
            return Self::Run;
        }
        if sparse::is_matrix(path) {
            return Self::Matrix;
        }
        let is_rig = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("toml"));
        if is_rig { Self::Rig } else { Self::Scene }
    }
}

impl Source {
    pub(in crate::lab) fn open(
        path: &Path,
        program: &Handed,
        settings: &Settings,
        observer: &SharedObserver,
    ) -> Result<Self> {
        let kind = if program.text.is_some() { SourceKind::Rig } else { SourceKind::of(path) };
        check_settings(kind, path, settings)?;
        if let (true, Some(_)) = (kind != SourceKind::Rig, &program.opener) {
            return Err(not_a_rig(path));
        }
        Ok(match kind {
            SourceKind::Scene => Self::Scene(SceneSource::open(
                path,
                &settings.view,
                settings.trace.for_scene(),
                settings,
                observer,
            )?),
            SourceKind::Rig => Self::Rig(Box::new(RigSource::open(path, program, settings, observer)?)),
            SourceKind::Run if is_captures(path) => {
                Self::Model(Box::new(ModelSource::of_captures(path, settings.channels, observer)?))
            }
            SourceKind::Run if saved_model::is_in(path) && !Journal::is_in(&journal_folder(path)) => {
                Self::Model(Box::new(ModelSource::open(path)?))
            }
            SourceKind::Run => Self::Run(Box::new(RunSource::open(path)?)),
            SourceKind::Matrix => Self::Matrix(MatrixSource::open(path, settings)?),
        })
    }

    /// The findings about the rig from the photos of a finished run; empty for other sources.
    pub(in crate::lab) fn findings(&self) -> Vec<Finding> {
        match self {
            Self::Run(run) => run.findings.clone(),
            Self::Model(model) => model.findings.clone(),
            _ => Vec::new(),
        }
    }

    pub(in crate::lab) fn name(&self) -> String {
        match self {
            Self::Scene(scene) => short_name(&scene.scene.path),
            Self::Rig(rig) => rig.name(),
            Self::Run(run) => run.note.name.clone(),
            Self::Model(model) => model.model.source.clone(),
            Self::Matrix(matrix) => matrix.name.clone(),
        }
    }

    /// The folder of the run, if the source is a run.
    pub(in crate::lab) fn folder(&self) -> Option<&Path> {
        match self {
            Self::Run(run) => Some(&run.folder),
            Self::Model(model) => Some(&model.folder),
            Self::Scene(_) | Self::Rig(_) | Self::Matrix(_) => None,
        }
    }

    pub(in crate::lab) fn resolution(&self) -> Resolution {
        match self {
            Self::Scene(scene) => scene.settings.resolution,
            Self::Rig(rig) => rig.resolution(),
            Self::Run(run) => run.note.photos,
            Self::Model(model) => model.model.resolution,
            Self::Matrix(matrix) => matrix.resolution(),
        }
    }

    pub(in crate::lab) fn projector_resolution(&self) -> Resolution {
        match self {
            Self::Scene(scene) => scene.settings.projector.unwrap_or(scene.settings.resolution),
            Self::Rig(rig) => rig.resolution(),
            Self::Run(run) => run.note.patterns,
            Self::Model(model) => model.model.projector,
            Self::Matrix(matrix) => matrix.projector_resolution(),
        }
    }

    pub(in crate::lab) fn channels(&self, choice: ChannelChoice) -> Channels {
        match (choice, self) {
            (_, Self::Matrix(matrix)) => Channels::of(matrix.channels()),
            (ChannelChoice::Luma, _) => Channels::Luma,
            (ChannelChoice::Rgb, _) | (ChannelChoice::Native, Self::Scene(_)) => Channels::Rgb,
            (ChannelChoice::Native, Self::Rig(rig)) => rig.channels(),
            (ChannelChoice::Native, Self::Run(run)) => Channels::of(run.note.channels),
            (ChannelChoice::Native, Self::Model(model)) => Channels::of(model.model.channels.len()),
        }
    }

    /// The blur, in pixels, of patterns and photos ([`Registration::blur`](crate::measure::Registration::blur)); 0 if uncalibrated.
    pub(in crate::lab) fn blur(&self) -> f64 {
        match self {
            Self::Rig(rig) if rig.is_calibrated => rig.calibration.registration.blur(),
            // If the calibration cannot be read, the first photo returns the error.
            Self::Run(run) if run.note.kind == Kind::Rig => run.blur().unwrap_or(0.0),
            Self::Rig(_) | Self::Run(_) | Self::Scene(_) | Self::Model(_) | Self::Matrix(_) => 0.0,
        }
    }

    /// Writes a scene in memory into a folder. Returns the file's name; `None` for all other sources.
    pub(in crate::lab) fn keep_scene(&self, folder: &Path) -> Result<Option<String>> {
        match self {
            Self::Scene(scene) => scene.keep_scene(folder),
            Self::Rig(_) | Self::Run(_) | Self::Model(_) | Self::Matrix(_) => Ok(None),
        }
    }

    /// The name of the step that prepares the light transport, for the record of a run's timings.
    pub(in crate::lab) fn preparation(&self) -> &'static str {
        match self {
            Self::Scene(_) => "tracing and matrix",
            Self::Rig(rig) if rig.is_traced() => "tracing, matrix and first photos",
            Self::Rig(_) => "first photos",
            Self::Run(_) => "journal",
            Self::Model(_) => "model",
            Self::Matrix(_) => "matrix",
        }
    }

    pub(in crate::lab) fn unit(&self) -> &str {
        match self {
            Self::Scene(_) => "W/(m² sr)",
            Self::Rig(_) => "DN/s",
            Self::Run(run) => run.note.kind.unit(),
            Self::Model(model) => &model.model.unit,
            Self::Matrix(_) => "",
        }
    }

    /// The true labels that the scene's author defined, if there are any.
    pub(in crate::lab) fn truth(&self) -> Result<Option<Truth>> {
        match self {
            Self::Scene(scene) => scene.truth(scene.settings.resolution),
            Self::Rig(rig) => rig.truth(),
            Self::Run(run) => Ok(run.truth.clone()),
            Self::Matrix(_) | Self::Model(_) => Ok(None),
        }
    }

    /// The note in a run's journal that makes a replay of this source possible.
    pub(in crate::lab) fn note(&self, channels: Channels) -> Option<SourceNote> {
        let note = |kind, path: &Path, hash, symmetric| SourceNote {
            kind,
            name: self.name(),
            path: path.to_path_buf(),
            hash: blake3::Hash::from_bytes(hash).to_string(),
            photos: self.resolution(),
            patterns: self.projector_resolution(),
            symmetric,
            channels: channels.count(),
        };
        match self {
            Self::Scene(source) => {
                let (path, hash) = source.file();
                Some(note(Kind::Scene, path, hash, source.is_symmetric()))
            }
            Self::Rig(rig) => Some(note(Kind::Rig, &rig.file.path, rig.file.hash, rig.is_symmetric())),
            Self::Run(run) => Some(run.note.clone()),
            Self::Matrix(_) | Self::Model(_) => None,
        }
    }

    pub(in crate::lab) fn describe(&self, manifest: &mut RunManifest, channels: Channels) {
        match self {
            Self::Matrix(matrix) => return matrix.describe(manifest),
            Self::Model(model) => return model.describe(manifest),
            Self::Scene(scene) => scene.describe(manifest),
            Self::Rig(rig) => rig.describe(manifest),
            Self::Run(_) => {}
        }
        let note = self.note(channels);
        manifest.scene = note.map(|note| SourceFile { path: (&note.path).into(), hash: note.hash });
        manifest.resolution = Some(self.resolution());
        manifest.channels = Some(match channels {
            Channels::Luma => "luma".into(),
            Channels::Rgb => "rgb".into(),
        });
    }
}

/// Refuses settings that do not apply to a source of this kind. Errors: [`Error::Option`] naming the setting.
pub(in crate::lab) fn check_settings(kind: SourceKind, path: &Path, settings: &Settings) -> Result<()> {
    let refused = match kind {
        SourceKind::Run => {
            settings.first_of_trace().map(|option| (option, "a run, whose photos are taken already"))
        }
        SourceKind::Matrix => {
            settings.first_beside_sizes().map(|option| (option, "a matrix, for which nothing is traced"))
        }
        SourceKind::Scene | SourceKind::Rig => None,
    };
    if let Some((option, what)) = refused {
        return Err(Error::option(option, format!("{} is {what}", path.display()))
            .help("leave it out, or give the scene or the rig"));
    }
    if let (false, Some(option)) = (kind == SourceKind::Scene, settings.first_of_operator()) {
        return Err(scenes_only(option));
    }
    Ok(())
}

pub(in crate::lab) fn scenes_only(option: &str) -> Error {
    let fault = "the photos of a rig, a run or a matrix are neither replayed from a traced matrix nor traced";
    Error::option(option, fault).help("leave it out, or give a scene")
}

pub(crate) fn not_a_rig(path: &Path) -> Error {
    Error::option("SOURCE", format!("{} is no rig", path.display())).help("give a rig file (.toml)")
}
