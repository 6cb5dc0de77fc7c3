//! The uneven brightness of a rig's devices, measured with a matte sheet.

use std::path::PathBuf;

use crate::calibrate::flat_field_of_sheet;
use crate::error::{Error, Result};
use crate::lab::{Lab, RigSource};
use crate::measure::{Calibration, FlatField, FrameSource, LiveFrames, Measurement, RigKind};
use crate::rig::MatteSheet;

impl RigSource {
    /// Measures the uneven brightness of projector and camera from one photo of a matte sheet of one colour. The sheet must fill the view
    /// and stand square to the camera. Virtual devices get such a sheet in place of their scene.
    ///
    /// # Errors
    /// [`Error::Rig`] if the calibration does not contain the factor between the devices, or if the photo does not show an even sheet;
    /// the errors of taking the photo.
    pub fn flat_field(&self) -> Result<FlatField> {
        let Some(known) = self.calibration.flat_field.clone() else {
            return Err(Error::rig(
                "calibration",
                "it does not tell the brightness of the projector from that of the camera",
            )
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
}

impl RigSource {
    /// Measures the uneven brightness as [`RigSource::flat_field`], and adds it to the folder of the calibration that the rig file names.
    /// Runs that began earlier cannot be continued.
    ///
    /// # Errors
    /// As [`RigSource::flat_field`]; [`Error::Option`] if the rig file names no calibration; [`Error::Write`].
    pub fn add_flat_field(&self) -> Result<(FlatField, PathBuf)> {
        let Some(folder) = self.file.calibration.clone() else {
            return Err(Error::option(
                "SOURCE",
                format!("{} names no calibration, which this is added to", self.file.path.display()),
            )
            .help("calibrate the rig first: krylux rig calibrate RIG --use"));
        };
        let flat = self.flat_field()?;
        Calibration { flat_field: Some(flat.clone()), ..self.calibration.clone() }.save(&folder)?;
        Ok((flat, folder))
    }
}

impl Lab {
    /// Measures the uneven brightness of the rig's devices with a matte sheet, as [`RigSource::flat_field`], and uses it for photos from
    /// now on. Nothing is written. Call it after [`Lab::calibrate`] and before the first photo of a run.
    ///
    /// # Errors
    /// As [`RigSource::flat_field`]; [`Error::Option`] if the source is not a rig.
    pub fn measure_flat_field(&mut self) -> Result<FlatField> {
        let rig = self.rig().ok_or_else(|| self.is_no_rig())?;
        let flat = rig.flat_field()?;
        let calibration = Calibration { flat_field: Some(flat.clone()), ..rig.calibration.clone() };
        self.set_calibration(calibration)?;
        Ok(flat)
    }
}
