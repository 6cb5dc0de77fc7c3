//! SOURCE on the command line, whatever it is: where photos come from, and what is known beside them.

use anyhow::Result;

use super::console::Console;
use super::labels;
use super::light::Light;
use super::operator::OperatorArgs;
use super::options::SourceArgs;
use super::simulation::{self, Simulation};
use super::trace::TraceArgs;
use crate::image::Resolution;
use crate::report::manifest::{self, Manifest};
use crate::report::segmentation::Truth;
use crate::transport::Channels;

/// An open source. Nothing is traced and no photo taken before [`Source::light`].
pub(super) enum Source {
    /// A scene file, seen by the rig that stands in it.
    Scene(Box<Simulation>),
}

impl Source {
    /// Opens whatever SOURCE names.
    pub(super) fn open(args: &SourceArgs, trace: &TraceArgs, console: &Console) -> Result<Self> {
        let simulation = Simulation::open(&args.source, &args.view, trace.settings(), trace, console)?;
        Ok(Self::Scene(Box::new(simulation)))
    }

    /// A short name, for folders and titles.
    pub(super) fn name(&self) -> String {
        match self {
            Self::Scene(simulation) => simulation::short_name(&simulation.scene.path),
        }
    }

    /// Pixels of photos.
    pub(super) fn resolution(&self) -> Resolution {
        match self {
            Self::Scene(simulation) => simulation.settings.resolution,
        }
    }

    /// Pixels of patterns.
    pub(super) fn projector_resolution(&self) -> Resolution {
        match self {
            Self::Scene(simulation) => {
                simulation.settings.projector.unwrap_or(simulation.settings.resolution)
            }
        }
    }

    /// The scene behind it, to be traced.
    ///
    /// # Errors
    /// Where there is none.
    pub(super) fn simulation(&mut self) -> Result<&mut Simulation> {
        match self {
            Self::Scene(simulation) => Ok(simulation),
        }
    }

    /// What [`Source::light`] does, for the record of what took how long.
    pub(super) fn preparation(&self) -> &'static str {
        match self {
            Self::Scene(_) => "tracing and matrix",
        }
    }

    /// The labels of its author, where there are any.
    pub(super) fn truth(&mut self) -> Result<Option<Truth>> {
        let resolution = self.resolution();
        match self {
            Self::Scene(simulation) => labels::truth(simulation, resolution),
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
        }
    }

    /// Notes what a run depends on.
    pub(super) fn describe(&self, manifest: &mut Manifest, channels: Channels) {
        match self {
            Self::Scene(simulation) => describe_simulation(simulation, manifest),
        }
        manifest.resolution = Some(self.resolution());
        manifest.channels = Some(match channels {
            Channels::Luma => "luma".into(),
            Channels::Rgb => "rgb".into(),
        });
    }
}

fn describe_simulation(simulation: &Simulation, manifest: &mut Manifest) {
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
