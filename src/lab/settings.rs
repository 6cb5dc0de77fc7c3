//! The settings of a source, with their defaults.

use std::path::PathBuf;
use std::sync::Arc;

use crate::cache::{self, Cache};
use crate::image::Resolution;
use crate::machine;
use crate::render::{Gather, Sampler, TraceSettings};
use crate::team::Team;
use crate::transport::{Backend, Channels};

/// Settings for opening a source. The default suits every source.
#[derive(Clone, Debug, Default)]
pub struct Settings {
    /// The name of the camera to use, if the scene has several.
    pub camera: Option<String>,
    /// A camera file. Its poses of camera and projector replace those of the scene.
    pub camera_file: Option<PathBuf>,
    /// Places a camera in front of a scene that has none.
    pub auto_camera: bool,
    /// Makes a missing picture or material library of a scene an error instead of a warning.
    pub strict: bool,
    /// How light is traced.
    pub trace: TraceOverrides,
    /// Part of the name of the graphics adapter to use. If it is `None`, any suitable adapter is used.
    pub adapter: Option<String>,
    /// The place where matrices are kept for later runs.
    pub cache: CacheChoice,
    /// How the photos of a scene are computed.
    pub operator: OperatorChoice,
    /// The place where products with a scene's matrix are computed.
    pub backend: Backend,
    /// The bytes of memory for a matrix during assembly, or for a traced photo. If it is `None`, half of the machine's memory is allowed.
    pub memory: Option<u64>,
    /// Gray or coloured photos.
    pub channels: ChannelChoice,
    /// Other processes that trace scenes and keep a part of their matrices. This process leads them.
    pub team: Option<Arc<Team>>,
    /// Whether a scene's matrix keeps the second bounce in a separate layer from the third and later ones.
    pub split_bounces: bool,
}

impl Settings {
    /// The option name of the first setting that affects tracing. A source that traces nothing refuses it.
    pub fn first_of_trace(&self) -> Option<&'static str> {
        let view = [
            (self.camera.is_some(), "--camera"),
            (self.camera_file.is_some(), "--camera-file"),
            (self.auto_camera, "--auto-camera"),
            (self.strict, "--strict"),
        ];
        let trace = self.trace.given();
        let adapter = self.adapter.is_some().then_some("--adapter");
        trace.or(adapter).or(view.into_iter().find(|(is_given, _)| *is_given).map(|(_, name)| name))
    }

    /// The option name of the first setting that affects how the photos of a scene are computed. Other sources refuse it.
    pub fn first_of_operator(&self) -> Option<&'static str> {
        let given = [
            (self.operator != OperatorChoice::Auto, "--operator"),
            (self.backend != Backend::Auto, "--products"),
            (self.memory.is_some(), "--memory"),
        ];
        given.into_iter().find(|(is_given, _)| *is_given).map(|(_, name)| name)
    }

    /// The limit of memory for a matrix or a photo, in bytes.
    pub(super) fn memory_limit(&self) -> u64 {
        self.memory.unwrap_or_else(|| machine::memory() / 2)
    }
}

/// How the photos of a scene are computed. All choices give the same photos, up to rounding.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum OperatorChoice {
    /// As products with a matrix, unless the matrix would exceed the memory.
    #[default]
    Auto,
    /// As products with a matrix that is traced once.
    Replay,
    /// By tracing each photo anew.
    Retrace,
}

/// Gray or coloured photos.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ChannelChoice {
    /// One gray pattern, one photo weighted by luminance.
    #[default]
    Luma,
    /// Red, green and blue: three independent systems.
    Rgb,
    /// The channels of the source: colours for a scene, the channels of a rig's devices, or those of a run's photos.
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
    /// The folder that the environment variable `KRYLUX_CACHE` names (none if it is empty), or else `krylux` in the user's cache folder.
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

/// Settings of the tracer. `None` means 64 paths of at most six surfaces for each of 128×128 pixels, or the value in a virtual rig's file.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TraceOverrides {
    /// Pixels of the camera, and of the projector if `projector` is `None`.
    pub resolution: Option<Resolution>,
    /// Pixels of a projector that stands apart from the camera.
    pub projector: Option<Resolution>,
    /// Light paths per camera pixel.
    pub samples: Option<u32>,
    /// The largest number of surfaces that a light path meets; 1 gives direct light only.
    pub max_bounces: Option<u32>,
    /// Selects the random numbers of the tracer and of starting vectors. On a rig it selects only those of starting vectors, since the file
    /// of a virtual rig names the seed of its devices.
    pub seed: Option<u32>,
    /// The distribution of random numbers.
    pub sampler: Option<Sampler>,
    /// Ends dim light paths at random.
    pub russian_roulette: bool,
    /// Specular chains traced from each pixel ([`Gather::photons`]).
    pub photons: Option<u32>,
    /// The radius around a point within which such chains count ([`Gather::radius`]).
    pub radius: Option<f32>,
}

impl TraceOverrides {
    /// Replaces fields of `settings` by the values given here, except the seed.
    fn over(&self, settings: TraceSettings) -> TraceSettings {
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
        TraceSettings { seed, ..self.over(TraceSettings::new(Resolution::new(128, 128), 64)) }
    }

    /// The settings for the scene of a virtual rig whose file contains `settings`. The seed is the file's: equal devices see equal scenes.
    pub fn for_rig(&self, settings: TraceSettings) -> TraceSettings {
        self.over(settings)
    }

    /// The seed of starting vectors and of every other random choice outside of the tracer.
    pub fn vector_seed(&self) -> u64 {
        self.seed.unwrap_or(0).into()
    }

    /// The option name of the first given setting that affects tracing, except the seed.
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
        given.into_iter().find(|(is_given, _)| *is_given).map(|(_, name)| name)
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
}
