//! Shards of a matrix: the light paths from some pixels, traced by themselves, and the matrix of all of them together.
//!
//! A matrix is the sum over its light paths, pixel by pixel. Machines that know nothing of each other trace the paths of some pixels each; the
//! contributions of all of them, in the order of the pixels, are what one machine combines to the matrix, so that all bits are the same.

use std::io::{self, Read, Write};

use super::assemble::{shape, whole};
use super::chunk::Chunk;
use super::found::Found;
use super::share::Share;
use super::wire::{self, Garbled};
use super::{Assembled, Channels, RigShape, luminance};
use crate::error::{Error, Result};
use crate::image::Resolution;
use crate::render::{StartPixels, TraceSettings, TraceSummary, Tracer};

/// The most parts that a matrix is traced in.
pub const MOST_PARTS: usize = 1 << 16;

/// The longest side of a camera or projector, as for [`TraceSettings::check`].
const LONGEST_SIDE: usize = 16384;

/// What is known of a shard beside its contributions.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub struct ShardRecord {
    /// Which of the parts it is, from 1 to `parts`.
    pub part: usize,
    /// The number of parts that all light paths are cut into.
    pub parts: usize,
    /// The shape of the whole matrix.
    pub rig: RigShape,
    /// The channels of the matrix.
    pub channels: Channels,
    /// Whether the second bounce and all later ones are layers apart.
    pub split: bool,
    /// The pixels whose paths it has.
    pub pixels: StartPixels,
    /// Whether each endpoint has paths in both halves of the samples, so that the noise is known.
    pub has_halves: bool,
    /// The cost of tracing.
    pub summary: TraceSummary,
}

/// The contributions of the light paths from some pixels to a matrix, summed pixel by pixel.
#[derive(Clone, Debug)]
pub struct Shard {
    record: ShardRecord,
    sums: Sums,
}

/// The contributions in one channel, or in three.
#[derive(Clone, Debug)]
enum Sums {
    Luma(OfPixels<1>),
    Rgb(OfPixels<3>),
}

/// Contributions, and the sums over the paths of each camera pixel. `direct` is empty where the projector stands apart.
#[derive(Clone, Debug)]
struct OfPixels<const C: usize> {
    /// From the camera's pixels, and from those of a projector that stands apart.
    chunks: [Vec<Chunk<C>>; 2],
    direct: Vec<[[f64; 2]; C]>,
    ambient: Vec<[[f64; 2]; C]>,
}

/// Traces the light paths of part `part` (from 1) of `parts`. `split` is as in [`assemble_layers`](super::assemble_layers).
///
/// # Errors
/// [`Error::Option`] naming `--shard` where there is no such part; as [`Tracer::trace`].
pub fn trace_shard(
    tracer: &mut Tracer,
    settings: &TraceSettings,
    channels: Channels,
    split: bool,
    (part, parts): (usize, usize),
) -> Result<Shard> {
    settings.check()?;
    if !(1..=parts).contains(&part) || parts > MOST_PARTS {
        return Err(Error::Option {
            option: "--shard".into(),
            fault: format!("there is no part {part} of {parts}"),
            help: format!(
                "give a part from 1 to the number of parts, which is {MOST_PARTS} at most, e.g. --shard 3/16"
            ),
        });
    }
    let rig = shape(tracer, settings);
    let pixels = tracer.start_pixels(settings).split(parts).swap_remove(part - 1);
    let mut record = ShardRecord {
        part,
        parts,
        rig,
        channels,
        split,
        pixels,
        has_halves: true,
        summary: TraceSummary::default(),
    };
    let sums = match channels {
        Channels::Luma => Sums::Luma(OfPixels::trace(tracer, settings, &mut record, |rgb| [luminance(rgb)])?),
        Channels::Rgb => Sums::Rgb(OfPixels::trace(tracer, settings, &mut record, |rgb| rgb)?),
    };
    Ok(Shard { record, sums })
}

