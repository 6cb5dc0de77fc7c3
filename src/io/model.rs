//! A low-rank model of light transport on disk: `model/` in the folder of the run that captured it.
//!
//! | file | holds |
//! |---|---|
//! | `model.json` | the format's version, sizes, what the model is of |
//! | `patterns-C.npy` | `Q` of channel `C`, `k×H×W` of the projector's pixels, `f64` |
//! | `photos-C.npy` | `W = G Q`, `k×H×W` of the camera's |
//! | `direct-C.npy` or `.npz` | the direct light: an image `H×W`, or a sparse matrix where it is no diagonal |
//! | `ambient.npy` | the photo without projector |
//!
//! NumPy and SciPy read all of it: `A x = d*x + W @ (Q.T @ x) + Q @ (W.T @ (x − Q @ (Q.T @ x)))`, the last term for symmetric ones.
//! The arrays are all that this module knows of a model; [`crate::analysis::low_rank`] says what they mean.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::{atomic, npy, sparse};
use crate::error::{Error, Result};
use crate::image::{Image, Resolution};
use crate::sparse::Csr;

/// The version of the format.
const FORMAT: u32 = 1;
const FOLDER: &str = "model";
const RECORD: &str = "model.json";

/// The arrays of a model.
#[derive(Clone, Debug)]
pub struct ModelArrays {
    /// One for each channel.
    pub channels: Vec<ChannelArrays>,
    /// The photo without projector.
    pub ambient: Image,
    /// Pixels of photos.
    pub resolution: Resolution,
    /// Pixels of patterns; as many in all as those of photos.
    pub projector: Resolution,
    /// The unit of photos' values.
    pub unit: String,
    /// The name of the source that the model was captured from.
    pub source: String,
    /// Whether the light transport matrix is symmetric.
    pub symmetric: bool,
}

/// The arrays of one channel, of `n` pixels.
#[derive(Clone, Debug)]
pub struct ChannelArrays {
    /// `k` patterns of `n` values.
    pub patterns: Vec<Vec<f64>>,
    /// Their `k` photos of `n` values, without direct light.
    pub photos: Vec<Vec<f64>>,
    /// The direct light.
    pub direct: DirectArrays,
}

/// The direct light of a channel.
#[derive(Clone, Debug)]
pub enum DirectArrays {
    /// Not known, or part of the photos.
    None,
    /// A diagonal of `n` values.
    Image(Vec<f64>),
    /// A matrix of `n × n`.
    Matrix(Csr),
}

#[derive(Serialize, Deserialize)]
struct Record {
    krylux_model: u32,
    version: String,
    source: String,
    resolution: Resolution,
    projector: Resolution,
    unit: String,
    symmetric: bool,
    channels: Vec<ChannelRecord>,
}

#[derive(Serialize, Deserialize)]
struct ChannelRecord {
    photos: usize,
    direct: DirectRecord,
}

#[derive(Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
enum DirectRecord {
    None,
    Image,
    Matrix,
}

/// Whether `run` is the folder of a run that left a model.
pub fn is_in(run: &Path) -> bool {
    record_path(run).is_file()
}

/// `model/model.json` below the run's folder: the file that a run that asks the model depends on.
pub fn record_path(run: &Path) -> PathBuf {
    run.join(FOLDER).join(RECORD)
}

impl ModelArrays {
    /// Writes the model below the run's folder; returns the files' names, relative to that. The record comes last, so that a
    /// model without it is not whole.
    ///
    /// # Errors
    /// [`Error::Write`].
    pub fn write(&self, run: &Path) -> Result<Vec<String>> {
        let folder = run.join(FOLDER);
        std::fs::create_dir_all(&folder).map_err(Error::writing(&folder))?;
        let mut names = Vec::new();
        let mut path = |name: String| -> PathBuf {
            names.push(format!("{FOLDER}/{name}"));
            folder.join(name)
        };
        let mut channels = Vec::new();
        for (channel, ChannelArrays { patterns, photos, direct }) in self.channels.iter().enumerate() {
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
            channels.push(ChannelRecord { photos: patterns.len(), direct: kind });
        }
        npy::write_image(&path("ambient.npy".into()), &self.ambient)?;
        let record = Record {
            krylux_model: FORMAT,
            version: env!("CARGO_PKG_VERSION").into(),
            source: self.source.clone(),
            resolution: self.resolution,
            projector: self.projector,
            unit: self.unit.clone(),
            symmetric: self.symmetric,
            channels,
        };
        let path = path(RECORD.into());
        let text =
            serde_json::to_string_pretty(&record).map_err(|error| Error::writing(&path)(error.into()))?;
        atomic::write_bytes(&path, text.as_bytes())?;
        Ok(names)
    }

    /// Reads the model that a run left.
    ///
    /// # Errors
    /// [`Error::Read`]; [`Error::Data`] naming the file when it is malformed, of another size than the record says, or holds
    /// a value that is not a finite number.
    pub fn read(run: &Path) -> Result<Self> {
        let folder = run.join(FOLDER);
        let path = folder.join(RECORD);
        let record = read_record(&path)?;
        let mut channels = Vec::new();
        for (channel, of) in record.channels.iter().enumerate() {
            let stack = |name: &str, size: Resolution| -> Result<Vec<Vec<f64>>> {
                let path = folder.join(format!("{name}-{channel}.npy"));
                let values = numbers(&path, &[of.photos, size.height, size.width])?;
                Ok(values.chunks(size.pixels().max(1)).map(<[f64]>::to_vec).collect())
            };
            let Resolution { width, height } = record.resolution;
            let direct = |extension| folder.join(format!("direct-{channel}.{extension}"));
            channels.push(ChannelArrays {
                patterns: stack("patterns", record.projector)?,
                photos: stack("photos", record.resolution)?,
                direct: match of.direct {
                    DirectRecord::None => DirectArrays::None,
                    DirectRecord::Image => DirectArrays::Image(numbers(&direct("npy"), &[height, width])?),
                    DirectRecord::Matrix => DirectArrays::Matrix(sparse::read(&direct("npz"))?),
                },
            });
        }
        let ambient = npy::read_image(&folder.join("ambient.npy"))?;
        if channels.is_empty() || ambient.channels() != channels.len() {
            let fault = format!("it has {} channels, but ambient.npy {}", channels.len(), ambient.channels());
            return Err(unusable(&path, fault));
        }
        let Record { resolution, projector, unit, source, symmetric, .. } = record;
        if ambient.resolution() != resolution || resolution.pixels() != projector.pixels() {
            return Err(unusable(&path, "its sizes contradict each other".into()));
        }
        Ok(Self { channels, ambient, resolution, projector, unit, source, symmetric })
    }
}

fn read_record(path: &Path) -> Result<Record> {
    let bytes = std::fs::read(path).map_err(Error::reading(path))?;
    let record: Record = serde_json::from_slice(&bytes).map_err(|error| unusable(path, error.to_string()))?;
    match record.krylux_model {
        FORMAT => Ok(record),
        other => Err(unusable(path, format!("its format is {other}, but this krylux knows {FORMAT}"))),
    }
}

/// An array of this shape and of finite numbers.
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
    Error::Data {
        path: path.to_path_buf(),
        fault,
        help: "capture the model anew with `krylux relight SCENE`".into(),
    }
}
