//! The files of a cached matrix, one for each channel.
//!
//! A file is a ZIP archive. Its members `indices`, `indptr`, `data`, `shape` and `format` are SciPy's, and contain the last layer: the
//! light of two or more bounces, or of three or more bounces if light of two bounces is a separate layer. The members of other layers have
//! the name of the layer as a prefix. Each layer of a symmetric matrix contains only its entries on and above the diagonal: with `U` for
//! these entries, the matrix is `U + Uᵀ - diag(U)`. `direct` is the diagonal, `ambient` is the photo without projector light, `white_error`
//! is the noise of the white photo, and `noise` has the relative errors. `krylux.json` is the record of everything else.

use std::fs::File;
use std::io::{self, BufReader, Read, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;

use serde::{Deserialize, Serialize};
use zip::{CompressionMethod, ZipArchive, ZipWriter};

use super::Key;
use super::check::require_matrix;
use crate::image::Image;
use crate::io::sparse::FirstError;
use crate::io::{atomic, npy, sparse};
use crate::render::TraceSummary;
use crate::transport::{
    Assembled, Bounces, Channels, CompressedRows, Entries, Layer, Noise, RigShape, TransportMatrix,
};

const RECORD: &str = "krylux.json";

/// The member `krylux.json` of a file. It has everything except the arrays. Its JSON text is included in the checksum.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Record {
    pub(super) key: String,
    pub(super) label: String,
    pub(super) channel: usize,
    pub(super) channels: Channels,
    pub(super) rig: RigShape,
    pub(super) layers: Vec<Bounces>,
    pub(super) has_noise: bool,
    pub(super) paths: u64,
    pub(super) rays: u64,
    pub(super) dispatches: u32,
    pub(super) longest_ns: u64,
    pub(super) tracing_ns: u64,
    /// The BLAKE3 hash of the fields above and of the arrays. It is empty while the hash is computed.
    pub(super) checksum: String,
}

/// One channel of a layer in CSR form: row starts, columns and weights. A symmetric matrix has only its entries on and above the diagonal.
pub(super) type Rows = (Vec<u64>, Vec<u32>, Vec<f32>);

#[derive(Debug)]
pub(super) struct Arrays<L = Rows> {
    pub(super) layers: Vec<L>,
    pub(super) direct: Vec<f32>,
    pub(super) ambient: Vec<f32>,
    pub(super) white_error: Vec<f32>,
    pub(super) noise: Vec<f64>,
}

/// A layer whose arrays are produced in pieces while they are written.
pub(super) struct InPieces<'a> {
    /// The offset of the entries of each row. The last element is the number of entries.
    pub(super) starts: Vec<u64>,
    /// The lengths of the arrays of columns and of weights. In a valid layer, they are equal.
    pub(super) counts: [usize; 2],
    pub(super) columns: Box<dyn Iterator<Item = Vec<u32>> + 'a>,
    pub(super) weights: Box<dyn Iterator<Item = Vec<f32>> + 'a>,
}

/// The checksum of a record and its arrays. It is updated with each field while the fields are read or written in order.
struct Checksum(blake3::Hasher);

impl Checksum {
    fn new(record: &Record) -> io::Result<Self> {
        let record = Record { checksum: String::new(), ..record.clone() };
        let mut checksum = Self(blake3::Hasher::new());
        checksum.array(&serde_json::to_vec(&record)?);
        Ok(checksum)
    }

    fn begin<T>(&mut self, count: usize) {
        self.0.update(&((count * size_of::<T>()) as u64).to_le_bytes());
    }

    fn piece<T: bytemuck::NoUninit>(&mut self, values: &[T]) {
        self.0.update(bytemuck::cast_slice(values));
    }

    fn array<T: bytemuck::NoUninit>(&mut self, values: &[T]) {
        self.begin::<T>(values.len());
        self.piece(values);
    }

    fn planes<L>(&mut self, arrays: &Arrays<L>) {
        self.array(&arrays.direct);
        self.array(&arrays.ambient);
        self.array(&arrays.white_error);
        self.array(&arrays.noise);
    }

    fn finish(&self) -> String {
        self.0.finalize().to_hex().to_string()
    }
}

