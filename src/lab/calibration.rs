//! The calibration of a rig's devices, and their uneven brightness, measured with a matte sheet.

use std::path::{Path, PathBuf};

use super::layout::RECORD;
use super::{Lab, Log, RigSource, RunFolder, RunOptions, layout};
use crate::calibrate::{CalibrateOptions, CalibrationReport, calibrate, flat_field_of_sheet};
use crate::error::{Error, Result};
use crate::io::manifest::Status;
use crate::measure::{
    Calibration, Effort, FlatField, FrameSource, JournaledFrames, LiveFrames, Measurement, RigKind,
    RunManifest,
};
use crate::observer::{Estimate, Step};
use crate::rig::MatteSheet;

impl RigSource {
    /// The folder of the calibration that the rig file names, or else `NAME-calibration` beside the rig file.
    pub fn calibration_folder(&self) -> PathBuf {
        let beside = || self.file.path.with_file_name(format!("{}-calibration", self.name()));
        self.file.calibration.clone().unwrap_or_else(beside)
    }

    /// The default folder of a new calibration. The candidates are [`Self::calibration_folder`] and the same name with `-2`, `-3`, … If
    /// the calibration in the last used candidate is unfinished, this candidate is returned, so that the calibration can be resumed or
    /// replaced. Otherwise [`Self::calibration_folder`] is returned if `again` is true, and the first unused candidate if not, so that an
    /// earlier calibration stays unchanged.
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

    /// Calibrates the devices from captures alone, in a separate run with a journal of all photos. `write` writes the files of the
    /// calibration. Returns the report, the number of photos and the time taken, and the run's folder. Fails as [`calibrate`], as `write`,
    /// and for a folder that holds a run.
    pub(crate) fn calibrate_in(
        &self,
        run: &RunOptions,
        options: &CalibrateOptions,
        write: impl FnOnce(&RunFolder, &Calibration, &CalibrationReport) -> Result<()>,
    ) -> Result<(CalibrationReport, Effort, PathBuf)> {
        let mut run = RunFolder::create(run, "calibration", None, self.observer())?;
        self.describe(&mut run.manifest);
        let outcome = self.calibrated(options, &mut run, write);
        let closed = run.close(outcome.as_ref().map(|_| "calibrated"));
        let (report, effort) = outcome?;
        closed.map(|()| (report, effort, run.path.clone()))
    }

    fn calibrated(
        &self,
        options: &CalibrateOptions,
        run: &mut RunFolder,
        write: impl FnOnce(&RunFolder, &Calibration, &CalibrationReport) -> Result<()>,
    ) -> Result<(CalibrationReport, Effort)> {
        let journal = layout::open_journal(&run.path, &self.identity()?, run.resumes, self.observer())?;
        let warn = layout::warn_of_damage(&journal, self.observer());
        let mut frames = JournaledFrames::new(journal, self.opener())?.reporting(warn);
        let (found, report) = self.calibrate_by(&mut frames, options)?;
        let effort = frames.effort();
        run.manifest.photos = effort.frames();
        run.answer(|run| {
            found.save(&run.answer)?;
            write(run, &found, &report)?;
            let written = std::fs::read_dir(&run.answer).map_err(Error::reading(&run.answer))?;
            Ok(written.flatten().map(|file| file.file_name().to_string_lossy().into_owned()).collect())
        })?;
        Ok((report, effort))
    }

    fn calibrate_by(
        &self,
        frames: &mut dyn FrameSource,
        options: &CalibrateOptions,
    ) -> Result<(Calibration, CalibrationReport)> {
        let coaxial = options.coaxial && self.is_symmetric();
        calibrate(frames, &CalibrateOptions { coaxial, ..options.clone() }, &mut |step| {
            self.observer().detail(format_args!("measuring {step}"));
            let step = Step { stage: "calibration", done: 1, total: 1, estimate: Estimate::None };
            self.observer().0.step(&step)
        })
    }

