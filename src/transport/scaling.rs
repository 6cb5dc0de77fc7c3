//! Predicts from short traces the memory of a matrix or of a photo, and the time and memory of a matrix on several processes.

use std::time::Instant;

use super::assembled::shape;
use super::contributions::Share;
use super::spread::of_share;
use super::{Channels, Part, TransportMatrix};
use crate::error::Result;
use crate::image::Resolution;
use crate::render::{TraceSettings, Tracer};

/// The maximum number of pixels on a side of a pilot trace.
const PILOT_SIDE: usize = 64;

/// The settings of a trace of at most 64×64 pixels with one path each.
pub(super) fn pilot(settings: &TraceSettings) -> TraceSettings {
    let small = |Resolution { width, height }| Resolution::new(width.min(PILOT_SIDE), height.min(PILOT_SIDE));
    TraceSettings {
        resolution: small(settings.resolution),
        projector: settings.projector.map(small),
        samples: 1,
        ..*settings
    }
}

/// The number of paths of this trace, and the mean number of connections per path.
pub(super) fn connections(tracer: &mut Tracer, pilot: &TraceSettings) -> Result<(u64, f64)> {
    let mut connections = 0_usize;
    let summary = tracer.trace(pilot, &mut |batch| {
        connections += (0..batch.len()).map(|path| batch.connections(path).count()).sum::<usize>();
        Ok(())
    })?;
    Ok((summary.paths, connections as f64 / summary.paths.max(1) as f64))
}

/// The predicted size of a matrix. It is an upper bound, but may be too small by the sampling error of the pilot trace.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prediction {
    /// The number of connections.
    pub connections: f64,
    /// The peak memory while the matrix is assembled, in bytes.
    pub bytes: f64,
}

/// Predicts the memory for [`super::assemble()`]. If a bound from the settings alone exceeds `limit` bytes, a pilot of at most 64×64 pixels
/// with one path each is traced, and the tracer's observer sees its steps. The call fails like [`Tracer::trace`].
pub fn predict(
    tracer: &mut Tracer,
    settings: &TraceSettings,
    channels: Channels,
    limit: u64,
) -> Result<Prediction> {
    let symmetric = tracer.symmetric(settings);
    let predict = |per_path| prediction(per_path, settings, channels, symmetric);
    // A path has at most two connections at each surface: a plain one, and one that is gathered through a chain of specular surfaces.
    let most = predict(2.0 * f64::from(settings.max_bounces));
    if most.bytes <= limit as f64 {
        return Ok(most);
    }
    let (_, per_path) = connections(tracer, &pilot(settings))?;
    // A few thousand paths determine the mean to a few per cent.
    Ok(predict(1.05 * per_path))
}

/// The largest fraction of all rows that becomes tiles at the same time, on up to four cores.
const LARGEST_GROUP: f64 = 0.125;

fn prediction(per_path: f64, settings: &TraceSettings, channels: Channels, symmetric: bool) -> Prediction {
    let pixels = settings.resolution.pixels() as f64;
    let projector = settings.projector.unwrap_or(settings.resolution).pixels() as f64;
    let paths = pixels * f64::from(settings.samples);
    let channels = channels.count() as f64;
    let pairs = pixels * projector;
    // Paths of one endpoint give these entries. The other endpoint, or the mirror images in a coaxial rig, gives as many again. There
    // cannot be more entries than pairs of pixels.
    let from_one_end = (per_path * paths).min(pairs);
    let rows = if symmetric { from_one_end } else { 2.0 * from_one_end };
    // While entries are summed pixel by pixel, each has a key, a mean and an error. In tiles, each entry has a 16-bit column and a weight;
    // heads and padding of the slices take at most three more bytes per entry. While a group of rows becomes tiles, its columns and weights
    // are in memory twice.
    let entries = (2.0 * from_one_end).min(pairs);
    let (found, tiles) = (rows * (4.0 + 8.0 * channels), entries * (5.0 + 4.0 * channels));
    let group = LARGEST_GROUP * entries * 2.0 * (4.0 + 4.0 * channels);
    // For a coaxial rig, contributions are freed while the tiles grow.
    let bytes = group + if symmetric { found.max(tiles) } else { found + tiles };
    Prediction { connections: per_path * paths * if symmetric { 1.0 } else { 2.0 }, bytes }
}

