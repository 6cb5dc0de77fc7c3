//! The check of a rig before a session, in under a minute: rig file, disk space, devices, light, frames, calibration, and automatic
//! behaviour of projectors and cameras (an iris, pulses, overscan).
//!
//! [`check`] runs one check after another and passes each [`Finding`] to a callback as soon as it is known. A finding has the state that
//! was found, the expected state, and the remedy. Its [`Grade`] follows from bounds, which are constants beside each check. `krylux rig
//! check` prints these findings.
//!
//! ```no_run
//! use std::ops::ControlFlow;
//!
//! use krylux::bench::rig_check::{self, RigToCheck};
//! use krylux::measure::{FrameSource, LiveFrames, RigFile, RigKind};
//! use krylux::rig::Helper;
//!
//! # fn main() -> krylux::Result<()> {
//! let file = RigFile::load("bench.toml".as_ref())?;
//! let RigKind::Hardware(rig) = file.kind.clone() else { return Ok(()) };
//! let mut open = || {
//!     let devices = rig.open(&Helper::find()?, None)?;
//!     Ok(Box::new(LiveFrames::new(devices, 0.1, 5)) as Box<dyn FrameSource>)
//! };
//! let rig = RigToCheck { file: &file, folder: "out".as_ref(), helper: &Helper::find, open: &mut open };
//! let findings = rig_check::check(rig, &mut |finding| {
//!     println!("{finding}");
//!     ControlFlow::Continue(())
//! })?;
//! println!("{}", findings.sentence());
//! # Ok(())
//! # }
//! ```

mod brightness;
mod devices;
mod photos;
mod picture;
mod probe;
mod timing;

use std::ops::ControlFlow;
use std::path::Path;

use crate::error::{Error, Result};
pub use crate::finding::{Finding, Findings, Grade};
use crate::measure::{Calibration, FrameSource, RigFile, sight};
use crate::rig::Helper;
use photos::{Seen, Setup};
use probe::Probe;

/// The rig to be checked, and the functions to open it.
pub struct RigToCheck<'a> {
    /// The rig file.
    pub file: &'a RigFile,
    /// The folder of the session's runs. It need not exist yet.
    pub folder: &'a Path,
    /// Finds the program that draws on the screen of an X11 projector. It is called only for a rig of real devices.
    pub helper: &'a dyn Fn() -> Result<Helper>,
    /// Opens projector and camera together. It is called after each device has been opened and closed separately.
    pub open: &'a mut dyn FnMut() -> Result<Box<dyn FrameSource>>,
}

/// Receives each finding. [`ControlFlow::Break`] ends the check with [`Error::Interrupted`].
pub type Report<'a> = dyn FnMut(&Finding) -> ControlFlow<()> + 'a;

/// Checks a rig. Each fault of the rig and each error of its devices becomes a finding.
///
/// # Errors
/// [`Error::Interrupted`] when `report` or the devices return it.
pub fn check(rig: RigToCheck<'_>, report: &mut Report<'_>) -> Result<Findings> {
    let mut recorder = Recorder::new(report);
    recorder.findings.complete = examine(rig, &mut recorder)?;
    Ok(recorder.findings)
}

/// Reports `error` as the only finding of a rig whose file could not be read. Returns [`Error::Interrupted`] when `report` breaks, or when
/// `error` is [`Error::Interrupted`].
pub fn unreadable(error: Error, report: &mut Report<'_>) -> Result<Findings> {
    let mut recorder = Recorder::new(report);
    recorder.failure("file", error)?;
    Ok(recorder.findings)
}

fn examine(rig: RigToCheck<'_>, recorder: &mut Recorder<'_, '_>) -> Result<bool> {
    let file = rig.file;
    recorder.add(devices::file(file))?;
    let [camera, projector] = [file.kind.camera_info().resolution, file.kind.projector_info().resolution];
    if let Some(finding) = sight::too_few(camera, projector) {
        recorder.add(finding)?;
    }
    recorder.add(devices::space(rig.folder, &file.kind.camera_info()))?;
    if !devices::devices(&file.kind, rig.helper, recorder)? {
        return Ok(false);
    }
    let known = devices::calibration(file, recorder)?;
    let mut frames = match (rig.open)() {
        Ok(frames) => frames,
        Err(error) => return recorder.failure("session", error),
    };
    let setup = Setup {
        settle: file.settle(known.as_ref()),
        exposure: file.longest_exposure(),
        known: known.as_ref(),
    };
    frames.set_settle(setup.settle);
    let examined = photos::photos(&setup, frames.as_mut(), recorder).and_then(|seen| match seen {
        Some(seen) => map(&setup, &seen, frames.as_mut(), recorder)
            .and_then(|()| imperfections(&setup, &seen, frames.as_mut(), recorder))
            .map(|()| true),
        None => Ok(false),
    });
    // The devices are released before any other finding is reported.
    drop(frames);
    examined.or_else(|error| recorder.failure("frames", error))
}

