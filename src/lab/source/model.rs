//! Models of light transport as sources.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::analysis::LowRank;
use crate::analysis::captures::{CapturedLight, fit_captures};
use crate::analysis::low_rank::SavedModel;
use crate::error::Result;
use crate::finding::Finding;
use crate::image::Image;
use crate::io::{manifest, model};
use crate::lab::layout::RECORD;
use crate::lab::settings::ChannelChoice;
use crate::lab::{Log, SharedObserver};
use crate::measure::{Captures, RunManifest};
use crate::operator::{Adjoint, Operator, delegate};
use crate::sparse::{Csr, SparseOperator};
use crate::transport::Part;

/// The folder of a run that left a model but no journal, or of captures.
pub(in crate::lab) struct ModelSource {
    pub(in crate::lab) model: SavedModel,
    pub(in crate::lab) folder: PathBuf,
    /// The findings about the rig from the photos of the run.
    pub(in crate::lab) findings: Vec<Finding>,
    /// The captures and their fit, if the folder has captures.
    pub(in crate::lab) captured: Option<Arc<CapturedLight>>,
}

impl ModelSource {
    pub(in crate::lab) fn open(folder: &Path) -> Result<Self> {
        let record = RunManifest::read(&folder.join(RECORD)).ok().and_then(|record| record.rig);
        let findings = record.map_or(Vec::new(), |rig| rig.findings);
        Ok(Self { model: SavedModel::read(folder)?, folder: folder.to_path_buf(), findings, captured: None })
    }

    /// Reads a folder of captures, and fits a model to them. Fails as [`Captures::read`] and [`fit_captures`].
    pub(in crate::lab) fn of_captures(
        folder: &Path,
        channels: ChannelChoice,
        observer: &SharedObserver,
    ) -> Result<Self> {
        let captures = Captures::read(folder)?;
        observer.note(format_args!(
            "captures  {} photos of {} pixels, patterns of {}",
            captures.photos.len(),
            captures.ambient.resolution(),
            captures.patterns[0].resolution()
        ));
        let light = Arc::new(fit_captures(captures, channels == ChannelChoice::Luma)?);
        Ok(Self {
            model: light.model.clone(),
            folder: folder.to_path_buf(),
            findings: light.captures.findings.clone(),
            captured: Some(light),
        })
    }

    pub(in crate::lab) fn describe(&self, manifest: &mut RunManifest) {
        let path = match &self.captured {
            Some(light) => light.captures.path.clone(),
            None => model::record_path(&self.folder),
        };
        // The record was readable when the source was opened.
        let hash = crate::file::read(&path).map(|bytes| blake3::hash(&bytes).to_hex().to_string());
        manifest.scene = Some(manifest::SourceFile { path: (&path).into(), hash: hash.unwrap_or_default() });
        manifest.resolution = Some(self.model.resolution);
    }
}

pub(in crate::lab) struct ModelParts {
    pub(in crate::lab) model: SavedModel,
    global: Vec<LowRank>,
    direct: Vec<SparseOperator>,
}

impl ModelParts {
    pub(in crate::lab) fn new(model: SavedModel) -> Result<Self> {
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

    pub(in crate::lab) fn operator(&mut self, part: Part, channel: usize) -> ModelOperator<'_> {
        // The model of the full light and the model of the global light contain the same captured patterns.
        let (whole, global) = (&mut self.model.channels[channel], &mut self.global[channel]);
        let (operator, captured): (&mut dyn Adjoint, Option<&LowRank>) = match part {
            Part::Full => (whole, Some(global)),
            Part::Global => (global, Some(whole)),
            Part::Direct => (&mut self.direct[channel], None),
        };
        ModelOperator { operator, captured, errors: Vec::new() }
    }

    /// The standard errors of a photo's samples due to what the captured photos leave open.
    pub(in crate::lab) fn errors(&self, pattern: &Image) -> Result<Image> {
        let plane = |(channel, model): (usize, &LowRank)| {
            model.errors(&pattern.plane(channel.min(pattern.channels() - 1)))
        };
        let planes: Vec<Vec<f64>> = self.model.channels.iter().enumerate().map(plane).collect();
        Image::from_planes(self.model.resolution, &planes)
    }
}

/// One part and channel of a model. The stated errors of its products are due to the limited rank. Direct light is known exactly.
pub(in crate::lab) struct ModelOperator<'a> {
    operator: &'a mut dyn Adjoint,
    captured: Option<&'a LowRank>,
    errors: Vec<f64>,
}

impl ModelOperator<'_> {
    fn state_errors(&mut self, xs: &[&[f64]], of: fn(&LowRank, &[f64]) -> f64) {
        self.errors = xs.iter().map(|x| self.captured.map_or(0.0, |model| of(model, x))).collect();
    }
}

impl Operator for ModelOperator<'_> {
    delegate!(operator: rows, cols, symmetry, block_size);

    fn apply_block(&mut self, xs: &[&[f64]], ys: &mut [&mut [f64]]) -> Result<()> {
        self.state_errors(xs, LowRank::error_of_rank);
        self.operator.apply_block(xs, ys)
    }

    fn standard_errors(&self) -> Vec<f64> {
        self.errors.clone()
    }
}

impl Adjoint for ModelOperator<'_> {
    fn apply_adjoint_block(&mut self, ys: &[&[f64]], xs: &mut [&mut [f64]]) -> Result<()> {
        self.state_errors(ys, LowRank::dual_error);
        self.operator.apply_adjoint_block(ys, xs)
    }
}

/// An `n × n` diagonal matrix of `values`. If `values` is empty, the matrix is zero.
fn diagonal(n: usize, values: &[f64]) -> Result<Csr> {
    let row_start = (0..=n).map(|row| row.min(values.len())).collect();
    Csr::new(n, row_start, (0..values.len() as u32).collect(), values.to_vec())
}
