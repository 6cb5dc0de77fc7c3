//! The rig of a bench verb, which may not be calibrated yet.

use std::path::{Path, PathBuf};

use anyhow::Result;

use super::super::console::Console;
use super::super::options::{SourceArgs, ViewArgs};
use super::super::rig_source::RigSource;
use super::super::source::is_rig;
use super::super::trace::{SizeArgs, TraceArgs};
use crate::error::Error;
use crate::measure::{Calibration, CaptureRequest, Effort, FrameSource};
use crate::rig::{CameraInfo, ProjectorInfo, RawFrame};

/// The arguments that select a rig.
#[derive(clap::Args)]
pub(super) struct RigArgs {
    /// A rig file (.toml), of real or virtual devices
    #[arg(value_name = "RIG")]
    pub(super) rig: PathBuf,
    /// The graphics adapter whose name contains this, where a virtual rig's scene is traced
    #[arg(long, value_name = "NAME")]
    adapter: Option<String>,
}

/// A rig and its calibration.
pub(super) struct Bench {
    pub(super) source: RigSource,
    /// The calibration, where there is a usable one.
    pub(super) known: Option<Calibration>,
}

impl RigArgs {
    /// Reads the file and its calibration. A calibration that cannot be used is noted and ignored.
    pub(super) fn read(&self, console: &Console) -> Result<Bench> {
        let source = self.source(console)?;
        let known = source.file.load_calibration().transpose();
        if let Err(why) = &known {
            console.note(format_args!("note: the calibration is ignored: {why}"));
        }
        Ok(Bench { source, known: known.ok().flatten() })
    }

    /// Reads the file alone.
    pub(super) fn source(&self, console: &Console) -> Result<RigSource> {
        require_rig(&self.rig, "RIG")?;
        let view = ViewArgs { camera: None, camera_file: None };
        let trace = TraceArgs::for_looking(SizeArgs::default(), self.adapter.clone());
        RigSource::uncalibrated(&SourceArgs { source: self.rig.clone(), view }, &trace, console)
    }
}

impl Bench {
    /// Opens the devices. When the user asks to stop, the next frame is [`Error::Interrupted`].
    pub(super) fn open(&mut self, console: &Console) -> crate::Result<Box<dyn FrameSource>> {
        let mut frames = self.source.opener(console)(None)?;
        frames.set_settle(self.settle());
        Ok(Box::new(Interruptible { frames, console: console.clone() }))
    }

    /// Seconds between the confirmation of a frame and its photo.
    pub(super) fn settle(&self) -> f64 {
        self.source.file.settle(self.known.as_ref())
    }

    /// The exposure that the user gives, or the longest one of the rig file.
    pub(super) fn exposure(&self, given: Option<f64>) -> Option<f64> {
        given.or(self.source.file.longest_exposure())
    }

    /// The rig file's name.
    pub(super) fn name(&self) -> String {
        self.source.name()
    }
}

/// Checks that the source of this argument is a rig.
///
/// # Errors
/// [`Error::Option`].
pub(super) fn require_rig(path: &Path, argument: &str) -> Result<()> {
    if is_rig(path) {
        return Ok(());
    }
    Err(Error::Option {
        option: argument.into(),
        fault: format!("{} is no rig", path.display()),
        help: "give a rig file (.toml): this verb needs devices".into(),
    }
    .into())
}

/// A frame source that stops when the user asks for it.
struct Interruptible {
    frames: Box<dyn FrameSource>,
    console: Console,
}

impl FrameSource for Interruptible {
    fn projector(&self) -> &ProjectorInfo {
        self.frames.projector()
    }

    fn camera(&self) -> &CameraInfo {
        self.frames.camera()
    }

    fn capture(&mut self, request: &CaptureRequest) -> crate::Result<RawFrame> {
        if self.console.check().is_break() {
            return Err(Error::Interrupted);
        }
        self.frames.capture(request)
    }

    fn set_settle(&mut self, seconds: f64) {
        self.frames.set_settle(seconds);
    }

    fn effort(&self) -> Effort {
        self.frames.effort()
    }
}
