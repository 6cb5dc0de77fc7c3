//! Requests to the devices of a rig while it is set up. They need no laboratory, and most of them no calibration.

mod align;
mod calibrate;

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::json;

pub use align::Align;
pub use calibrate::{Calibrate, Calibrated, measured_figures};

use super::options::{count, default_values, png, time};
use super::pattern::Pattern;
use crate::bench::preview::LivePreview;
use crate::bench::rig_check::{self, Findings, RigToCheck};
use crate::error::{Error, Result};
use crate::io::name::Name;
use crate::lab::{Log, RigSource, SharedObserver, SourceKind};
use crate::measure::{Calibration, CaptureRequest, Effort, FrameSource, RigFile, RigKind};
use crate::report::content::Content;
use crate::report::stages;
use crate::rig::{AttachedDevices, CameraInfo, Helper, MonitorInfo, ProjectorInfo, RawFrame, VirtualScene};

default_values!(Align, Calibrate, CheckBench);

/// Refuses a source that is not a rig. `argument` is the command line argument that names the source. Errors: [`Error::Option`].
pub fn require_rig(path: &Path, argument: &str) -> Result<()> {
    if SourceKind::of(path) == SourceKind::Rig {
        return Ok(());
    }
    Err(Error::option(argument, format!("{} is no rig", path.display()))
        .help("give a rig file (.toml): this verb asks devices"))
}

/// A rig that is being set up. It may lack a calibration.
pub struct BenchRig {
    /// The rig.
    pub source: RigSource,
    /// The calibration, if there is a usable one.
    pub known: Option<Calibration>,
}

impl BenchRig {
    /// Loads the calibration that the rig file names. If the calibration is unusable, a note gives the reason.
    pub fn new(source: RigSource) -> Self {
        let known = source.file.load_calibration().transpose();
        if let Err(why) = &known {
            source.observer().note(format_args!("note: the calibration is left aside: {why}"));
        }
        Self { source, known: known.ok().flatten() }
    }

    /// Opens the devices. When the observer stops the work, the next frame fails with [`Error::Interrupted`].
    pub fn open(&self) -> Result<Box<dyn FrameSource>> {
        let mut frames = self.source.opener()(None)?;
        frames.set_settle(self.settle());
        Ok(Box::new(Interruptible { frames, observer: self.source.observer().clone() }))
    }

    /// Seconds between a frame's confirmation and its photo.
    pub fn settle(&self) -> f64 {
        self.source.file.settle(self.known.as_ref())
    }

    /// The given exposure, or else the longest one in the rig file.
    pub fn exposure(&self, given: Option<f64>) -> Option<f64> {
        given.or(self.source.file.longest_exposure())
    }

    /// Starts a preview of a pattern, with this exposure in seconds. Warns if no exposure suits white. Fails if the rig fails.
    pub fn preview(&self, pattern: &crate::image::Image, exposure: Option<f64>) -> Result<LivePreview> {
        let known = self.known.as_ref().map(|known| &known.camera);
        let (preview, outcome) = LivePreview::new(self.open()?, known, pattern, self.exposure(exposure))?;
        if let Some(warning) = outcome.warning(preview.exposure()) {
            self.source.observer().note(format_args!("warning: {warning}"));
        }
        Ok(preview)
    }
}

/// A source of frames that fails once the observer stops the work.
struct Interruptible {
    frames: Box<dyn FrameSource>,
    observer: SharedObserver,
}

impl FrameSource for Interruptible {
    fn projector(&self) -> &ProjectorInfo {
        self.frames.projector()
    }

    fn camera(&self) -> &CameraInfo {
        self.frames.camera()
    }

    fn capture(&mut self, request: &CaptureRequest) -> Result<RawFrame> {
        match self.observer.0.frame() {
            ControlFlow::Continue(()) => self.frames.capture(request),
            ControlFlow::Break(()) => Err(Error::Interrupted),
        }
    }

    fn set_settle(&mut self, seconds: f64) {
        self.frames.set_settle(seconds);
    }

    fn effort(&self) -> Effort {
        self.frames.effort()
    }
}

