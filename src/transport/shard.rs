//! A shard is a part of a matrix: the contributions of the light paths from some pixels, traced separately. All shards together give the
//! matrix.
//!
//! A matrix is the sum over its light paths, pixel by pixel. Each of several independent machines traces the paths from some of the pixels.
//! Joined in the order of the pixels, the contributions are those that a single machine would trace, so the matrix has the same bits.

use std::io::{self, Read, Write};

use super::assembled::{Assembled, shape};
use super::contributions::{Chunk, Found, Share};
use super::noise::Estimates;
use super::spread::of_share;
use super::wire::{self, Garbled, Reader};
use super::{Channels, RigShape};
use crate::error::{Error, Result};
use crate::image::Resolution;
use crate::render::{StartPixels, TraceSettings, TraceSummary, Tracer};

/// The maximum number of parts into which the tracing of a matrix is divided.
pub const MOST_PARTS: usize = 1 << 16;

/// The maximum length of a side of a camera or projector in pixels, as in [`TraceSettings::check`].
const LONGEST_SIDE: usize = 16384;

/// The description of a shard, without its contributions.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub struct ShardRecord {
    /// The number of this part, from 1 to `parts`.
    pub part: usize,
    /// The number of parts into which the light paths are divided.
    pub parts: usize,
    /// The shape of the whole matrix.
    pub rig: RigShape,
    /// The channels of the matrix.
    pub channels: Channels,
    /// Whether light of two bounces and light of more bounces are separate layers.
    pub split: bool,
    /// The pixels whose paths the shard contains.
    pub pixels: StartPixels,
    /// Whether each endpoint (camera, projector) has paths in both halves of the samples. Only then can the noise be estimated.
    pub has_halves: bool,
    /// The cost of tracing.
    pub summary: TraceSummary,
}

/// The contributions of the light paths from some pixels to a matrix, summed pixel by pixel.
#[derive(Clone, Debug)]
pub struct Shard {
    record: ShardRecord,
    share: Channeled,
}

#[derive(Clone, Debug)]
enum Channeled {
    Luma(Share<1>),
    Rgb(Share<3>),
}

/// Traces the light paths of part `part` (from 1) of `parts`. `split` is as in [`assemble_layers`](super::assemble_layers).
///
/// # Errors
/// [`Error::Option`] naming `--shard` if there is no such part; the errors of [`Tracer::trace`].
pub fn trace_shard(
    tracer: &mut Tracer,
    settings: &TraceSettings,
    channels: Channels,
    split: bool,
    (part, parts): (usize, usize),
) -> Result<Shard> {
    settings.check()?;
    if !(1..=parts).contains(&part) || parts > MOST_PARTS {
        return Err(Error::option("--shard", format!("there is no part {part} of {parts}")).help(format!(
            "give a part from 1 to the number of parts, which is {MOST_PARTS} at most, e.g. --shard 3/16"
        )));
    }
    let rig = shape(tracer, settings);
    let pixels = tracer.start_pixels(settings).split(parts).swap_remove(part - 1);
    let share = match channels {
        Channels::Luma => Channeled::Luma(Share::trace(tracer, settings, &pixels, split, None)?),
        Channels::Rgb => Channeled::Rgb(Share::trace(tracer, settings, &pixels, split, None)?),
    };
    let (has_halves, summary) = match &share {
        Channeled::Luma(share) => (share.has_halves, share.summary),
        Channeled::Rgb(share) => (share.has_halves, share.summary),
    };
    let record = ShardRecord { part, parts, rig, channels, split, pixels, has_halves, summary };
    Ok(Shard { record, share })
}

/// Joins all shards, in any order, to a matrix. The matrix has the same bits as that of [`assemble_layers`](super::assemble_layers). Its
/// tracing time is the time of the slowest shard.
///
/// # Errors
/// [`Error::Dimension`] unless the shards are all parts of one matrix, each exactly once.
pub fn join_shards(mut shards: Vec<Shard>) -> Result<Assembled> {
    shards.sort_by_key(|shard| shard.record.part);
    let found: Vec<String> =
        shards.iter().map(|Shard { record, .. }| format!("{} of {}", record.part, record.parts)).collect();
    let Some(first) = shards.first().map(|shard| shard.record.clone()) else {
        return Err(Error::dimension("shards", "all parts of a matrix", "none"));
    };
    let fits = |(index, shard): (usize, &Shard)| {
        let record = &shard.record;
        (record.part, record.parts) == (index + 1, first.parts)
            && (record.rig, record.channels, record.split) == (first.rig, first.channels, first.split)
    };
    if shards.len() != first.parts || !shards.iter().enumerate().all(fits) {
        return Err(Error::dimension(
            "shards",
            format!("parts 1 to {} of one matrix, each once", first.parts),
            format!("parts {}", found.join(", ")),
        ));
    }
    let (mut luma, mut rgb) = (Vec::new(), Vec::new());
    for shard in shards {
        match shard.share {
            Channeled::Luma(share) => luma.push(share),
            Channeled::Rgb(share) => rgb.push(share),
        }
    }
    let ShardRecord { rig, channels, split, .. } = first;
    match channels {
        Channels::Luma => of_share(Share::joined(luma), rig, channels, split),
        Channels::Rgb => of_share(Share::joined(rgb), rig, channels, split),
    }
}

