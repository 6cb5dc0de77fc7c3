//! From a scene file to its light transport matrix, with everything that the user should see on the way.

use std::time::Instant;

use anyhow::Result;

use super::console::Console;
use super::noise;
use super::options::{SourceArgs, TraceArgs};
use crate::cache::{Cache, Found, Key};
use crate::render::{TraceSummary, Tracer};
use crate::scene::{self, LoadOptions, Scene};
use crate::transport::{self, Assembled, Channels};

/// Loads the scene and says what was ignored in it.
pub(super) fn load(source: &SourceArgs, console: &Console) -> Result<Scene> {
    let view = &source.view;
    let options = LoadOptions { camera: view.camera.as_deref(), rig: view.camera_file.as_deref() };
    let scene = scene::load_with(&source.source, &options)?;
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

/// Opens the adapter for this scene.
pub(super) fn open(scene: &Scene, trace: &TraceArgs, console: &Console) -> Result<Tracer> {
    let tracer = Tracer::new(scene, trace.adapter.as_deref())?;
    let adapter = tracer.adapter();
    console.detail(format_args!("adapter   {} ({}), {}", adapter.name, adapter.kind, adapter.driver_version));
    Ok(tracer)
}

/// Finds the light transport matrix in the cache or traces it, and says what that took.
pub(super) fn assemble(
    tracer: &mut Tracer,
    scene: &Scene,
    trace: &TraceArgs,
    channels: Channels,
    console: &Console,
) -> Result<Assembled> {
    assemble_layers(tracer, scene, trace, channels, false, console)
}

/// As [`assemble`]; if `split`, the second bounce is a layer of its own.
pub(super) fn assemble_layers(
    tracer: &mut Tracer,
    scene: &Scene,
    trace: &TraceArgs,
    channels: Channels,
    split: bool,
    console: &Console,
) -> Result<Assembled> {
    let start = Instant::now();
    let settings = trace.settings_for(scene);
    let cache = trace.cache.open();
    let key = Key::new(scene, tracer.adapter(), &settings, channels, split);
    let cached = look_up(cache.as_ref(), &key, console);
    let is_new = cached.is_none();
    let traced = match cached {
        Some(cached) => cached,
        None => {
            let bar = console.bar("tracing");
            transport::assemble_layers(tracer, &settings, channels, split, &mut |progress| {
                bar.at(progress.done, progress.total)
            })?
        }
    };
    if is_new {
        say_traced(&traced.summary, console)?;
    } else {
        console
            .say(format_args!("traced    {} light paths, from the cache", grouped(traced.summary.paths)))?;
    }
    console.say(format_args!(
        "matrix    {} entries, {:.1} MiB, {:.2} s in all",
        grouped(traced.matrix.nonzeros() as u64),
        traced.matrix.bytes() as f64 / f64::from(1 << 20),
        start.elapsed().as_secs_f64()
    ))?;
    noise::say_noise(traced.noise.as_ref(), console)?;
    // What cannot be kept is no reason to fail: the next run traces again.
    if let Some(cache) = cache.filter(|_| is_new) {
        match cache.store(&key, &traced) {
            Ok(true) => {
                console.detail(format_args!("cache     {} in {}", key.hex(), cache.folder().display()));
            }
            Ok(false) => console.detail("cache     not kept: larger than the cache"),
            Err(error) => console.note(format_args!("note: the matrix is not kept for later runs: {error}")),
        }
    }
    Ok(traced)
}

/// The matrix from the cache, if it is there and whole.
pub(super) fn look_up(cache: Option<&Cache>, key: &Key, console: &Console) -> Option<Assembled> {
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
pub(super) fn say_traced(summary: &TraceSummary, console: &Console) -> Result<()> {
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

/// A short name for the scene: the file's, or the folder's where the file is just called `scene`.
pub(super) fn short_name(scene: &Scene) -> String {
    let stem = scene.path.file_stem().map(|stem| stem.to_string_lossy().into_owned());
    let folder =
        scene.path.parent().and_then(|folder| folder.file_name()).map(|f| f.to_string_lossy().into_owned());
    match (stem, folder) {
        (Some(stem), Some(folder)) if stem == "scene" => folder,
        (Some(stem), _) => stem,
        (None, _) => "scene".into(),
    }
}

#[cfg(test)]
mod tests {
    #[test]
    fn numbers_are_grouped_by_thousands() {
        assert_eq!([0, 999, 1000, 1048576].map(super::grouped), ["0", "999", "1,000", "1,048,576"]);
    }
}
