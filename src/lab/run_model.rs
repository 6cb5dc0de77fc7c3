//! Models of light transport, made from the photos of a run.

use std::path::Path;
use std::sync::Arc;

use super::layout::journal_folder;
use super::source::{RunPhotos, RunSource, Source};
use super::{Lab, Log, SharedObserver};
use crate::analysis::captures::CapturedLight;
use crate::analysis::low_rank::{SavedModel, estimated_direct, from_products};
use crate::error::{Error, Result};
use crate::image::Resolution;
use crate::io::model;
use crate::journal::Journal;
use crate::operator::Product;
use crate::transport::Channels;

/// The low-rank model of the run in a folder, either saved by the run or made from all photos of the run. No photo is taken.
///
/// # Errors
/// [`Error::Data`] if the folder has neither a model nor photos; [`Error::Journal`] if the photos do not suffice.
pub fn open_model(folder: &Path, observer: &SharedObserver) -> Result<SavedModel> {
    if model::is_in(folder) {
        return SavedModel::read(folder);
    }
    from_photos(&run_with_photos(folder)?, observer)
}

/// The channels of the model that [`open_model`] returns, and the resolutions of its photos and patterns. [`Error::Data`] without a model.
pub(crate) fn model_shape(folder: &Path) -> Result<(Channels, [Resolution; 2])> {
    if model::is_in(folder) {
        let model = SavedModel::read(folder)?;
        return Ok((Channels::of(model.channels.len()), [model.resolution, model.projector]));
    }
    let note = run_with_photos(folder)?.note;
    Ok((Channels::of(note.channels), [note.photos, note.patterns]))
}

impl Lab {
    /// The low-rank model of the light transport, either saved by the run or made from all photos of the run. No photo is taken.
    ///
    /// # Errors
    /// [`Error::Data`] if the source is not the folder of a run; [`Error::Journal`] if the photos of the run do not suffice.
    pub fn model(&self) -> Result<SavedModel> {
        match &self.source {
            Source::Model(source) => Ok(source.model.clone()),
            Source::Run(run) => open_model(&run.folder, &self.observer),
            _ => Err(Error::data(self.name(), "it holds no model, and no photos to make one of")
                .help("give the folder of a `krylux relight` run, or of another run that kept its photos")),
        }
    }

    /// Whether the source is the folder of a run, so that a model can predict further photos.
    pub fn has_model(&self) -> bool {
        matches!(self.source, Source::Model(_) | Source::Run(_))
    }

    /// The captures and their fit, if the source is a folder of captures.
    pub fn captured(&self) -> Option<&Arc<CapturedLight>> {
        match &self.source {
            Source::Model(source) => source.captured.as_ref(),
            _ => None,
        }
    }

    /// The checkerboards that were captured, as [`SavedModel::captured_checkerboards`].
    pub fn captured_checkerboards(&self) -> Option<[usize; 2]> {
        match &self.source {
            Source::Model(source) => source.model.captured_checkerboards(),
            _ => None,
        }
    }

    /// Whether the run that is the source saved a model.
    pub fn has_saved_model(&self) -> bool {
        match &self.source {
            Source::Model(source) => source.captured.is_none(),
            Source::Run(run) => model::is_in(&run.folder),
            _ => false,
        }
    }
}

fn run_with_photos(folder: &Path) -> Result<RunSource> {
    if Journal::is_in(&journal_folder(folder)) {
        return RunSource::open(folder);
    }
    Err(Error::data(folder, "there is no model in this folder, and there are no photos to make one of")
        .help("give the folder of a `krylux relight` run, or of another run that kept its photos"))
}

/// The model of each channel, made from all photos in the run's journal.
fn from_photos(run: &RunSource, observer: &SharedObserver) -> Result<SavedModel> {
    let note = &run.note;
    let RunPhotos { global, full, direct, ambient } = run.taken(observer)?;
    let mut channels = Vec::new();
    for (channel, (global, full)) in global.into_iter().zip(full).enumerate() {
        let known = direct.as_ref().and_then(|direct| direct.get(channel)).cloned();
        let direct = match known {
            Some(direct) => direct,
            None if global.is_empty() => estimated(&full, observer)?,
            None => {
                let fault = "the run kept photos without direct light, but not the direct light itself";
                return Err(Error::journal(&note.path, fault)
                    .help("run it anew with this version of krylux, or give the scene"));
            }
        };
        let less_direct = full.into_iter().map(|mut product: Product| {
            product.to.iter_mut().zip(&direct).zip(&product.from).for_each(|((y, d), x)| *y -= d * x);
            product
        });
        let products = global.into_iter().chain(less_direct).collect();
        channels.push(from_products(products, direct.clone(), note.symmetric)?);
    }
    Ok(SavedModel {
        channels,
        ambient,
        resolution: note.photos,
        projector: note.patterns,
        unit: note.kind.unit().into(),
        source: note.name.clone(),
    })
}

/// An estimate of the direct light, for a run that has the white photo but no measurement of the direct light.
fn estimated(full: &[Product], observer: &SharedObserver) -> Result<Vec<f64>> {
    let level = |product: &Product| product.from.iter().copied().fold(0.0, f64::max);
    // The mask excludes pixels that the rig never lights because its camera does not see them.
    let pixels = full.first().map_or(0, |product| product.from.len());
    let lit: Vec<bool> =
        (0..pixels).map(|pixel| full.iter().any(|product| product.from[pixel] != 0.0)).collect();
    let is_white = |product: &&Product| {
        let level = level(product);
        level > 0.0 && product.from.iter().zip(&lit).all(|(value, lit)| !lit || *value == level)
    };
    let Some(white) = full.iter().find(is_white) else {
        observer.note(format_args!(
            "note: the run has no white photo from which direct light could be estimated; it stays in the model, so that fine \
             detail of patterns is lost"
        ));
        return Ok(Vec::new());
    };
    observer.note(format_args!(
        "note: the run kept no direct light: it is estimated as a share of the white photo"
    ));
    let level = level(white);
    let white: Vec<f64> = white.to.iter().map(|value| value / level).collect();
    estimated_direct(full, &white)
}
