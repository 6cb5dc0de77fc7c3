//! Low-rank models of light transport on disk. A model is in the folder `model/`, in the folder of the run that captured it.
//!
//! | file | content |
//! |---|---|
//! | `model.json` | the format's version, the sizes, the source, and the BLAKE3 digest of every file |
//! | `patterns-C.npy` | `Q` of channel `C`: `k×H×W` of the projector's pixels, `f64` |
//! | `photos-C.npy` | `W = G Q`, where `G` is `A` without direct light: `k×H×W` of the camera's pixels, `f64` |
//! | `direct-C.npy` or `.npz` | the direct light: an image `H×W`, or a sparse matrix if it is not diagonal |
//! | `ambient.npy` | the photo without the projector |
//! | `captured-C.npy`, `pixels-C.npy`, `missing-C.npy`, `near-C.npz` | of a model that was fitted to captures: the inputs of its error estimate ([`CapturedArrays`]) |
//!
//! NumPy and SciPy read all of these files. With the direct light `d`, the photo of a pattern `x` is
//! `A x = d*x + W @ (Q.T @ x) + Q @ (W.T @ (x − Q @ (Q.T @ x)))`. The last term is present only in symmetric models.
//!
//! When a file is read, it is checked against its digest in the record. The record also has a digest of its own.
//!
//! This module reads and writes the arrays; [`crate::analysis::low_rank`] defines their meaning.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::{atomic, npy, sparse};
use crate::error::{Error, Result};
use crate::file;
use crate::image::{Image, Resolution};
use crate::sparse::Csr;

const FORMAT: u32 = 2;
/// The folder of a model in the folder of its run.
pub const FOLDER: &str = "model";
const RECORD: &str = "model.json";

/// The arrays of a model, and the facts that are needed to interpret them.
#[derive(Clone, Debug)]
pub struct ModelArrays {
    /// The arrays of each channel.
    pub channels: Vec<ChannelArrays>,
    /// The photo without the projector.
    pub ambient: Image,
    /// The resolution of photos.
    pub resolution: Resolution,
    /// The resolution of patterns. It has the same number of pixels as the resolution of photos.
    pub projector: Resolution,
    /// The unit of the photos' values.
    pub unit: String,
    /// The name of the source from which the model was captured.
    pub source: String,
    /// Whether the light transport matrix is symmetric.
    pub symmetric: bool,
}

/// The arrays of one channel, for images of `n` pixels.
#[derive(Clone, Debug)]
pub struct ChannelArrays {
    /// `Q`: `k` patterns of `n` values.
    pub patterns: Vec<Vec<f64>>,
    /// `W`: the `k` photos of these patterns, `n` values each, without direct light.
    pub photos: Vec<Vec<f64>>,
    /// The direct light.
    pub direct: DirectArrays,
    /// The inputs of the error estimate, for a model that was fitted to captures.
    pub captured: Option<CapturedArrays>,
}

/// The inputs of the error estimate of a model that was fitted to captures of `m` pixels.
#[derive(Clone, Debug)]
pub struct CapturedArrays {
    /// The captured patterns, of the projector's pixels.
    pub patterns: Vec<Vec<f64>>,
    /// For each camera pixel: column and row of its home (NaN if unknown), level, and noise (4 rows of `m`).
    pub pixels: Vec<Vec<f64>>,
    /// Pairs of photo and camera pixel that were saturated.
    pub missing: Vec<[u32; 2]>,
    /// The light of two or more bounces near the homes (`m × n`), if there is a map from camera to projector.
    pub near: Option<Csr>,
    /// The scales of the prior, by name.
    pub scales: BTreeMap<String, f64>,
}