fn map(
    setup: &Setup<'_>,
    seen: &Seen,
    frames: &mut dyn FrameSource,
    recorder: &mut Recorder<'_, '_>,
) -> Result<()> {
    let because = match (seen.settled, seen.in_range) {
        (true, true) => return devices::pixel_map(setup.known, frames, seen.exposure, recorder),
        (false, _) => "the light of a frame has not settled in its photo",
        (true, false) => "white is saturated",
    };
    recorder.add(Finding::unmeasured("pixel map", because))
}

/// Findings about automatic behaviour of an open rig's devices and about obstacles to their light: an automatic iris, stray light,
/// limited-range video, pulses of a lamp or colour wheel, a rolling shutter, overscan, blur, ghosts, and a white segment. They are the last
/// findings of [`check`], and an audit reports them too. The list is empty when white cannot be seen. An error of the devices is a finding.
///
/// # Errors
/// [`Error::Interrupted`] when the devices return it.
pub fn faults(
    file: &RigFile,
    known: Option<&Calibration>,
    frames: &mut dyn FrameSource,
) -> Result<Vec<Finding>> {
    let mut go_on = |_: &Finding| ControlFlow::Continue(());
    let mut recorder = Recorder::new(&mut go_on);
    let setup = Setup { settle: file.settle(known), exposure: file.longest_exposure(), known };
    frames.set_settle(setup.settle);
    let seen = photos::photos(&setup, frames, &mut recorder);
    // The caller judges black and white from other photos, so the findings about them are dropped here.
    recorder.findings.all.clear();
    let examined = match seen {
        Ok(Some(seen)) => imperfections(&setup, &seen, frames, &mut recorder),
        other => other.map(drop),
    };
    if let Err(error) = examined {
        recorder.failure("frames", error)?;
    }
    Ok(recorder.findings.all)
}

/// Checks for common effects that the menus of the devices hide: an automatic iris, stray light, limited-range video, pulses of light, a
/// rolling shutter, overscan, blur, ghosts, and a white segment. The checks take 23 photos, and eight more with a colour projector. If a
/// pattern's light has not settled, the pattern is photographed twice.
fn imperfections(
    setup: &Setup<'_>,
    seen: &Seen,
    frames: &mut dyn FrameSource,
    recorder: &mut Recorder<'_, '_>,
) -> Result<()> {
    if !seen.in_range {
        for name in ["devices", "picture"] {
            recorder.add(Finding::unmeasured(name, "white is saturated"))?;
        }
        return Ok(());
    }
    let mut probe = Probe::new(frames, setup.known, &seen.photos, seen.exposure, seen.settled);
    brightness::brightness(&mut probe, setup.settle, recorder)?;
    timing::pulses(&mut probe, recorder)?;
    timing::shutter(&mut probe, setup.settle, recorder)?;
    picture::picture(&mut probe, recorder)?;
    brightness::colours(&mut probe, recorder)
}

struct Recorder<'a, 'b> {
    findings: Findings,
    report: &'a mut Report<'b>,
}

impl<'a, 'b> Recorder<'a, 'b> {
    fn new(report: &'a mut Report<'b>) -> Self {
        Self { findings: Findings { all: Vec::new(), complete: false }, report }
    }

    fn add(&mut self, finding: Finding) -> Result<()> {
        let flow = (self.report)(&finding);
        self.findings.all.push(finding);
        match flow {
            ControlFlow::Continue(()) => Ok(()),
            ControlFlow::Break(()) => Err(Error::Interrupted),
        }
    }

    /// Adds the error that prevents the remaining checks. Returns `false`, because the check is then incomplete.
    fn failure(&mut self, name: &'static str, error: Error) -> Result<bool> {
        if matches!(error, Error::Interrupted) {
            return Err(error);
        }
        self.add(Finding::error(name, &error))?;
        Ok(false)
    }
}

/// The findings of a check that nobody stops.
#[cfg(test)]
fn recorded(check: impl FnOnce(&mut Recorder<'_, '_>) -> Result<()>) -> Vec<Finding> {
    let mut go_on = |_: &Finding| ControlFlow::Continue(());
    let mut recorder = Recorder::new(&mut go_on);
    check(&mut recorder).expect("nobody stops it");
    recorder.findings.all
}
