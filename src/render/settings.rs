//! What is traced, and what of it is refused.

use super::photons::Gather;
use super::sampler::Sampler;
use crate::error::{Error, Result};
use crate::image::Resolution;

/// The most surfaces that a path may meet: ray and surface counts share a word with the canary.
pub const MAX_BOUNCES: u32 = 64;

/// What to trace.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TraceSettings {
    /// Pixels of the camera, and of the projector where it has none of its own.
    pub resolution: Resolution,
    /// Pixels of a projector apart from the camera; `None`: as many as the camera's.
    pub projector: Option<Resolution>,
    /// Light paths per camera pixel, at least 1.
    pub samples: u32,
    /// Surfaces that a path meets at most: 1 is direct light only, [`MAX_BOUNCES`] the limit.
    pub max_bounces: u32,
    /// Selects the random numbers; equal seeds give equal bits.
    pub seed: u32,
    /// How they are spread.
    pub sampler: Sampler,
    /// Ends dim paths by chance. At six bounces that costs more variance than it saves time.
    pub russian_roulette: bool,
    /// How finely the specular chains of the far end are mapped, where the scene has any.
    pub gather: Gather,
}

impl TraceSettings {
    /// `samples` light paths of up to six surfaces from each of the camera's pixels.
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
}

/// Refuses settings that no device could trace, by the option that they come from.
pub(super) fn check(settings: &TraceSettings) -> Result<()> {
    let Resolution { width, height } = settings.resolution;
    if width == 0 || height == 0 || width > 16384 || height > 16384 {
        return Err(Error::Option {
            option: "--size".into(),
            fault: format!("{} pixels cannot be traced", settings.resolution),
            help: "give 1 to 16384 pixels a side, e.g. --size 128 or --size 128x96".into(),
        });
    }
    if settings.samples == 0 || settings.samples > 1 << 20 {
        return Err(Error::Option {
            option: "--spp".into(),
            fault: format!("{} samples per pixel cannot be traced", settings.samples),
            help: "give 1 to 1048576, e.g. --spp 64".into(),
        });
    }
    if !(settings.gather.radius.is_finite() && settings.gather.radius > 0.0) {
        return Err(Error::Option {
            option: "--gather-radius".into(),
            fault: format!("{} is no radius", settings.gather.radius),
            help: "give a positive number, e.g. --gather-radius 1".into(),
        });
    }
    if settings.gather.photons > 1 << 16 {
        return Err(Error::Option {
            option: "--gather-photons".into(),
            fault: format!("{} chains per pixel cannot be traced", settings.gather.photons),
            help: "give 0 to 65536, e.g. --gather-photons 16".into(),
        });
    }
    if settings.max_bounces == 0 || settings.max_bounces > MAX_BOUNCES {
        return Err(Error::Option {
            option: "--max-bounces".into(),
            fault: format!("{} surface hits per path cannot be traced", settings.max_bounces),
            help: format!("give 1 (direct light only) to {MAX_BOUNCES}, e.g. --max-bounces 6"),
        });
    }
    Ok(())
}
