//! How the numbers that decide the light paths are spread.

/// Where random numbers come from. Either way they are a hash of pixel, sample, vertex and seed: any path can be traced on
/// its own, and the two halves of a pixel's samples ([`super::Run::half`]) are independent of each other.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Sampler {
    /// Scrambled Sobol points: each half of a pixel's samples is stratified, in pairs of numbers.
    #[default]
    Sobol,
    /// Every number independent of all others: what the other is measured against.
    Independent,
}

impl Sampler {
    /// As `shaders/shared/parameters.wgsl` has it.
    pub(super) fn word(self) -> u32 {
        match self {
            Self::Sobol => 0,
            Self::Independent => 1,
        }
    }
}
