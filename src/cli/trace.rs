//! The options of the tracer: how a scene's light is followed. What is not given is 64 paths of six surfaces from each of
//! 128x128 pixels, or what the file of a virtual rig says.

use std::str::FromStr;

use clap::{Args, ValueEnum};

use super::operator::CacheArgs;
use crate::image::Resolution;
use crate::render::{Gather, Sampler, TraceSettings};

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
    #[arg(long, value_name = "R")]
    gather_radius: Option<f32>,
    /// Pixels of a projector that stands apart from the camera [default: as many as the camera's]
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

    /// `settings` with what is given in their place; the seed too if `seeded`.
    fn over(&self, settings: TraceSettings) -> TraceSettings {
        TraceSettings {
            resolution: self.size.given().unwrap_or(settings.resolution),
            projector: self.projector_size.map(|Size(resolution)| resolution).or(settings.projector),
            samples: self.spp.unwrap_or(settings.samples),
            max_bounces: self.max_bounces.unwrap_or(settings.max_bounces),
            sampler: self.sampler.map_or(settings.sampler, Into::into),
            russian_roulette: self.russian_roulette || settings.russian_roulette,
            gather: Gather {
                photons: self.gather_photons.unwrap_or(settings.gather.photons),
                radius: self.gather_radius.unwrap_or(settings.gather.radius),
            },
            ..settings
        }
    }

    /// The settings for a scene.
    pub(super) fn settings(&self) -> TraceSettings {
        let seed = self.seed.unwrap_or(0);
        TraceSettings { seed, ..self.over(TraceSettings::new(Resolution::new(128, 128), 64)) }
    }

    /// The settings for a virtual rig's scene, where its file says `settings`. The seed is left to it: equal devices see
    /// equal scenes.
    pub(super) fn settings_of_rig(&self, settings: TraceSettings) -> TraceSettings {
        self.over(settings)
    }

    /// Seeds starting vectors and whatever else is chosen by chance outside of the tracer.
    pub(super) fn seed(&self) -> u64 {
        self.seed.unwrap_or(0).into()
    }

    /// The first option given that says what is traced, or how: a source that traces nothing has no use for it.
    pub(super) fn given(&self) -> Option<&'static str> {
        let given = [
            (self.size.size.is_some(), "--size"),
            (self.spp.is_some(), "--spp"),
            (self.max_bounces.is_some(), "--max-bounces"),
            (self.russian_roulette, "--russian-roulette"),
            (self.sampler.is_some(), "--sampler"),
            (self.gather_photons.is_some(), "--gather-photons"),
            (self.gather_radius.is_some(), "--gather-radius"),
            (self.projector_size.is_some(), "--projector-size"),
            (self.adapter.is_some(), "--adapter"),
        ];
        given.into_iter().find(|(is_given, _)| *is_given).map(|(_, name)| name)
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

    #[test]
    fn a_size_is_a_square_or_width_by_height() {
        assert_eq!("64".parse(), Ok(Size(Resolution::new(64, 64))));
        assert_eq!("128x96".parse(), Ok(Size(Resolution::new(128, 96))));
        for wrong in ["", "0", "64x", "x64", "-3", "64x64x3", "20000"] {
            assert!(wrong.parse::<Size>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn what_is_given_stands_in_the_place_of_what_a_rig_file_says() {
        let file = TraceSettings { seed: 7, ..TraceSettings::new(Resolution::new(64, 48), 256) };
        let none = TraceArgs::default();
        assert_eq!((none.settings_of_rig(file), none.given()), (file, None));
        let some = TraceArgs { spp: Some(32), seed: Some(3), ..TraceArgs::default() };
        assert_eq!(some.settings_of_rig(file), TraceSettings { samples: 32, ..file });
        assert_eq!((some.settings().seed, some.seed(), some.given()), (3, 3, Some("--spp")));
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
