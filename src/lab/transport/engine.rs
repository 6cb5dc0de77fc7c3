//! The engines that compute or take photos.

use std::sync::Arc;

use crate::analysis::LowRank;
use crate::error::{Error, Result};
use crate::image::Image;
use crate::lab::measured::MeasuredRig;
use crate::lab::source::ExplicitParts;
use crate::lab::source::ModelParts;
use crate::lab::source::SceneSource;
use crate::operator::Adjoint;
use crate::transport::{Assembled, Channels, EstimatedOperator, Part, Retraced, RetracedOperator, Transport};

pub(super) enum Engine {
    /// Products with a traced matrix.
    Replayed(Arc<Assembled>),
    /// A scene that is traced for each photo. The photos equal those of `Replayed`, up to rounding.
    Retraced(Box<SceneSource>, Channels),
    /// As `Retraced`, with known errors of the products.
    Estimated(Box<SceneSource>, Channels),
    /// A rig, or the photos of a rig that a run took.
    Measured(Box<MeasuredRig>),
    Explicit(Box<ExplicitParts>),
    Model(Box<ModelParts>),
    /// No engine, since every photo is in the journal.
    JournalOnly,
}

impl Engine {
    /// Lets `work` multiply with one part and channel.
    pub(super) fn with_operator<T>(
        &mut self,
        part: Part,
        channel: usize,
        work: impl FnOnce(&mut dyn Adjoint) -> Result<T>,
    ) -> Result<T> {
        match self {
            Self::Replayed(traced) => work(&mut traced.operator(part, channel)),
            Self::Retraced(scene, channels) => {
                let mut tracer = scene.tracer();
                let retraced =
                    Retraced { tracer: &mut tracer, settings: scene.settings, channels: *channels };
                work(&mut RetracedOperator { retraced, part, channel })
            }
            Self::Estimated(scene, channels) => {
                let mut tracer = scene.tracer();
                let retraced =
                    Retraced { tracer: &mut tracer, settings: scene.settings, channels: *channels };
                work(&mut EstimatedOperator::new(retraced, part, channel))
            }
            Self::Measured(rig) => work(&mut rig.measurement.operator(part, channel)),
            Self::Explicit(parts) => work(parts.operator(part)?),
            Self::Model(parts) => work(&mut parts.operator(part, channel)),
            Self::JournalOnly => Err(Error::Interrupted),
        }
    }

    pub(super) fn photograph(&mut self, pattern: &Image) -> Result<Image> {
        match self {
            Self::Replayed(traced) => traced.photograph(pattern),
            Self::Retraced(scene, channels) | Self::Estimated(scene, channels) => {
                let mut tracer = scene.tracer();
                Retraced { tracer: &mut tracer, settings: scene.settings, channels: *channels }
                    .photograph(pattern)
            }
            Self::Measured(rig) => rig.measurement.photograph(pattern)?.to_image(),
            Self::Explicit(parts) => parts.photograph(pattern),
            Self::Model(parts) => {
                let none: Option<&mut [LowRank]> = None;
                Ok(parts.model.relight("", pattern.clone(), none)?.relit)
            }
            Self::JournalOnly => Err(Error::Interrupted),
        }
    }
}