/// The memory in bytes of a photo that is traced without a matrix. It is the sum of a constant and a part that grows with the pixels:
/// patterns, sums over the light paths, and results. Measured photos of 512² to 2048² pixels took 1 to 10 % less.
pub fn photo_bytes(settings: &TraceSettings, channels: Channels) -> u64 {
    let camera = settings.resolution.pixels() as u64;
    let projector = settings.projector.unwrap_or(settings.resolution).pixels() as u64;
    let per_pixel = match channels {
        Channels::Luma => 100,
        Channels::Rgb => 160,
    };
    (128 << 20) + per_pixel * camera.max(projector)
}

/// The limits of the probe's trace: the number of pixels on its longer side, and the number of samples.
const SIDE: usize = 128;
const SAMPLES: u32 = 64;
const REPEATS: u32 = 5;
/// The number of entries of the timed vectors, which do not fit into the caches.
const LONG: usize = 1 << 21;

/// The memory in bytes of a process without a matrix: the program, software Vulkan and its kernels. Measured on Debian 12.
const BASE: f64 = 130e6;
/// The fraction of all rows that is merged and becomes tiles at the same time.
const GROUP: f64 = 1.0 / 16.0;
/// The ratio of peak memory to the size of the arrays in use at that time. It exceeds 1 because allocators keep freed memory. With 512x512
/// pixels and 256 samples, ratios of 1.0 in a single process and of 0.9 to 1.1 in each of four processes were measured.
const SLACK: f64 = 1.1;

/// The measured constants of a scene on this machine. Times are those of all cores of this process together.
#[derive(Clone, Copy, Debug, serde::Serialize)]
pub struct Probe {
    /// Seconds to trace a light path.
    pub path: f64,
    /// Connections of a light path.
    pub connections: f64,
    /// The fraction of all pixels that the paths of a pixel reach, under the assumption that they reach these pixels equally often. It
    /// determines how many connections add to the same entry.
    pub reached: f64,
    /// Seconds to merge an entry into the matrix.
    pub merge: f64,
    /// Seconds to multiply an entry.
    pub multiply: f64,
    /// Seconds per entry to orthogonalize a vector against one other vector.
    pub orthogonalize: f64,
}

/// The network between the machines.
#[derive(Clone, Copy, Debug, serde::Serialize)]
pub struct Network {
    /// Bytes that a process can send per second.
    pub bandwidth: f64,
    /// Seconds between sending a short message and receiving it.
    pub latency: f64,
}

/// The time in seconds and the memory in bytes of a computation on several processes. Each process is assumed to be as fast as the process
/// of the probe.
#[derive(Clone, Copy, Debug, serde::Serialize)]
pub struct Scaled {
    /// The number of processes.
    pub processes: usize,
    /// The entries of the whole matrix.
    pub entries: f64,
    /// The peak memory of a process while the matrix is assembled.
    pub memory: f64,
    /// The memory that the leader needs for its vectors.
    pub vectors_memory: f64,
    /// The time of tracing.
    pub tracing: f64,
    /// The time of merging contributions.
    pub merging: f64,
    /// The time of exchanging contributions.
    pub exchange: f64,
    /// The time of the products for all photos.
    pub products: f64,
    /// The time of sending patterns and receiving photos.
    pub messages: f64,
    /// The time of the Krylov method's vector operations, which the leader does alone.
    pub vectors: f64,
}

impl Scaled {
    /// The total time.
    pub fn seconds(&self) -> f64 {
        self.parts().iter().map(|(_, seconds)| seconds).sum()
    }

    /// The name of the part that takes the longest.
    pub fn binds(&self) -> &'static str {
        self.parts().into_iter().max_by(|a, b| a.1.total_cmp(&b.1)).map_or("", |(name, _)| name)
    }

    fn parts(&self) -> [(&'static str, f64); 6] {
        [
            ("tracing", self.tracing),
            ("merging", self.merging),
            ("exchange", self.exchange),
            ("products", self.products),
            ("messages", self.messages),
            ("vectors", self.vectors),
        ]
    }
}

