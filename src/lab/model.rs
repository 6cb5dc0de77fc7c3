//! Models of light transport as sources, and models from the photos that some run took.

use std::path::{Path, PathBuf};

use super::layout::journal_folder;
use super::run::{RunPhotos, RunSource};
use super::source::Source;
use super::{Lab, Log, SharedObserver};
use crate::analysis::LowRank;
use crate::analysis::low_rank::{SavedModel, estimated_direct, from_products};
use crate::error::{Error, Result};
use crate::image::Image;
use crate::io::{manifest, model};
use crate::journal::Journal;
use crate::measure::RunManifest;
use crate::operator::{Adjoint, Operator, Product, delegate};
use crate::sparse::{Csr, SparseOperator};
use crate::transport::Part;

/// The folder of a run that left a model, and no journal.
pub(super) struct ModelSource {
    pub(super) model: SavedModel,
    pub(super) folder: PathBuf,
}

impl ModelSource {
    pub(super) fn open(folder: &Path) -> Result<Self> {
        Ok(Self { model: SavedModel::read(folder)?, folder: folder.to_path_buf() })
    }

    /// Notes what a run depends on.
    pub(super) fn describe(&self, manifest: &mut RunManifest) {
        let path = model::record_path(&self.folder);
        // The record was read when the source was opened.
        let hash = std::fs::read(&path).map(|bytes| blake3::hash(&bytes).to_hex().to_string());
        manifest.scene =
            Some(manifest::Scene { path: path.display().to_string(), hash: hash.unwrap_or_default() });
        manifest.resolution = Some(self.model.resolution);
    }
}

/// The parts of a model, as operators.
pub(super) struct ModelParts {
    pub(super) model: SavedModel,
    global: Vec<LowRank>,
    direct: Vec<SparseOperator>,
}

impl ModelParts {
    pub(super) fn new(model: SavedModel) -> Result<Self> {
        let global = model.channels.iter().map(LowRank::global).collect();
        let direct = |channel: &LowRank| -> Result<SparseOperator> {
            Ok(SparseOperator::new(match channel.direct_matrix() {
                Some(matrix) => matrix.clone(),
                None => diagonal(channel.cols(), channel.direct())?,
            }))
        };
        let direct = model.channels.iter().map(direct).collect::<Result<_>>()?;
        Ok(Self { model, global, direct })
    }

    pub(super) fn operator(&mut self, part: Part, channel: usize) -> ModelOperator<'_> {
        // Either of the first two has the captured patterns.
        let (whole, global) = (&mut self.model.channels[channel], &mut self.global[channel]);
        let (operator, captured): (&mut dyn Adjoint, Option<&LowRank>) = match part {
            Part::Full => (whole, Some(global)),
            Part::Global => (global, Some(whole)),
            Part::Direct => (&mut self.direct[channel], None),
        };
        ModelOperator { operator, captured, errors: Vec::new() }
    }

    /// The standard errors of a photo's samples that the rank of the model leaves, spread evenly over the pixels.
    pub(super) fn errors(&self, pattern: &Image) -> Result<Image> {
        let plane = |(channel, model): (usize, &LowRank)| {
            let error = model.error_of_rank(&pattern.plane(channel.min(pattern.channels() - 1)));
            vec![error / (model.rows().max(1) as f64).sqrt(); model.rows()]
        };
        let planes: Vec<Vec<f64>> = self.model.channels.iter().enumerate().map(plane).collect();
        Image::from_planes(self.model.resolution, &planes)
    }
}

/// One part and channel of a model, which states what its rank leaves open as the errors of its products. Direct light is known.
pub(super) struct ModelOperator<'a> {
    operator: &'a mut dyn Adjoint,
    captured: Option<&'a LowRank>,
    errors: Vec<f64>,
}

impl ModelOperator<'_> {
    fn state_errors(&mut self, xs: &[&[f64]]) {
        let error = |x: &&[f64]| self.captured.map_or(0.0, |model| model.error_of_rank(x));
        self.errors = xs.iter().map(error).collect();
    }
}

impl Operator for ModelOperator<'_> {
    delegate!(operator: rows, cols, symmetry, block_size);

    fn apply(&mut self, x: &[f64], y: &mut [f64]) -> Result<()> {
        self.apply_block(&[x], &mut [y])
    }

    fn apply_block(&mut self, xs: &[&[f64]], ys: &mut [&mut [f64]]) -> Result<()> {
        self.state_errors(xs);
        self.operator.apply_block(xs, ys)
    }

    fn standard_errors(&self) -> Vec<f64> {
        self.errors.clone()
    }
}

impl Adjoint for ModelOperator<'_> {
    fn apply_adjoint(&mut self, y: &[f64], x: &mut [f64]) -> Result<()> {
        self.state_errors(&[y]);
        self.operator.apply_adjoint(y, x)
    }
}

/// A diagonal matrix of `n × n`; without values it is zero.
fn diagonal(n: usize, values: &[f64]) -> Result<Csr> {
    let row_start = (0..=n).map(|row| row.min(values.len())).collect();
    Csr::new(n, row_start, (0..values.len() as u32).collect(), values.to_vec())
}

impl Lab {
    /// The low-rank model of the light transport: the one that a run left, or one from all the photos that a run took. No photo is taken.
    ///
    /// # Errors
    /// [`Error::Data`] where the source is not the folder of a run; [`Error::Journal`] where its photos do not suffice.
    pub fn model(&self) -> Result<SavedModel> {
        match &self.source {
            Source::Model(source) => Ok(source.model.clone()),
            Source::Run(run) => open_model(&run.folder, &self.observer),
            _ => Err(Error::Data {
                path: self.name().into(),
                fault: "it holds no model, and no photos to make one of".into(),
                help: "give the folder of a `krylux relight` run, or of another run that kept its photos"
                    .into(),
            }),
        }
    }

    /// Whether a model answers without further photos: whether the source is the folder of a run.
    pub fn has_model(&self) -> bool {
        matches!(self.source, Source::Model(_) | Source::Run(_))
    }

    /// Whether the run that is the source left a model.
    pub fn has_saved_model(&self) -> bool {
        match &self.source {
            Source::Model(_) => true,
            Source::Run(run) => model::is_in(&run.folder),
            _ => false,
        }
    }
}

/// The low-rank model in the folder of a run: the one that the run left, or one from all the photos that it took. No photo is taken.
///
/// # Errors
/// [`Error::Data`] where there is neither; [`Error::Journal`] where the photos do not suffice.
pub fn open_model(folder: &Path, observer: &SharedObserver) -> Result<SavedModel> {
    if model::is_in(folder) {
        return SavedModel::read(folder);
    }
    if Journal::is_in(&journal_folder(folder)) {
        return from_photos(&RunSource::open(folder)?, observer);
    }
    Err(Error::Data {
        path: folder.to_path_buf(),
        fault: "there is no model in this folder, and there are no photos to make one of".into(),
        help: "give the folder of a `krylux relight` run, or of another run that kept its photos".into(),
    })
}

/// The model of each channel from all that the run's journal holds.
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
                return Err(Error::Journal {
                    path: note.path.clone(),
                    fault: "the run kept photos without direct light, but not the direct light itself".into(),
                    help: "run it anew with this version of krylux, or give the scene".into(),
                });
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

/// The direct light where it was not measured, from a run that has the white photo among its photos.
fn estimated(full: &[Product], observer: &SharedObserver) -> Result<Vec<f64>> {
    let level = |product: &Product| product.from.iter().copied().fold(0.0, f64::max);
    // A rig never lights the pixels that its camera does not see.
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
