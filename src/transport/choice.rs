//! How much memory a matrix will need, before it is traced.

use super::Channels;
use crate::error::Result;
use crate::image::Resolution;
use crate::render::{TraceSettings, Tracer};

/// Pixels on a side of the pilot that counts connections.
const PILOT: usize = 64;

/// What assembling the matrix will need at its peak, in bytes, as far as the pilot's count goes; more than that never.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prediction {
    /// Connections in all.
    pub connections: f64,
    /// Bytes of memory at the peak.
    pub bytes: f64,
}

/// Predicts the memory for [`super::assemble()`]. Only where it could exceed `limit` bytes does it trace: one path from each
/// of at most 64×64 pixels. The tracer's observer sees the steps.
///
/// # Errors
/// As [`Tracer::trace`].
pub fn predict(
    tracer: &mut Tracer,
    settings: &TraceSettings,
    channels: Channels,
    limit: u64,
) -> Result<Prediction> {
    let symmetric = tracer.symmetric(settings);
    let predict = |per_path| prediction(per_path, settings, channels, symmetric);
    // Besides the plain one, a surface may have a connection through a specular chain.
    let most = predict(2.0 * f64::from(settings.max_bounces));
    if most.bytes <= limit as f64 {
        return Ok(most);
    }
    let small = |Resolution { width, height }| Resolution::new(width.min(PILOT), height.min(PILOT));
    let pilot = TraceSettings {
        resolution: small(settings.resolution),
        projector: settings.projector.map(small),
        samples: 1,
        ..*settings
    };
    let mut connections = 0_usize;
    let summary = tracer.trace(&pilot, &mut |batch| {
        connections += (0..batch.len()).map(|path| batch.connections(path).count()).sum::<usize>();
        Ok(())
    })?;
    // A few thousand paths tell the mean to some per cent.
    Ok(predict(1.05 * connections as f64 / summary.paths.max(1) as f64))
}

fn prediction(per_path: f64, settings: &TraceSettings, channels: Channels, symmetric: bool) -> Prediction {
    let pixels = settings.resolution.pixels() as f64;
    let projector = settings.projector.unwrap_or(settings.resolution).pixels() as f64;
    let paths = pixels * f64::from(settings.samples);
    let channels = channels.count() as f64;
    let pairs = pixels * projector;
    // Paths come from both ends, or each connection has a mirror image. None has more entries than there are pairs of pixels.
    let from_one_end = (per_path * paths).min(pairs);
    let rows = if symmetric { from_one_end } else { 2.0 * from_one_end };
    // Added up pixel by pixel they have a key, a mean and an error each; in the matrix's rows, a column and a weight. They become its rows, and
    // these its tiles, where columns are half as wide, but slices have a head and are filled up: at most three bytes an entry of its own.
    let entries = (2.0 * from_one_end).min(pairs);
    let (matrix, tiles) = (entries * (4.0 + 4.0 * channels), entries * (5.0 + 4.0 * channels));
    let bytes = matrix + tiles.max(rows * (4.0 + 8.0 * channels));
    Prediction { connections: per_path * paths * if symmetric { 1.0 } else { 2.0 }, bytes }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_grows_with_paths_until_the_matrix_is_full() {
        let settings = |side, samples| TraceSettings::new(Resolution::new(side, side), samples);
        let bytes = |side, samples| prediction(2.5, &settings(side, samples), Channels::Luma, true).bytes;
        assert_eq!(bytes(512, 64), 2.5 * 512.0 * 512.0 * 64.0 * 2.0 * (8.0 + 9.0));
        assert_eq!(bytes(512, 64), 4.0 * bytes(256, 64));
        assert_eq!(bytes(16, 1 << 20), 65536.0 * (8.0 + 12.0), "no more than every pair of pixels");
    }
}
