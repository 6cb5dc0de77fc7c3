//! The validation of what a virtual rig's projector and beam splitter do to the light.

use super::check::{Check, Checked};
use crate::rig::{Pulse, Splitter, VirtualCamera, VirtualProjector};

impl Check {
    /// Checks the way of the light: projector, camera, and what is between them.
    pub(crate) fn between(
        &self,
        projector: &VirtualProjector,
        camera: &VirtualCamera,
        splitter: &Splitter,
    ) -> Checked {
        self.projector(projector)?;
        if projector.white_segment > 0.0 && projector.channels != 3 {
            return Err(self.fault(
                "projector.white_segment adds to what three colours have in common, but the projector has one channel",
                "give the projector channels = 3, or leave white_segment out",
            ));
        }
        self.camera(camera)?;
        self.crosstalk(projector, camera)?;
        self.splitter(splitter)
    }

    /// Checks the pulses of a projector with this many channels.
    pub(crate) fn pulse(&self, pulse: &Pulse, channels: usize) -> Checked {
        self.range("projector.pulse.period", pulse.period, 0.0, 60.0)?;
        self.range("projector.pulse.duty", pulse.duty, 1e-3, 1.0)?;
        if pulse.wheel && channels != 3 {
            return Err(self.fault(
                "projector.pulse.wheel shows three colours, but the projector has one channel",
                "give the projector channels = 3, or leave wheel out",
            ));
        }
        if pulse.period == 0.0 && (pulse.wheel || pulse.duty < 1.0) {
            return Err(self.fault(
                "projector.pulse has no period",
                "give period in seconds, e.g. pulse = { period = 0.0083, duty = 0.5 }",
            ));
        }
        Ok(())
    }

    fn splitter(&self, spec: &Splitter) -> Checked {
        let [right, down] = spec.ghost_shift;
        self.ranges(
            "splitter",
            &[
                ("ghost", spec.ghost, 0.0, 1.0),
                ("ghost_shift[0]", right, -1e5, 1e5),
                ("ghost_shift[1]", down, -1e5, 1e5),
                ("stray", spec.stray, 0.0, 10.0),
            ],
        )?;
        if spec.ghost > 0.0 && spec.ghost_shift == [0.0; 2] {
            return Err(self.fault(
                format!("splitter.ghost is {}, but splitter.ghost_shift is missing", spec.ghost),
                "give the displacement of the second image in projector pixels, e.g. ghost_shift = [5.0, 0.0]",
            ));
        }
        Ok(())
    }
}
