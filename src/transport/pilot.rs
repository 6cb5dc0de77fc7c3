//! A small trace that tells what a large one will meet.

use crate::error::Result;
use crate::image::Resolution;
use crate::render::{TraceSettings, Tracer};

/// Pixels on each side.
const SIDE: usize = 64;

/// The settings of a trace of at most 64×64 pixels with one path each.
pub(super) fn of(settings: &TraceSettings) -> TraceSettings {
    let small = |Resolution { width, height }| Resolution::new(width.min(SIDE), height.min(SIDE));
    TraceSettings {
        resolution: small(settings.resolution),
        projector: settings.projector.map(small),
        samples: 1,
        ..*settings
    }
}

/// The number of paths of this trace, and their mean number of connections.
///
/// # Errors
/// As [`Tracer::trace`].
pub(super) fn connections(tracer: &mut Tracer, pilot: &TraceSettings) -> Result<(u64, f64)> {
    let mut connections = 0_usize;
    let summary = tracer.trace(pilot, &mut |batch| {
        connections += (0..batch.len()).map(|path| batch.connections(path).count()).sum::<usize>();
        Ok(())
    })?;
    Ok((summary.paths, connections as f64 / summary.paths.max(1) as f64))
}
