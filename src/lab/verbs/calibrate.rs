//! Calibration of a rig's devices.

use std::path::{Path, PathBuf};

use crate::calibrate::{CalibrateOptions, CalibrationReport, calibrate};
use crate::error::{Error, Result};
use crate::io::manifest::Status;
use crate::lab::layout::RECORD;
use crate::lab::{Lab, Log, RigSource, RunFolder, RunOptions, journal};
use crate::measure::{Calibration, Effort, FrameSource, JournaledFrames, RunManifest};
use crate::observer::{Estimate, Step};
use crate::report::calibration;

/// A calibration with its report.
#[derive(Clone, Debug)]
pub struct Calibrated {
    /// The calibration of the devices.
    pub calibration: Calibration,
    /// The accuracy of the calibration.
    pub report: CalibrationReport,
    /// The photos and the time of the calibration.
    pub effort: Effort,
    /// The folder in which it is saved.
    pub folder: PathBuf,
}

impl RigSource {
    /// The folder of the calibration that the rig file names, or else `NAME-calibration` beside the rig file.
    pub fn calibration_folder(&self) -> PathBuf {
        let beside = || self.file.path.with_file_name(format!("{}-calibration", self.name()));
        self.file.calibration.clone().unwrap_or_else(beside)
    }

    /// The folder of a calibration for which no folder is named. It is the first unused one of [`Self::calibration_folder`] and the same
    /// name with `-2`, `-3`, …, so that an earlier calibration stays unchanged. An unfinished last one is returned instead, to be resumed
    /// or replaced. So is the folder that the rig file names, if `again` is true and the last one is complete.
    pub fn next_calibration_folder(&self, again: bool) -> PathBuf {
        let named = self.calibration_folder();
        let name = named.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let first = match name.rsplit_once('-') {
            Some((stem, number)) if number.parse::<u32>().is_ok() && named.with_file_name(stem).exists() => {
                stem
            }
            _ => &name,
        };
        let numbered = |number: usize| match number {
            1 => named.with_file_name(first),
            _ => named.with_file_name(format!("{first}-{number}")),
        };
        let taken = (1..).take_while(|&number| numbered(number).exists()).count();
        let record = RunManifest::read(&numbered(taken.max(1)).join(RECORD));
        match record.is_ok_and(|record| record.status != Status::Done) {
            true => numbered(taken),
            false if again => named,
            false => numbered(taken + 1),
        }
    }

    /// Calibrates the devices from captures alone, and writes the calibration and a report into a folder, with a journal of all photos.
    ///
    /// # Errors
    /// As [`calibrate`]; [`crate::Error::Write`]; [`crate::Error::Option`] for a folder that holds a run.
    pub fn calibrate(&self, options: &CalibrateOptions, run: &RunOptions) -> Result<Calibrated> {
        let mut run = RunFolder::create(run, "calibration", None, self.observer())?;
        self.describe(&mut run.manifest);
        let outcome = self.calibrated(options, &mut run);
        let closed = match &outcome {
            Ok(_) => run.close(Ok("calibrated")),
            Err(error) => run.close(Err(error)),
        };
        let calibrated = outcome?;
        closed.map(|()| calibrated)
    }

    fn calibrated(&self, options: &CalibrateOptions, run: &mut RunFolder) -> Result<Calibrated> {
        let observer = self.observer();
        let journal = journal::open(&run.path, &self.identity()?, run.resumes, observer)?;
        let warn = journal::warning(&journal, observer);
        let mut frames = JournaledFrames::new(journal, self.opener())?.reporting(warn);
        let (found, report) = self.calibrate_by(&mut frames, options)?;
        let effort = frames.effort();
        run.manifest.photos = effort.frames();
        let (title, lines) = (format!("{} · calibration", self.name()), report.lines());
        let seconds = run.seconds();
        run.answer(|run| {
            found.save(&run.answer)?;
            calibration::write(&run.answer, &found, &report)?;
            let page = (&found, &report);
            calibration::write_page(&run.answer, (title, &lines), page, &run.manifest, seconds)?;
            let written = std::fs::read_dir(&run.answer).map_err(Error::reading(&run.answer))?;
            Ok(written.flatten().map(|file| file.file_name().to_string_lossy().into_owned()).collect())
        })?;
        Ok(Calibrated { calibration: found, report, effort, folder: run.path.clone() })
    }

    fn calibrate_by(
        &self,
        frames: &mut dyn FrameSource,
        options: &CalibrateOptions,
    ) -> Result<(Calibration, CalibrationReport)> {
        let observer = self.observer();
        let coaxial = options.coaxial && self.is_symmetric();
        calibrate(frames, &CalibrateOptions { coaxial, ..options.clone() }, &mut |step| {
            observer.detail(format_args!("measuring {step}"));
            let step = Step { stage: "calibration", done: 1, total: 1, estimate: Estimate::None };
            observer.0.step(&step)
        })
    }

    /// Writes this folder's name into the rig file as its calibration, so that every verb uses it. Fails as
    /// [`RigFile::name_calibration`](crate::measure::RigFile::name_calibration).
    pub fn name_calibration(&self, folder: &Path) -> Result<()> {
        self.file.name_calibration(folder).map(drop)
    }

    /// Whether the rig file names this folder as its calibration.
    pub fn names_calibration(&self, folder: &Path) -> bool {
        self.file.calibration.as_deref() == Some(folder)
    }
}

impl Lab {
    /// Calibrates the rig's devices from captures alone, and uses that calibration for photos from now on. Nothing is written; see
    /// [`RigSource::calibrate`]. Call it before the first photo of a run.
    ///
    /// # Errors
    /// As [`calibrate`]; [`crate::Error::Option`] if the source is not a rig.
    pub fn calibrate(&mut self, options: &CalibrateOptions) -> Result<CalibrationReport> {
        let rig = self.rig().ok_or_else(|| self.is_no_rig())?;
        let (calibration, report) = rig.calibrate_by(rig.opener()(None)?.as_mut(), options)?;
        self.set_calibration(calibration)?;
        Ok(report)
    }
}
