//! The rig file: a TOML file that describes the devices of a rig and how it is measured.
//!
//! ```toml
//! kind = "virtual"                # simulated devices
//! calibration = "my-rig"          # the folder that `krylux rig calibrate` wrote, relative to this file
//! seed = 1
//!
//! [scene]                         # the scene of a virtual rig
//! file = "scene.glb"
//! size = [64, 64]
//!
//! [projector]                     # VirtualProjector
//! [camera]                        # VirtualCamera
//! [splitter]                      # Splitter
//! [ambient]                       # Ambient
//! [drift]                         # Drift
//! [faults]                        # Faults
//! [measurement]                   # MeasureOptions
//! ```
//!
//! An imperfection that the file leaves out is absent. The file of a rig of real devices has these tables instead:
//! ```toml
//! kind = "hardware"
//!
//! [projector]                     # X11Spec
//! kind = "x11"
//! monitor = "HDMI-1"
//! size = [128, 96]
//!
//! [camera]                        # by its kind: GenicamSpec, V4lSpec, Gphoto2Spec
//! kind = "gige"
//! address = "192.168.1.20"
//! size = [640, 480]
//!
//! [measurement]                   # MeasureOptions
//! ```
//!
//! A still camera is controlled by other programs. Programs that the file names run only if the file is in the user's own folder
//! ([`own_folder`]) or if they are otherwise allowed ([`RigFile::require_programs_allowed`]).
//!
//! A program can hand over devices, such as a camera behind its maker's library ([`LabBuilder::devices`](crate::lab::LabBuilder::devices)).
//! The file then only describes them:
//! ```toml
//! kind = "program"
//!
//! [projector]                     # ProgramProjector
//! size = [128, 96]
//!
//! [camera]                        # ProgramCamera
//! size = [640, 480]
//! bits = 12
//! exposures = [1e-4, 1.0]
//!
//! [measurement]                   # MeasureOptions
//! ```
//!
//! A *camera file* is a different file: it holds the poses of camera and projector in a scene (see [`crate::scene::load_with`]). A virtual
//! rig may name a camera file as `scene.camera_file`.

mod check;
mod programs;

use std::path::{Path, PathBuf};

use serde::Deserialize;
use serde::de::DeserializeOwned;

pub use super::rig_file::programs::own_folder;
use super::{Calibration, MeasureOptions};
use crate::error::{Error, Result};
use crate::image::Resolution;
use crate::render::MAX_BOUNCES;
use crate::rig::{
    Ambient, CameraInfo, CameraKind, CameraSpec, Drift, Faults, HardwareRig, ProgramRig, ProjectorInfo,
    Splitter, VirtualCamera, VirtualProjector, VirtualRig, VirtualScene, X11Spec, did_you_mean,
};
use crate::transport::Channels;
use check::FileCheck;

/// The content of a rig file.
#[derive(Clone, Debug, PartialEq)]
pub struct RigFile {
    /// The path of the file.
    pub path: PathBuf,
    /// The BLAKE3 hash of the file's bytes.
    pub hash: [u8; 32],
    /// The folder of the calibration. It is `None` when the file does not name one.
    pub calibration: Option<PathBuf>,
    /// How the rig is measured.
    pub measurement: MeasureOptions,
    /// The devices.
    pub kind: RigKind,
}

/// The devices of a rig file.
#[allow(clippy::large_enum_variant, reason = "a program has only one of them")]
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum RigKind {
    /// Virtual devices in front of a simulated scene.
    Virtual(VirtualRig),
    /// Real devices.
    Hardware(HardwareRig),
    /// Devices that a program hands over.
    Program(ProgramRig),
}

const KINDS: [&str; 3] = ["virtual", "hardware", "program"];

