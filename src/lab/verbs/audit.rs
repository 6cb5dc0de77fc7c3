//! Whether a source is the linear, symmetric operator that every method takes it for.

use crate::analysis::audit::{Audit, AuditOptions, Exact, audit};
use crate::error::Result;
use crate::lab::Lab;
use crate::lab::source::not_for_runs;
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

    /// Audits the source. An audit asks whether a photo taken twice is the same, so the laboratory must not keep photos in a journal.
    ///
    /// # Errors
    /// [`crate::Error::Data`] for the folder of a run; as [`audit()`] and [`Lab::operator`].
    pub fn audit(&mut self, options: &AuditOptions) -> Result<Audit> {
        self.check_for_audit()?;
        self.without_journal();
        self.audits = true;
        let measured = self.photos_with(
            |found: &Option<Audit>| found.as_ref().is_some_and(|found| !found.white.is_empty()),
            |lab| lab.with_measurement(|measurement| audit(measurement, options)),
        )?;
        if let Some(found) = measured {
            return Ok(found);
        }
        let resolution = self.resolution();
        self.photos(|lab| {
            let direct = lab.white_of(Part::Direct)?.swap_remove(0);
            let mut full = lab.reference_operators(Part::Full)?.swap_remove(0);
            audit(&mut Exact { full: &mut full, direct: Some(direct), resolution }, options)
        })
    }
}
