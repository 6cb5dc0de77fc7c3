//! A captured model with its metadata, written to and read from disk.

use std::path::Path;

use super::LowRank;
use crate::error::Result;
use crate::image::{Image, Resolution};
use crate::io::model::{ChannelArrays, DirectArrays, ModelArrays};

/// A captured model of every channel, with everything that relighting needs.
#[derive(Clone, Debug)]
pub struct SavedModel {
    /// The model of each channel.
    pub channels: Vec<LowRank>,
    /// The photo without projector.
    pub ambient: Image,
    /// The resolution of photos.
    pub resolution: Resolution,
    /// The resolution of patterns. They have the same total number of pixels as photos.
    pub projector: Resolution,
    /// The unit of photos' values.
    pub unit: String,
    /// The name of the captured source.
    pub source: String,
}

impl SavedModel {
    /// The number of photos of the capture: the largest rank of the channels. A colour photo counts once.
    pub fn rank(&self) -> usize {
        self.channels.iter().map(LowRank::rank).max().unwrap_or(0)
    }

    /// Writes the model to the run's folder ([`ModelArrays::write`]) and returns the files' names relative to it.
    /// Fails with [`crate::Error::Write`].
    pub fn write(&self, run: &Path) -> Result<Vec<String>> {
        let channels = self.channels.iter().map(|model| ChannelArrays {
            patterns: model.basis().to_vec(),
            photos: model.photos().to_vec(),
            direct: match (model.direct_matrix(), model.direct()) {
                (Some(matrix), _) => DirectArrays::Matrix(matrix.clone()),
                (None, []) => DirectArrays::None,
                (None, direct) => DirectArrays::Image(direct.to_vec()),
            },
        });
        let arrays = ModelArrays {
            channels: channels.collect(),
            ambient: self.ambient.clone(),
            resolution: self.resolution,
            projector: self.projector,
            unit: self.unit.clone(),
            source: self.source.clone(),
            symmetric: self.channels.iter().all(LowRank::is_symmetric),
        };
        arrays.write(run)
    }

    /// Reads the model of a run. Fails as [`ModelArrays::read`] does.
    pub fn read(run: &Path) -> Result<Self> {
        let ModelArrays { channels, ambient, resolution, projector, unit, source, symmetric } =
            ModelArrays::read(run)?;
        let model = |arrays: ChannelArrays| {
            let ChannelArrays { patterns, photos, direct } = arrays;
            match direct {
                DirectArrays::None => LowRank::new(patterns, photos, Vec::new(), symmetric),
                DirectArrays::Image(direct) => LowRank::new(patterns, photos, direct, symmetric),
                DirectArrays::Matrix(direct) => {
                    LowRank::new(patterns, photos, Vec::new(), symmetric)?.with_direct_matrix(direct)
                }
            }
        };
        let channels = channels.into_iter().map(model).collect::<Result<_>>()?;
        Ok(Self { channels, ambient, resolution, projector, unit, source })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Error;
    use crate::io::{model, npy};
    use crate::sparse::Csr;

    /// Two photos of 3×2 pixels without particular structure.
    fn low_rank(direct: Vec<f64>) -> Result<LowRank> {
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
            low_rank((0..6).map(|i| 0.1 * i as f64).collect())?,
            low_rank(Vec::new())?,
            low_rank(Vec::new())?.with_direct_matrix(spread)?,
        ];
        let saved = saved(three);
        assert!(!model::is_in(folder.path()));
        let names = saved.write(folder.path())?;
        assert!(model::is_in(folder.path()) && names.iter().all(|name| folder.path().join(name).exists()));
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
        saved(vec![low_rank(Vec::new())?]).write(folder.path())?;
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
