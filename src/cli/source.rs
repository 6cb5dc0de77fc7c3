//! SOURCE on the command line, whatever it is: where photos come from, and what is known beside them.

use std::path::Path;

use anyhow::Result;

use super::console::Console;
use super::labels;
use super::light::Light;
use super::operator::OperatorArgs;
use super::options::SourceArgs;
use super::rig_source::RigSource;
use super::simulation::{self, Simulation};
use super::trace::TraceArgs;
use crate::error::Error;
use crate::image::Resolution;
use crate::report::manifest::{self, Manifest};
use crate::report::segmentation::Truth;
use crate::transport::Channels;

/// An open source. Nothing is traced and no photo taken before [`Source::light`].
pub(super) enum Source {
    /// A scene file, seen by the rig that stands in it.
    Scene(Box<Simulation>),
    /// A rig file.
    Rig(Box<RigSource>),
}

impl Source {
    /// Opens whatever SOURCE names.
    pub(super) fn open(args: &SourceArgs, trace: &TraceArgs, console: &Console) -> Result<Self> {
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
        }
    }

    /// Pixels of photos.
    pub(super) fn resolution(&self) -> Resolution {
        match self {
            Self::Scene(simulation) => simulation.settings.resolution,
            Self::Rig(rig) => rig.resolution(),
        }
    }

    /// Pixels of patterns.
    pub(super) fn projector_resolution(&self) -> Resolution {
        match self {
            Self::Scene(simulation) => {
                simulation.settings.projector.unwrap_or(simulation.settings.resolution)
            }
            Self::Rig(rig) => rig.resolution(),
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
        }
    }

    /// What [`Source::light`] does, for the record of what took how long.
    pub(super) fn preparation(&self) -> &'static str {
        match self {
            Self::Scene(_) => "tracing and matrix",
            Self::Rig(rig) if rig.is_traced() => "tracing, matrix and first photos",
            Self::Rig(_) => "first photos",
        }
    }

    /// What the values of photos are in.
    pub(super) fn unit(&self) -> &'static str {
        match self {
            Self::Scene(_) => "W/(m² sr)",
            Self::Rig(_) => "DN/s",
        }
    }

    /// The labels of the scene's author, where there are any.
    pub(super) fn truth(&mut self) -> Result<Option<Truth>> {
        let resolution = self.resolution();
        match self {
            Self::Scene(simulation) => labels::truth(simulation, resolution),
            Self::Rig(rig) => rig.truth(),
        }
    }

    /// What photos are taken by.
    pub(super) fn light(
        &mut self,
        choice: &OperatorArgs,
        channels: Channels,
        console: &Console,
    ) -> Result<Light<'_>> {
        match self {
            Self::Scene(simulation) => Light::of_scene(simulation, choice, channels, console),
            Self::Rig(rig) => match choice.given() {
                Some(option) => Err(not_for_rigs(option)),
                None => Ok(Light::Measured(Box::new(rig.measured(Some(channels), console)?))),
            },
        }
    }

    /// Notes what a run depends on.
    pub(super) fn describe(&self, manifest: &mut Manifest, channels: Channels) {
        match self {
            Self::Scene(simulation) => describe_simulation(simulation, manifest),
            Self::Rig(rig) => rig.describe(manifest),
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

/// Notes what a trace depends on.
pub(super) fn describe_simulation(simulation: &Simulation, manifest: &mut Manifest) {
    let (scene, settings) = (&simulation.scene, &simulation.settings);
    let adapter = simulation.tracer.adapter();
    manifest.seed = Some(u64::from(settings.seed));
    manifest.adapter = Some(manifest::Adapter {
        name: adapter.name.clone(),
        driver: format!("{} {}", adapter.driver, adapter.driver_version),
        backend: "vulkan".into(),
    });
    manifest.scene = Some(manifest::Scene {
        path: scene.path.display().to_string(),
        hash: scene.hash.iter().map(|byte| format!("{byte:02x}")).collect(),
    });
    manifest.samples_per_pixel = Some(settings.samples);
    manifest.max_bounces = Some(settings.max_bounces);
}
