//! The options of the tracer: how a scene's light is followed. What is not given is 64 paths of six surfaces from each of
//! 128x128 pixels, or what the file of a virtual rig says.

use std::str::FromStr;

use clap::{Args, ValueEnum};

use super::operator::CacheArgs;
use super::options::number;
use crate::image::Resolution;
use crate::lab::TraceOverrides;
use crate::render::Sampler;

/// Pixels of camera and projector.
#[derive(Args, Clone, Copy, Default)]
pub(super) struct SizeArgs {
    /// Pixels of the camera, and of the projector where that has no --projector-size: 128, or 128x96 [default: 128]
    #[arg(long, value_name = "N|WxH")]
    size: Option<Size>,
}

impl SizeArgs {
    /// What is given.
    pub(super) fn given(&self) -> Option<Resolution> {
        self.size.map(|Size(resolution)| resolution)
    }
}

/// How the light is traced.
#[derive(Args, Default)]
pub(super) struct TraceArgs {
    #[command(flatten)]
    pub(super) size: SizeArgs,
    /// Light paths per camera pixel [default: 64]
    #[arg(long, value_name = "N")]
    spp: Option<u32>,
    /// Surfaces that a light path meets at most; 1 is direct light only [default: 6]
    #[arg(long, value_name = "N")]
    max_bounces: Option<u32>,
    /// Selects the random numbers; equal seeds give equal results. On a rig, those of starting vectors only: what its
    /// devices do is its file's [default: 0]
    #[arg(long, value_name = "N")]
    seed: Option<u32>,
    /// End dim light paths by chance; at six bounces that costs more variance than it saves time
    #[arg(long)]
    russian_roulette: bool,
    /// How the random numbers are spread [default: sobol]
    #[arg(long, value_enum)]
    sampler: Option<SamplerArg>,
    /// Chains through mirrors and glass traced from each pixel, for light that is mirrored at both ends; 0 leaves it out
    /// [default: 16]
    #[arg(long, value_name = "N")]
    gather_photons: Option<u32>,
    /// How far around a point such chains count: 1 is what a pixel sees through its chain; smaller is sharper, and noisier
    /// [default: 1]
    #[arg(long, value_name = "R", value_parser = number::<f32>)]
    gather_radius: Option<f32>,
    /// Pixels of a projector that stands apart from the camera [default: those of the camera]
    #[arg(long, value_name = "N|WxH")]
    projector_size: Option<Size>,
    /// The graphics adapter whose name contains this; `krylux info` lists them
    #[arg(long, value_name = "NAME")]
    pub(super) adapter: Option<String>,
    #[command(flatten)]
    pub(super) cache: CacheArgs,
}

impl TraceArgs {
    /// For a verb that looks and traces nothing.
    pub(super) fn for_looking(size: SizeArgs, adapter: Option<String>) -> Self {
        Self { size, adapter, ..Self::default() }
    }

    /// The overrides of a laboratory's settings.
    pub(super) fn overrides(&self) -> TraceOverrides {
        TraceOverrides {
            resolution: self.size.given(),
            projector: self.projector_size.map(|Size(resolution)| resolution),
            samples: self.spp,
            max_bounces: self.max_bounces,
            seed: self.seed,
            sampler: self.sampler.map(Into::into),
            russian_roulette: self.russian_roulette,
            photons: self.gather_photons,
            radius: self.gather_radius,
        }
    }
}

/// `--sampler`.
#[derive(Clone, Copy, ValueEnum)]
enum SamplerArg {
    /// Scrambled Sobol points: less noise for the same number of paths
    Sobol,
    /// Each number independent of all others
    Independent,
}

impl From<SamplerArg> for Sampler {
    fn from(argument: SamplerArg) -> Self {
        match argument {
            SamplerArg::Sobol => Self::Sobol,
            SamplerArg::Independent => Self::Independent,
        }
    }
}

/// `--size`: `128` is square, `128x96` is width by height.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Size(Resolution);

impl FromStr for Size {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let side = |side: &str| match side.parse::<usize>() {
            Ok(side @ 1..=16384) => Ok(side),
            _ => Err(format!("`{side}` is not a number of pixels from 1 to 16384; write 128 or 128x96")),
        };
        Ok(Self(match text.split_once(['x', '×']) {
            Some((width, height)) => Resolution::new(side(width)?, side(height)?),
            None => Resolution::new(side(text)?, side(text)?),
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::{Gather, TraceSettings};

    #[test]
    fn a_size_is_a_square_or_width_by_height() {
        assert_eq!("64".parse(), Ok(Size(Resolution::new(64, 64))));
        assert_eq!("128x96".parse(), Ok(Size(Resolution::new(128, 96))));
        for wrong in ["", "0", "64x", "x64", "-3", "64x64x3", "20000"] {
            assert!(wrong.parse::<Size>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn the_help_tells_the_tracers_defaults() {
        let gather = Gather::default();
        assert_eq!(
            (gather.photons, gather.radius, TraceSettings::new(Resolution::new(1, 1), 1).max_bounces),
            (16, 1.0, 6)
        );
    }
}
