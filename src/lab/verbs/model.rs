//! The model of light transport that a run left, or that its photos give.

use crate::analysis::low_rank::SavedModel;
use crate::error::{Error, Result};
use crate::io::model;
use crate::lab::Lab;
use crate::lab::run_model::open_model;
use crate::lab::source::Source;

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
