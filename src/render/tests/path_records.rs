//! The records of light paths, for comparisons to the last bit.

use crate::render::strategy::Strategy;
use crate::render::{Batch, TraceSummary, Tracer};

/// The record of one path as bits: rays, direct light, ambient light, and connections (camera pixel,
/// projector pixel, value).
pub(super) type PathRecord = (u64, [u32; 3], [u32; 3], Vec<(u32, u32, [u32; 3])>);

/// The records of all paths of a strategy, in path order.
pub(super) fn path_records(tracer: &mut Tracer, strategy: &Strategy) -> Vec<PathRecord> {
    let mut records = Vec::new();
    let mut visit = |batch: &Batch<'_>| {
        records.extend((0..batch.len()).map(|path| {
            let connections = batch.connections(path).map(|connection| {
                (connection.camera, connection.projector, connection.value.map(f32::to_bits))
            });
            let ambient = batch.ambient(path).unwrap_or_default();
            let [direct, ambient] = [batch.direct(path), ambient].map(|light| light.map(f32::to_bits));
            (batch.rays(path), direct, ambient, connections.collect())
        }));
        Ok(())
    };
    tracer
        .run(
            (strategy, None),
            0..strategy.paths(),
            strategy.paths(),
            &mut TraceSummary::default(),
            &mut visit,
        )
        .expect("the scene can be traced");
    records
}