impl Record {
    fn checksum(&self, arrays: &Arrays) -> io::Result<String> {
        let mut checksum = Checksum::new(self)?;
        for (starts, columns, weights) in &arrays.layers {
            checksum.array(starts);
            checksum.array(columns);
            checksum.array(weights);
        }
        checksum.planes(arrays);
        Ok(checksum.finish())
    }
}

/// The name of a layer's array in the archive. For the last layer, it is SciPy's name; for other layers, it has a prefix.
fn member(bounces: Bounces, last: bool, array: &str) -> String {
    let layer = match bounces {
        _ if last => return array.into(),
        Bounces::One => "one",
        Bounces::Two => "two",
        Bounces::Rest | Bounces::Global => "rest",
    };
    format!("{layer}_{array}")
}

pub(super) fn write(key: &Key, files: &[PathBuf], traced: &Assembled) -> crate::Result<()> {
    let entries = kept(traced.matrix.rig);
    let layers: Vec<_> = traced.matrix.layers.iter().map(Layer::tiles).collect();
    let row_starts: Vec<Vec<usize>> = layers.iter().map(|tiles| tiles.row_start(entries)).collect();
    for (channel, path) in files.iter().enumerate() {
        let in_pieces = layers.iter().zip(&row_starts).map(|(tiles, row_start)| InPieces {
            starts: row_start.iter().map(|&start| start as u64).collect(),
            counts: [row_start.last().copied().unwrap_or(0); 2],
            columns: Box::new(tiles.columns(entries, row_start)),
            weights: Box::new(tiles.weights(entries, channel, row_start)),
        });
        let (record, arrays) = channel_content(key, traced, channel, in_pieces.collect());
        atomic::write_with(path, |file| write_channel(file, record, arrays))?;
    }
    Ok(())
}

/// Which entries of each layer a file contains.
fn kept(rig: RigShape) -> Entries {
    if rig.symmetric { Entries::Upper } else { Entries::All }
}

fn channel_content<'a>(
    key: &Key,
    traced: &Assembled,
    channel: usize,
    layers: Vec<InPieces<'a>>,
) -> (Record, Arrays<InPieces<'a>>) {
    let Assembled { matrix, ambient, noise, summary, .. } = traced;
    let plane =
        |image: &Image| image.samples().iter().skip(channel).step_by(image.channels()).copied().collect();
    let arrays = Arrays {
        layers,
        direct: matrix.direct[channel].clone(),
        ambient: plane(ambient),
        white_error: noise.as_ref().map_or(Vec::new(), |noise| plane(&noise.white)),
        noise: noise
            .as_ref()
            .map_or(Vec::new(), |noise| vec![noise.white_relative, noise.operator, noise.global]),
    };
    let record = Record {
        key: key.hex().into(),
        label: key.label().into(),
        channel,
        channels: matrix.channels,
        rig: matrix.rig,
        layers: matrix.layers.iter().map(Layer::bounces).collect(),
        has_noise: noise.is_some(),
        paths: summary.paths,
        rays: summary.rays,
        dispatches: summary.dispatches,
        longest_ns: summary.longest.as_nanos() as u64,
        tracing_ns: summary.tracing.as_nanos() as u64,
        checksum: String::new(),
    };
    (record, arrays)
}

/// Writes the archive of one channel. The record comes last, because it has the checksum of the arrays.
pub(super) fn write_channel(
    file: &mut (impl Write + io::Seek),
    mut record: Record,
    mut arrays: Arrays<InPieces<'_>>,
) -> io::Result<()> {
    let mut checksum = Checksum::new(&record)?;
    let mut archive = ZipWriter::new(FirstError::new(file));
    let last = arrays.layers.len().saturating_sub(1);
    for (index, (layer, &bounces)) in arrays.layers.drain(..).zip(&record.layers).enumerate() {
        write_layer(&mut archive, &mut checksum, layer, |array| member(bounces, index == last, array))?;
    }
    sparse::add_format_to_npz(&mut archive)?;
    let shape = [record.rig.camera.pixels() as i64, record.rig.projector.pixels() as i64];
    sparse::add_to_npz(&mut archive, "shape", 2, shape.into_iter())?;
    for (name, plane) in
        [("direct", &arrays.direct), ("ambient", &arrays.ambient), ("white_error", &arrays.white_error)]
    {
        sparse::add_to_npz(&mut archive, name, plane.len(), plane.iter().copied())?;
    }
    sparse::add_to_npz(&mut archive, "noise", arrays.noise.len(), arrays.noise.iter().copied())?;
    checksum.planes(&arrays);
    record.checksum = checksum.finish();
    archive.start_file(RECORD, sparse::npz_options(0))?;
    archive.write_all(&serde_json::to_vec_pretty(&record)?)?;
    archive.finish()?;
    Ok(())
}

