//! Options that several verbs share.

use std::path::PathBuf;
use std::str::FromStr;

use clap::{Args, ValueEnum};

use super::operator::CacheArgs;
use crate::image::Resolution;
use crate::krylov::{METHODS, Method};
use crate::render::{Gather, Sampler, TraceSettings};
use crate::scene::Scene;
use crate::transport::Channels;

/// Which scene.
#[derive(Args)]
pub(super) struct SourceArgs {
    /// The scene: a .glb or .gltf file with a camera, or an .obj file with a rig file
    #[arg(value_name = "SCENE")]
    pub(super) source: PathBuf,
    #[command(flatten)]
    pub(super) view: ViewArgs,
}

/// Where camera and projector stand.
#[derive(Args, Clone)]
pub(super) struct ViewArgs {
    /// The camera to use, where the scene has several
    #[arg(long, value_name = "NAME")]
    pub(super) camera: Option<String>,
    /// Where camera and projector stand, in TOML, instead of the scene's own [default: NAME.rig.toml next to the scene]
    #[arg(long, value_name = "RIG")]
    pub(super) camera_file: Option<PathBuf>,
}

/// Pixels of camera and projector.
#[derive(Args)]
pub(super) struct SizeArgs {
    /// Pixels of the camera, and of the projector where that has no --projector-size: 128, or 128x96
    #[arg(long, value_name = "N|WxH", default_value = "128")]
    size: Size,
}

impl SizeArgs {
    pub(super) fn resolution(&self) -> Resolution {
        self.size.0
    }
}

/// How the light is traced.
#[derive(Args)]
pub(super) struct TraceArgs {
    #[command(flatten)]
    pub(super) size: SizeArgs,
    /// Light paths per camera pixel
    #[arg(long, value_name = "N", default_value_t = 64)]
    pub(super) spp: u32,
    /// Surfaces that a light path meets at most; 1 is direct light only
    #[arg(long, value_name = "N", default_value_t = 6)]
    pub(super) max_bounces: u32,
    /// Selects the random numbers; equal seeds give equal results
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(super) seed: u32,
    /// End dim light paths by chance; at six bounces that costs more variance than it saves time
    #[arg(long)]
    russian_roulette: bool,
    /// How the random numbers are spread
    #[arg(long, value_enum, default_value = "sobol")]
    sampler: SamplerArg,
    /// Chains through mirrors and glass traced from each pixel, for light that is mirrored at both ends; 0 leaves it out
    #[arg(long, value_name = "N", default_value_t = Gather::default().photons)]
    gather_photons: u32,
    /// How far around a point such chains count: 1 is what a pixel sees through its chain; smaller is sharper, and noisier
    #[arg(long, value_name = "R", default_value_t = Gather::default().radius)]
    gather_radius: f32,
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
    pub(super) fn settings(&self) -> TraceSettings {
        let Self { spp: samples, max_bounces, seed, russian_roulette, .. } = *self;
        let projector = self.projector_size.map(|Size(resolution)| resolution);
        let sampler = self.sampler.into();
        let size = self.size.resolution();
        TraceSettings {
            max_bounces,
            seed,
            projector,
            sampler,
            russian_roulette,
            gather: Gather { photons: self.gather_photons, radius: self.gather_radius },
            ..TraceSettings::new(size, samples)
        }
    }

    /// The settings for this scene, whose rig may say how many pixels its projector has.
    pub(super) fn settings_for(&self, scene: &Scene) -> TraceSettings {
        let settings = self.settings();
        TraceSettings { projector: settings.projector.or(scene.projector_resolution), ..settings }
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

/// Where a run leaves its folder.
#[derive(Args)]
pub(super) struct RunArgs {
    /// Where the run goes [default: out/SOURCE-VERB]
    #[arg(short = 'o', long = "output", value_name = "DIR")]
    pub(super) folder: Option<PathBuf>,
    /// Write into a folder that holds an earlier run
    #[arg(long)]
    pub(super) overwrite: bool,
}

/// How much is said, and how.
#[derive(Args)]
pub(super) struct OutputArgs {
    /// Print a machine-readable summary on stdout, and nothing else there
    #[arg(long)]
    pub(super) json: bool,
    /// Print nothing but errors (and --json's summary)
    #[arg(short, long, conflicts_with = "verbose")]
    pub(super) quiet: bool,
    /// Print details on stderr
    #[arg(short, long)]
    pub(super) verbose: bool,
}

/// `--channels`.
#[derive(Clone, Copy, ValueEnum)]
pub(super) enum ChannelsArg {
    /// One gray pattern, one photo weighted by luminance
    Luma,
    /// Red, green and blue, each a system of its own
    Rgb,
}

impl From<ChannelsArg> for Channels {
    fn from(argument: ChannelsArg) -> Self {
        match argument {
            ChannelsArg::Luma => Self::Luma,
            ChannelsArg::Rgb => Self::Rgb,
        }
    }
}

/// `--method`: any that solves `A x = b`.
pub(super) fn method(name: &str) -> Result<Method, String> {
    Method::from_name(name).map_err(|_| {
        let names: Vec<&str> = METHODS.iter().map(|facts| facts.name).collect();
        format!("expected one of {}", names.join(", "))
    })
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
}
