//! The scenes of the figures, built in memory and traced once, and the ideal rig or the virtual devices that take the photos.

use std::path::Path;
use std::sync::Arc;

use super::figure::{Content, Panel, Rig};
use crate::calibrate::CalibrateOptions;
use crate::error::{Error, Result};
use crate::image::Resolution;
use crate::lab::{Lab, LabOperator, OperatorChoice, OperatorSettings, Settings, SharedObserver};
use crate::measure::{Calibration, DirectPatterns, RigFile, RigKind};
use crate::observer::{Estimate, Observer, Step};
use crate::operator::Operator;
use crate::scene::{Lens, Scene, builtin};
use crate::team::Team;
use crate::transport::{Assembled, Backend, Part};

/// Options for reproducing figures.
#[derive(Clone, Debug)]
pub struct BenchOptions {
    /// The rig that takes the photos.
    pub rig: Rig,
    /// A fast functional test: a third of the pixels per side, and a quarter of the light paths.
    pub quick: bool,
    /// Selects the graphics adapter whose name contains this text.
    pub adapter: Option<String>,
    /// Other processes that help with tracing.
    pub team: Option<Arc<Team>>,
}

/// The scenes and the rig of the figures. Traced scenes are kept in memory for later figures.
pub struct Bench {
    options: BenchOptions,
    observer: SharedObserver,
    scenes: Vec<OpenScene>,
    /// The operators of rigs whose frames the next call of [`Bench::costs`] counts.
    meters: Vec<LabOperator>,
    /// The patterns that rigs showed to measure their direct light, since the last call of [`Bench::costs`].
    direct: usize,
}

struct OpenScene {
    stage: Arc<Stage>,
    lab: Lab,
    /// The calibration of the virtual devices in front of the scene, once they have been used.
    calibration: Option<Calibration>,
}

impl Bench {
    /// Creates a bench. Nothing is traced yet. `observer` sees the steps of each trace and may stop it.
    pub fn new(options: BenchOptions, observer: Arc<dyn Observer + Send + Sync>) -> Self {
        Self {
            options,
            observer: SharedObserver(observer),
            scenes: Vec::new(),
            meters: Vec::new(),
            direct: 0,
        }
    }

    /// The kind of rig.
    pub fn rig(&self) -> Rig {
        self.options.rig
    }

    /// The number of pixels per side for a figure of `side` pixels; smaller in a quick run.
    pub(super) fn side(&self, side: usize) -> usize {
        if self.options.quick { side / 3 } else { side }
    }

    pub(super) fn stage(&mut self, set: Set, side: usize) -> Result<Arc<Stage>> {
        Ok(Arc::clone(&self.open(set, Resolution::new(side, side))?.stage))
    }

    pub(super) fn lab(&mut self, stage: &Stage) -> Result<&mut Lab> {
        Ok(&mut self.open(stage.set, stage.resolution)?.lab)
    }