impl RigKind {
    /// The name of the kind in a rig file.
    pub fn word(&self) -> &'static str {
        match self {
            Self::Virtual(_) => "virtual",
            Self::Hardware(_) => "hardware",
            Self::Program(_) => "program",
        }
    }

    /// The description of the projector.
    pub fn projector_info(&self) -> ProjectorInfo {
        match self {
            Self::Virtual(rig) => rig.projector_info(),
            Self::Hardware(rig) => rig.projector.info(),
            Self::Program(rig) => rig.projector_info(),
        }
    }

    /// The channels of the light transport: RGB if projector or camera has three channels, else luma.
    pub fn channels(&self) -> Channels {
        let coloured = self.projector_info().channels.max(self.camera_info().channels) > 1;
        if coloured { Channels::Rgb } else { Channels::Luma }
    }

    /// The description of the camera.
    pub fn camera_info(&self) -> CameraInfo {
        match self {
            Self::Virtual(rig) => rig.camera_info(),
            Self::Hardware(rig) => rig.camera.info(),
            Self::Program(rig) => rig.camera_info(),
        }
    }
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct VirtualTables {
    #[serde(rename = "kind")]
    _kind: String,
    calibration: Option<PathBuf>,
    #[serde(default)]
    seed: u64,
    scene: SceneTable,
    #[serde(default)]
    projector: VirtualProjector,
    #[serde(default)]
    camera: VirtualCamera,
    #[serde(default)]
    splitter: Splitter,
    #[serde(default)]
    ambient: Ambient,
    #[serde(default)]
    drift: Drift,
    #[serde(default)]
    faults: Faults,
    #[serde(default)]
    measurement: MeasureOptions,
}

/// The tables of a file for real devices or for devices that a program hands over.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct DeviceTables<P, C> {
    #[serde(rename = "kind")]
    _kind: String,
    calibration: Option<PathBuf>,
    projector: P,
    camera: C,
    #[serde(default)]
    measurement: MeasureOptions,
}

/// The part of a file that names the kind of its camera. The type of the other tables depends on this kind.
#[derive(Deserialize)]
struct OfKind {
    camera: Option<KindOnly>,
}

#[derive(Deserialize)]
struct KindOnly {
    kind: CameraKind,
}

/// The table `[scene]` of a virtual rig: a scene to be traced, or a matrix.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct SceneTable {
    /// Width and height in pixels, of the projector and of the simulated photo before the camera resamples it.
    size: [usize; 2],
    /// The file of a scene to be traced.
    file: Option<PathBuf>,
    /// The file of a matrix, instead of a scene.
    matrix: Option<PathBuf>,
    camera: Option<String>,
    camera_file: Option<PathBuf>,
    samples: Option<u32>,
    max_bounces: Option<u32>,
    seed: Option<u32>,
}

impl SceneTable {
    /// The scene, with paths relative to `folder`.
    fn into_scene(self, check: &FileCheck, folder: &Path) -> Result<VirtualScene> {
        let [width, height] = self.size;
        for side in [width, height] {
            check.range("scene.size", side as f64, 1.0, 16384.0)?;
        }
        let size = Resolution::new(width, height);
        match (self.file, self.matrix) {
            (Some(file), None) => {
                let samples = self.samples.unwrap_or(64);
                let max_bounces = self.max_bounces.unwrap_or(6);
                check.range("scene.samples", samples.into(), 1.0, f64::from(1 << 20))?;
                check.range("scene.max_bounces", max_bounces.into(), 1.0, MAX_BOUNCES.into())?;
                if self.camera.is_some() && self.camera_file.is_some() {
                    return Err(check.fault(
                        "[scene] has both camera and camera_file",
                        "give the name of one of the scene's cameras, or a camera file with the poses of camera and projector",
                    ));
                }
                Ok(VirtualScene::File {
                    path: folder.join(file),
                    camera: self.camera,
                    camera_file: self.camera_file.map(|path| folder.join(path)),
                    size,
                    samples,
                    max_bounces,
                    seed: self.seed.unwrap_or(0),
                })
            }
            (None, Some(matrix)) => {
                let of_files = [
                    ("camera", self.camera.is_some()),
                    ("camera_file", self.camera_file.is_some()),
                    ("samples", self.samples.is_some()),
                    ("max_bounces", self.max_bounces.is_some()),
                    ("seed", self.seed.is_some()),
                ];
                if let Some((key, _)) = of_files.into_iter().find(|(_, given)| *given) {
                    return Err(check.fault(
                        format!("scene.{key} is an option of tracing, but scene.matrix needs no tracing"),
                        format!("leave out {key}, or give scene.file instead of scene.matrix"),
                    ));
                }
                Ok(VirtualScene::Matrix { path: folder.join(matrix), size })
            }
            _ => Err(check.fault(
                "[scene] needs either file or matrix",
                "give file = \"scene.glb\", or matrix = \"matrix.npz\" as `krylux matrix` writes it",
            )),
        }
    }
}

