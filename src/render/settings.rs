//! The settings of a trace and their limits, the pixels at which its paths start, and its cost.

use std::ops::Range;
use std::time::Duration;

use super::photons::Gather;
use crate::error::{Error, Result};
use crate::image::Resolution;

/// The maximum number of surfaces that a path hits. The counts of rays and surfaces share a word with the mark of finished paths.
pub const MAX_BOUNCES: u32 = 64;

/// The settings of a trace.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct TraceSettings {
    /// The pixels of the camera. Without `projector`, the projector has the same pixels.
    pub resolution: Resolution,
    /// The pixels of the projector; `None` for the resolution of the camera.
    pub projector: Option<Resolution>,
    /// Light paths per camera pixel, at least 1.
    pub samples: u32,
    /// The maximum number of surfaces that a path hits: from 1 (direct light only) to [`MAX_BOUNCES`].
    pub max_bounces: u32,
    /// Selects the random numbers. Equal seeds give equal bits.
    pub seed: u32,
    /// The kind of random numbers.
    pub sampler: Sampler,
    /// Whether dim paths end at random (Russian roulette). At six bounces, this increases the variance more than it reduces the time.
    pub russian_roulette: bool,
    /// The sampling of specular chains, in scenes that have any.
    pub gather: Gather,
}

impl TraceSettings {
    /// `samples` light paths of up to six surfaces from each camera pixel, with seed 0.
    pub fn new(resolution: Resolution, samples: u32) -> Self {
        Self {
            resolution,
            projector: None,
            samples,
            max_bounces: 6,
            seed: 0,
            sampler: Sampler::Sobol,
            russian_roulette: false,
            gather: Gather::default(),
        }
    }

    /// Checks the limits of the settings. Fails with [`Error::Option`], which names the option of the command line.
    pub fn check(&self) -> Result<()> {
        check_size("--size", self.resolution)?;
        if let Some(projector) = self.projector {
            check_size("--projector-size", projector)?;
        }
        let unusable =
            |option: &str, fault: String, help: String| Err(Error::option(option, fault).help(help));
        let Gather { radius, photons } = self.gather;
        if self.samples == 0 || self.samples > 1 << 20 {
            let fault = format!("{} samples per pixel cannot be traced", self.samples);
            return unusable("--spp", fault, "give 1 to 1048576, e.g. --spp 64".into());
        }
        if !(radius.is_finite() && radius > 0.0) {
            let help = "give a positive number, e.g. --gather-radius 1".into();
            return unusable("--gather-radius", format!("{radius} is no radius"), help);
        }
        if photons > 1 << 16 {
            let fault = format!("{photons} chains per pixel cannot be traced");
            return unusable("--gather-photons", fault, "give 0 to 65536, e.g. --gather-photons 16".into());
        }
        if self.max_bounces == 0 || self.max_bounces > MAX_BOUNCES {
            let fault = format!("{} surface hits per path cannot be traced", self.max_bounces);
            let help = format!("give 1 (direct light only) to {MAX_BOUNCES}, e.g. --max-bounces 6");
            return unusable("--max-bounces", fault, help);
        }
        Ok(())
    }
}

fn check_size(option: &str, size: Resolution) -> Result<()> {
    let Resolution { width, height } = size;
    if width == 0 || height == 0 || width > 16384 || height > 16384 {
        return Err(Error::option(option, format!("{size} pixels cannot be traced"))
            .help(format!("give 1 to 16384 pixels a side, e.g. {option} 128 or {option} 128x96")));
    }
    Ok(())
}

/// The kind of random numbers that decide the light paths. Either kind is a hash of pixel, sample, vertex and seed. Any path can therefore
/// be traced alone, and the two halves of a pixel's samples ([`crate::render::Run::half`]) are independent of each other.
///
/// Sobol points are those of Burley 2020: the samples in each half of a pixel's samples are stratified, in pairs of numbers. Independent
/// numbers are the baseline for comparisons.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize, clap::ValueEnum,
)]
#[serde(rename_all = "lowercase")]
pub enum Sampler {
    /// Scrambled Sobol points: less noise for the same number of paths
    #[default]
    Sobol,
    /// Each number independent of all others
    Independent,
}

impl Sampler {
    pub(super) fn word(self) -> u32 {
        match self {
            Self::Sobol => 0,
            Self::Independent => 1,
        }
    }
}

/// The pixels at which light paths start: a range of consecutive pixels for the camera, and one for the projector. In a coaxial rig, the
/// range of the projector is empty.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct StartPixels {
    /// Pixels of the camera.
    pub camera: Range<usize>,
    /// Pixels of a projector that stands apart.
    pub projector: Range<usize>,
}

impl StartPixels {
    /// Whether both ranges are empty.
    pub fn is_empty(&self) -> bool {
        self.camera.is_empty() && self.projector.is_empty()
    }

    /// Divides the range of each endpoint into `parts` ranges, whose lengths differ by at most one pixel. The parts are in the order of the
    /// pixels and cover each pixel once. Some parts are empty if there are fewer pixels than parts.
    pub fn split(&self, parts: usize) -> Vec<Self> {
        let [camera, projector] = [&self.camera, &self.projector].map(|pixels| cut(pixels, parts));
        camera.into_iter().zip(projector).map(|(camera, projector)| Self { camera, projector }).collect()
    }
}

fn cut(pixels: &Range<usize>, parts: usize) -> Vec<Range<usize>> {
    let at = |part: usize| pixels.start + (pixels.len() as u128 * part as u128 / parts as u128) as usize;
    (0..parts).map(|part| at(part)..at(part + 1)).collect()
}

/// The cost of a trace.
#[derive(Clone, Copy, Debug, Default, serde::Serialize, serde::Deserialize)]
pub struct TraceSummary {
    /// Light paths traced.
    pub paths: u64,
    /// Rays traced for these paths: to the next surface, and to the other endpoint.
    pub rays: u64,
    /// Number of dispatches.
    pub dispatches: u32,
    /// Wall time of the longest dispatch, including its read-back. If a dispatch waited for an earlier one, its time starts when the
    /// earlier one was done. The measured end may be late, if the host is reading the records of another dispatch.
    pub longest: Duration,
    /// The sum of these wall times over all dispatches.
    pub tracing: Duration,
}

impl TraceSummary {
    /// Adds the paths, rays and dispatches of a trace that ran at the same time in another process or on another device. For each duration,
    /// the longer one is kept.
    pub(crate) fn add_parallel(&mut self, other: &Self) {
        self.paths += other.paths;
        self.rays += other.rays;
        self.dispatches += other.dispatches;
        self.longest = self.longest.max(other.longest);
        self.tracing = self.tracing.max(other.tracing);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_cover_each_pixel_once_and_in_order() {
        let all = StartPixels { camera: 3..20, projector: 0..2 };
        for parts in 1..8 {
            let found = all.split(parts);
            assert_eq!(found.len(), parts);
            let chained: Vec<usize> = found.iter().flat_map(|part| part.camera.clone()).collect();
            assert_eq!(chained, (3..20).collect::<Vec<_>>());
            let chained: Vec<usize> = found.iter().flat_map(|part| part.projector.clone()).collect();
            assert_eq!(chained, [0, 1]);
            let lengths = found.iter().map(|part| part.camera.len());
            assert!(lengths.clone().max() <= lengths.min().map(|least| least + 1));
        }
    }
}
