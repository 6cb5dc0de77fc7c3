//! A small trace that shows what a large one will meet, and the prediction of the memory that a matrix will need.

use super::Channels;
use crate::error::Result;
use crate::image::Resolution;
use crate::render::{TraceSettings, Tracer};

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
pub(super) fn connections(tracer: &mut Tracer, pilot: &TraceSettings) -> Result<(u64, f64)> {
    let mut connections = 0_usize;
    let summary = tracer.trace(pilot, &mut |batch| {
        connections += (0..batch.len()).map(|path| batch.connections(path).count()).sum::<usize>();
        Ok(())
    })?;
    Ok((summary.paths, connections as f64 / summary.paths.max(1) as f64))
}

/// The predicted size of a matrix. It is an upper bound, apart from the sampling error of the pilot trace.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prediction {
    /// The number of connections.
    pub connections: f64,
    /// The peak memory while the matrix is assembled, in bytes.
    pub bytes: f64,
}

/// Predicts the memory for [`super::assemble()`]. If it could exceed `limit` bytes, a pilot of at most 64×64 pixels with one path each is
/// traced, and the tracer's observer sees its steps. The call fails like [`Tracer::trace`].
pub fn predict(
    tracer: &mut Tracer,
    settings: &TraceSettings,
    channels: Channels,
    limit: u64,
) -> Result<Prediction> {
    let symmetric = tracer.symmetric(settings);
    let predict = |per_path| prediction(per_path, settings, channels, symmetric);
    // A surface has at most two connections: a plain one, and a gathered one through a specular chain.
    let most = predict(2.0 * f64::from(settings.max_bounces));
    if most.bytes <= limit as f64 {
        return Ok(most);
    }
    let (_, per_path) = connections(tracer, &of(settings))?;
    // A few thousand paths determine the mean to a few per cent.
    Ok(predict(1.05 * per_path))
}

/// The largest share of the rows that become tiles at the same time, on up to four cores.
const GROUP: f64 = 0.125;

fn prediction(per_path: f64, settings: &TraceSettings, channels: Channels, symmetric: bool) -> Prediction {
    let pixels = settings.resolution.pixels() as f64;
    let projector = settings.projector.unwrap_or(settings.resolution).pixels() as f64;
    let paths = pixels * f64::from(settings.samples);
    let channels = channels.count() as f64;
    let pairs = pixels * projector;
    // Paths come from both endpoints, or each connection has a mirror image. There cannot be more entries than pairs of pixels.
    let from_one_end = (per_path * paths).min(pairs);
    let rows = if symmetric { from_one_end } else { 2.0 * from_one_end };
    // When entries are summed pixel by pixel, each has a key, a mean and an error. In tiles, each has a 16-bit column and a weight; heads
    // and padding of the slices take at most three more bytes. In between, a group of rows has its columns and weights in memory twice.
    let entries = (2.0 * from_one_end).min(pairs);
    let (found, tiles) = (rows * (4.0 + 8.0 * channels), entries * (5.0 + 4.0 * channels));
    let group = GROUP * entries * 2.0 * (4.0 + 4.0 * channels);
    // The contributions to a triangle are freed while the tiles grow.
    let bytes = group + if symmetric { found.max(tiles) } else { found + tiles };
    Prediction { connections: per_path * paths * if symmetric { 1.0 } else { 2.0 }, bytes }
}

/// The memory in bytes of a photo that is traced without a matrix. One part grows with the pixels: patterns, sums over the light paths
/// and results. The other part is constant. Measured photos of 512² to 2048² pixels took 1 to 10 % less.
pub fn photo_bytes(settings: &TraceSettings, channels: Channels) -> u64 {
    let camera = settings.resolution.pixels() as u64;
    let projector = settings.projector.unwrap_or(settings.resolution).pixels() as u64;
    let per_pixel = match channels {
        Channels::Luma => 100,
        Channels::Rgb => 160,
    };
    (128 << 20) + per_pixel * camera.max(projector)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_grows_with_the_number_of_paths_until_the_matrix_is_full() {
        let settings = |side, samples| TraceSettings::new(Resolution::new(side, side), samples);
        let bytes = |side, samples| prediction(2.5, &settings(side, samples), Channels::Luma, true).bytes;
        assert_eq!(bytes(512, 64), 2.5 * 512.0 * 512.0 * 64.0 * 2.0 * (9.0 + 2.0));
        assert_eq!(bytes(512, 64), 4.0 * bytes(256, 64));
        assert_eq!(bytes(16, 1 << 20), 65536.0 * (12.0 + 2.0), "no more than every pair of pixels");
    }

    /// Three connections per path, two samples, 8×4 by 16×4 pixels in color: 192 connections from each end, in 2048 pairs of pixels.
    #[test]
    fn a_rig_apart_holds_contributions_of_both_ends_and_the_tiles() {
        let projector = Some(Resolution::new(16, 4));
        let settings = TraceSettings { projector, ..TraceSettings::new(Resolution::new(8, 4), 2) };
        let apart = prediction(3.0, &settings, Channels::Rgb, false);
        let (found, tiles, group) = (384.0 * 28.0, 384.0 * 17.0, 384.0 * 2.0 * 16.0 / 8.0);
        assert_eq!(apart, Prediction { connections: 384.0, bytes: group + found + tiles });
        // In a coaxial rig every connection has a mirror image, and tiles replace contributions.
        let coaxial = prediction(3.0, &TraceSettings { projector: None, ..settings }, Channels::Rgb, true);
        assert_eq!(coaxial, Prediction { connections: 192.0, bytes: group + tiles });
    }

    #[test]
    fn a_photo_takes_its_pixels_and_what_is_always_there() {
        let camera = TraceSettings::new(Resolution::new(512, 256), 4);
        let with = |projector| TraceSettings { projector, ..camera };
        let always = 134_217_728;
        assert_eq!(photo_bytes(&camera, Channels::Luma), always + 100 * 131_072);
        assert_eq!(photo_bytes(&with(Some(Resolution::new(8, 8))), Channels::Rgb), always + 160 * 131_072);
        let larger = with(Some(Resolution::new(1024, 256)));
        assert_eq!(photo_bytes(&larger, Channels::Rgb), always + 160 * 262_144);
    }
}