impl Shard {
    /// The record of the shard.
    pub fn record(&self) -> &ShardRecord {
        &self.record
    }

    /// Whether two shards have the same contributions to the last bit. Their tracing times are not compared.
    pub fn has_bits_of(&self, other: &Self) -> bool {
        match (&self.share, &other.share) {
            (Channeled::Luma(a), Channeled::Luma(b)) => a.has_bits_of(b),
            (Channeled::Rgb(a), Channeled::Rgb(b)) => a.has_bits_of(b),
            _ => false,
        }
    }

    /// Writes the contributions, but not the record. It fails if writing to `to` fails.
    pub fn write(&self, to: &mut impl Write) -> io::Result<()> {
        match &self.share {
            Channeled::Luma(share) => share.write(&self.record, to),
            Channeled::Rgb(share) => share.write(&self.record, to),
        }
    }

    /// Reads the contributions of a shard with this record from the next `bytes` bytes. The error text says what is wrong with the bytes.
    pub fn read(record: ShardRecord, from: &mut impl Read, bytes: u64) -> std::result::Result<Self, String> {
        record.check()?;
        let mut from = Reader::of(from, bytes);
        let share = match record.channels {
            Channels::Luma => Share::read(&record, &mut from).map(Channeled::Luma),
            Channels::Rgb => Share::read(&record, &mut from).map(Channeled::Rgb),
        };
        let share = share.and_then(|share| from.end().map(|()| share)).map_err(|Garbled(why)| why)?;
        Ok(Self { record, share })
    }
}

impl ShardRecord {
    /// Checks that a shard with this record can exist. The error text says why it cannot.
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

    /// The numbers of pixels at which paths can end: first for paths from the camera, then for paths from the projector.
    fn others(&self) -> [usize; 2] {
        [self.rig.projector.pixels(), self.rig.camera.pixels()]
    }
}

impl<const C: usize> Share<C> {
    fn write(&self, record: &ShardRecord, to: &mut impl Write) -> io::Result<()> {
        let chunks: Vec<&Chunk<C>> = self.found.chunks().collect();
        for (from_camera, others) in [true, false].into_iter().zip(record.others()) {
            wire::put_chunks(to, &chunks, from_camera, &(0..others))?;
        }
        wire::put_estimates(to, &self.direct)?;
        wire::put_estimates(to, &self.ambient)
    }

    fn read(record: &ShardRecord, from: &mut Reader<impl Read>) -> std::result::Result<Self, Garbled> {
        let classes = if record.split { 3 } else { 2 };
        let StartPixels { camera, projector } = &record.pixels;
        let [of_camera, of_projector] = record.others();
        let mut chunks = Vec::new();
        for (from_camera, pixels, others) in [(true, camera, of_camera), (false, projector, of_projector)] {
            let chunk = wire::take_chunk::<C>(from, from_camera)?;
            if !chunk.is_of(pixels, others, classes) {
                return Err(Garbled("its contributions are not to this matrix".into()));
            }
            chunks.push(chunk);
        }
        let (direct, ambient) = (wire::take_estimates::<C>(from)?, wire::take_estimates::<C>(from)?);
        let pixels = camera.len();
        let expected = if record.rig.symmetric { pixels } else { 0 };
        if (direct.len(), ambient.len()) != (expected, pixels) {
            return Err(Garbled("its direct or ambient light is of other pixels".into()));
        }
        let (found, has_halves, summary) = (Found::of_chunks(chunks), record.has_halves, record.summary);
        Ok(Self { found, direct, ambient, has_halves, summary })
    }

    fn has_bits_of(&self, other: &Self) -> bool {
        let bits = |estimates: &[Estimates<C>]| -> Vec<u64> {
            estimates.as_flattened().as_flattened().iter().map(|value| value.to_bits()).collect()
        };
        // How contributions are divided into chunks depends on the speed of the machine, so chunks are not compared.
        let [ours, theirs] = [self, other].map(|of| of.found.chunks().flat_map(Chunk::contributions));
        ours.eq(theirs)
            && bits(&self.direct) == bits(&other.direct)
            && bits(&self.ambient) == bits(&other.ambient)
    }
}