/// Writes the arrays of a layer. `name` returns the member name of each array.
fn write_layer(
    archive: &mut ZipWriter<impl Write + io::Seek>,
    checksum: &mut Checksum,
    layer: InPieces<'_>,
    name: impl Fn(&str) -> String,
) -> io::Result<()> {
    let InPieces { starts, counts: [count, weights_count], columns, weights } = layer;
    checksum.array(&starts);
    checksum.begin::<u32>(count);
    let columns = columns.inspect(|piece| checksum.piece(piece)).flatten();
    // SciPy uses one type for both index arrays: 32 bits if possible.
    if i32::try_from(count).is_ok() {
        sparse::add_to_npz(archive, &name("indices"), count, columns.map(|column| column as i32))?;
        sparse::add_to_npz(archive, &name("indptr"), starts.len(), starts.iter().map(|&v| v as i32))?;
    } else {
        sparse::add_to_npz(archive, &name("indices"), count, columns.map(i64::from))?;
        sparse::add_to_npz(archive, &name("indptr"), starts.len(), starts.iter().map(|&v| v as i64))?;
    }
    checksum.begin::<f32>(weights_count);
    let weights = weights.inspect(|piece| checksum.piece(piece)).flatten();
    sparse::add_to_npz(archive, &name("data"), weights_count, weights)
}

/// The description of the matrix in a file; `None` if the file cannot be read.
pub(super) fn label(path: &Path) -> Option<String> {
    let mut archive = ZipArchive::new(BufReader::new(crate::file::open(path).ok()?)).ok()?;
    Some(read_record(&mut archive).ok()?.label)
}

type Archive = ZipArchive<BufReader<File>>;

/// Reads a matrix from the open files of its channels. The paths are used only in messages. The error text says what is wrong with the
/// files.
pub(super) fn read(key: &Key, files: Vec<(PathBuf, File)>) -> Result<Assembled, String> {
    let count = files.len();
    let channels = files.into_iter().enumerate().map(|(channel, (path, file))| {
        let (record, arrays) = read_channel(file).map_err(|why| format!("{}: {why}", path.display()))?;
        let expected = (key.hex(), channel, count);
        if (record.key.as_str(), record.channel, record.channels.count()) != expected {
            return Err(format!("{}: its content belongs to another key or channel", path.display()));
        }
        require_matrix(&record, &arrays, key.rig(), key.channels())
            .map_err(|why| format!("{}: {why}", path.display()))?;
        Ok((record, arrays))
    });
    let channels = channels.collect::<Result<Vec<_>, String>>()?;
    combine_channels(channels).ok_or_else(|| "its channels do not belong to one matrix".into())
}

fn read_channel(file: File) -> Result<(Record, Arrays), String> {
    let mut archive = ZipArchive::new(BufReader::new(file)).map_err(|error| error.to_string())?;
    let record = read_record(&mut archive)?;
    let mut arrays = Arrays {
        layers: Vec::new(),
        direct: read_array(&mut archive, "direct")?,
        ambient: read_array(&mut archive, "ambient")?,
        white_error: read_array(&mut archive, "white_error")?,
        noise: read_array(&mut archive, "noise")?,
    };
    for (index, &bounces) in record.layers.iter().enumerate() {
        let name = |array| member(bounces, index + 1 == record.layers.len(), array);
        let starts = read_indices(&mut archive, &name("indptr"))?;
        let columns = read_indices(&mut archive, &name("indices"))?;
        let columns: Result<Vec<u32>, _> = columns.into_iter().map(u32::try_from).collect();
        let columns = columns.map_err(|_| format!("{}: a column beyond 2^32", name("indices")))?;
        arrays.layers.push((starts, columns, read_array(&mut archive, &name("data"))?));
    }
    let checksum = record.checksum(&arrays).map_err(|error| error.to_string())?;
    if checksum != record.checksum {
        return Err("its content does not match its checksum".into());
    }
    Ok((record, arrays))
}

