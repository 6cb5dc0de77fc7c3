//! The applications of a captured model: relit patterns, dual photographs, and photos without interreflections.

use std::path::Path;

use super::{LowRank, cancel_interreflections};
use crate::analysis::captures::{Posterior, PosteriorState, captured_checkerboards};
use crate::analysis::planes::{Planes, norm, relative_error};
use crate::error::{Error, Result};
use crate::finding::Ratio;
use crate::image::{Image, Resolution};
use crate::io::model::{ChannelArrays, DirectArrays, ModelArrays};
use crate::operator::Adjoint;
use crate::transport::Squares;

/// The largest number of products, with the model or the true matrix, to remove the interreflections of one photo.
const PRODUCTS: usize = 200;

/// A relit pattern.
#[derive(Clone, Debug)]
pub struct Relit {
    /// The pattern's name.
    pub name: String,
    /// The pattern.
    pub pattern: Image,
    /// The photo predicted by the model, including ambient light.
    pub relit: Image,
    /// The relative error due to the limited rank of the model, estimated from the model's own photos
    /// ([`LowRank::error_of_rank`](super::LowRank::error_of_rank)). It does not include the noise of the photos.
    pub stated: Ratio,
    /// The true photo, if the scene is simulated.
    pub truth: Option<Image>,
    /// The relative error `‖relit − true‖ / ‖true‖` of the projector's light for each number of photos from 1. The noise that the operator
    /// states for the true photo is subtracted. Empty if there is no true photo.
    pub errors: Vec<f64>,
    /// The difference between `relit` and `truth`, both without ambient light.
    pub comparison: Option<Squares>,
}

/// A dual photograph: the scene lit from the camera and seen from the projector.
#[derive(Clone, Debug)]
pub struct Dual {
    /// The name of the pattern on the camera's side.
    pub name: String,
    /// The photograph `Aᵀ y`.
    pub image: Image,
    /// The relative error of the dual photograph, if the scene is simulated.
    pub error: Option<f64>,
}

/// A photo without its interreflections.
#[derive(Clone, Debug)]
pub struct Reduced {
    /// The photo's name.
    pub name: String,
    /// The photo, without ambient light.
    pub photo: Image,
    /// The direct image `D A⁻¹ y`, computed with the model.
    pub direct: Image,
    /// The direct image computed with the true matrix, if the scene is simulated.
    pub truth: Option<Image>,
    /// The relative error `‖direct − true‖ / ‖true‖`.
    pub error: Option<f64>,
    /// The share of the photo that the model does not explain.
    pub residual: f64,
}

/// The plane of a pattern for a channel. A gray pattern has one plane for all channels.
fn plane(pattern: &Image, channel: usize) -> Vec<f64> {
    pattern.plane(channel.min(pattern.channels() - 1))
}

impl SavedModel {
    /// Relights a pattern with the model. `full`, if known, holds the true operators of all light, one per channel.
    pub fn relight<O: Adjoint>(&self, name: &str, pattern: Image, full: Option<&mut [O]>) -> Result<Relit> {
        let by_rank = |rank: usize| -> Planes {
            let each = self.channels.iter().enumerate();
            each.map(|(channel, of)| of.truncated(rank).relight(&plane(&pattern, channel))).collect()
        };
        let ranks = self.rank();
        let found = by_rank(ranks);
        let each = self.channels.iter().enumerate();
        let errors = each.map(|(channel, of)| of.error_of_rank(&plane(&pattern, channel)));
        let stated = Ratio::of(norm(&vec![errors.collect()]), norm(&found), 0.0);
        let mut noise = 0.0;
        let truth = products(full, |operator, channel| {
            let mut photo = vec![0.0; operator.rows()];
            operator.apply(&plane(&pattern, channel), &mut photo)?;
            noise += operator.standard_error().powi(2);
            Ok(photo)
        })?;
        let errors = match &truth {
            Some(truth) => (1..=ranks).map(|rank| error(squares(&by_rank(rank), truth, noise))).collect(),
            None => Vec::new(),
        };
        Ok(Relit {
            name: name.to_owned(),
            relit: self.with_ambient(&found)?,
            stated,
            comparison: truth.as_ref().map(|truth| squares(&found, truth, noise)),
            truth: truth.as_ref().map(|truth| self.with_ambient(truth)).transpose()?,
            pattern,
            errors,
        })
    }

    /// Computes the dual photograph under a pattern of camera pixels. `full` has the same meaning as in [`SavedModel::relight`].
    pub fn dual<O: Adjoint>(&self, name: String, pattern: &Image, full: Option<&mut [O]>) -> Result<Dual> {
        let each = self.channels.iter().enumerate();
        let found: Planes = each.map(|(channel, of)| of.dual(&plane(pattern, channel))).collect();
        let mut noise = 0.0;
        let truth = products(full, |operator, channel| {
            let mut photo = vec![0.0; operator.cols()];
            operator.apply_adjoint(&plane(pattern, channel), &mut photo)?;
            noise += operator.standard_error().powi(2);
            Ok(photo)
        })?;
        Ok(Dual {
            name,
            image: Image::from_planes(self.projector, &found)?,
            error: truth.map(|truth| error(squares(&found, &truth, noise))),
        })
    }

