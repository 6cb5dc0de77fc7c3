//! Low-rank models of light transport on disk: the folder `model/` in the folder of the run that captured the
//! model.
//!
//! | file | content |
//! |---|---|
//! | `model.json` | the format's version, the sizes and the source |
//! | `patterns-C.npy` | `Q` of channel `C`: `k×H×W` of the projector's pixels, `f64` |
//! | `photos-C.npy` | `W = G Q`: `k×H×W` of the camera's pixels, `f64` |
//! | `direct-C.npy` or `.npz` | the direct light: an image `H×W`, or a sparse matrix if it is not diagonal |
//! | `ambient.npy` | the photo without the projector |
//!
//! NumPy and SciPy read all of these files. With `d` the direct light,
//! `A x = d*x + W @ (Q.T @ x) + Q @ (W.T @ (x − Q @ (Q.T @ x)))`. The last term belongs to symmetric models
//! only.
//!
//! This module reads and writes the arrays; [`crate::analysis::low_rank`] defines their meaning.

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

/// The arrays of a model, and what is needed to interpret them.
#[derive(Clone, Debug)]
pub struct ModelArrays {
    /// The arrays of each channel.
    pub channels: Vec<ChannelArrays>,
    /// The photo without the projector.
    pub ambient: Image,
    /// The resolution of photos.
    pub resolution: Resolution,
    /// The resolution of patterns. It has the same number of pixels as that of photos.
    pub projector: Resolution,
    /// The unit of the photos' values.
    pub unit: String,
    /// The name of the source that the model was captured from.
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
}

/// The direct light of a channel.
#[derive(Clone, Debug)]
pub enum DirectArrays {
    /// The direct light is unknown, or it is part of the photos.
    None,
    /// A diagonal matrix, given by its `n` diagonal values.
    Image(Vec<f64>),
    /// An `n × n` matrix.
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

/// Whether the run's folder `run` contains a model.
pub fn is_in(run: &Path) -> bool {
    record_path(run).is_file()
}

/// The path of the model's record, `model/model.json`, in the run's folder `run`. Runs that use the model
/// depend on this file.
pub fn record_path(run: &Path) -> PathBuf {
    run.join(FOLDER).join(RECORD)
}

impl ModelArrays {
    /// Writes the model into the run's folder `run`. Returns the names of its files relative to that folder.
    /// The record is written last, so that a model with a record is complete.
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

    /// Reads the model in the run's folder `run`.
    ///
    /// # Errors
    /// [`Error::Read`]; [`Error::Data`] naming the file when it is malformed, when its size differs from the
    /// record's, or when it has a value that is not finite.
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
        other => Err(unusable(path, format!("its format is {other}, but this krylux reads format {FORMAT}"))),
    }
}

/// Reads an array and checks that it has this shape and finite values.
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
