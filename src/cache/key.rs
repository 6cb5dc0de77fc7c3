//! What a matrix depends on.

use crate::gpu::{AdapterSummary, shader};
use crate::render::TraceSettings;
use crate::scene::Scene;
use crate::transport::Channels;

/// To be raised whenever equal paths come to make another matrix, or its file another format, or the host makes something else of a scene
/// (how triangles are paired decides last bits). What changes in the shaders is told by themselves.
const OPERATOR_VERSION: u32 = 1;

/// Hexadecimal digits of a key: 128 bits.
pub(super) const HEX_DIGITS: usize = 32;

/// BLAKE3 of everything that a traced matrix depends on: the scene's files, camera, projector and materials, resolutions,
/// samples, bounces, seed, sampler, channels, layers; the shaders; and adapter and driver, since sines and powers differ by device.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Key {
    hex: String,
    label: String,
    channels: Channels,
}

impl Key {
    /// The key of the matrix that tracing `scene` on `adapter` makes; `split` as in
    /// [`crate::transport::assemble_layers`]. Geometry and textures count by [`Scene::hash`].
    pub fn new(
        scene: &Scene,
        adapter: &AdapterSummary,
        settings: &TraceSettings,
        channels: Channels,
        split: bool,
    ) -> Self {
        let mut hasher = blake3::Hasher::new();
        let mut part = |text: &str| {
            // With its length, so that no two lists of parts run into one text.
            hasher.update(&(text.len() as u64).to_le_bytes());
            hasher.update(text.as_bytes());
        };
        part(&format!("krylux operator {OPERATOR_VERSION}"));
        // Products come after the matrix.
        shader::SOURCES.iter().filter(|(name, _)| *name != "product").for_each(|(name, source)| {
            part(name);
            part(source);
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
        Self { hex, label, channels }
    }

    /// The key in hexadecimal.
    pub fn hex(&self) -> &str {
        &self.hex
    }

    /// What the matrix is of, in words.
    pub fn label(&self) -> &str {
        &self.label
    }

    /// How many files the matrix has: one for each channel.
    pub fn channels(&self) -> Channels {
        self.channels
    }
}
