//! Sources of the figures' photos: scenes are built in memory, traced once, and measured by an ideal rig or by virtual devices.

use std::sync::Arc;

use super::devices::realistic;
use super::rig::Rig;
use super::stage::{Set, Stage};
use crate::calibrate::CalibrateOptions;
use crate::error::{Error, Result};
use crate::image::Resolution;
use crate::lab::{Lab, LabOperator, OperatorChoice, Settings, SharedObserver};
use crate::measure::Calibration;
use crate::observer::{Estimate, Observer, Step};
use crate::operator::Operator;
use crate::team::Team;
use crate::transport::{Backend, Part};

/// Options for reproducing figures.
#[derive(Clone, Debug)]
pub struct BenchOptions {
    /// The rig that takes the photos.
    pub rig: Rig,
    /// Uses a third of the pixels per side and a quarter of the light paths, as a fast functional test.
    pub quick: bool,
    /// Selects the graphics adapter whose name contains this text.
    pub adapter: Option<String>,
    /// Other processes that help to trace.
    pub team: Option<Arc<Team>>,
}

/// The scenes and the rig of the figures. Traced scenes are kept for later figures.
pub struct Bench {
    options: BenchOptions,
    observer: SharedObserver,
    scenes: Vec<OpenScene>,
    /// Operators of the rigs that took photos since [`Bench::frames`] was asked last.
    meters: Vec<LabOperator>,
}

/// A traced scene.
struct OpenScene {
    stage: Arc<Stage>,
    lab: Lab,
    /// That of the virtual devices in front of it, from the first time that they are used.
    calibration: Option<Calibration>,
}

impl Bench {
    /// Creates a bench without tracing anything. `observer` sees the steps of each trace and may stop it.
    pub fn new(options: BenchOptions, observer: Arc<dyn Observer + Send + Sync>) -> Self {
        Self { options, observer: SharedObserver(observer), scenes: Vec::new(), meters: Vec::new() }
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
        Ok(Arc::clone(&self.open(set, Resolution::new(side, side))?.stage))
    }

    /// The laboratory around a traced scene.
    pub(super) fn lab(&mut self, stage: &Stage) -> Result<&mut Lab> {
        Ok(&mut self.open(stage.set, stage.resolution)?.lab)
    }

    /// Products with the traced matrix. Answers are evaluated with it, whichever rig took the photos.
    pub(super) fn truth(&mut self, stage: &Stage, part: Part) -> Result<LabOperator> {
        Ok(self.lab(stage)?.reference_operators(part)?.swap_remove(0))
    }

    /// Photos of the scene by the rig. Virtual devices are opened anew each time.
    pub(super) fn photos(&mut self, stage: &Stage, part: Part) -> Result<LabOperator> {
        let step = Step { stage: "tracing", done: 1, total: 1, estimate: Estimate::None };
        if self.observer.0.step(&step).is_break() {
            return Err(Error::Interrupted);
        }
        match self.options.rig {
            Rig::Ideal => self.truth(stage, part),
            Rig::Virtual => {
                let mut rig = self.devices(stage)?;
                self.meters.push(rig.reference_operators(part)?.swap_remove(0));
                Ok(rig.reference_operators(part)?.swap_remove(0))
            }
        }
    }

    /// The scene through the virtual devices, calibrated.
    pub(super) fn devices(&mut self, stage: &Stage) -> Result<Lab> {
        let known = match stage.set.is_coaxial() {
            true => None,
            // The devices are the same in front of each scene. They are calibrated before the projector's lens is opened, or before it is moved:
            // stripes that are out of focus tell few pixels apart (of the corner by a lens of 70 mm, Gray codes lose 63 %), and the
            // symmetry of the light transport tells the devices' uneven brightness.
            false => calibration_of(&self.open(Set::Corner, stage.resolution)?.through_devices(None)?),
        };
        self.open(stage.set, stage.resolution)?.through_devices(known)
    }

    /// The frames that virtual cameras took for photos since this was asked last, those of black, white and exposures included and those of
    /// calibrations not.
    pub(super) fn frames(&mut self) -> u64 {
        self.meters.drain(..).filter_map(|rig| rig.frames()).sum()
    }

    /// The scene, traced now if it is not.
    fn open(&mut self, set: Set, resolution: Resolution) -> Result<&mut OpenScene> {
        let is_open = |scene: &OpenScene| (scene.stage.set, scene.stage.resolution) == (set, resolution);
        let at = match self.scenes.iter().position(is_open) {
            Some(at) => at,
            None => {
                let scene = OpenScene::new(set, resolution, &self.options, &self.observer)?;
                self.scenes.push(scene);
                self.scenes.len() - 1
            }
        };
        Ok(&mut self.scenes[at])
    }
}

impl OpenScene {
    fn new(
        set: Set,
        resolution: Resolution,
        options: &BenchOptions,
        observer: &SharedObserver,
    ) -> Result<Self> {
        // One matrix, and the order of sums on the processor: the numbers do not depend on the memory or on the device of products.
        let settings = Settings {
            adapter: options.adapter.clone(),
            team: options.team.clone(),
            operator: OperatorChoice::Replay,
            backend: Backend::Cpu,
            ..Settings::default()
        };
        let mut lab = Lab::builder_of_scene(set.scene())
            .settings(settings)
            .size(resolution.width, resolution.height)
            .samples(if options.quick { set.samples() / 4 } else { set.samples() })
            .observer(observer.clone())
            .open()?;
        let truth = lab.labels()?;
        // A scene whose products are replayed has a matrix.
        let traced = lab.assembled()?.ok_or(Error::Interrupted)?;
        let stage = Arc::new(Stage { set, resolution, truth, traced });
        Ok(Self { stage, lab, calibration: None })
    }

    /// The scene through virtual devices, whose calibration is `known`, or is measured from captures alone the first time; their uneven
    /// brightness is then measured by a sheet.
    fn through_devices(&mut self, known: Option<Calibration>) -> Result<Lab> {
        let mut rig = self.lab.through_rig(realistic(self.stage.resolution)?)?;
        match known.or(self.calibration.take()) {
            Some(known) => rig.set_calibration(known)?,
            None => {
                rig.calibrate(&CalibrateOptions::default())?;
                rig.measure_flat_field()?;
            }
        }
        self.calibration = calibration_of(&rig);
        Ok(rig)
    }
}

/// The calibration of the devices of a rig.
fn calibration_of(rig: &Lab) -> Option<Calibration> {
    rig.rig().map(|rig| rig.calibration.clone())
}