/// Show what the camera sees, live: saturated pixels red, black ones blue, with a focus score; until Ctrl-C
#[derive(clap::Args, Clone, Debug, PartialEq, Serialize, Deserialize)]
#[command(
    after_help = "Examples:\n  krylux rig preview rig.toml\n  krylux rig preview rig.toml --frames 1 --pattern checker:4 -o preview.png"
)]
pub struct PreviewCamera {
    /// The projected pattern: white, black, left, checker:N, stripes:N, pixel:X,Y, or an image file
    /// (.npy, .exr, .png, .tif …), as levels
    #[arg(long, value_name = "PATTERN", default_value = "white")]
    pub pattern: Pattern,
    /// Seconds of each exposure [default: the longest exposure in the rig file, else the one at which white
    /// fills 70 % of the camera's range]
    #[arg(long, value_name = "SECONDS", value_parser = time)]
    pub exposure: Option<f64>,
    /// Frames to take; 0: until Ctrl-C
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = count::<u64>)]
    pub frames: u64,
    /// The file of the picture; it is complete at any moment
    /// [default: preview.png, or the first free one of preview-2.png, preview-3.png, …]
    #[arg(short = 'o', long = "output", value_name = "FILE.png", value_parser = png)]
    pub file: Option<PathBuf>,
}

/// Check a bench before a session: devices, light, frames, calibration, disk; exit 1 where something fails
#[derive(clap::Args, Clone, Debug, PartialEq, Serialize, Deserialize)]
#[command(after_help = "Example:\n  krylux rig check rig.toml")]
pub struct CheckBench {
    /// The folder of the session's runs; its disk is checked for free space
    #[arg(short = 'o', long = "output", value_name = "DIR", default_value = "out")]
    pub folder: PathBuf,
}

impl CheckBench {
    /// Checks a rig, or the error of reading its file, and passes each finding to `report`. Fails only with [`Error::Interrupted`].
    pub fn ask(&self, source: Result<RigSource>, report: &mut rig_check::Report<'_>) -> Result<Findings> {
        let source = source.and_then(|source| source.require_programs_allowed().map(|()| source));
        let bench = match source {
            // The check loads the calibration itself, since one that cannot be read is a finding.
            Ok(source) => BenchRig { source, known: None },
            // An error becomes a finding, except an interruption.
            Err(error) => return rig_check::unreadable(error, report),
        };
        let rig = RigToCheck {
            file: &bench.source.file,
            folder: &self.folder,
            helper: &Helper::find,
            open: &mut || bench.open(),
        };
        rig_check::check(rig, report)
    }

    /// The facts of the findings, and a sentence about them.
    pub fn content(findings: &Findings) -> Content<'static> {
        let mut content = Content::default();
        content.line(findings.sentence());
        content.fact("passed", findings.passed());
        content.fact("whole", findings.complete);
        content.fact("sentence", findings.sentence());
        content.fact("findings", &findings.all);
        content.detail("complete", findings.complete);
        content.detail("status", findings.sentence());
        content
    }
}

/// Measure how uneven projector and camera are, by one photo of a matte sheet; added to the rig's calibration
///
/// Stand a matte sheet of one colour square to the camera, so that it fills the view, and keep other light away. A virtual rig
/// gets such a sheet in place of its scene. Calibrate the rig first. From then on patterns are divided by the projector's brightness
/// and photos by the camera's. Runs that were begun before cannot be continued.
#[derive(clap::Args, Clone, Debug, PartialEq, Serialize, Deserialize)]
#[command(after_help = "Example:\n  krylux rig flat-field rig.toml")]
pub struct MeasureSheet {}

impl MeasureSheet {
    /// Photographs the sheet, and adds the brightness of both devices to the calibration that the rig file names. Fails as
    /// [`RigSource::flat_field`]; [`Error::Option`] if the rig file names no calibration; [`Error::Write`].
    pub fn ask(rig: &RigSource) -> Result<Content<'static>> {
        let (flat, folder) = rig.add_flat_field()?;
        let mut content = Content::default();
        for (name, values) in [("projector", flat.projector), ("camera", flat.camera)] {
            let [least, most] =
                [f64::min, f64::max].map(|choose| values.iter().copied().reduce(choose).unwrap_or(1.0));
            let darkest = least / most;
            content.line(format_args!(
                "{name:<9} its darkest pixel has {darkest:.3} of the light of its brightest"
            ));
            content.fact(name, darkest);
            content.attribute(name, &[values.len()], values);
        }
        content.line(format_args!("wrote     {}", folder.display()));
        content.fact("folder", Name::from(&folder));
        Ok(content)
    }
}

/// List the monitors and cameras that a rig file may name; no camera is opened but that of the rig file
#[derive(clap::Args, Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[command(after_help = "Example:\n  krylux rig list --abilities")]
pub struct ListDevices {
    /// A rig file; its X server and its camera are queried, too
    #[arg(value_name = "RIG")]
    pub file: Option<PathBuf>,
    /// The X server [default: that of the rig file, or of DISPLAY]
    #[arg(long, value_name = ":N")]
    pub display: Option<String>,
    /// Open every camera that answers, and say what it can do, as for that of the rig file. What it can do is a description that the camera
    /// sends: a separate process reads it
    #[arg(long)]
    pub abilities: bool,
}

