//! Keys of traced matrices.

use crate::gpu::{AdapterSummary, shader};
use crate::render::TraceSettings;
use crate::scene::Scene;
use crate::transport::{Channels, RigShape};

/// The version of everything that a matrix depends on but the key does not hash. It must be raised when the
/// same paths give another matrix, when the file format changes, or when the host prepares a scene
/// differently for the tracer (the pairing of triangles affects the last bits). Changes of the shaders need
/// no new version, since their sources are hashed.
const OPERATOR_VERSION: u32 = 4;

/// The number of hexadecimal digits of a key, which has 128 bits.
pub(super) const HEX_DIGITS: usize = 32;

/// The key of a traced matrix: a BLAKE3 hash of everything that the matrix depends on. That is the scene's
/// files, camera, projector and materials, the resolutions, samples, bounces, seed, sampler, channels and
/// layers, the sources of the shaders, and the adapter with its driver, since the results of sines and powers
/// depend on the device.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Key {
    hex: String,
    label: String,
    channels: Channels,
    rig: RigShape,
}

impl Key {
    /// The key of the matrix that results from tracing `scene` on `adapter`. `split` is as in
    /// [`crate::transport::assemble_layers`]. Geometry and textures enter by [`Scene::hash`].
    ///
    /// The `Debug` texts of the camera, the materials, the settings and the channels are hashed, so renaming
    /// a field of these types changes every key.
    pub fn new(
        scene: &Scene,
        adapter: &AdapterSummary,
        settings: &TraceSettings,
        channels: Channels,
        split: bool,
    ) -> Self {
        let mut hasher = blake3::Hasher::new();
        let mut part = |text: &str| {
            // The length separates the parts: other parts with the same concatenation have another hash.
            hasher.update(&(text.len() as u64).to_le_bytes());
            hasher.update(text.as_bytes());
        };
        part(&format!("krylux operator {OPERATOR_VERSION}"));
        // The shader of products does not affect the matrix.
        shader::SOURCES.iter().filter(|(name, _)| *name != "product").for_each(|(name, source)| {
            part(name);
            part(&without_comments(source));
        });
        part(&format!("{:?}", scene.hash));
        part(&format!("{:?} {:?}", scene.camera, scene.projector));
        part(&format!("{:?}", scene.materials));
        part(&format!("{settings:?} {channels:?} {split}"));
        part(&format!("{} {} {}", adapter.name, adapter.driver, adapter.driver_version));
        let hex = hasher.finalize().to_hex()[..HEX_DIGITS].to_owned();
        let label = format!(
            "{}, {}, {} samples, {} bounces, seed {}",
            scene.path.display(),
            settings.resolution,
            settings.samples,
            settings.max_bounces,
            settings.seed
        );
        let (camera, projector) = (settings.resolution, settings.projector.unwrap_or(settings.resolution));
        // Whether the rig is coaxial is the tracer's to say.
        let rig = RigShape { camera, projector, symmetric: camera == projector };
        Self { hex, label, channels, rig }
    }

    /// A key that a file names; `None` if it names none: keys are names of files.
    pub(super) fn stored(hex: String, label: String, channels: Channels, rig: RigShape) -> Option<Self> {
        let is_digit = |byte: u8| byte.is_ascii_digit() || (b'a'..=b'f').contains(&byte);
        (hex.len() == HEX_DIGITS && hex.bytes().all(is_digit)).then_some(Self { hex, label, channels, rig })
    }

    /// The key in hexadecimal.
    pub fn hex(&self) -> &str {
        &self.hex
    }

    /// A description of the scene and the settings of the matrix.
    pub fn label(&self) -> &str {
        &self.label
    }

    /// The pixels of camera and projector. Of a matrix that is not square it is known that it is not symmetric.
    pub(super) fn rig(&self) -> RigShape {
        self.rig
    }

    /// The channels of the matrix. It has one file for each of them.
    pub fn channels(&self) -> Channels {
        self.channels
    }
}

/// The source of a shader without comments and empty lines, which change no matrix.
fn without_comments(source: &str) -> String {
    let code = source.lines().map(|line| line.split("//").next().unwrap_or_default().trim_end());
    code.filter(|line| !line.is_empty()).collect::<Vec<_>>().join("\n")
}