fn read_record(archive: &mut Archive) -> Result<Record, String> {
    serde_json::from_slice(&read_member(archive, RECORD)?).map_err(|error| format!("{RECORD}: {error}"))
}

/// The bytes of a member. Members are not compressed, so a member cannot be larger than the file.
fn read_member(archive: &mut Archive, name: &str) -> Result<Vec<u8>, String> {
    let mut member = archive.by_name(name).map_err(|error| format!("{name}: {error}"))?;
    if member.compression() != CompressionMethod::Stored || member.size() != member.compressed_size() {
        return Err(format!("{name}: it is compressed, which no matrix in the cache is"));
    }
    let mut bytes = Vec::new();
    member.read_to_end(&mut bytes).map_err(|error| format!("{name}: {error}"))?;
    Ok(bytes)
}

fn read_array<T: npyz::Deserialize>(archive: &mut Archive, name: &str) -> Result<Vec<T>, String> {
    let bytes = read_member(archive, &format!("{name}.npy"))?;
    npy::parse_as(&bytes).map_err(|why| format!("{name}: {why}"))
}

fn read_indices(archive: &mut Archive, name: &str) -> Result<Vec<u64>, String> {
    match read_array::<i32>(archive, name) {
        Ok(values) => Ok(values.into_iter().map(|value| value as u64).collect()),
        Err(_) => Ok(read_array::<i64>(archive, name)?.into_iter().map(|value| value as u64).collect()),
    }
}

/// Combines the channels into a matrix. Returns `None` if channels differ in anything except their values.
fn combine_channels(channels: Vec<(Record, Arrays)>) -> Option<Assembled> {
    let (first, shared) = channels.first()?;
    let (rig, kind, bounces) = (first.rig, first.channels, first.layers.clone());
    let fits = |(record, arrays): &(Record, Arrays)| {
        (record.rig, record.channels, record.has_noise) == (rig, kind, first.has_noise)
            && record.layers == bounces
            && arrays.layers.iter().zip(&shared.layers).all(|(a, b)| a.0 == b.0 && a.1 == b.1)
    };
    if !channels.iter().all(fits) {
        return None;
    }
    let image = |plane: fn(&Arrays) -> &[f32]| {
        let samples = (0..rig.camera.pixels())
            .flat_map(|pixel| channels.iter().map(move |(_, arrays)| plane(arrays).get(pixel).copied()));
        Image::new(rig.camera, channels.len(), samples.collect::<Option<Vec<f32>>>()?).ok()
    };
    let noise = match (first.has_noise, shared.noise.as_slice()) {
        (false, _) => None,
        (true, &[white_relative, operator, global]) => {
            Some(Noise { white: image(|arrays| &arrays.white_error)?, white_relative, operator, global })
        }
        (true, _) => return None,
    };
    let summary = TraceSummary {
        paths: first.paths,
        rays: first.rays,
        dispatches: first.dispatches,
        longest: Duration::from_nanos(first.longest_ns),
        tracing: Duration::from_nanos(first.tracing_ns),
    };
    let ambient = image(|arrays| &arrays.ambient)?;
    let (_, mut arrays): (Vec<Record>, Vec<Arrays>) = channels.into_iter().unzip();
    let direct = arrays.iter_mut().map(|arrays| std::mem::take(&mut arrays.direct)).collect();
    let layers = bounces.into_iter().enumerate().map(|(index, bounces)| {
        let weights = arrays.iter_mut().map(|arrays| std::mem::take(&mut arrays.layers[index].2)).collect();
        let (starts, columns, _) = std::mem::take(&mut arrays[0].layers[index]);
        let row_start = starts.into_iter().map(|start| start as usize).collect();
        let rows = vec![CompressedRows { row_start, columns, weights }];
        match kept(rig) {
            Entries::Upper => Layer::symmetric(bounces, rows),
            Entries::All => Layer::new(bounces, rig.projector.pixels(), rows),
        }
    });
    let layers = layers.collect();
    Some(Assembled {
        matrix: TransportMatrix::new(rig, kind, direct, layers),
        ambient,
        noise,
        summary,
        gpu_matrix: None,
    })
}