impl Probe {
    /// Assembles a small matrix of the scene in this process, and measures the time of each step. It fails like [`Tracer::trace`].
    pub fn measure(tracer: &mut Tracer, settings: &TraceSettings) -> Result<Self> {
        let small = |size: Resolution| {
            let scale = (SIDE as f64 / size.width.max(size.height) as f64).min(1.0);
            let side = |pixels: usize| ((pixels as f64 * scale) as usize).max(1);
            Resolution::new(side(size.width), side(size.height))
        };
        let pilot = TraceSettings {
            resolution: small(settings.resolution),
            projector: settings.projector.map(small),
            samples: 1,
            ..*settings
        };
        // This trace also compiles the kernels, so the next trace measures tracing alone.
        let (paths, per_path) = connections(tracer, &pilot)?;
        let pilot = TraceSettings { samples: settings.samples.min(SAMPLES), ..pilot };
        let all = tracer.start_pixels(&pilot);
        let start = Instant::now();
        let share = Share::<1>::trace(tracer, &pilot, &all, false, None)?;
        let summary = share.summary;
        let found: usize = share.found.chunks().map(|chunk| chunk.terms.len()).sum();
        let matrix = of_share(share, shape(tracer, &pilot), Channels::Luma, false)?.matrix;
        let rest = start.elapsed().saturating_sub(summary.tracing).as_secs_f64();
        let entries = matrix.nonzeros().max(1) as f64;
        let starts = (paths as f64).max(1.0);
        let ends = matrix.projector_resolution().pixels() as f64;
        Ok(Self {
            path: summary.tracing.as_secs_f64() / summary.paths.max(1) as f64,
            connections: per_path,
            reached: reached(per_path * f64::from(pilot.samples), found as f64 / starts, ends),
            merge: rest / entries,
            multiply: product_seconds(&matrix) / entries,
            orthogonalize: vector_seconds(),
        })
    }

    /// Predicts the time and memory of `photos` photos by a Krylov method on `processes` processes. Each photo is one product. Its vector
    /// is orthogonalized twice against all earlier vectors.
    pub fn scaled(
        &self,
        settings: &TraceSettings,
        channels: Channels,
        symmetric: bool,
        photos: usize,
        (processes, network): (usize, Network),
    ) -> Scaled {
        let camera = settings.resolution.pixels() as f64;
        let projector = settings.projector.unwrap_or(settings.resolution).pixels() as f64;
        let (channels, photos, count) = (channels.count() as f64, photos as f64, processes as f64);
        let paths = camera * f64::from(settings.samples) * if symmetric { 1.0 } else { 2.0 };
        // The number of entries in a row from the paths of `times` endpoints. In a coaxial rig, the mirror images count as a second
        // endpoint.
        let of_row = |times: f64| {
            let reached = (self.reached * projector).max(1.0);
            reached * (1.0 - (-times * self.connections * f64::from(settings.samples) / reached).exp())
        };
        let entries = camera * of_row(2.0);
        let found = camera * of_row(1.0) * if symmetric { 1.0 } else { 2.0 };
        let contribution = 4.0 + 8.0 * channels;
        let entry = 4.0 + 4.0 * channels;
        let away = (count - 1.0) / count;
        // In tiles, columns take half the memory, and padding adds a twentieth. A group of rows that becomes tiles is in memory two more
        // times.
        let tiled = entries / count * (1.05 * (entry - 2.0));
        let group = GROUP * entries / count * 2.0 * entry;
        let own = found / count * contribution;
        let memory = if processes == 1 && !symmetric {
            group + tiled + own
        } else {
            // Contributions are freed while the tiles grow. The contributions of one step are in memory three more times: as sent, as
            // received and as merged.
            group + tiled.max(own) + 3.0 * own * away * GROUP
        };
        let message = |bytes: f64, steps: f64| steps * (bytes / network.bandwidth + network.latency);
        let is_team = if processes > 1 { 1.0 } else { 0.0 };
        Scaled {
            processes,
            entries,
            memory: BASE + SLACK * memory,
            vectors_memory: 8.0 * photos * camera * channels,
            tracing: paths * self.path / count,
            merging: entries * self.merge / count,
            exchange: found / count * contribution * away / network.bandwidth,
            products: photos * channels * entries * self.multiply / count,
            messages: is_team
                * photos
                * channels
                * (message(8.0 * projector, count.log2().ceil()) + message(8.0 * camera * away, 1.0)),
            vectors: 2.0 * channels * photos * photos / 2.0 * camera * self.orthogonalize,
        }
    }
}

