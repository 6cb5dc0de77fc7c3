//! The settings of a source, with their defaults.

use std::path::PathBuf;
use std::str::FromStr;
use std::sync::Arc;

use crate::cache::{self, Cache};
use crate::image::Resolution;
use crate::machine;
use crate::render::{Gather, Sampler, TraceSettings};
use crate::scene::LoadOptions;
use crate::team::Team;
use crate::transport::{Backend, Channels};

/// Settings for opening a source. The default suits every source.
#[derive(Clone, Debug, Default)]
pub struct Settings {
    /// The places of camera and projector.
    pub view: View,
    /// How light is traced.
    pub trace: TraceOverrides,
    /// Part of the name of the graphics adapter to use. If it is `None`, any suitable adapter is used.
    pub adapter: Option<String>,
    /// The place where matrices are kept for later runs.
    pub cache: CacheChoice,
    /// How the photos of a scene are computed.
    pub operator: OperatorSettings,
    /// Gray or coloured photos.
    pub channels: ChannelChoice,
    /// Other processes that trace scenes and keep a part of their matrices. This process leads them.
    pub team: Option<Arc<Team>>,
    /// Whether a scene's matrix keeps the second bounce in a separate layer from the third and later bounces.
    pub split_bounces: bool,
}

impl Settings {
    /// The option name of the first given setting that affects tracing. A source that traces nothing refuses this setting.
    pub fn first_of_trace(&self) -> Option<&'static str> {
        let trace = self.trace.given();
        let adapter = self.adapter.is_some().then_some("--adapter");
        let placed = self.view.auto_camera.then_some("--auto-camera");
        trace.or(adapter).or(self.view.first_of_file()).or(placed)
    }

    /// Works like [`Self::first_of_trace`], without the sizes of the pictures. They may be given for a matrix.
    pub fn first_beside_sizes(&self) -> Option<&'static str> {
        let trace = TraceOverrides { resolution: None, projector: None, ..self.trace };
        Self { trace, ..self.clone() }.first_of_trace()
    }

    /// The option name of the first given setting that affects how the photos of a scene are computed. Other sources refuse this setting.
    pub fn first_of_operator(&self) -> Option<&'static str> {
        let given = [
            (self.operator.choice != OperatorChoice::Auto, "--operator"),
            (self.operator.backend != Backend::Auto, "--products"),
            (self.operator.memory.is_some(), "--memory"),
        ];
        first_given(&given)
    }

    /// The limit of memory for a matrix or a photo, in bytes.
    pub(super) fn memory_limit(&self) -> u64 {
        self.operator.memory.unwrap_or_else(|| machine::memory() / 2)
    }
}

/// The name of the first option that is given.
pub(crate) fn first_given<'a>(options: &[(bool, &'a str)]) -> Option<&'a str> {
    options.iter().find(|(is_given, _)| *is_given).map(|(_, name)| *name)
}

/// The places of camera and projector.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct View {
    /// The camera to use, where the scene has several
    #[arg(long, value_name = "NAME")]
    pub camera: Option<String>,
    /// Where camera and projector stand, in TOML, instead of the scene's own [default: NAME.rig.toml next to the scene]
    #[arg(long, value_name = "RIG")]
    pub camera_file: Option<PathBuf>,
    /// Place a camera in front of a scene that has none, from where all of it is seen; of several cameras take the first
    #[arg(long)]
    pub auto_camera: bool,
    /// End where a picture, a material library or texture coordinates of the scene are missing or cannot be read, instead of showing its surfaces
    /// without them
    #[arg(long)]
    pub strict: bool,
}

impl View {
    /// The option name of the first given option that only reading a file uses.
    pub(super) fn first_of_file(&self) -> Option<&'static str> {
        let given = [
            (self.camera.is_some(), "--camera"),
            (self.camera_file.is_some(), "--camera-file"),
            (self.strict, "--strict"),
        ];
        first_given(&given)
    }

    /// The options that load a scene with this view.
    pub(crate) fn options(&self) -> LoadOptions<'_> {
        LoadOptions {
            camera: self.camera.as_deref(),
            camera_file: self.camera_file.as_deref(),
            auto_camera: self.auto_camera,
            strict: self.strict,
            ..LoadOptions::default()
        }
    }
}

/// How the photos of a scene are computed.
#[derive(Clone, Copy, Debug, Default, clap::Args)]
pub struct OperatorSettings {
    /// How photos are computed: as products with a matrix, or each traced anew (the same photos, to rounding); auto decides by --memory
    #[arg(id = "operator", long = "operator", value_name = "OPERATOR", value_enum, default_value = "auto")]
    pub choice: OperatorChoice,
    /// Where products with the matrix are computed (the same, to the rounding of sums); auto: on a GPU that has f64 and room for the matrix,
    /// else on the processor
    #[arg(id = "products", long = "products", value_name = "PRODUCTS", value_enum, default_value = "auto")]
    pub backend: Backend,
    /// The memory that a matrix may take while it is assembled, e.g. 8GiB or 500MB [default: half of the machine's]
    #[arg(long, value_name = "BYTES", value_parser = byte_count)]
    pub memory: Option<u64>,
}