    /// Products with the traced matrix, to evaluate results. They do not depend on the rig that took the photos.
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
                let rig = self.devices(stage)?;
                self.metered(rig, part)
            }
        }
    }

    /// Photos by virtual devices with one exposure per frame of this many seconds, however dim the photos are.
    pub(super) fn photos_exposed(&mut self, stage: &Stage, seconds: f64) -> Result<LabOperator> {
        let known = calibration_of(&self.devices(stage)?);
        let mut file = realistic(stage.resolution)?;
        file.measurement.exposures = vec![seconds];
        file.measurement.takes = 1;
        let mut rig = self.lab(stage)?.through_rig(file)?;
        rig.set_calibration(known.ok_or(Error::Interrupted)?)?;
        // The checks of the rig would fail in dim light, because noise hides even the white pattern at most pixels.
        rig.unexamined();
        self.metered(rig, Part::Full)
    }

    fn metered(&mut self, mut rig: Lab, part: Part) -> Result<LabOperator> {
        if let (Part::Global, Some(open)) = (part, rig.rig()) {
            let registration = &open.calibration.registration;
            let lit = vec![true; registration.projector.pixels()];
            self.direct += DirectPatterns::of(registration).shown(registration.projector, &lit).len();
        }
        self.meters.push(rig.reference_operators(part)?.swap_remove(0));
        Ok(rig.reference_operators(part)?.swap_remove(0))
    }

    pub(super) fn devices(&mut self, stage: &Stage) -> Result<Lab> {
        let known = match stage.set.is_coaxial() {
            true => None,
            // The devices are the same for each scene, so one calibration suffices. It is done before the projector is moved. The symmetry
            // of the light transport reveals the devices' uneven brightness.
            false => calibration_of(&self.open(Set::Corner, stage.resolution)?.through_devices(None)?),
        };
        self.open(stage.set, stage.resolution)?.through_devices(known)
    }

    /// The costs of virtual devices since the last call: the photos that measured direct light, and all frames. The frames include black, white
    /// and exposures, but not calibrations.
    pub(super) fn costs(&mut self) -> (usize, u64) {
        (std::mem::take(&mut self.direct), self.meters.drain(..).filter_map(|rig| rig.frames()).sum())
    }

    /// Returns the scene, and traces it first if necessary.
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
        // One matrix and a fixed order of sums on the processor make the numbers independent of the memory and of the device.
        let settings = Settings {
            adapter: options.adapter.clone(),
            team: options.team.clone(),
            operator: OperatorSettings {
                choice: OperatorChoice::Replay,
                backend: Backend::Cpu,
                memory: None,
            },
            ..Settings::default()
        };
        let mut lab = Lab::builder_of_scene(set.scene())
            .settings(settings)
            .size(resolution.width, resolution.height)
            .samples(if options.quick { set.samples() / 4 } else { set.samples() })
            .observer(observer.clone())
            .open()?;
        let truth = lab.labels()?;
        // The assembled matrix exists, because products of this scene are replayed.
        let traced = lab.assembled()?.ok_or(Error::Interrupted)?;
        let stage = Arc::new(Stage { set, resolution, truth, traced });
        Ok(Self { stage, lab, calibration: None })
    }

    /// The scene seen by virtual devices. Their calibration is `known`, or else it is measured from captures alone. After this measurement,
    /// a matte sheet shows their uneven brightness.
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