/// The matrix of all shards, which may be in any order: the same bits as [`assemble_layers`](super::assemble_layers). The time of tracing is that of
/// the shard that took longest.
///
/// # Errors
/// [`Error::Dimension`] where they are not all parts of one matrix, each of them once.
pub fn join_shards(mut shards: Vec<Shard>) -> Result<Assembled> {
    shards.sort_by_key(|shard| shard.record.part);
    let found: Vec<String> =
        shards.iter().map(|Shard { record, .. }| format!("{} of {}", record.part, record.parts)).collect();
    let Some(first) = shards.first().map(|shard| shard.record.clone()) else {
        return Err(Error::Dimension {
            what: "shards",
            expected: "all parts of a matrix".into(),
            found: "none".into(),
        });
    };
    let fits = |(index, shard): (usize, &Shard)| {
        let record = &shard.record;
        (record.part, record.parts) == (index + 1, first.parts)
            && (record.rig, record.channels, record.split) == (first.rig, first.channels, first.split)
    };
    if shards.len() != first.parts || !shards.iter().enumerate().all(fits) {
        return Err(Error::Dimension {
            what: "shards",
            expected: format!("parts 1 to {} of one matrix, each once", first.parts),
            found: format!("parts {}", found.join(", ")),
        });
    }
    let mut summary = TraceSummary::default();
    let mut has_halves = true;
    let (mut luma, mut rgb) = (Vec::new(), Vec::new());
    for Shard { record, sums } in shards {
        summary.add_parallel(&record.summary);
        has_halves &= record.has_halves;
        match sums {
            Sums::Luma(sums) => luma.push(sums),
            Sums::Rgb(sums) => rgb.push(sums),
        }
    }
    let ShardRecord { rig, channels, split, .. } = first;
    match channels {
        Channels::Luma => whole(OfPixels::share(luma, has_halves, summary), rig, channels, split),
        Channels::Rgb => whole(OfPixels::share(rgb, has_halves, summary), rig, channels, split),
    }
}

impl Shard {
    /// What is known of it beside its contributions.
    pub fn record(&self) -> &ShardRecord {
        &self.record
    }

    /// Whether two shards have the same contributions to the last bit, whatever it took to trace them.
    pub fn has_bits_of(&self, other: &Self) -> bool {
        match (&self.sums, &other.sums) {
            (Sums::Luma(a), Sums::Luma(b)) => a.has_bits_of(b),
            (Sums::Rgb(a), Sums::Rgb(b)) => a.has_bits_of(b),
            _ => false,
        }
    }

    /// Writes the contributions, without the record.
    ///
    /// # Errors
    /// Those of `to`.
    pub fn write(&self, to: &mut impl Write) -> io::Result<()> {
        match &self.sums {
            Sums::Luma(sums) => sums.write(&self.record, to),
            Sums::Rgb(sums) => sums.write(&self.record, to),
        }
    }

    /// Reads the contributions of a shard with this record, which are the next `bytes` bytes. `Err` says what is wrong with them: they may be anything.
    pub fn read(record: ShardRecord, from: &mut impl Read, bytes: u64) -> std::result::Result<Self, String> {
        record.check()?;
        let mut from = wire::Reader::of(from, bytes);
        let read = || -> std::result::Result<Sums, Garbled> {
            let sums = match record.channels {
                Channels::Luma => Sums::Luma(OfPixels::read(&record, &mut from)?),
                Channels::Rgb => Sums::Rgb(OfPixels::read(&record, &mut from)?),
            };
            from.end()?;
            Ok(sums)
        };
        read().map(|sums| Self { record: record.clone(), sums }).map_err(|Garbled(why)| why)
    }
}

impl ShardRecord {
    /// Checks that there can be such a shard. `Err` says why not.
    pub fn check(&self) -> std::result::Result<(), String> {
        let RigShape { camera, projector, symmetric } = self.rig;
        let is_size = |Resolution { width, height }| {
            (1..=LONGEST_SIDE).contains(&width) && (1..=LONGEST_SIDE).contains(&height)
        };
        if !(is_size(camera) && is_size(projector)) || symmetric && camera != projector {
            return Err("no camera and projector have these sizes".into());
        }
        if self.parts > MOST_PARTS || !(1..=self.parts).contains(&self.part) {
            return Err(format!("there is no part {} of {}", self.part, self.parts));
        }
        let projector = if symmetric { 0 } else { projector.pixels() };
        let all = StartPixels { camera: 0..camera.pixels(), projector: 0..projector };
        if all.split(self.parts)[self.part - 1] != self.pixels {
            return Err(format!("its pixels are not those of part {} of {}", self.part, self.parts));
        }
        Ok(())
    }

