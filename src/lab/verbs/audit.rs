//! An audit of the assumption of every method: that a source is a linear, symmetric operator.

use crate::bench::audit::{Audit, AuditOptions, Exact, audit};
use crate::bench::rig_check::{self, Finding};
use crate::error::{Error, Result};
use crate::lab::Lab;
use crate::lab::source::{Source, not_for_runs};
use crate::transport::Part;

impl Lab {
    /// Refuses a source that cannot be audited: [`crate::Error::Data`] for the folder of a run.
    pub fn check_for_audit(&self) -> Result<()> {
        match self.folder_of_run() {
            Some(folder) => Err(not_for_runs(folder)),
            None => Ok(()),
        }
    }

    /// Findings about unrequested behaviour of a rig's devices, such as an automatic iris. The devices are opened for this check alone,
    /// before they are opened as an operator. Devices that a program handed over can be opened only once, so they are not examined.
    fn faults_of_devices(&mut self) -> Result<Vec<Finding>> {
        self.transport = None;
        let Source::Rig(rig) = &self.source else { return Ok(Vec::new()) };
        let known = rig.is_calibrated.then_some(&rig.calibration);
        let mut frames = match rig.opener()(None) {
            Ok(frames) => frames,
            Err(Error::Interrupted) => return Err(Error::Interrupted),
            // The audit opens the devices next, and reports the error then.
            Err(_) => return Ok(Vec::new()),
        };
        rig_check::faults(&rig.file, known, &mut *frames)
    }

    /// Audits the source, and adds the faults of a rig's devices to the checks. An audit compares two photos of the same pattern, so the
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