fn calibration_of(rig: &Lab) -> Option<Calibration> {
    rig.rig().map(|rig| rig.calibration.clone())
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Set {
    Zigzag,
    Corner,
    /// The white room. Camera and projector share a lens of this radius in tenths of a millimetre, focused 1.4 m ahead, so that the back
    /// wall at 2.3 m is out of focus.
    Room(u32),
    TwoSheets,
    /// The two sheets by one lens for camera and projector, whose blur of the farthest points is that of `Room(130)`, in pixels.
    SheetsOutOfFocus,
    SheetBehindSheet,
    /// The same with a front sheet whose back side is black.
    LinedSheet,
    GlossySheet,
    /// The same sheet without gloss.
    MatteSheet,
    Carton,
    CartonEggs,
    /// The zigzag with the projector [`APART`] to the right of the camera.
    Apart,
    /// As `Apart`, but projector and camera are exchanged.
    Exchanged,
    /// The corner, with the projector to the right of the camera. The distance is in tenths of a millimetre. The projector is turned
    /// towards the point of the corner at which the camera looks.
    Beside(u32),
}

/// The distance between the projector of [`Set::Apart`] and the camera, in metres.
pub(super) const APART: f32 = 0.1;

/// The distance of the corner's edge from the camera, in metres. The projector of [`Set::Beside`] looks at this edge.
pub(super) const EDGE: f32 = 1.2;

/// The lens of [`Set::SheetsOutOfFocus`]. It blurs points at 0.97 m by discs with a radius of 0.5 pixels, at 100 pixels per side.
const SHEETS_LENS: Lens = Lens { radius: 0.02, focus: 0.8 };

/// The distances in metres at which the lens of [`Set::Room`] is focused, and of the back wall.
const ROOM_FOCUS: f32 = 1.4;
const BACK_WALL: f32 = 2.3;

impl Set {
    pub(super) fn is_out_of_focus(self) -> bool {
        matches!(self, Self::Room(_) | Self::SheetsOutOfFocus)
    }

    /// The radius in pixels of the discs to which a lens blurs the back wall of the room, for this number of pixels per side.
    pub(super) fn blur_of_back_wall(tenths: u32, side: usize) -> f64 {
        let radius = 1e-4 * f64::from(tenths);
        let seen = radius * f64::from(1.0 / ROOM_FOCUS - 1.0 / BACK_WALL);
        let pixel = 2.0 * f64::from(builtin::room().camera.tan_half_fov) / side as f64;
        seen / pixel
    }

    /// Whether projector and camera have the same pose and lens, so that the light transport is symmetric.
    fn is_coaxial(self) -> bool {
        !matches!(self, Self::Apart | Self::Exchanged | Self::Beside(1..))
    }

    /// The number of light paths per pixel. With an open lens, direct light is sampled, too. The scene with exchanged devices is traced
    /// separately, with other paths, and both traces must agree.
    fn samples(self) -> u32 {
        match self {
            Self::Apart | Self::Exchanged => 1024,
            Self::Room(_) | Self::SheetsOutOfFocus => 512,
            _ => 256,
        }
    }

    pub(super) fn scene(self) -> Scene {
        let mut scene = match self {
            Self::Zigzag | Self::Apart | Self::Exchanged => builtin::zigzag(),
            Self::Corner | Self::Beside(_) => builtin::corner(),
            Self::Room(_) => builtin::room(),
            Self::TwoSheets | Self::SheetsOutOfFocus => builtin::two_sheets(),
            Self::SheetBehindSheet => builtin::sheet_behind_sheet(),
            Self::LinedSheet => builtin::sheet_behind_lined_sheet(),
            Self::GlossySheet => builtin::glossy_sheet(0.15),
            Self::MatteSheet => builtin::glossy_sheet(1.0),
            Self::Carton => builtin::nine_cells(false),
            Self::CartonEggs => builtin::nine_cells(true),
        }
        .to_scene();
        let mut projector = scene.camera.clone();
        match self {
            // A projector that is not given has the camera's lens.
            Self::Room(tenths) => {
                scene.camera.lens = Lens { radius: 1e-4 * tenths as f32, focus: ROOM_FOCUS };
                return scene;
            }
            Self::SheetsOutOfFocus => {
                scene.camera.lens = SHEETS_LENS;
                return scene;
            }
            Self::Apart | Self::Exchanged => {
                projector.position += APART * projector.right;
                if self == Self::Exchanged {
                    std::mem::swap(&mut projector, &mut scene.camera);
                }
            }
            Self::Beside(tenths @ 1..) => {
                let looks_at = projector.position + EDGE * projector.forward;
                projector.position += 1e-4 * tenths as f32 * projector.right;
                projector.forward = (looks_at - projector.position).normalize();
                projector.right = projector.forward.cross(projector.up).normalize();
            }
            _ => return scene,
        }
        scene.projector = Some(projector);
        scene
    }
}

pub(super) struct Stage {
    pub(super) set: Set,
    pub(super) resolution: Resolution,
    pub(super) truth: Vec<u8>,
    pub(super) traced: Arc<Assembled>,
}

impl Stage {
    pub(super) fn pixels(&self) -> usize {
        self.resolution.pixels()
    }

    /// The photo of `pattern` with direct and global light, in W/(m² sr).
    pub(super) fn photo(&self, pattern: &[f64]) -> Vec<f64> {
        let mut photo = vec![0.0; self.pixels()];
        self.traced.matrix.apply(Part::Full, 0, pattern, &mut photo);
        photo
    }

    pub(super) fn white(&self) -> Vec<f64> {
        self.photo(&vec![1.0; self.pixels()])
    }

    /// The rig's reading for 1 W/(m² sr), from its photo of white.
    pub(super) fn reading(&self, white: &[f64]) -> f64 {
        white.iter().sum::<f64>() / self.white().iter().sum::<f64>()
    }

    pub(super) fn white_panel(&self) -> Panel {
        let white = Content::Light { values: self.white(), white: None };
        self.panel("white", "The photo under white, W/(m² sr)", white)
    }

    pub(super) fn panel(
        &self,
        name: impl Into<String>,
        caption: impl Into<String>,
        content: Content,
    ) -> Panel {
        Panel { name: name.into(), caption: caption.into(), resolution: self.resolution, content }
    }
}

const REALISTIC: &[u8] = include_bytes!("../../assets/rigs/realistic.toml");
/// The number of captures averaged per pattern. More than one is affordable, because the virtual rig runs unattended.
const TAKES: u32 = 2;

/// A rig of a projector of this size, with 8 bits and gamma 2.2, and a 14-bit camera with 2.5 times as many pixels per side. Both have
/// realistic errors.
pub(super) fn realistic(resolution: Resolution) -> Result<RigFile> {
    const NAME: &str = "realistic.toml";
    let mut file = RigFile::from_bytes(Path::new(NAME), REALISTIC)?;
    let RigKind::Virtual(rig) = &mut file.kind else {
        return Err(Error::data(NAME, "its devices are real").help("the figures are made by virtual devices"));
    };
    let side = |pixels: usize| (2.5 * pixels as f64).round() as usize;
    rig.camera.size = Some([side(resolution.width), side(resolution.height)]);
    file.measurement.takes = TAKES;
    Ok(file)
}
