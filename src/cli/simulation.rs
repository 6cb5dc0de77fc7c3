//! From a scene file to its light transport matrix, with everything that the user should see on the way.

use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use anyhow::Result;

use super::console::Console;
use super::noise;
use super::options::ViewArgs;
use super::trace::TraceArgs;
use crate::cache::{Cache, Found, Key};
use crate::io::manifest;
use crate::journal::Identity;
use crate::measure::RunManifest;
use crate::render::{TraceSettings, TraceSummary, Tracer};
use crate::scene::{self, LoadOptions, Scene};
use crate::transport::{self, Assembled, Backend, Channels};

/// A scene, with the device that traces it and the matrices that are there already.
pub(super) struct Simulation {
    pub(super) scene: Scene,
    pub(super) tracer: Tracer,
    pub(super) settings: TraceSettings,
    cache: Option<Cache>,
}

impl Simulation {
    /// Loads the scene, says what was ignored in it, and opens the adapter for it. Of `trace` only the adapter and the cache
    /// count here; what is traced is in `settings`.
    pub(super) fn open(
        path: &Path,
        view: &ViewArgs,
        settings: TraceSettings,
        trace: &TraceArgs,
        console: &Console,
    ) -> Result<Self> {
        let (scene, tracer) = Tracer::open(trace.adapter.as_deref(), || load(path, view, console))?;
        let adapter = tracer.adapter();
        console.detail(format_args!(
            "adapter   {} ({}), {}",
            adapter.name, adapter.kind, adapter.driver_version
        ));
        // The scene's rig may say how many pixels its projector has.
        let settings =
            TraceSettings { projector: settings.projector.or(scene.projector_resolution), ..settings };
        Ok(Self { scene, tracer, settings, cache: trace.cache.open() })
    }

    /// Whether projector and camera have the same pose and lens, so that the matrix is symmetric.
    pub(super) fn is_symmetric(&self) -> bool {
        self.tracer.symmetric(&self.settings)
    }

    /// Names the matrix that tracing would make.
    pub(super) fn key(&self, channels: Channels, split: bool) -> Key {
        Key::new(&self.scene, self.tracer.adapter(), &self.settings, channels, split)
    }

    /// `identity` with all that a trace depends on.
    pub(super) fn identity(&self, identity: Identity, channels: Channels) -> Identity {
        let (settings, adapter) = (&self.settings, self.tracer.adapter());
        identity
            .with("scene", blake3::Hash::from_bytes(self.scene.hash).to_string())
            .with("size", settings.resolution)
            .with("samples per pixel", settings.samples)
            .with("bounces", settings.max_bounces)
            .with("seed", settings.seed)
            .with("channels", channels.count())
            .with("adapter", format!("{} {} {}", adapter.name, adapter.driver, adapter.driver_version))
            .with("all that is traced", self.key(channels, false).hex())
    }

    /// Notes what a trace depends on.
    pub(super) fn describe(&self, manifest: &mut RunManifest) {
        let (scene, settings) = (&self.scene, &self.settings);
        let adapter = self.tracer.adapter();
        manifest.seed = Some(u64::from(settings.seed));
        manifest.adapter = Some(manifest::Adapter {
            name: adapter.name.clone(),
            driver: format!("{} {}", adapter.driver, adapter.driver_version),
            backend: "vulkan".into(),
        });
        manifest.scene = Some(manifest::Scene {
            path: scene.path.display().to_string(),
            hash: blake3::Hash::from_bytes(scene.hash).to_string(),
        });
        manifest.samples_per_pixel = Some(settings.samples);
        manifest.max_bounces = Some(settings.max_bounces);
    }

    /// Moves the matrix to where products are to be taken, and says where that is.
    pub(super) fn place(&self, traced: &mut Assembled, place: Backend, console: &Console) -> Result<()> {
        if let Some(why) = traced.place(&self.tracer, place)? {
            console.note(format_args!("note: products are taken on the processor: {why}"));
        }
        let whom = if traced.is_on_gpu() { &self.tracer.adapter().name } else { "the processor" };
        console.detail(format_args!("products  on {whom}"));
        Ok(())
    }

    /// The matrix from the cache, if it is there and whole.
    pub(super) fn look_up(&self, channels: Channels, console: &Console) -> Option<Assembled> {
        look_up(self.cache.as_ref(), &self.key(channels, false), console)
    }

    /// Finds the light transport matrix in the cache or traces it, and says what that took.
    pub(super) fn assemble(&mut self, channels: Channels, console: &Console) -> Result<Assembled> {
        self.assemble_layers(channels, false, console)
    }

