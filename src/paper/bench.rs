//! The scenes of the figures, built in memory and traced once, and the ideal rig or the virtual devices that take the photos.

use std::path::Path;
use std::sync::Arc;

use super::figure::{Content, Panel, Rig};
use crate::calibrate::CalibrateOptions;
use crate::error::{Error, Result};
use crate::image::Resolution;
use crate::lab::{Lab, LabOperator, OperatorChoice, OperatorSettings, Settings, SharedObserver};
use crate::measure::{Calibration, RigFile, RigKind};
use crate::observer::{Estimate, Observer, Step};
use crate::operator::Operator;
use crate::rig::VirtualRig;
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
    /// The operators of rigs whose frames the next call of [`Bench::frames`] counts.
    meters: Vec<LabOperator>,
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
        Self { options, observer: SharedObserver(observer), scenes: Vec::new(), meters: Vec::new() }
    }

    /// The kind of rig.
    pub fn rig(&self) -> Rig {
        self.options.rig
    }

    /// The number of pixels per side for a figure in which the paper uses `side`.
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
                let mut rig = self.devices(stage)?;
                self.meters.push(rig.reference_operators(part)?.swap_remove(0));
                Ok(rig.reference_operators(part)?.swap_remove(0))
            }
        }
    }

    pub(super) fn devices(&mut self, stage: &Stage) -> Result<Lab> {
        let known = match stage.set.is_coaxial() {
            true => None,
            // The devices are the same for each scene, so one calibration suffices. It is done before the projector's lens is opened, or
            // before the projector is moved, because stripes that are out of focus distinguish few pixels (for the corner and a lens of 70
            // mm, Gray codes lose 63 %). The symmetry of the light transport reveals the devices' uneven brightness.
            false => calibration_of(&self.open(Set::Corner, stage.resolution)?.through_devices(None)?),
        };
        self.open(stage.set, stage.resolution)?.through_devices(known)
    }

    /// The number of frames that virtual cameras took since the last call. It includes black, white and exposures, but not calibrations.
    pub(super) fn frames(&mut self) -> u64 {
        self.meters.drain(..).filter_map(|rig| rig.frames()).sum()
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
    /// The corner with a projector whose lens is wide open and focused behind the scene.
    Defocused,
    /// As `Defocused`, but the camera has an equal lens, which makes the matrix symmetric again.
    BothDefocused,
    TwoSheets,
    Post,
    FoldedSheet,
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

/// A lens that blurs walls at 0.6 to 1.2 m by discs with a radius of 2.6 to 7.7 pixels, at 128 pixels per side.
const DEFOCUSED: Lens = Lens { radius: 0.035, focus: 2.4 };

impl Set {
    pub(super) fn is_out_of_focus(self) -> bool {
        matches!(self, Self::Defocused | Self::BothDefocused)
    }

    /// Whether projector and camera have the same pose and lens, so that the light transport is symmetric.
    fn is_coaxial(self) -> bool {
        !matches!(self, Self::Defocused | Self::Apart | Self::Exchanged | Self::Beside(1..))
    }

    /// The number of light paths per pixel. With an open lens, direct light is sampled, too. At 256 paths, the optimal pattern exploits the
    /// noise in the fixed matrix, and gains five per cent that methods with few products cannot reach. The scene with exchanged devices is
    /// traced separately, with other paths, and both traces must agree.
    fn samples(self) -> u32 {
        match self {
            Self::Defocused | Self::BothDefocused | Self::Apart | Self::Exchanged => 1024,
            _ => 256,
        }
    }

    pub(super) fn scene(self) -> Scene {
        let mut scene = match self {
            Self::Zigzag | Self::Apart | Self::Exchanged => builtin::zigzag(),
            Self::Corner | Self::Defocused | Self::BothDefocused | Self::Beside(_) => builtin::corner(),
            Self::TwoSheets => builtin::two_sheets(),
            Self::Post => builtin::two_sheets_post(),
            Self::FoldedSheet => builtin::folded_sheet(),
            Self::Carton => builtin::nine_cells(false),
            Self::CartonEggs => builtin::nine_cells(true),
        }
        .to_scene();
        let mut projector = scene.camera.clone();
        match self {
            Self::Defocused => projector.lens = DEFOCUSED,
            Self::BothDefocused => {
                scene.camera.lens = DEFOCUSED;
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
const ONE_BIT: &[u8] = include_bytes!("../../assets/rigs/one-bit.toml");

/// The number of captures averaged per pattern. More than one is affordable, because the virtual rig runs unattended.
const TAKES: u32 = 2;

/// A rig of a projector of this size, with 8 bits and gamma 2.2, and a 14-bit camera. Both have realistic errors.
pub(super) fn realistic(resolution: Resolution) -> Result<RigFile> {
    let (mut file, rig) = shipped("realistic.toml", REALISTIC, resolution, 2.5)?;
    file.measurement.takes = TAKES;
    Ok(RigFile { kind: RigKind::Virtual(rig), ..file })
}

/// A rig of a one-bit projector and a camera of the same size: the rig file, and the devices to insert into it.
pub(super) fn one_bit(resolution: Resolution) -> Result<(RigFile, VirtualRig)> {
    shipped("one-bit.toml", ONE_BIT, resolution, 1.0)
}

/// A shipped rig file and its devices. Per side, the camera has `finer` times as many pixels as the projector.
fn shipped(name: &str, bytes: &[u8], resolution: Resolution, finer: f64) -> Result<(RigFile, VirtualRig)> {
    let file = RigFile::from_bytes(Path::new(name), bytes)?;
    let RigKind::Virtual(mut rig) = file.kind.clone() else {
        return Err(Error::data(name, "its devices are real").help("the figures are made by virtual devices"));
    };
    let side = |pixels: usize| (finer * pixels as f64).round() as usize;
    rig.camera.size = Some([side(resolution.width), side(resolution.height)]);
    Ok((file, rig))
}