    /// Removes the interreflections from `photo`, which has no ambient light. `global`, if known, holds the true operators of the light of
    /// two or more bounces, one per channel. Fails with [`Error::Option`] naming `--inverse` if a channel's direct light is not a diagonal,
    /// or as [`cancel_interreflections`] does.
    pub fn reduce<O: Adjoint>(
        &self,
        name: String,
        photo: &Planes,
        global: Option<&mut [O]>,
    ) -> Result<Reduced> {
        if self.channels.iter().any(|of| of.direct().is_empty()) {
            return Err(Error::option("--inverse", "the direct light of this rig is not a diagonal, so a photo cannot be reduced to it pixel by pixel").help("leave it out, or use pinholes behind one beam splitter"));
        }
        let (mut found, mut residual) = (Planes::new(), 0.0_f64);
        for (of, photo) in self.channels.iter().zip(photo) {
            let cancelled = cancel_interreflections(&mut of.global(), of.direct(), photo, PRODUCTS)?;
            residual = residual.max(cancelled.residual);
            found.push(cancelled.direct);
        }
        let truth = products(global, |operator, channel| {
            let direct = self.channels[channel].direct();
            Ok(cancel_interreflections(operator, direct, &photo[channel], PRODUCTS)?.direct)
        })?;
        let image = |planes: &Planes| Image::from_planes(self.resolution, planes);
        Ok(Reduced {
            name,
            photo: image(photo)?,
            direct: image(&found)?,
            error: truth.as_ref().and_then(|truth| relative_error(&found, truth).value()),
            truth: truth.as_ref().map(image).transpose()?,
            residual,
        })
    }

    fn with_ambient(&self, light: &Planes) -> Result<Image> {
        let planes = crate::analysis::planes::sum(light, &self.ambient.planes());
        Image::from_planes(self.resolution, &planes)
    }
}

/// The difference between a computed photo and the true photo. The errors of the true photo have the expected sum of squares `noise`.
fn squares(found: &Planes, truth: &Planes, noise: f64) -> Squares {
    Squares::new(found.iter().flatten(), truth.iter().flatten(), noise)
}

/// The relative error of a computed photo, without the noise of the true photo. For a dark photo, the error is zero or infinite.
fn error(squares: Squares) -> f64 {
    match squares.relative() {
        Some([error, _]) => error,
        None if squares.difference > squares.noise => f64::INFINITY,
        None => 0.0,
    }
}

fn products<O: Adjoint>(
    operators: Option<&mut [O]>,
    mut product: impl FnMut(&mut O, usize) -> Result<Vec<f64>>,
) -> Result<Option<Planes>> {
    let Some(operators) = operators else { return Ok(None) };
    let each = operators.iter_mut().enumerate();
    Ok(Some(each.map(|(channel, operator)| product(operator, channel)).collect::<Result<Planes>>()?))
}

/// The captured models of all channels, with all data that relighting needs.
#[derive(Clone, Debug)]
pub struct SavedModel {
    /// The model of each channel.
    pub channels: Vec<LowRank>,
    /// The photo without the projector's light.
    pub ambient: Image,
    /// The resolution of photos.
    pub resolution: Resolution,
    /// The resolution of patterns. Patterns have the same total number of pixels as photos.
    pub projector: Resolution,
    /// The unit of the photos' values.
    pub unit: String,
    /// The name of the captured source.
    pub source: String,
}

impl SavedModel {
    /// The number of photos of the capture, which is the largest rank of the channels. A colour photo counts once.
    pub fn rank(&self) -> usize {
        self.channels.iter().map(LowRank::rank).max().unwrap_or(0)
    }

    /// The side of the squares and the places in each direction of shifted checkerboards that are among the captured patterns, if the model
    /// is made from captures.
    pub fn captured_checkerboards(&self) -> Option<[usize; 2]> {
        let state = self.channels.first()?.posterior()?.state();
        captured_checkerboards(&state.patterns, state.projector)
    }

    /// Writes the model to the run's folder ([`ModelArrays::write`]), and returns the names of the files, relative to the folder. Fails
    /// with [`crate::Error::Write`].
    pub fn write(&self, run: &Path) -> Result<Vec<String>> {
        let channels = self.channels.iter().map(|model| ChannelArrays {
            patterns: model.basis().to_vec(),
            photos: model.photos().to_vec(),
            direct: match (model.direct_matrix(), model.direct()) {
                (Some(matrix), _) => DirectArrays::Matrix(matrix.clone()),
                (None, []) => DirectArrays::None,
                (None, direct) => DirectArrays::Image(direct.to_vec()),
            },
            captured: model
                .posterior()
                .map(|posterior| posterior.state().arrays(model.near_matrix().cloned())),
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
            let ChannelArrays { patterns, photos, direct, captured } = arrays;
            let model = match direct {
                DirectArrays::None => LowRank::new(patterns, photos, Vec::new(), symmetric),
                DirectArrays::Image(direct) => LowRank::new(patterns, photos, direct, symmetric),
                DirectArrays::Matrix(direct) => {
                    LowRank::new(patterns, photos, Vec::new(), symmetric)?.with_direct_matrix(direct)
                }
            }?;
            let Some(mut captured) = captured else { return Ok(model) };
            let near = captured.near.take();
            let has_homes = near.is_some();
            let model = near.into_iter().try_fold(model, LowRank::with_near_matrix)?;
            let state = PosteriorState::from_arrays(captured, projector, has_homes).ok_or_else(|| {
                Error::data(run, "the record of its model names other scales than this program knows")
            })?;
            Ok(model.with_posterior(Posterior::of(state)?))
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
