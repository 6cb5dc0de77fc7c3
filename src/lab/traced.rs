//! Reports about a traced matrix, and its storage in the cache.

use std::time::Instant;

use super::text::{grouped, percent};
use super::{Log, SharedObserver};
use crate::cache::{Cache, Key};
use crate::render::TraceSummary;
use crate::transport::{Assembled, Noise};

/// Stores a matrix in the cache. A failure is only reported, since the next run can trace again.
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

/// Reports a matrix that took the time since `start`.
pub(super) fn report_matrix(traced: &Assembled, start: Instant, observer: &SharedObserver) {
    observer.info(format_args!(
        "matrix    {} entries, {:.1} MiB, {:.2} s in all",
        grouped(traced.matrix.nonzeros() as u64),
        traced.matrix.bytes() as f64 / f64::from(1 << 20),
        start.elapsed().as_secs_f64()
    ));
    report_noise(traced.noise.as_ref(), observer);
}

fn report_noise(noise: Option<&Noise>, observer: &SharedObserver) {
    let Some(noise) = noise else { return };
    observer.info(format_args!(
        "noise     {} % of the white photo, {} % of the matrix, {} % without direct light",
        percent(noise.white_relative),
        percent(noise.operator),
        percent(noise.global)
    ));
}