    /// Enters the folder into the rig file as its calibration, so that every verb uses this calibration. Fails as
    /// [`RigFile::name_calibration`](crate::measure::RigFile::name_calibration).
    pub fn name_calibration(&self, folder: &Path) -> Result<()> {
        self.file.name_calibration(folder).map(drop)
    }

    /// Measures the uneven brightness of projector and camera from one photo of a matte sheet of one colour. The sheet must fill the
    /// camera's view and be perpendicular to its axis. Virtual devices get such a sheet in place of their scene.
    ///
    /// # Errors
    /// [`Error::Rig`] if the calibration does not contain the factor between the devices, or if the photo does not show an even sheet;
    /// the errors of taking the photo.
    pub fn flat_field(&self) -> Result<FlatField> {
        let Some(known) = self.calibration.flat_field.clone() else {
            let fault = "it does not tell the brightness of the projector from that of the camera";
            return Err(Error::rig("calibration", fault)
                .help("calibrate the rig in front of a scene first: krylux rig calibrate"));
        };
        let calibration = Calibration { flat_field: None, ..self.calibration.clone() };
        let frames: Box<dyn FrameSource> = match self.kind() {
            RigKind::Virtual(rig) => {
                let light = Box::new(MatteSheet { resolution: self.resolution(), channels: self.channels() });
                let tries = self.file.measurement.tries;
                Box::new(LiveFrames::new(rig.open(light, None)?, self.settle(), tries))
            }
            RigKind::Hardware(_) | RigKind::Program(_) => self.opener()(None)?,
        };
        let mut measurement = Measurement::new(frames, calibration, self.file.measurement.clone())?;
        flat_field_of_sheet(&mut measurement, &known)
    }

    /// Measures the uneven brightness as [`RigSource::flat_field`], and adds it to the folder of the calibration that the rig file names.
    /// Runs that began before this change cannot be continued.
    ///
    /// # Errors
    /// The errors of [`RigSource::flat_field`]; [`Error::Option`] if the rig file names no calibration; [`Error::Write`].
    pub fn add_flat_field(&self) -> Result<(FlatField, PathBuf)> {
        let Some(folder) = self.file.calibration.clone() else {
            let fault = format!("{} names no calibration, which this is added to", self.file.path.display());
            return Err(Error::option("SOURCE", fault)
                .help("calibrate the rig first: krylux rig calibrate RIG --use"));
        };
        let flat = self.flat_field()?;
        Calibration { flat_field: Some(flat.clone()), ..self.calibration.clone() }.save(&folder)?;
        Ok((flat, folder))
    }
}

impl Lab {
    /// Calibrates the rig's devices from captures alone, and uses the new calibration for photos from now on. Nothing is written. Call it
    /// before the first photo of a run.
    ///
    /// # Errors
    /// The errors of [`calibrate`]; [`crate::Error::Option`] if the source is not a rig.
    pub fn calibrate(&mut self, options: &CalibrateOptions) -> Result<CalibrationReport> {
        let rig = self.rig().ok_or_else(|| self.is_no_rig())?;
        let (calibration, report) = rig.calibrate_by(rig.opener()(None)?.as_mut(), options)?;
        self.set_calibration(calibration)?;
        Ok(report)
    }

    /// Measures the uneven brightness of the rig's devices with a matte sheet, as [`RigSource::flat_field`]. Photos are corrected by this
    /// brightness from now on. Nothing is written. Call it after [`Lab::calibrate`] and before the first photo of a run.
    ///
    /// # Errors
    /// The errors of [`RigSource::flat_field`]; [`Error::Option`] if the source is not a rig.
    pub fn measure_flat_field(&mut self) -> Result<FlatField> {
        let rig = self.rig().ok_or_else(|| self.is_no_rig())?;
        let flat = rig.flat_field()?;
        let calibration = Calibration { flat_field: Some(flat.clone()), ..rig.calibration.clone() };
        self.set_calibration(calibration)?;
        Ok(flat)
    }
}
