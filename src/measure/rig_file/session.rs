//! Settings of a session that follow from a rig file, from its calibration, or from neither.

use super::RigFile;
use crate::error::Result;
use crate::measure::Calibration;

/// Seconds between the confirmation of a frame and its photo where neither the rig file nor a calibration
/// gives them. Projectors that process their picture show it some frames late.
const CAREFUL_SETTLE: f64 = 0.1;

impl RigFile {
    /// Loads the calibration that the file names, and checks that it belongs to the file's devices. `None`
    /// when the file names none.
    pub fn load_calibration(&self) -> Option<Result<Calibration>> {
        let folder = self.calibration.as_ref()?;
        let (projector, camera) = (self.kind.projector_info(), self.kind.camera_info());
        Some(Calibration::load(folder).and_then(|known| known.check(&projector, &camera).map(|()| known)))
    }

    /// Seconds between the confirmation of a frame and its photo: those of the file, else the calibration's,
    /// else 0.1.
    pub fn settle(&self, known: Option<&Calibration>) -> f64 {
        let measured = known.map(|known| known.stability.settle);
        self.measurement.settle.or(measured).unwrap_or(CAREFUL_SETTLE)
    }

    /// The longest exposure that the file gives, in seconds. `None` when it leaves the choice to the program.
    pub fn longest_exposure(&self) -> Option<f64> {
        self.measurement.exposures.last().copied()
    }
}
