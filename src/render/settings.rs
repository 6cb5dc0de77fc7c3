//! The settings of a trace, and their limits.

use super::photons::Gather;
use super::sampler::Sampler;
use crate::error::{Error, Result};
use crate::image::Resolution;

/// The most surfaces that a path may meet. The numbers of rays and surfaces share a word with the mark that
/// proves a path finished.
pub const MAX_BOUNCES: u32 = 64;

/// The settings of a trace.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TraceSettings {
    /// Pixels of the camera, and of a projector whose resolution is not given.
    pub resolution: Resolution,
    /// Pixels of the projector; `None` for those of the camera.
    pub projector: Option<Resolution>,
    /// Light paths per camera pixel, at least 1.
    pub samples: u32,
    /// The most surfaces that a path meets: from 1 (direct light only) to [`MAX_BOUNCES`].
    pub max_bounces: u32,
    /// Selects the random numbers. Equal seeds give equal bits.
    pub seed: u32,
    /// The kind of random numbers.
    pub sampler: Sampler,
    /// Ends dim paths at random (Russian roulette). At six bounces this costs more variance than it saves
    /// time.
    pub russian_roulette: bool,
    /// Sampling of the specular chains, in scenes that have any.
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
}

/// Checks the limits of the settings. The error names the option of the command line.
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
