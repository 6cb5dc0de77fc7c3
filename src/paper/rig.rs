//! The two rigs by which every figure is made.

/// The kind of rig that measures the light.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Rig {
    /// Shows any real-valued pattern and measures the light without error.
    Ideal,
    /// An 8-bit projector and a 14-bit camera with realistic errors, calibrated from captures.
    Virtual,
}

impl Rig {
    /// Its name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Ideal => "ideal",
            Self::Virtual => "virtual",
        }
    }
}