/// How the photos of a scene are computed. All choices give the same photos, up to rounding.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum OperatorChoice {
    /// A matrix, unless it would exceed the memory
    #[default]
    Auto,
    /// Trace once, keep the matrix, multiply
    Replay,
    /// Trace for every photo, keep nothing
    Retrace,
}

/// Gray or coloured photos.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ChannelChoice {
    /// One gray pattern, one photo weighted by luminance.
    #[default]
    Luma,
    /// Red, green and blue: three independent linear systems.
    Rgb,
    /// The channels of the source: colours for a scene, the devices' channels for a rig, and the channels of its photos for a run.
    Native,
}

impl From<Channels> for ChannelChoice {
    fn from(channels: Channels) -> Self {
        match channels {
            Channels::Luma => Self::Luma,
            Channels::Rgb => Self::Rgb,
        }
    }
}

/// The place where matrices are kept for later runs.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum CacheChoice {
    /// The folder in the environment variable `KRYLUX_CACHE` (none if it is empty), or by default `krylux` in the user's cache folder.
    #[default]
    Default,
    /// Matrices are not kept.
    Off,
    /// Matrices are kept in this folder.
    Folder(PathBuf),
}

impl CacheChoice {
    /// The cache to use, if any.
    pub fn open(&self) -> Option<Cache> {
        let folder = match self {
            Self::Off => None,
            Self::Folder(folder) => Some(folder.clone()),
            Self::Default => match std::env::var_os("KRYLUX_CACHE") {
                Some(folder) => Some(PathBuf::from(folder)).filter(|folder| !folder.as_os_str().is_empty()),
                None => cache::default_folder(),
            },
        };
        folder.map(|folder| Cache::new(folder, cache::LIMIT))
    }
}

/// Settings of the tracer. `None` means the stated default, or the value in a virtual rig's file. Each option has an identifier of its own,
/// because requests have fields of the same names, such as `photos`.
#[derive(Clone, Copy, Debug, Default, PartialEq, clap::Args)]
pub struct TraceOverrides {
    /// Pixels of the camera, and of the projector where that has no --projector-size: 128, or 128x96; for a matrix that came without them,
    /// the size of its photos [default: 128]
    #[arg(id = "size", long = "size", value_name = "N|WxH", value_parser = size)]
    pub resolution: Option<Resolution>,
    /// Light paths per camera pixel [default: 64]
    #[arg(id = "spp", long = "spp", value_name = "N")]
    pub samples: Option<u32>,
    /// Surfaces that a light path meets at most; 1 is direct light only [default: 6]
    #[arg(long, value_name = "N")]
    pub max_bounces: Option<u32>,
    /// Selects the random numbers; equal seeds give equal results. On a rig, those of starting vectors only: what its
    /// devices do is its file's [default: 0]
    #[arg(long, value_name = "N")]
    pub seed: Option<u32>,
    /// End dim light paths by chance; at six bounces that costs more variance than it saves time
    #[arg(long)]
    pub russian_roulette: bool,
    /// How the random numbers are spread [default: sobol]
    #[arg(long, value_enum)]
    pub sampler: Option<Sampler>,
    /// Chains through mirrors and glass traced from each pixel, for light that is mirrored at both ends; 0 leaves it out
    /// [default: 16]
    #[arg(id = "gather_photons", long = "gather-photons", value_name = "N")]
    pub photons: Option<u32>,
    /// How far around a point such chains count: 1 is what a pixel sees through its chain; smaller is sharper, and noisier
    /// [default: 1]
    #[arg(id = "gather_radius", long = "gather-radius", value_name = "R", value_parser = number::<f32>)]
    pub radius: Option<f32>,
    /// Pixels of a projector that stands apart from the camera, or of the patterns of a matrix [default: those of the camera]
    #[arg(id = "projector_size", long = "projector-size", value_name = "N|WxH", value_parser = size)]
    pub projector: Option<Resolution>,
}

/// Parses a resolution: `128` is square, `128x96` is width by height.
pub(crate) fn size(text: &str) -> Result<Resolution, String> {
    let side = |side: &str| match side.parse::<usize>() {
        Ok(side @ 1..=16384) => Ok(side),
        _ => Err(format!("`{side}` is not a number of pixels from 1 to 16384; write 128 or 128x96")),
    };
    let (width, height) = text.split_once(['x', '×']).unwrap_or((text, text));
    Ok(Resolution::new(side(width)?, side(height)?))
}

/// Parses a number for any option. It may be infinite. NaN is refused, since it would pass every comparison with a bound.
pub(crate) fn number<T: FromStr + Into<f64> + Copy>(text: &str) -> Result<T, String> {
    let number = text.trim().parse::<T>().ok().filter(|&number| !number.into().is_nan());
    number.ok_or_else(|| format!("`{text}` is not a number; write one as in 0.5 or 1e-6"))
}

