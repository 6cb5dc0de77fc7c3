//! The engines that take photos and products.

use std::sync::Arc;

use crate::analysis::LowRank;
use crate::error::{Error, Result};
use crate::image::Image;
use crate::lab::measured::MeasuredRig;
use crate::lab::source::{ExplicitParts, ModelParts, SceneSource};
use crate::operator::{Adjoint, Direction};
use crate::transport::{Assembled, Channels, EstimatedOperator, Part, Retraced, RetracedOperator, Transport};

/// A provider of photos.
pub(super) enum Engine {
    /// Products with a traced matrix.
    Replayed(Arc<Assembled>),
    /// A scene that is traced for each photo. The photos equal those of `Replayed`, up to rounding.
    Retraced(Retracing),
    /// A rig, or the photos of a rig that a run took.
    Measured(Box<MeasuredRig>),
    Explicit(Box<ExplicitParts>),
    Model(Box<ModelParts>),
    /// No engine, since every photo is in the journal.
    JournalOnly,
}

pub(super) struct Retracing {
    pub(super) scene: Box<SceneSource>,
    pub(super) channels: Channels,
    /// Whether the errors of products are known.
    pub(super) states_errors: bool,
}

impl Retracing {
    pub(super) fn with<T>(&self, work: impl FnOnce(Retraced<'_>) -> T) -> T {
        let mut tracer = self.scene.tracer();
        work(Retraced { tracer: &mut tracer, settings: self.scene.settings, channels: self.channels })
    }
}

impl Engine {
    /// Calls `work` with the operator of one part and channel.
    pub(super) fn with_operator<T>(
        &mut self,
        part: Part,
        channel: usize,
        work: impl FnOnce(&mut dyn Adjoint) -> Result<T>,
    ) -> Result<T> {
        match self {
            Self::Replayed(traced) => work(&mut traced.operator(part, channel)),
            Self::Retraced(scene) if scene.states_errors => {
                scene.with(|retraced| work(&mut EstimatedOperator::new(retraced, part, channel)))
            }
            Self::Retraced(scene) => {
                scene.with(|retraced| work(&mut RetracedOperator { retraced, part, channel }))
            }
            Self::Measured(rig) => work(&mut rig.measurement.operator(part, channel)),
            Self::Explicit(parts) => work(parts.operator(part, channel)?),
            Self::Model(parts) => work(&mut parts.operator(part, channel)),
            Self::JournalOnly => Err(Error::Interrupted),
        }
    }

    /// Products with several vectors, and their standard errors if the engine knows them.
    pub(super) fn products(
        &mut self,
        (part, channel): (Part, usize),
        direction: Direction,
        xs: &[&[f64]],
        ys: &mut [&mut [f64]],
    ) -> Result<Vec<f64>> {
        self.with_operator(part, channel, |operator| {
            operator.products(direction, xs, ys)?;
            Ok(operator.standard_errors())
        })
    }

    pub(super) fn photograph(&mut self, pattern: &Image) -> Result<Image> {
        match self {
            Self::Replayed(traced) => traced.photograph(pattern),
            Self::Retraced(scene) => scene.with(|mut retraced| retraced.photograph(pattern)),
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
