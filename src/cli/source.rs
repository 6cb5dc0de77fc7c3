//! SOURCE on the command line, whatever it is: where photos come from, and what is known beside them.

use std::path::Path;

use anyhow::Result;

use super::about::{self, About, Kind};
use super::console::Console;
use super::light::{Kept, Light};
use super::operator::OperatorArgs;
use super::options::SourceArgs;
use super::replay::Replay;
use super::rig_source::RigSource;
use super::run_folder::RunFolder;
use super::simulation::{self, Simulation};
use super::trace::TraceArgs;
use super::truth;
use crate::error::Error;
use crate::image::Resolution;
use crate::journal::Identity;
use crate::measure::RunManifest;
use crate::report::segmentation::Truth;
use crate::transport::Channels;

/// An open source. Nothing is traced and no photo taken before [`Source::light`].
pub(super) enum Source {
    /// A scene file, seen by the rig that stands in it.
    Scene(Box<Simulation>),
    /// A rig file.
    Rig(Box<RigSource>),
    /// The folder of a run.
    Run(Box<Replay>),
}

impl Source {
    /// Opens whatever SOURCE names.
    pub(super) fn open(args: &SourceArgs, trace: &TraceArgs, console: &Console) -> Result<Self> {
        if args.source.is_dir() {
            if let Some(option) = trace.given().or(args.view.given()) {
                return Err(Error::Option {
                    option: option.into(),
                    fault: format!("{} is a run, whose photos are taken already", args.source.display()),
                    help: "leave it out, or give the scene or the rig".into(),
                }
                .into());
            }
            return Ok(Self::Run(Box::new(Replay::open(&args.source)?)));
        }
        if is_rig(&args.source) {
            return Ok(Self::Rig(Box::new(RigSource::open(args, trace, console)?)));
        }
        let simulation = Simulation::open(&args.source, &args.view, trace.settings(), trace, console)?;
        Ok(Self::Scene(Box::new(simulation)))
    }

    /// A short name, for folders and titles.
    pub(super) fn name(&self) -> String {
        match self {
            Self::Scene(simulation) => simulation::short_name(&simulation.scene.path),
            Self::Rig(rig) => rig.name(),
            Self::Run(run) => run.about.name.clone(),
        }
    }

    /// Pixels of photos.
    pub(super) fn resolution(&self) -> Resolution {
        match self {
            Self::Scene(simulation) => simulation.settings.resolution,
            Self::Rig(rig) => rig.resolution(),
            Self::Run(run) => run.about.photos,
        }
    }

    /// Pixels of patterns.
    pub(super) fn projector_resolution(&self) -> Resolution {
        match self {
            Self::Scene(simulation) => {
                simulation.settings.projector.unwrap_or(simulation.settings.resolution)
            }
            Self::Rig(rig) => rig.resolution(),
            Self::Run(run) => run.about.patterns,
        }
    }

    /// Photos that a run was allowed to take, where the source is one that came to its end: what is asked of it by default.
    pub(super) fn held(&self) -> Option<usize> {
        match self {
            Self::Run(run) => run.photos,
            Self::Scene(_) | Self::Rig(_) => None,
        }
    }

    /// The scene behind it, to be looked at.
    ///
    /// # Errors
    /// [`Error::Data`] where there is none.
    pub(super) fn simulation(&mut self) -> Result<&mut Simulation> {
        match self {
            Self::Scene(simulation) => Ok(simulation),
            Self::Rig(rig) => rig.simulation(),
            Self::Run(run) => Err(Error::Data {
                path: run.about.path.clone(),
                fault: "a run has photos of it, but not the scene itself".into(),
                help: "give the scene".into(),
            }
            .into()),
        }
    }