/// Parses a number of bytes: `8GiB`, `500MB`, `1.5G` or `1000`.
pub(crate) fn byte_count(text: &str) -> Result<u64, String> {
    const UNITS: [(&str, u64); 14] = [
        ("", 1),
        ("b", 1),
        ("k", 1 << 10),
        ("kib", 1 << 10),
        ("m", 1 << 20),
        ("mib", 1 << 20),
        ("g", 1 << 30),
        ("gib", 1 << 30),
        ("t", 1 << 40),
        ("tib", 1 << 40),
        ("kb", 1_000),
        ("mb", 1_000_000),
        ("gb", 1_000_000_000),
        ("tb", 1_000_000_000_000),
    ];
    let split = text.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(text.len());
    let (number, unit) = text.split_at(split);
    let unit = unit.trim().to_ascii_lowercase();
    let scale = UNITS.iter().find(|(name, _)| *name == unit).map(|(_, scale)| *scale as f64);
    let bytes = number.parse::<f64>().ok().zip(scale).map(|(number, scale)| number * scale);
    let bytes = bytes.filter(|bytes| (1.0..=(1_u64 << 60) as f64).contains(bytes));
    let unusable = || format!("`{text}` is no number of bytes; write 8GiB, 500MB or 1.5G");
    bytes.map(|bytes| bytes as u64).ok_or_else(unusable)
}

impl TraceOverrides {
    /// The settings for the scene of a virtual rig whose file contains `settings`. Its seed is kept, so equal devices see equal scenes.
    pub fn for_rig(&self, settings: TraceSettings) -> TraceSettings {
        TraceSettings {
            resolution: self.resolution.unwrap_or(settings.resolution),
            projector: self.projector.or(settings.projector),
            samples: self.samples.unwrap_or(settings.samples),
            max_bounces: self.max_bounces.unwrap_or(settings.max_bounces),
            sampler: self.sampler.unwrap_or(settings.sampler),
            russian_roulette: self.russian_roulette || settings.russian_roulette,
            gather: Gather {
                photons: self.photons.unwrap_or(settings.gather.photons),
                radius: self.radius.unwrap_or(settings.gather.radius),
            },
            ..settings
        }
    }

    /// The settings for a scene.
    pub fn for_scene(&self) -> TraceSettings {
        let seed = self.seed.unwrap_or(0);
        TraceSettings { seed, ..self.for_rig(TraceSettings::new(Resolution::new(128, 128), 64)) }
    }

    /// The seed of starting vectors and of every other random choice outside of the tracer.
    pub fn vector_seed(&self) -> u64 {
        self.seed.unwrap_or(0).into()
    }

    /// The option name of the first given setting that affects tracing. The seed does not count.
    fn given(&self) -> Option<&'static str> {
        let given = [
            (self.resolution.is_some(), "--size"),
            (self.samples.is_some(), "--spp"),
            (self.max_bounces.is_some(), "--max-bounces"),
            (self.russian_roulette, "--russian-roulette"),
            (self.sampler.is_some(), "--sampler"),
            (self.photons.is_some(), "--gather-photons"),
            (self.radius.is_some(), "--gather-radius"),
            (self.projector.is_some(), "--projector-size"),
        ];
        first_given(&given)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn overrides_replace_what_a_rig_file_says_except_the_seed() {
        let file = TraceSettings { seed: 7, ..TraceSettings::new(Resolution::new(64, 48), 256) };
        let none = TraceOverrides::default();
        assert_eq!((none.for_rig(file), none.given()), (file, None));
        let some = TraceOverrides { samples: Some(32), seed: Some(3), ..none };
        assert_eq!(some.for_rig(file), TraceSettings { samples: 32, ..file });
        assert_eq!((some.for_scene().seed, some.vector_seed(), some.given()), (3, 3, Some("--spp")));
    }

    #[test]
    fn a_size_is_a_square_or_width_by_height() {
        assert_eq!(size("64"), Ok(Resolution::new(64, 64)));
        assert_eq!(size("128x96"), Ok(Resolution::new(128, 96)));
        for wrong in ["", "0", "64x", "x64", "-3", "64x64x3", "20000"] {
            assert!(size(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn the_help_tells_the_tracers_defaults() {
        let gather = Gather::default();
        let bounces = TraceSettings::new(Resolution::new(1, 1), 1).max_bounces;
        assert_eq!((gather.photons, gather.radius, bounces), (16, 1.0, 6));
    }

    #[test]
    fn bytes_have_binary_or_decimal_units() {
        for (text, bytes) in [
            ("8GiB", 8 << 30),
            ("500MB", 500_000_000),
            ("1.5g", 3 << 29),
            ("16 KiB", 16384),
            ("1000", 1000),
            ("2tb", 2_000_000_000_000),
        ] {
            assert_eq!(byte_count(text), Ok(bytes), "{text}");
        }
        for wrong in ["", "GiB", "-1", "8 apples", "1e3", "0", "1.2.3G", "99999999TiB"] {
            assert!(byte_count(wrong).is_err(), "{wrong}");
        }
    }
}