/// The direct light of a channel.
#[derive(Clone, Debug)]
pub enum DirectArrays {
    /// Unknown, or included in the photos.
    None,
    /// A diagonal matrix, given by its `n` diagonal values.
    Image(Vec<f64>),
    /// An `n × n` matrix.
    Matrix(Csr),
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Record {
    krylux_model: u32,
    version: String,
    /// The digest of this record, computed with this field empty.
    digest: String,
    source: String,
    resolution: Resolution,
    projector: Resolution,
    unit: String,
    symmetric: bool,
    channels: Vec<ChannelRecord>,
    /// The digest of each other file in the folder, by file name.
    files: BTreeMap<String, String>,
}

/// The version of a record. It is read first, because it determines whether the other fields can be read.
#[derive(Deserialize)]
struct Version {
    krylux_model: u32,
}

#[derive(Serialize, Deserialize)]
struct ChannelRecord {
    photos: usize,
    direct: DirectRecord,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    captured: Option<CapturedRecord>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct CapturedRecord {
    photos: usize,
    missing: usize,
    has_near: bool,
    scales: BTreeMap<String, f64>,
}

#[derive(Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
enum DirectRecord {
    None,
    Image,
    Matrix,
}

/// Whether the run's folder `run` contains a model.
pub fn is_in(run: &Path) -> bool {
    record_path(run).is_file()
}

/// The folder of the model in the run's folder `run`.
pub fn folder(run: &Path) -> PathBuf {
    run.join(FOLDER)
}

/// The path of the model's record in the run's folder `run`. Runs that use the model depend on this file.
pub fn record_path(run: &Path) -> PathBuf {
    folder(run).join(RECORD)
}

impl ModelArrays {
    /// Writes the model into the run's folder `run`. Returns the names of the written files, relative to this folder. The record is written
    /// last, so if there is a record, the model is complete.
    pub fn write(&self, run: &Path) -> Result<Vec<String>> {
        let folder = folder(run);
        file::follow_no_links_below(run);
        file::make_folder(&folder)?;
        let mut names = Vec::new();
        let mut path = |name: String| -> PathBuf {
            names.push(format!("{FOLDER}/{name}"));
            folder.join(name)
        };
        let mut channels = Vec::new();
        for (channel, ChannelArrays { patterns, photos, direct, captured }) in
            self.channels.iter().enumerate()
        {
            let shape = |size: Resolution| [patterns.len(), size.height, size.width];
            let file = path(format!("patterns-{channel}.npy"));
            npy::write_npy(&file, &shape(self.projector), &patterns.concat())?;
            let file = path(format!("photos-{channel}.npy"));
            npy::write_npy(&file, &shape(self.resolution), &photos.concat())?;
            let kind = match direct {
                DirectArrays::Matrix(matrix) => {
                    sparse::write(&path(format!("direct-{channel}.npz")), matrix)?;
                    DirectRecord::Matrix
                }
                DirectArrays::None => DirectRecord::None,
                DirectArrays::Image(direct) => {
                    let Resolution { width, height } = self.resolution;
                    npy::write_npy(&path(format!("direct-{channel}.npy")), &[height, width], direct)?;
                    DirectRecord::Image
                }
            };
            let sizes = [self.projector, self.resolution];
            let captured =
                captured.as_ref().map(|captured| captured.write(channel, sizes, &mut path)).transpose()?;
            channels.push(ChannelRecord { photos: patterns.len(), direct: kind, captured });
        }
        npy::write_image(&path("ambient.npy".into()), &self.ambient)?;
        let mut files = BTreeMap::new();
        for name in &names {
            let file = run.join(name);
            let name = name.trim_start_matches(FOLDER).trim_start_matches('/');
            files.insert(name.to_owned(), digest_of_file(&file)?);
        }
        let mut record = Record {
            krylux_model: FORMAT,
            version: env!("CARGO_PKG_VERSION").into(),
            digest: String::new(),
            source: self.source.clone(),
            resolution: self.resolution,
            projector: self.projector,
            unit: self.unit.clone(),
            symmetric: self.symmetric,
            channels,
            files,
        };
        let path = record_path(run);
        record.digest = record.own_digest(&path)?;
        let text =
            serde_json::to_string_pretty(&record).map_err(|error| Error::writing(&path)(error.into()))?;
        atomic::write_bytes(&path, text.as_bytes())?;
        names.push(format!("{FOLDER}/{RECORD}"));
        Ok(names)
    }