impl ListDevices {
    /// Searches for devices. The returned flag tells whether there are any. Fails if the rig file cannot be read.
    pub fn ask(&self) -> Result<(Content<'static>, bool)> {
        let file = self.file.as_deref().map(RigFile::load).transpose()?;
        let (hardware, other) = match file.as_ref().map(|file| &file.kind) {
            Some(RigKind::Hardware(rig)) => (Some(rig), None),
            other => (None, other.map(|kind| (kind.projector_info(), kind.camera_info()))),
        };
        let mut content = Content::default();
        if let Some((projector, camera)) = &other {
            content.line(format_args!(
                "virtual   projector: {} pixels, {} bits, frame_time = {}",
                projector.resolution, projector.bits, projector.frame_time
            ));
            let [shortest, longest] = camera.exposures;
            content.line(format_args!(
                "virtual   camera: {} pixels, {} bits, exposures {shortest} to {longest} s",
                camera.resolution, camera.bits
            ));
        }
        let mut notes: Vec<String> = Vec::new();
        let mut note = |why: &Error| notes.push(why.to_string());
        let found = AttachedDevices::find(self.display.as_deref(), hardware, self.abilities, &mut note);
        found.monitors.iter().enumerate().for_each(|monitor| content.line(line_of(monitor)));
        if found.cameras.is_empty() {
            content.line("camera    none answers");
        }
        for camera in &found.cameras {
            for (at, line) in camera.lines.iter().enumerate() {
                content.line(format_args!("{:<9} {line}", if at == 0 { "camera" } else { "" }));
            }
            notes.extend(camera.unknown.clone());
        }
        notes.iter().for_each(|why| content.note(format_args!("note: {why}")));
        let is_found = other.is_some() || !found.monitors.is_empty() || !found.cameras.is_empty();
        if !is_found {
            content.note("nothing was found: connect and switch on a projector or a camera, or name the X server by --display");
        }
        content.fact("monitors", &found.monitors);
        content.fact("cameras", found.cameras.iter().map(|camera| &camera.described).collect::<Vec<_>>());
        content.fact(
            "virtual",
            other.map(|(projector, camera)| json!({ "projector": projector, "camera": camera })),
        );
        content.detail("notes", notes);
        Ok((content, is_found))
    }
}

/// The lines of `krylux info` about a rig file.
pub fn about(file: &RigFile) -> Content<'static> {
    let (projector, camera) = (file.kind.projector_info(), file.kind.camera_info());
    let scene = match &file.kind {
        RigKind::Virtual(rig) => Some(match &rig.scene {
            VirtualScene::File { path, size, samples, .. } => {
                format!("{}, {size} pixels, {samples} light paths each", path.display())
            }
            VirtualScene::Matrix { path, size } => format!("{}, {size} pixels", path.display()),
        }),
        _ => None,
    };
    let colour = |channels: usize| if channels == 1 { "gray" } else { "colours" };
    let kind = file.kind.word();
    let mut content = Content::default();
    content.line(format_args!("rig       {} ({kind})", file.path.display()));
    match &scene {
        Some(scene) => content.line(format_args!("  scene   {scene}")),
        None => content.line(format_args!("  devices {}, {}", projector.name, camera.name)),
    }
    content.line(format_args!(
        "  shows   {} pixels, {} bits, {}",
        projector.resolution,
        projector.bits,
        colour(projector.channels)
    ));
    let [shortest, longest] = camera.exposures;
    content.line(format_args!(
        "  sees    {} pixels, {} bits, {}, exposures from {shortest} to {longest} s",
        camera.resolution,
        camera.bits,
        colour(camera.channels)
    ));
    match &file.calibration {
        Some(folder) => content.line(format_args!("  known   calibration {}", folder.display())),
        None => {
            content.line("  known   nothing: it names no calibration, so its devices are taken as ideal");
        }
    }
    content.line(format_args!("  stages  {}", stages(&file.measurement)));
    content.fact("path", Name::from(&file.path));
    content.fact("hash", blake3::Hash::from_bytes(file.hash).to_string());
    content.fact("kind", kind);
    content.fact("scene", scene);
    content.fact("projector", projector);
    content.fact("camera", camera);
    content.fact("calibration", file.calibration.as_ref().map(Name::from));
    content.fact("measurement", &file.measurement);
    content
}

fn line_of((at, monitor): (usize, &MonitorInfo)) -> String {
    let [x, y] = monitor.place;
    let refresh = monitor.frame_time.map_or_else(String::new, |time| format!(", frame_time = {time:.5}"));
    let primary = if monitor.is_primary { ", the desktop's first" } else { "" };
    format!(
        "monitor   {at} \"{}\": {} pixels at ({x}, {y}){refresh}{primary}",
        monitor.name, monitor.resolution
    )
}