impl RigFile {
    /// Reads a rig file.
    ///
    /// # Errors
    /// [`Error::Read`] when the file cannot be read; [`Error::Data`] when it is invalid. The error names the line or the key, the valid
    /// values, and the known name that is most similar to an unknown name.
    pub fn load(path: &Path) -> Result<Self> {
        let bytes = crate::file::read(path)?;
        Self::from_bytes(path, &bytes)
    }

    /// Parses `bytes` as the content of the file at `path`.
    pub fn from_bytes(path: &Path, bytes: &[u8]) -> Result<Self> {
        let check = FileCheck { path: path.to_path_buf() };
        let text = std::str::from_utf8(bytes)
            .map_err(|_| check.fault("not UTF-8 text", "give a rig file in TOML"))?;
        let hash = *blake3::hash(bytes).as_bytes();
        let folder = path.parent().unwrap_or(Path::new(""));
        let (kind, calibration, measurement) = match kind_of(&check, text)?.as_str() {
            "virtual" => {
                let tables: VirtualTables = parse(path, text)?;
                check.virtual_rig(&tables)?;
                let VirtualTables { calibration, measurement, seed, projector, camera, .. } = tables;
                let VirtualTables { splitter, ambient, drift, faults, .. } = tables;
                let scene = tables.scene.into_scene(&check, folder)?;
                let rig = VirtualRig { scene, projector, camera, splitter, ambient, drift, faults, seed };
                (RigKind::Virtual(rig), calibration, measurement)
            }
            "program" => {
                let DeviceTables { calibration, projector, camera, measurement, .. } = parse(path, text)?;
                let rig = ProgramRig { projector, camera };
                check.program(&rig)?;
                (RigKind::Program(rig), calibration, measurement)
            }
            _ => real_devices(&check, text)?,
        };
        check.measurement(&measurement)?;
        let calibration = calibration.map(|calibration| folder.join(calibration));
        Ok(Self { path: path.to_path_buf(), hash, calibration, measurement, kind })
    }
}

/// Parses the file of a rig of real devices and checks its values.
fn real_devices(check: &FileCheck, text: &str) -> Result<(RigKind, Option<PathBuf>, MeasureOptions)> {
    let OfKind { camera } = parse(&check.path, text)?;
    // The table parser below reports a missing camera together with the other errors of the file.
    let (rig, calibration, measurement) = match camera.map_or(CameraKind::Gige, |camera| camera.kind) {
        CameraKind::Gige | CameraKind::Usb3 => hardware(check, text, CameraSpec::Genicam)?,
        CameraKind::V4l => hardware(check, text, CameraSpec::V4l)?,
        CameraKind::Gphoto2 => hardware(check, text, CameraSpec::Gphoto2)?,
    };
    check.x11(&rig.projector)?;
    check.hardware_camera(&rig.camera)?;
    Ok((RigKind::Hardware(rig), calibration, measurement))
}

/// Parses the file of a rig of real devices with a camera of kind `C`.
fn hardware<C: DeserializeOwned>(
    check: &FileCheck,
    text: &str,
    spec: fn(C) -> CameraSpec,
) -> Result<(HardwareRig, Option<PathBuf>, MeasureOptions)> {
    let DeviceTables::<X11Spec, C> { calibration, projector, camera, measurement, .. } =
        parse(&check.path, text)?;
    Ok((HardwareRig { projector, camera: spec(camera) }, calibration, measurement))
}