    /// Reads the model in the run's folder `run`.
    ///
    /// # Errors
    /// [`Error::Read`]; [`Error::Data`], which names the file, if its digest or size differs from the record's, if it is malformed, or if
    /// it has a value that is not finite.
    pub fn read(run: &Path) -> Result<Self> {
        file::follow_no_links_below(run);
        let folder = folder(run);
        let path = folder.join(RECORD);
        let record = read_record(&path)?;
        let whole = |name: String| record.whole_file(&folder, &name);
        let mut channels = Vec::new();
        for (channel, of) in record.channels.iter().enumerate() {
            let stack = |name: &str, size: Resolution| {
                pictures(&whole(format!("{name}-{channel}.npy"))?, of.photos, size)
            };
            let Resolution { width, height } = record.resolution;
            let direct = |extension| whole(format!("direct-{channel}.{extension}"));
            channels.push(ChannelArrays {
                patterns: stack("patterns", record.projector)?,
                photos: stack("photos", record.resolution)?,
                direct: match of.direct {
                    DirectRecord::None => DirectArrays::None,
                    DirectRecord::Image => DirectArrays::Image(numbers(&direct("npy")?, &[height, width])?),
                    DirectRecord::Matrix => DirectArrays::Matrix(sparse::read(&direct("npz")?)?),
                },
                captured: match &of.captured {
                    None => None,
                    Some(captured) => {
                        let sizes = [record.projector, record.resolution];
                        Some(CapturedArrays::read(captured, sizes, |name, extension| {
                            whole(format!("{name}-{channel}.{extension}"))
                        })?)
                    }
                },
            });
        }
        let ambient = npy::read_image(&whole("ambient.npy".into())?)?;
        if channels.is_empty() || ambient.channels() != channels.len() {
            let fault = format!("it has {} channels, but ambient.npy {}", channels.len(), ambient.channels());
            return Err(unusable(&path, fault));
        }
        let Record { resolution, projector, unit, source, symmetric, .. } = record;
        if ambient.resolution() != resolution || symmetric && resolution.pixels() != projector.pixels() {
            return Err(unusable(&path, "its sizes contradict each other".into()));
        }
        Ok(Self { channels, ambient, resolution, projector, unit, source, symmetric })
    }
}

impl CapturedArrays {
    fn write(
        &self,
        channel: usize,
        [projector, camera]: [Resolution; 2],
        path: &mut impl FnMut(String) -> PathBuf,
    ) -> Result<CapturedRecord> {
        let mut array = |name: &str, shape: &[usize], values: &[f64]| {
            npy::write_npy(&path(format!("{name}-{channel}.npy")), shape, values)
        };
        let shape = |count: usize, size: Resolution| [count, size.height, size.width];
        array("captured", &shape(self.patterns.len(), projector), &self.patterns.concat())?;
        array("pixels", &shape(self.pixels.len(), camera), &self.pixels.concat())?;
        let missing: Vec<f64> = self.missing.as_flattened().iter().copied().map(f64::from).collect();
        array("missing", &[self.missing.len(), 2], &missing)?;
        if let Some(near) = &self.near {
            sparse::write(&path(format!("near-{channel}.npz")), near)?;
        }
        Ok(CapturedRecord {
            photos: self.patterns.len(),
            missing: self.missing.len(),
            has_near: self.near.is_some(),
            scales: self.scales.clone(),
        })
    }

    fn read(
        record: &CapturedRecord,
        [projector, camera]: [Resolution; 2],
        path: impl Fn(&str, &str) -> Result<PathBuf>,
    ) -> Result<Self> {
        let patterns = pictures(&path("captured", "npy")?, record.photos, projector)?;
        let pixels = npy::read_npy(&path("pixels", "npy")?)?;
        if pixels.shape != [4, camera.height, camera.width] {
            return Err(unusable(&path("pixels", "npy")?, "its shape is not that of four pictures".into()));
        }
        let file = path("missing", "npy")?;
        let missing = numbers(&file, &[record.missing, 2])?;
        let missing = missing.as_chunks::<2>().0.iter().map(|pair| pair.map(|index| index as u32));
        let missing: Vec<[u32; 2]> = missing.collect();
        let is_in = |[photo, pixel]: &[u32; 2]| {
            (*photo as usize) < record.photos && (*pixel as usize) < camera.pixels()
        };
        if !missing.iter().all(is_in) {
            return Err(unusable(&file, "it names photos or pixels that do not exist".into()));
        }
        Ok(Self {
            patterns,
            pixels: rows(&pixels.values, camera),
            missing,
            near: if record.has_near { Some(sparse::read(&path("near", "npz")?)?) } else { None },
            scales: record.scales.clone(),
        })
    }
}

impl Record {
    /// The digest of the record itself. `path` names the record in errors.
    fn own_digest(&self, path: &Path) -> Result<String> {
        let mut record = serde_json::to_value(self).map_err(|error| Error::writing(path)(error.into()))?;
        record["digest"] = "".into();
        Ok(blake3::hash(record.to_string().as_bytes()).to_string())
    }

