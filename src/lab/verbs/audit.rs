//! Whether a source is the linear, symmetric operator that every method takes it for.

use crate::bench::audit::{Audit, AuditOptions, Exact, audit};
use crate::bench::rig_check::{self, Finding};
use crate::error::{Error, Result};
use crate::lab::Lab;
use crate::lab::source::{Source, not_for_runs};
use crate::transport::Part;

impl Lab {
    /// Refuses a source that cannot be audited.
    ///
    /// # Errors
    /// [`crate::Error::Data`] for the folder of a run.
    pub fn check_for_audit(&self) -> Result<()> {
        match self.folder_of_run() {
            Some(folder) => Err(not_for_runs(folder)),
            None => Ok(()),
        }
    }

    /// What the devices of a rig do without being asked. They are opened for this alone, before they are opened as an operator; devices that a
    /// program handed over once cannot be, and are not examined.
    fn faults_of_devices(&mut self) -> Result<Vec<Finding>> {
        self.transport = None;
        let Source::Rig(rig) = &self.source else { return Ok(Vec::new()) };
        let known = rig.is_calibrated.then_some(&rig.calibration);
        let mut frames = match rig.opener()(None) {
            Ok(frames) => frames,
            Err(Error::Interrupted) => return Err(Error::Interrupted),
            // The audit opens the devices next, and reports why they cannot be.
            Err(_) => return Ok(Vec::new()),
        };
        rig_check::faults(&rig.file, known, &mut *frames)
    }

    /// Audits the source, and names the faults of a rig's devices beside the checks. An audit asks whether a photo taken twice is the same, so the
    /// laboratory must not keep photos in a journal.
    ///
    /// # Errors
    /// [`crate::Error::Data`] for the folder of a run; as [`audit()`] and [`Lab::operator`].
    pub fn audit(&mut self, options: &AuditOptions) -> Result<Audit> {
        self.check_for_audit()?;
        self.without_journal();
        self.unexamined();
        let devices = self.faults_of_devices()?;
        let measured = self.photos_with(
            |found: &Option<Audit>| found.as_ref().is_some_and(|found| !found.white.is_empty()),
            |lab| lab.with_measurement(|measurement| audit(measurement, options)),
        )?;
        if let Some(found) = measured {
            return Ok(Audit { devices, ..found });
        }
        let resolution = self.resolution();
        self.photos(|lab| {
            let direct = lab.white_of(Part::Direct)?.swap_remove(0);
            let mut full = lab.reference_operators(Part::Full)?.swap_remove(0);
            audit(&mut Exact { full: &mut full, direct: Some(direct), resolution }, options)
        })
    }
}
