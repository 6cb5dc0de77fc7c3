//! Loading and tracing of a scene: progress, warnings, a check of the memory, reports, and the storage of the matrix in the cache.

use std::ops::ControlFlow;
use std::path::Path;
use std::time::Instant;

use super::text::{bytes, grouped, percent};
use super::{Log, SharedObserver};
use crate::cache::{Cache, Key};
use crate::error::{Error, Result};
use crate::machine;
use crate::observer::{Estimate, Level, Step};
use crate::render::TraceSummary;
use crate::scene::{self, LoadOptions, Scene, Watcher};
use crate::transport::Assembled;

pub(super) fn load(path: &Path, options: LoadOptions<'_>, observer: &SharedObserver) -> Result<Scene> {
    let told = |share: f32| told(observer, READING * share);
    let options = LoadOptions { watcher: Watcher::new(&told), ..options };
    at(observer, 0.0)?;
    let scene = scene::load_with(path, &options)?;
    at(observer, READING)?;
    check(&scene, observer)?;
    Ok(scene)
}

/// Checks the memory that a scene takes, and tells its warnings and its size.
pub(super) fn check(scene: &Scene, observer: &SharedObserver) -> Result<()> {
    require_memory(scene, machine::memory())?;
    for warning in &scene.warnings {
        observer.log(Level::Warning, &format!("warning: {}: {warning}", scene.path.display()));
    }
    observer.detail(format_args!(
        "scene     {} triangles, {} materials, camera `{}`",
        scene.triangles.len(),
        scene.materials.len(),
        scene.camera.name
    ));
    Ok(())
}

/// The bytes of memory per triangle for a scene and its search tree while they are moved to the device. A measurement with 7.7 million
/// triangles gave 640 bytes per triangle, including 152 bytes for the scene itself.
const BYTES_PER_TRIANGLE: u64 = 640;

/// Checks that the search tree of a scene takes no more than `most` bytes of memory.
fn require_memory(scene: &Scene, most: u64) -> Result<()> {
    let needed = scene.triangles.len() as u64 * BYTES_PER_TRIANGLE;
    if needed <= most {
        return Ok(());
    }
    let fault = format!(
        "its {} triangles take about {} of memory, more than the {} that there are",
        grouped(scene.triangles.len() as u64),
        bytes(needed),
        bytes(most)
    );
    Err(Error::scene(&scene.path, fault)
        .help("simplify the meshes, place fewer of them, or use a machine with more memory"))
}

/// The fraction of the loading progress that counts for reading the files. Building the search tree counts for the rest.
const READING: f32 = 0.5;

/// Works like [`told`], but a stop is returned as an error.
pub(super) fn at(observer: &SharedObserver, share: f32) -> Result<()> {
    if told(observer, share).is_break() { Err(Error::Interrupted) } else { Ok(()) }
}

/// Tells the observer the progress of loading a scene: 0 at the start, [`READING`] after the files, and 1 after the search tree. Returns
/// whether to continue.
fn told(observer: &SharedObserver, share: f32) -> ControlFlow<()> {
    let done = (100.0 * share) as u64;
    observer.0.step(&Step { stage: "loading", done, total: 100, estimate: Estimate::None })
}

/// Stores a matrix in the cache. A failure is only reported, since the next run can trace the matrix again.
pub(super) fn store(cache: &Cache, key: &Key, traced: &Assembled, observer: &SharedObserver) {
    match cache.store(key, traced) {
        Ok(true) => {
            observer.detail(format_args!("cache     {} in {}", key.hex(), cache.folder().display()));
        }
        Ok(false) => observer.detail(format_args!("cache     not kept: larger than the cache")),
        Err(error) => {
            observer.note(format_args!("note: the matrix is not kept for later runs: {error}"));
        }
    }
}

pub(super) fn report_trace(summary: &TraceSummary, observer: &SharedObserver) {
    let seconds = summary.tracing.as_secs_f64();
    observer.detail(format_args!(
        "dispatch  {} of them, the longest {:.0} ms",
        summary.dispatches,
        summary.longest.as_secs_f64() * 1e3
    ));
    observer.info(format_args!(
        "traced    {} light paths, {} rays in {seconds:.2} s ({:.2} M rays/s)",
        grouped(summary.paths),
        grouped(summary.rays),
        summary.rays as f64 / seconds.max(1e-9) / 1e6
    ));
}

/// Reports the size and the noise of a matrix, and the time since `start`.
pub(super) fn report_matrix(traced: &Assembled, start: Instant, observer: &SharedObserver) {
    observer.info(format_args!(
        "matrix    {} entries, {:.1} MiB, {:.2} s in all",
        grouped(traced.matrix.nonzeros() as u64),
        traced.matrix.bytes() as f64 / f64::from(1 << 20),
        start.elapsed().as_secs_f64()
    ));
    let Some(noise) = &traced.noise else { return };
    observer.info(format_args!(
        "noise     {} % of the white photo, {} % of the matrix, {} % without direct light",
        percent(noise.white_relative),
        percent(noise.operator),
        percent(noise.global)
    ));
}
