//! Sources of the figures' photos: scenes are built in memory, traced once, and measured by an ideal rig or by virtual devices.

use std::ops::ControlFlow;
use std::sync::Arc;

use super::devices::Devices;
use super::stage::{Set, Stage};
use crate::analysis::MASKED;
use crate::error::{Error, Result};
use crate::image::Resolution;
use crate::observer::{Estimate, Observer, Step};
use crate::operator::Adjoint;
use crate::render::{TraceSettings, Tracer};
use crate::transport::{Channels, Part, assemble};

/// The kind of rig that measures the light.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Rig {
    /// Shows any real-valued pattern and measures the light without error.
    Ideal,
    /// An 8-bit projector and a 14-bit camera with realistic errors, calibrated from captures.
    Virtual,
}

impl Rig {
    /// Its name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Ideal => "ideal",
            Self::Virtual => "virtual",
        }
    }
}

/// Options for reproducing figures.
#[derive(Clone, Debug)]
pub struct BenchOptions {
    /// The rig that takes the photos.
    pub rig: Rig,
    /// Uses a third of the pixels per side and a quarter of the light paths, as a fast functional test.
    pub quick: bool,
    /// Selects the graphics adapter whose name contains this text.
    pub adapter: Option<String>,
}

/// The scenes and the rig of the figures. Traced scenes are cached for later figures.
pub struct Bench {
    options: BenchOptions,
    observer: Arc<dyn Observer + Send + Sync>,
    stages: Vec<(Set, Resolution, Arc<Stage>)>,
    /// Calibrated devices for each stage.
    devices: Vec<(Arc<Stage>, Devices)>,
}

impl Bench {
    /// Creates a bench without tracing anything. `observer` sees the steps of each trace and may stop it.
    pub fn new(options: BenchOptions, observer: Arc<dyn Observer + Send + Sync>) -> Self {
        Self { options, observer, stages: Vec::new(), devices: Vec::new() }
    }

    /// The kind of rig.
    pub fn rig(&self) -> Rig {
        self.options.rig
    }

    /// Pixels per side where the paper uses `side`.
    pub(super) fn side(&self, side: usize) -> usize {
        if self.options.quick { side / 3 } else { side }
    }

    /// The traced scene at `side × side` pixels.
    pub(super) fn stage(&mut self, set: Set, side: usize) -> Result<Arc<Stage>> {
        let resolution = Resolution::new(side, side);
        if let Some((.., stage)) = self.stages.iter().find(|(s, r, _)| (*s, *r) == (set, resolution)) {
            return Ok(Arc::clone(stage));
        }
        let scene = set.scene();
        let mut tracer = Tracer::new(&scene, self.options.adapter.as_deref())?;
        let truth = tracer.regions(resolution)?;
        let truth = truth.into_iter().map(|region| region.map_or(MASKED, |region| region as u8)).collect();
        let samples = if self.options.quick { set.samples() / 4 } else { set.samples() };
        let settings = TraceSettings::new(resolution, samples);
        tracer.observe(Arc::clone(&self.observer));
        let traced = assemble(&mut tracer, &settings, Channels::Luma)?;
        let stage = Arc::new(Stage { traced, truth, resolution, out_of_focus: set.is_out_of_focus() });
        self.stages.push((set, resolution, Arc::clone(&stage)));
        Ok(stage)
    }

    /// Runs `work` with an operator that takes photos of `stage` by the rig.
    pub(super) fn with_rig<T>(
        &mut self,
        stage: &Arc<Stage>,
        part: Part,
        work: impl FnOnce(&mut dyn Adjoint) -> Result<T>,
    ) -> Result<T> {
        self.check()?;
        match self.options.rig {
            Rig::Ideal => work(&mut stage.ideal(part)),
            Rig::Virtual => {
                let mut measurement = self.devices(stage)?.measurement(stage)?;
                work(&mut measurement.operator(part, 0))
            }
        }
    }

    /// The devices for a stage, calibrated on first use.
    fn devices(&mut self, stage: &Arc<Stage>) -> Result<&Devices> {
        let known = self.devices.iter().position(|(known, _)| Arc::ptr_eq(known, stage));
        let at = match known {
            Some(at) => at,
            None => {
                let devices = Devices::set_up(stage, &mut || self.go_on())?;
                self.devices.push((Arc::clone(stage), devices));
                self.devices.len() - 1
            }
        };
        Ok(&self.devices[at].1)
    }

    /// Asks the observer whether to continue.
    fn go_on(&self) -> ControlFlow<()> {
        self.observer.step(&Step { stage: "tracing", done: 1, total: 1, estimate: Estimate::None })
    }

    fn check(&self) -> Result<()> {
        if self.go_on().is_break() { Err(Error::Interrupted) } else { Ok(()) }
    }
}
