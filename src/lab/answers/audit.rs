//! Whether a source is a linear, symmetric operator.

use super::Answer;
use crate::analysis::audit::Audit;
use crate::error::Result;
use crate::lab::{Lab, RunFolder};
use crate::report::audit::AuditRun;

impl Answer for Audit {
    fn verb(&self) -> &'static str {
        "audit"
    }

    fn photos(&self) -> usize {
        self.photos
    }

    fn sentence(&self, _: &Lab) -> String {
        Self::sentence(self)
    }

    /// An audit that failed by saturation has no white photo whose noise could be known.
    fn has_white(&self) -> bool {
        !self.white.is_empty()
    }

    fn write(&self, lab: &mut Lab, run: &mut RunFolder, seconds: f64) -> Result<Vec<String>> {
        let page = AuditRun { title: format!("{} · audit", lab.name()), found: self, unit: lab.unit() };
        page.write(&run.path, &run.manifest, seconds)
    }
}
