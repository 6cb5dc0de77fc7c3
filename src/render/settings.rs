//! The settings of a trace, and their limits.

use super::photons::Gather;
use super::sampler::Sampler;
use crate::error::{Error, Result};
use crate::image::Resolution;

/// The most surfaces that a path may meet. The numbers of rays and surfaces share a word with the mark that
/// proves a path finished.
pub const MAX_BOUNCES: u32 = 64;

/// The settings of a trace.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
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

    /// Checks the limits of the settings.
    ///
    /// # Errors
    /// [`Error::Option`] naming the option of the command line.
    pub fn check(&self) -> Result<()> {
        check_size("--size", self.resolution)?;
        if let Some(projector) = self.projector {
            check_size("--projector-size", projector)?;
        }
        let unusable = |option: &str, fault: String, help: String| {
            Err(Error::Option { option: option.into(), fault, help })
        };
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
        return Err(Error::Option {
            option: option.into(),
            fault: format!("{size} pixels cannot be traced"),
            help: format!("give 1 to 16384 pixels a side, e.g. {option} 128 or {option} 128x96"),
        });
    }
    Ok(())
}