/// The fraction of the `ends` pixels that a pixel's paths can reach, if `connections` connections hit `found` different pixels. All
/// reachable pixels are assumed to be equally likely.
fn reached(connections: f64, found: f64, ends: f64) -> f64 {
    let hit = |share: f64| {
        let reached = share * ends;
        reached * (1.0 - (-connections / reached).exp())
    };
    let (mut low, mut high) = (found / ends, 1.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if hit(middle) < found { low = middle } else { high = middle }
    }
    high.clamp(f64::MIN_POSITIVE, 1.0)
}

fn product_seconds(matrix: &TransportMatrix) -> f64 {
    let x = vec![1.0; matrix.projector_resolution().pixels()];
    let mut y = vec![0.0; matrix.resolution().pixels()];
    matrix.apply(Part::Full, 0, &x, &mut y);
    let start = Instant::now();
    (0..REPEATS).for_each(|_| matrix.apply(Part::Full, 0, &x, &mut y));
    std::hint::black_box(y);
    start.elapsed().as_secs_f64() / f64::from(REPEATS)
}

/// The time in seconds, per entry, to subtract from a vector its component along another vector.
fn vector_seconds() -> f64 {
    let (mut x, y) = (vec![1.0; LONG], vec![0.5; LONG]);
    let start = Instant::now();
    for _ in 0..REPEATS {
        let along: f64 = x.iter().zip(&y).map(|(x, y)| x * y).sum();
        x.iter_mut().zip(&y).for_each(|(x, y)| *x -= 1e-9 * along * y);
    }
    std::hint::black_box(x);
    start.elapsed().as_secs_f64() / f64::from(REPEATS) / LONG as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    const PROBE: Probe = Probe {
        path: 2e-7,
        connections: 2.5,
        reached: 0.5,
        merge: 3e-8,
        multiply: 1e-9,
        orthogonalize: 1e-9,
    };
    const NETWORK: Network = Network { bandwidth: 1.25e9, latency: 2e-5 };

    fn scaled(side: usize, samples: u32, processes: usize) -> Scaled {
        let settings = TraceSettings::new(Resolution::new(side, side), samples);
        PROBE.scaled(&settings, Channels::Luma, true, 50, (processes, NETWORK))
    }

    #[test]
    fn work_and_memory_are_divided_and_messages_are_not() {
        let [one, eight] = [1, 8].map(|processes| scaled(512, 256, processes));
        assert_eq!(one.entries, eight.entries);
        assert!((one.tracing / eight.tracing - 8.0).abs() < 1e-9);
        assert!((eight.memory - BASE) < 0.35 * (one.memory - BASE));
        assert_eq!((one.messages, one.exchange), (0.0, 0.0));
        assert!(eight.messages > 0.0 && eight.vectors == one.vectors);
        assert_eq!(scaled(2048, 64, 64).binds(), "vectors", "what one process does alone binds in the end");
    }

    #[test]
    fn a_matrix_has_no_more_entries_than_the_pixels_that_are_reached() {
        let full = scaled(32, 1 << 20, 1);
        assert!((full.entries - 0.5 * 1024.0 * 1024.0).abs() < 1.0, "{}", full.entries);
        // With few samples, nearly all entries are different, so doubling the paths doubles the entries.
        let [few, more] = [1, 2].map(|samples| scaled(512, samples, 1).entries);
        assert!((more / few - 2.0).abs() < 1e-3);
    }

    /// A rig that is not coaxial: 10×10 by 20×10 pixels in color, four samples, six photos, four processes, calculated by hand.
    #[test]
    fn every_part_is_what_its_counts_make() {
        let probe = Probe {
            path: 2.0,
            connections: 3.0,
            reached: 0.25,
            merge: 5.0,
            multiply: 7.0,
            orthogonalize: 11.0,
        };
        let network = Network { bandwidth: 1000.0, latency: 0.5 };
        let projector = Some(Resolution::new(20, 10));
        let settings = TraceSettings { projector, ..TraceSettings::new(Resolution::new(10, 10), 4) };
        let scaled = probe.scaled(&settings, Channels::Rgb, false, 6, (4, network));
        // A row reaches 50 of 200 pixels. They are hit at random by 24 connections: 12 of camera paths and 12 of projector paths.
        let entries = 100.0 * 50.0 * (1.0 - (-24.0_f64 / 50.0).exp());
        let found = 2.0 * 100.0 * 50.0 * (1.0 - (-12.0_f64 / 50.0).exp());
        // A contribution takes 4 bytes for its position and 24 for its values. A matrix entry takes 4 bytes for its column and 12 for its
        // weights, and in a tile 2 and 12 bytes.
        let (own, tiled) = (28.0 * found / 4.0, 1.05 * 14.0 * entries / 4.0);
        assert!(own > tiled, "contributions are the larger of the two");
        // One sixteenth of the rows at a time is merged and becomes tiles. Three quarters of the contributions to these rows come from
        // other processes.
        let memory = own + 2.0 * 16.0 * entries / 4.0 / 16.0 + 3.0 * own * 0.75 / 16.0;
        let expected = [
            (scaled.entries, entries),
            (scaled.memory, BASE + 1.1 * memory),
            (scaled.vectors_memory, 8.0 * 6.0 * 100.0 * 3.0),
            (scaled.tracing, 800.0 * 2.0 / 4.0),
            (scaled.merging, 5.0 * entries / 4.0),
            (scaled.exchange, 28.0 * found / 4.0 * 0.75 / 1000.0),
            (scaled.products, 18.0 * entries * 7.0 / 4.0),
            // The pattern reaches four processes in two steps. One step returns three quarters of the photo.
            (scaled.messages, 18.0 * (2.0 * (1.6 + 0.5) + (0.6 + 0.5))),
            (scaled.vectors, 3.0 * 36.0 * 100.0 * 11.0),
        ];
        for (place, (is, wanted)) in expected.into_iter().enumerate() {
            // The results differ only in the order of additions and products.
            assert!((is - wanted).abs() <= 1e-12 * wanted, "part {place}: {is}, by hand {wanted}");
        }
        // A single process keeps the contributions of both endpoints beside the tiles, and exchanges nothing.
        let alone = probe.scaled(&settings, Channels::Rgb, false, 6, (1, network)).memory;
        let together = 4.0 * (own + tiled) + 2.0 * 16.0 * entries / 16.0;
        assert!((alone - BASE - 1.1 * together).abs() <= 1e-12 * alone, "{alone}, by hand {together}");
        let seconds: f64 = expected[3..].iter().map(|part| part.1).sum();
        assert!((scaled.seconds() - seconds).abs() <= 1e-12 * seconds);
    }

    /// For a coaxial rig, a single process keeps contributions to the triangle (12 bytes each) until they become tiles (6 bytes for each
    /// entry).
    #[test]
    fn one_process_holds_contributions_or_tiles_whichever_are_more() {
        let (side, samples, of_row) = (512.0_f64 * 512.0, 256.0, 0.5 * 512.0 * 512.0);
        let one = scaled(512, 256, 1);
        let entries = side * of_row * (1.0 - (-2.0 * 2.5 * samples / of_row).exp());
        let found = side * of_row * (1.0 - (-2.5 * samples / of_row).exp());
        let tiles = 1.05 * 6.0 * entries;
        let memory = 2.0 * 8.0 * entries / 16.0 + tiles.max(12.0 * found);
        assert!((one.memory - BASE - 1.1 * memory).abs() <= 1e-9 * memory, "{} of {memory}", one.memory);
    }

    #[test]
    fn the_reached_share_explains_the_entries_that_were_found() {
        // 300 connections hit 200 different pixels of 1000.
        let share = reached(300.0, 200.0, 1000.0);
        let hit = share * 1000.0 * (1.0 - (-300.0 / (share * 1000.0)).exp());
        assert!((hit - 200.0).abs() < 1e-6, "{share}");
        assert_eq!(reached(300.0, 300.0, 1000.0), 1.0, "no two hit the same");
    }

    #[test]
    fn memory_grows_with_the_number_of_paths_until_the_matrix_is_full() {
        let settings = |side, samples| TraceSettings::new(Resolution::new(side, side), samples);
        let bytes = |side, samples| prediction(2.5, &settings(side, samples), Channels::Luma, true).bytes;
        assert_eq!(bytes(512, 64), 2.5 * 512.0 * 512.0 * 64.0 * 2.0 * (9.0 + 2.0));
        assert_eq!(bytes(512, 64), 4.0 * bytes(256, 64));
        assert_eq!(bytes(16, 1 << 20), 65536.0 * (12.0 + 2.0), "no more than every pair of pixels");
    }

    /// The rig has three connections per path, two samples, and 8×4 by 16×4 pixels in color. This gives 192 connections from each endpoint,
    /// in 2048 pairs of pixels.
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