    /// The number of pixels at which paths from the camera end, and those from the projector.
    fn others(&self) -> [usize; 2] {
        [self.rig.projector.pixels(), self.rig.camera.pixels()]
    }
}

impl<const C: usize> OfPixels<C> {
    /// Traces the pixels of the record, and notes there what that took.
    fn trace(
        tracer: &mut Tracer,
        settings: &TraceSettings,
        record: &mut ShardRecord,
        project: impl Fn([f32; 3]) -> [f32; C] + Sync,
    ) -> Result<Self> {
        let share = Share::trace(tracer, settings, &record.pixels, (record.split, None), &project)?;
        (record.has_halves, record.summary) = (share.has_halves, share.summary);
        Ok(Self {
            chunks: Chunk::by_endpoint(share.found.into_chunks()),
            direct: share.direct,
            ambient: share.ambient,
        })
    }

    /// The contributions of all pixels, from parts in their order.
    fn share(parts: Vec<Self>, has_halves: bool, summary: TraceSummary) -> Share<C> {
        let (mut direct, mut ambient) = (Vec::new(), Vec::new());
        let mut chunks = [Vec::new(), Vec::new()];
        for part in parts {
            direct.extend(part.direct);
            ambient.extend(part.ambient);
            chunks.iter_mut().zip(part.chunks).for_each(|(all, more)| all.extend(more));
        }
        let found = Found::of_chunks(chunks.into_iter().flatten().collect());
        Share { found, direct, ambient, has_halves, summary }
    }

    fn write(&self, record: &ShardRecord, to: &mut impl Write) -> io::Result<()> {
        let [camera, projector] = record.others();
        wire::put_chunks(to, &self.chunks[0], true, &(0..camera))?;
        wire::put_chunks(to, &self.chunks[1], false, &(0..projector))?;
        wire::put_estimates(to, &self.direct)?;
        wire::put_estimates(to, &self.ambient)
    }

    fn read(record: &ShardRecord, from: &mut wire::Reader<impl Read>) -> std::result::Result<Self, Garbled> {
        let classes = if record.split { 3 } else { 2 };
        let mut chunk = |from_camera: bool| {
            let chunk = wire::take_chunk::<C>(from, from_camera)?;
            let StartPixels { camera, projector } = &record.pixels;
            let [others_of_camera, others_of_projector] = record.others();
            let (pixels, others) =
                if from_camera { (camera, others_of_camera) } else { (projector, others_of_projector) };
            if chunk.is_of(pixels, others, classes) {
                Ok(chunk)
            } else {
                Err(Garbled("its contributions are not to this matrix".into()))
            }
        };
        let chunks = [vec![chunk(true)?], vec![chunk(false)?]];
        let (direct, ambient) = (wire::take_estimates::<C>(from)?, wire::take_estimates::<C>(from)?);
        let pixels = record.pixels.camera.len();
        let expected = if record.rig.symmetric { pixels } else { 0 };
        if (direct.len(), ambient.len()) != (expected, pixels) {
            return Err(Garbled("its direct or ambient light is of other pixels".into()));
        }
        Ok(Self { chunks, direct, ambient })
    }

    fn has_bits_of(&self, other: &Self) -> bool {
        let bits = |estimates: &[[[f64; 2]; C]]| -> Vec<u64> {
            estimates.as_flattened().as_flattened().iter().map(|value| value.to_bits()).collect()
        };
        // How the contributions are cut into chunks depends on the speed of the machine.
        let same = |(a, b): (&Vec<Chunk<C>>, &Vec<Chunk<C>>)| {
            a.iter().flat_map(Chunk::contributions).eq(b.iter().flat_map(Chunk::contributions))
        };
        self.chunks.iter().zip(&other.chunks).all(same)
            && bits(&self.direct) == bits(&other.direct)
            && bits(&self.ambient) == bits(&other.ambient)
    }
}