    /// What [`Source::light`] does, for the record of what took how long.
    pub(super) fn preparation(&self) -> &'static str {
        match self {
            Self::Scene(_) => "tracing and matrix",
            Self::Rig(rig) if rig.is_traced() => "tracing, matrix and first photos",
            Self::Rig(_) => "first photos",
            Self::Run(_) => "journal",
        }
    }

    /// What the values of photos are in.
    pub(super) fn unit(&self) -> &'static str {
        match self {
            Self::Scene(_) => "W/(m² sr)",
            Self::Rig(_) => "DN/s",
            Self::Run(run) if run.about.kind == Kind::Scene => "W/(m² sr)",
            Self::Run(_) => "DN/s",
        }
    }

    /// The labels of the scene's author, where there are any.
    pub(super) fn truth(&mut self) -> Result<Option<Truth>> {
        let resolution = self.resolution();
        match self {
            Self::Scene(simulation) => truth::truth(simulation, resolution),
            Self::Rig(rig) => rig.truth(),
            Self::Run(run) => Ok(run.truth()),
        }
    }

    /// What photos are taken by; with a run's folder, each is in its journal before it is used, and none is taken twice.
    pub(super) fn light(
        &mut self,
        choice: &OperatorArgs,
        channels: Channels,
        folder: Option<&RunFolder>,
        console: &Console,
    ) -> Result<Light<'_>> {
        if let (Self::Rig(_) | Self::Run(_), Some(option)) = (&*self, choice.given()) {
            return Err(not_for_rigs(option));
        }
        let about = self.about(channels);
        let Some(folder) = folder else {
            return match self {
                Self::Scene(simulation) => Light::of_scene(simulation, choice, channels, console),
                Self::Rig(rig) => {
                    Ok(Light::Measured(Box::new(rig.measured(Some(channels), None, console)?)))
                }
                Self::Run(run) => run.light(channels, console),
            };
        };
        match self {
            Self::Scene(simulation) => {
                let identity = simulation.identity(Identity::new(), channels);
                let mut journal = folder.journal(&identity, console)?;
                journal.note(about::ABOUT, &serde_json::to_vec(&about)?)?;
                let light = Light::of_scene(simulation, choice, channels, console)?;
                let mut kept = Kept::new(journal, about, light);
                kept.keep_known(console)?;
                Ok(Light::Kept(Box::new(kept)))
            }
            Self::Rig(rig) => {
                let journal = rig.journal(folder, channels, console)?;
                Ok(Light::Measured(Box::new(rig.measured(Some(channels), Some(journal), console)?)))
            }
            Self::Run(run) => run.light(channels, console),
        }
    }

    /// What a replay has to know of it.
    fn about(&self, channels: Channels) -> About {
        let (photos, patterns, name) = (self.resolution(), self.projector_resolution(), self.name());
        match self {
            Self::Scene(simulation) => {
                let (path, hash) = (
                    simulation.scene.path.clone(),
                    blake3::Hash::from_bytes(simulation.scene.hash).to_string(),
                );
                let symmetric = simulation.is_symmetric();
                let channels = channels.count();
                About { kind: Kind::Scene, name, path, hash, photos, patterns, symmetric, channels }
            }
            Self::Rig(rig) => rig.about(channels),
            Self::Run(run) => run.about.clone(),
        }
    }

    /// Notes what a run depends on.
    pub(super) fn describe(&self, manifest: &mut RunManifest, channels: Channels) {
        match self {
            Self::Scene(simulation) => simulation.describe(manifest),
            Self::Rig(rig) => rig.describe(manifest),
            Self::Run(run) => run.describe(manifest),
        }
        manifest.resolution = Some(self.resolution());
        manifest.channels = Some(match channels {
            Channels::Luma => "luma".into(),
            Channels::Rgb => "rgb".into(),
        });
    }
}

/// Whether it is a rig file by its name.
pub(super) fn is_rig(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("toml"))
}

/// A rig takes its photos itself.
pub(super) fn not_for_rigs(option: &str) -> anyhow::Error {
    Error::Option {
        option: option.into(),
        fault: "the photos of a rig are neither replayed from a matrix nor traced".into(),
        help: "leave it out, or give a scene".into(),
    }
    .into()
}
