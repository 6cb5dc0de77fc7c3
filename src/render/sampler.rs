//! The choice of random numbers.

/// The kind of random numbers that decide the light paths. Either kind is a hash of pixel, sample, vertex and
/// seed. So any path can be traced on its own, and the two halves of a pixel's samples ([`super::Run::half`])
/// are independent of each other.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Sampler {
    /// Scrambled Sobol points (Burley 2020): the samples in each half of a pixel's samples are stratified, in
    /// pairs of numbers.
    #[default]
    Sobol,
    /// Independent numbers, the baseline for comparisons.
    Independent,
}

impl Sampler {
    /// The constant of `shaders/shared/parameters.wgsl`.
    pub(super) fn word(self) -> u32 {
        match self {
            Self::Sobol => 0,
            Self::Independent => 1,
        }
    }
}
