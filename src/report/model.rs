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

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::{atomic, npy, sparse};
use crate::analysis::LowRank;
use crate::error::{Error, Result};
use crate::image::{Image, Resolution};

/// The version of the format.
const FORMAT: u32 = 1;
const FOLDER: &str = "model";
const RECORD: &str = "model.json";

/// A captured model with what belongs to it.
#[derive(Clone, Debug)]
pub struct SavedModel {
    /// One for each channel.
    pub channels: Vec<LowRank>,
    /// The photo without projector.
    pub ambient: Image,
    /// Pixels of photos.
    pub resolution: Resolution,
    /// Pixels of patterns; as many in all as those of photos.
    pub projector: Resolution,
    /// What the values of photos are in.
    pub unit: String,
    /// The name of what it was captured from.
    pub source: String,
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

impl SavedModel {
    /// Whether `run` is the folder of a run that left a model.
    pub fn is_in(run: &Path) -> bool {
        run.join(FOLDER).join(RECORD).is_file()
    }

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
        for (channel, model) in self.channels.iter().enumerate() {
            let stack = |vectors: &[Vec<f64>]| vectors.concat();
            let shape = |size: Resolution| [model.rank(), size.height, size.width];
            npy::write_npy(
                &path(format!("patterns-{channel}.npy")),
                &shape(self.projector),
                &stack(model.basis()),
            )?;
            npy::write_npy(
                &path(format!("photos-{channel}.npy")),
                &shape(self.resolution),
                &stack(model.photos()),
            )?;
            let direct = match (model.direct_matrix(), model.direct()) {
                (Some(matrix), _) => {
                    sparse::write(&path(format!("direct-{channel}.npz")), matrix)?;
                    DirectRecord::Matrix
                }
                (None, []) => DirectRecord::None,
                (None, direct) => {
                    let Resolution { width, height } = self.resolution;
                    npy::write_npy(&path(format!("direct-{channel}.npy")), &[height, width], direct)?;
                    DirectRecord::Image
                }
            };
            channels.push(ChannelRecord { photos: model.rank(), direct });
        }
        npy::write_image(&path("ambient.npy".into()), &self.ambient)?;
        let record = Record {
            krylux_model: FORMAT,
            version: env!("CARGO_PKG_VERSION").into(),
            source: self.source.clone(),
            resolution: self.resolution,
            projector: self.projector,
            unit: self.unit.clone(),
            symmetric: self.channels.iter().all(LowRank::is_symmetric),
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
    /// something that is no number.
    pub fn read(run: &Path) -> Result<Self> {
        let folder = run.join(FOLDER);
        let record = read_record(&folder.join(RECORD))?;
        let mut channels = Vec::new();
        for (channel, of) in record.channels.iter().enumerate() {
            let stack = |name: &str, size: Resolution| -> Result<Vec<Vec<f64>>> {
                let path = folder.join(format!("{name}-{channel}.npy"));
                let values = numbers(&path, &[of.photos, size.height, size.width])?;
                Ok(values.chunks(size.pixels().max(1)).map(<[f64]>::to_vec).collect())
            };
            let patterns = stack("patterns", record.projector)?;
            let photos = stack("photos", record.resolution)?;
            let Resolution { width, height } = record.resolution;
            let direct = match of.direct {
                DirectRecord::Image => {
                    numbers(&folder.join(format!("direct-{channel}.npy")), &[height, width])?
                }
                DirectRecord::None | DirectRecord::Matrix => Vec::new(),
            };
            let model = LowRank::new(patterns, photos, direct, record.symmetric)?;
            channels.push(match of.direct {
                DirectRecord::Matrix => {
                    model.with_direct_matrix(sparse::read(&folder.join(format!("direct-{channel}.npz")))?)?
                }
                _ => model,
            });
        }
        let ambient = npy::read_image(&folder.join("ambient.npy"))?;
        let path = folder.join(RECORD);
        if channels.is_empty() || ambient.channels() != channels.len() {
            let fault = format!("it has {} channels, but ambient.npy {}", channels.len(), ambient.channels());
            return Err(unusable(&path, fault));
        }
        if ambient.resolution() != record.resolution
            || record.resolution.pixels() != record.projector.pixels()
        {
            return Err(unusable(&path, "its sizes contradict each other".into()));
        }
        Ok(Self {
            channels,
            ambient,
            resolution: record.resolution,
            projector: record.projector,
            unit: record.unit,
            source: record.source,
        })
    }

    /// `model/model.json` below the run's folder: what a run that asks the model depends on.
    pub fn record_path(run: &Path) -> PathBuf {
        run.join(FOLDER).join(RECORD)
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sparse::Csr;

    /// Two photos of 3×2 pixels that look like nothing in particular.
    fn model(direct: Vec<f64>) -> Result<LowRank> {
        let unit = |at: usize| (0..6).map(|i| f64::from(u8::from(i == at))).collect::<Vec<f64>>();
        let photo = |at: usize| (0..6).map(|i| 1.0 / (1.0 + (i * at + i) as f64)).collect::<Vec<f64>>();
        LowRank::new(vec![unit(0), unit(4)], vec![photo(1), photo(2)], direct, true)
    }

    fn saved(channels: Vec<LowRank>) -> SavedModel {
        let resolution = Resolution::new(3, 2);
        SavedModel {
            ambient: Image::filled(resolution, channels.len(), 0.25),
            channels,
            resolution,
            projector: resolution,
            unit: "W/(m² sr)".into(),
            source: "test".into(),
        }
    }

    #[test]
    fn a_model_answers_to_the_bit_what_it_did_before_it_was_written() -> Result<()> {
        let folder = tempfile::tempdir().map_err(Error::writing("a temporary folder"))?;
        let spread = Csr::new(6, vec![0, 1, 3, 4, 5, 6, 6], vec![0, 0, 1, 2, 5, 4], vec![0.5; 6])?;
        let three = vec![
            model((0..6).map(|i| 0.1 * i as f64).collect())?,
            model(Vec::new())?,
            model(Vec::new())?.with_direct_matrix(spread)?,
        ];
        let saved = saved(three);
        assert!(!SavedModel::is_in(folder.path()));
        let names = saved.write(folder.path())?;
        assert!(
            SavedModel::is_in(folder.path()) && names.iter().all(|name| folder.path().join(name).exists())
        );
        let read = SavedModel::read(folder.path())?;
        let pattern: Vec<f64> = (0..6).map(|i| (i as f64).sin()).collect();
        for (before, after) in saved.channels.iter().zip(&read.channels) {
            assert_eq!(before.relight(&pattern), after.relight(&pattern));
            assert_eq!(before.dual(&pattern), after.dual(&pattern));
        }
        assert_eq!((read.ambient, read.unit), (saved.ambient, saved.unit));
        Ok(())
    }

    #[test]
    fn what_is_damaged_is_refused_by_name() -> Result<()> {
        let folder = tempfile::tempdir().map_err(Error::writing("a temporary folder"))?;
        saved(vec![model(Vec::new())?]).write(folder.path())?;
        let photos = folder.path().join("model/photos-0.npy");
        for values in [vec![0.5; 6], vec![f64::NAN; 12]] {
            npy::write_npy(&photos, &[values.len() / 6, 2, 3], &values)?;
            let refused = SavedModel::read(folder.path());
            assert!(matches!(refused, Err(Error::Data { ref path, .. }) if *path == photos));
        }
        std::fs::remove_file(&photos).map_err(Error::writing(&photos))?;
        assert!(matches!(SavedModel::read(folder.path()), Err(Error::Read { .. })));
        Ok(())
    }
}