/// Returns the kind of rig that the file describes. A missing or an unknown kind is an error.
fn kind_of(check: &FileCheck, text: &str) -> Result<String> {
    let table: toml::Table = parse(&check.path, text)?;
    let known = KINDS.join(", ");
    match table.get("kind").map(|kind| kind.as_str()) {
        Some(Some(kind)) if KINDS.contains(&kind) => Ok(kind.to_owned()),
        Some(Some(kind)) => {
            let meant = did_you_mean(kind, &KINDS, "\"");
            Err(check.fault(format!("unknown kind \"{kind}\"{meant}"), format!("known kinds: {known}")))
        }
        Some(None) => Err(check.fault("kind is not a string", format!("give kind = \"virtual\"; known kinds: {known}"))),
        None if table.contains_key("camera") && !table.contains_key("scene") => Err(check.fault(
            "it does not say what kind of rig it describes",
            "begin a rig file with kind = \"virtual\" or \"hardware\"; a camera file, which holds the poses of camera and \
             projector, is given as --camera-file",
        )),
        None => Err(check.fault(
            "it does not say what kind of rig it describes",
            format!("begin it with kind = \"virtual\"; known kinds: {known}"),
        )),
    }
}

pub(crate) fn parse<T: DeserializeOwned>(path: &Path, text: &str) -> Result<T> {
    toml::from_str(text).map_err(|error| explain(path, text, &error))
}

fn explain(path: &Path, text: &str, error: &toml::de::Error) -> Error {
    let message = error.message().trim_end();
    let place = error.span().map_or_else(String::new, |span| place(text, span.start));
    let data = |fault, help| Error::data(path, fault).help(help);
    // The messages of serde are "unknown field `a`, expected one of `b`, `c`" and "unknown variant `a`, expected `b` or `c`".
    let unknown = [("unknown field `", "key"), ("unknown variant `", "value")];
    for (beginning, what) in unknown {
        let Some((name, rest)) = message.strip_prefix(beginning).and_then(|rest| rest.split_once('`')) else {
            continue;
        };
        let known: Vec<&str> = rest.split('`').skip(1).step_by(2).collect();
        let meant = did_you_mean(name, &known, "`");
        let known = if known.is_empty() { "none".into() } else { known.join(", ") };
        return data(format!("{place}unknown {what} `{name}`{meant}"), format!("known here: {known}"));
    }
    let help = "a rig file is TOML: tables like [camera], and lines like `bits = 14`; see the examples in assets/rigs";
    data(format!("{place}{message}"), help.into())
}

/// Writes `line 7, in [camera]: ` for the byte at `at`. The table is left out when that line is itself a table's header.
fn place(text: &str, at: usize) -> String {
    // The span of an error may end at the end of the text or inside a character.
    let before = String::from_utf8_lossy(text.as_bytes().get(..at).unwrap_or(text.as_bytes()));
    let line = before.matches('\n').count() + 1;
    let is_header = text.lines().nth(line - 1).is_some_and(|line| line.trim_start().starts_with('['));
    let table = before.lines().rev().find_map(|line| {
        let (name, _) = line.trim().strip_prefix('[')?.split_once(']')?;
        // A line of an array of arrays also begins with a bracket.
        name.starts_with(|c: char| c.is_ascii_alphabetic()).then(|| name.to_owned())
    });
    match table {
        Some(table) if !is_header => format!("line {line}, in [{table}]: "),
        _ => format!("line {line}: "),
    }
}

/// Seconds between the confirmation of a frame and its photo when neither the rig file nor a calibration gives them. Projectors that
/// process their picture show it some frames late.
const CAREFUL_SETTLE: f64 = 0.1;

impl RigFile {
    /// Loads the calibration that the file names, and checks that it belongs to the file's devices. It is `None` when the file names none.
    pub fn load_calibration(&self) -> Option<Result<Calibration>> {
        let folder = self.calibration.as_ref()?;
        let (projector, camera) = (self.kind.projector_info(), self.kind.camera_info());
        Some(Calibration::load(folder).and_then(|known| known.check(&projector, &camera).map(|()| known)))
    }

    /// Seconds between the confirmation of a frame and its photo: the file's value, else the calibration's value, else 0.1.
    pub fn settle(&self, known: Option<&Calibration>) -> f64 {
        let measured = known.map(|known| known.stability.settle);
        self.measurement.settle.or(measured).unwrap_or(CAREFUL_SETTLE)
    }

    /// The longest exposure that the file gives, in seconds. It is `None` when the file leaves the choice to the program.
    pub fn longest_exposure(&self) -> Option<f64> {
        self.measurement.exposures.last().copied()
    }
}