    /// The path of a file of the model. The file's digest is checked first.
    fn whole_file(&self, folder: &Path, name: &str) -> Result<PathBuf> {
        let path = folder.join(name);
        if self.files.get(name) != Some(&digest_of_file(&path)?) {
            return Err(unusable(&path, "it is not what was written: its digest is another one".into()));
        }
        Ok(path)
    }
}

fn digest_of_file(path: &Path) -> Result<String> {
    let content = file::open(path)?;
    let mut hasher = blake3::Hasher::new();
    hasher.update_reader(content).map_err(Error::reading(path))?;
    Ok(hasher.finalize().to_string())
}

fn read_record(path: &Path) -> Result<Record> {
    let bytes = file::read(path)?;
    let malformed = |error: serde_json::Error| unusable(path, error.to_string());
    let Version { krylux_model } = serde_json::from_slice(&bytes).map_err(malformed)?;
    if krylux_model != FORMAT {
        let fault = format!("its format is {krylux_model}, but this krylux reads format {FORMAT}");
        return Err(unusable(path, fault));
    }
    let record: Record = serde_json::from_slice(&bytes).map_err(malformed)?;
    if record.own_digest(path)? != record.digest {
        return Err(unusable(path, "it is not what was written: its digest is another one".into()));
    }
    Ok(record)
}

/// Reads `count` pictures of one size, each as an array of its own. Fails as [`numbers`].
fn pictures(path: &Path, count: usize, size: Resolution) -> Result<Vec<Vec<f64>>> {
    Ok(rows(&numbers(path, &[count, size.height, size.width])?, size))
}

fn rows(values: &[f64], size: Resolution) -> Vec<Vec<f64>> {
    values.chunks(size.pixels().max(1)).map(<[f64]>::to_vec).collect()
}

/// Reads an array, and checks that its shape is `shape` and its values are finite.
fn numbers(path: &Path, shape: &[usize]) -> Result<Vec<f64>> {
    let array = npy::read_npy(path)?;
    if array.shape != shape {
        return Err(unusable(path, format!("its shape is {:?}, but the model has {shape:?}", array.shape)));
    }
    match array.values.iter().position(|value| !value.is_finite()) {
        Some(at) => Err(unusable(path, format!("its value {at} is {}", array.values[at]))),
        None => Ok(array.values),
    }
}

fn unusable(path: &Path, fault: String) -> Error {
    Error::data(path, fault).help("capture the model anew with `krylux relight SCENE`")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of_channels(channels: Vec<ChannelArrays>, resolution: Resolution) -> ModelArrays {
        ModelArrays {
            channels,
            ambient: Image::filled(resolution, 3, 0.25),
            resolution,
            projector: resolution,
            unit: "DN/s".into(),
            source: "test".into(),
            symmetric: true,
        }
    }

    #[test]
    fn a_model_whose_ambient_light_has_other_channels_is_refused() -> Result<()> {
        let folder = tempfile::tempdir().map_err(Error::writing("a temporary folder"))?;
        let resolution = Resolution::new(2, 1);
        let channel = ChannelArrays {
            patterns: vec![vec![1.0, 2.0]],
            photos: vec![vec![3.0, 4.0]],
            direct: DirectArrays::None,
            captured: None,
        };
        let mut model = of_channels(vec![channel], resolution);
        model.write(folder.path())?;
        let error = ModelArrays::read(folder.path()).err().map(|error| error.to_string()).unwrap_or_default();
        assert!(error.contains("it has 1 channels, but ambient.npy 3"), "{error}");
        model.ambient = Image::filled(resolution, 1, 0.25);
        model.write(folder.path())?;
        assert_eq!(format!("{:?}", ModelArrays::read(folder.path())?), format!("{model:?}"));
        Ok(())
    }

    #[test]
    fn every_flipped_bit_of_a_model_is_noticed() -> Result<()> {
        let folder = tempfile::tempdir().map_err(Error::writing("a temporary folder"))?;
        let resolution = Resolution::new(2, 2);
        let values = |scale: f64| vec![vec![scale, 2.0 * scale, 3.0 * scale, 5.0 * scale]];
        let matrix = Csr::new(4, vec![0, 1, 2, 3, 4], vec![0, 2, 1, 3], vec![0.5; 4])?;
        let direct =
            [DirectArrays::Matrix(matrix), DirectArrays::Image(values(0.1).concat()), DirectArrays::None];
        let channels = direct.map(|direct| ChannelArrays {
            patterns: values(0.2),
            photos: values(0.3),
            direct,
            captured: None,
        });
        let model = of_channels(channels.into(), resolution);
        let names = model.write(folder.path())?;
        let whole = format!("{:?}", ModelArrays::read(folder.path())?);
        for name in names {
            let path = folder.path().join(name);
            let bytes = std::fs::read(&path).map_err(Error::reading(&path))?;
            for at in 0..bytes.len() {
                let mut damaged = bytes.clone();
                damaged[at] ^= 1 << (at % 8);
                std::fs::write(&path, damaged).map_err(Error::writing(&path))?;
                // Changed white space in the record has no effect. If a changed model is accepted, it must therefore equal the original.
                if let Ok(read) = ModelArrays::read(folder.path()) {
                    assert_eq!(format!("{read:?}"), whole, "byte {at} of {}", path.display());
                }
            }
            std::fs::write(&path, bytes).map_err(Error::writing(&path))?;
        }
        Ok(())
    }
}