    /// As [`Simulation::assemble`]; if `split`, the second bounce is a layer of its own.
    pub(super) fn assemble_layers(
        &mut self,
        channels: Channels,
        split: bool,
        console: &Console,
    ) -> Result<Assembled> {
        let start = Instant::now();
        let key = self.key(channels, split);
        let cached = look_up(self.cache.as_ref(), &key, console);
        let is_new = cached.is_none();
        let traced = match cached {
            Some(cached) => cached,
            None => {
                let settings = &self.settings;
                with_bar(&mut self.tracer, console, |tracer| {
                    transport::assemble_layers(tracer, settings, channels, split)
                })?
            }
        };
        if is_new {
            say_traced(&traced.summary, console)?;
        } else {
            console.say(format_args!(
                "traced    {} light paths, from the cache",
                grouped(traced.summary.paths)
            ))?;
        }
        console.say(format_args!(
            "matrix    {} entries, {:.1} MiB, {:.2} s in all",
            grouped(traced.matrix.nonzeros() as u64),
            traced.matrix.bytes() as f64 / f64::from(1 << 20),
            start.elapsed().as_secs_f64()
        ))?;
        noise::say_noise(traced.noise.as_ref(), console)?;
        // What cannot be kept is no reason to fail: the next run traces again.
        if let Some(cache) = self.cache.as_ref().filter(|_| is_new) {
            match cache.store(&key, &traced) {
                Ok(true) => {
                    console.detail(format_args!("cache     {} in {}", key.hex(), cache.folder().display()));
                }
                Ok(false) => console.detail("cache     not kept: larger than the cache"),
                Err(error) => {
                    console.note(format_args!("note: the matrix is not kept for later runs: {error}"));
                }
            }
        }
        Ok(traced)
    }
}

/// Loads the scene and says what was ignored in it.
pub(super) fn load(path: &Path, view: &ViewArgs, console: &Console) -> Result<Scene> {
    let options = LoadOptions { camera: view.camera.as_deref(), rig: view.camera_file.as_deref() };
    let scene = scene::load_with(path, &options)?;
    for warning in &scene.warnings {
        console.note(format_args!("warning: {}: {warning}", scene.path.display()));
    }
    console.detail(format_args!(
        "scene     {} triangles, {} materials, camera `{}`",
        scene.triangles.len(),
        scene.materials.len(),
        scene.camera.name
    ));
    Ok(scene)
}

/// The matrix from the cache, if it is there and whole.
fn look_up(cache: Option<&Cache>, key: &Key, console: &Console) -> Option<Assembled> {
    match cache?.load(key) {
        Found::Whole(traced) => Some(*traced),
        Found::Missing => None,
        Found::Damaged(why) => {
            console.note(format_args!("note: the cached matrix is damaged and made anew: {why}"));
            None
        }
    }
}

/// The line about a finished trace.
fn say_traced(summary: &TraceSummary, console: &Console) -> Result<()> {
    let seconds = summary.tracing.as_secs_f64();
    console.detail(format_args!(
        "dispatch  {} of them, the longest {:.0} ms",
        summary.dispatches,
        summary.longest.as_secs_f64() * 1e3
    ));
    console.say(format_args!(
        "traced    {} light paths, {} rays in {seconds:.2} s ({:.2} M rays/s)",
        grouped(summary.paths),
        grouped(summary.rays),
        summary.rays as f64 / seconds.max(1e-9) / 1e6
    ))
}

/// `1048576` as `1,048,576`.
pub(super) fn grouped(number: u64) -> String {
    let digits = number.to_string();
    let mut text = String::new();
    for (index, digit) in digits.chars().enumerate() {
        if index > 0 && (digits.len() - index).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

/// A short name for a file: its own, or its folder's where it is just called `scene`.
pub(super) fn short_name(path: &Path) -> String {
    let stem = path.file_stem().map(|stem| stem.to_string_lossy().into_owned());
    let folder =
        path.parent().and_then(|folder| folder.file_name()).map(|f| f.to_string_lossy().into_owned());
    match (stem, folder) {
        (Some(stem), Some(folder)) if stem == "scene" => folder,
        (Some(stem), _) => stem,
        (None, _) => "scene".into(),
    }
}

/// Lets `work` trace with a progress bar, which also stops it where the user asks for that.
pub(super) fn with_bar<T>(tracer: &mut Tracer, console: &Console, work: impl FnOnce(&mut Tracer) -> T) -> T {
    tracer.observe(Arc::new(console.bar("tracing")));
    let done = work(tracer);
    tracer.observe(Arc::new(()));
    done
}

#[cfg(test)]
mod tests {
    #[test]
    fn numbers_are_grouped_by_thousands() {
        assert_eq!([0, 999, 1000, 1048576].map(super::grouped), ["0", "999", "1,000", "1,048,576"]);
    }
}
