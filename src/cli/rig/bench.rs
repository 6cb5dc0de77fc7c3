//! An open rig at the bench, of which little may be known yet.

use std::path::{Path, PathBuf};

use super::super::console::Console;
use super::super::opening::Opening;
use super::super::options::{SourceArgs, ViewArgs};
use super::super::trace::TraceArgs;
use crate::error::{Error, Result};
use crate::lab::{RigSource, SourceKind};
use crate::measure::{Calibration, CaptureRequest, Effort, FrameSource};
use crate::rig::{CameraInfo, ProjectorInfo, RawFrame};

/// Which rig.
#[derive(clap::Args)]
pub(super) struct RigArgs {
    /// A rig file (.toml), of real or virtual devices
    #[arg(value_name = "RIG")]
    pub(super) rig: PathBuf,
    /// The graphics adapter whose name contains this, where a virtual rig's scene is traced
    #[arg(long, value_name = "NAME")]
    adapter: Option<String>,
}

/// A rig, and what is known of it.
pub(super) struct Bench {
    pub(super) source: RigSource,
    /// What calibration found, where there is one that can be used.
    pub(super) known: Option<Calibration>,
}

impl RigArgs {
    /// Reads the rig file and the calibration that it refers to. If the calibration cannot be used, a note says why, and the rig is read without it.
    pub(super) fn read(&self, console: &Console) -> Result<Bench> {
        let source = self.source(console)?;
        let known = source.file.load_calibration().transpose();
        if let Err(why) = &known {
            console.note(format_args!("note: the calibration is left aside: {why}"));
        }
        Ok(Bench { source, known: known.ok().flatten() })
    }

    /// Reads the file alone.
    pub(super) fn source(&self, console: &Console) -> Result<RigSource> {
        require_rig(&self.rig, "RIG")?;
        let trace = TraceArgs::for_looking(None, self.adapter.clone());
        let source = SourceArgs { source: self.rig.clone(), view: ViewArgs::default() };
        Opening::new(&source, &trace).builder(console).open_uncalibrated_rig()
    }
}

impl Bench {
    /// Opens the devices. Frames come until the user asks to stop: then as [`Error::Interrupted`].
    pub(super) fn open(&mut self, console: &Console) -> Result<Box<dyn FrameSource>> {
        let mut shots = self.source.opener()(None)?;
        shots.set_settle(self.settle());
        Ok(Box::new(Interruptible { shots, console: console.clone() }))
    }

    /// Seconds between a frame's confirmation and its photo.
    pub(super) fn settle(&self) -> f64 {
        self.source.file.settle(self.known.as_ref())
    }

    /// The exposure that is given, or the longest that the rig file gives.
    pub(super) fn exposure(&self, given: Option<f64>) -> Option<f64> {
        given.or(self.source.file.longest_exposure())
    }

    /// The rig file's name.
    pub(super) fn name(&self) -> String {
        self.source.name()
    }
}

/// That a source, given as this argument, is a rig.
///
/// # Errors
/// [`Error::Option`].
pub(super) fn require_rig(path: &Path, argument: &str) -> Result<()> {
    if SourceKind::of(path) == SourceKind::Rig {
        return Ok(());
    }
    Err(Error::option(argument, format!("{} is no rig", path.display()))
        .help("give a rig file (.toml): this verb asks devices"))
}

/// Frames until the user asks to stop.
struct Interruptible {
    shots: Box<dyn FrameSource>,
    console: Console,
}

impl FrameSource for Interruptible {
    fn projector(&self) -> &ProjectorInfo {
        self.shots.projector()
    }

    fn camera(&self) -> &CameraInfo {
        self.shots.camera()
    }

    fn capture(&mut self, shot: &CaptureRequest) -> Result<RawFrame> {
        if self.console.check().is_break() {
            return Err(Error::Interrupted);
        }
        self.shots.capture(shot)
    }

    fn set_settle(&mut self, seconds: f64) {
        self.shots.set_settle(seconds);
    }

    fn effort(&self) -> Effort {
        self.shots.effort()
    }
}
