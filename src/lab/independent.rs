//! Light that an answer was not computed from: light paths with another seed, or one more photo of a rig.

use std::sync::{Arc, Mutex};

use super::source::Source;
use super::transport::LightTransport;
use super::{Lab, LabOperator};
use crate::error::Result;
use crate::io::manifest::Independent;
use crate::operator::Operator;
use crate::transport::{EstimatedProduct, Part, Question, Retraced, with_other_seed};

impl Lab {
    /// Operators of a scene, one for each channel, traced with another seed. They state the errors of their products. Each product traces
    /// the scene once more. The result is `None` for other sources, and for one light path per pixel, since its noise is not known.
    pub(crate) fn independent_operators(&mut self, part: Part) -> Result<Option<Vec<LabOperator>>> {
        let Source::Scene(scene) = &self.source else { return Ok(None) };
        if scene.settings.samples < 2 {
            return Ok(None);
        }
        let other = scene.with_settings(with_other_seed(&scene.settings));
        let transport = LightTransport::of_estimated(&other, &self.settings, self.channels, &self.observer)?;
        let transport = Arc::new(Mutex::new(transport));
        let operator = |channel| LabOperator::new(&transport, part, channel, &self.observer, None);
        Ok(Some((0..self.channels.count()).map(operator).collect()))
    }

    /// Products with light that no answer was computed from, if such light exists.
    pub(super) fn independent(
        &mut self,
        part: Part,
        channel: usize,
        asked: &[Question<'_>],
    ) -> Result<Option<(Independent, Vec<EstimatedProduct>)>> {
        match &self.source {
            Source::Scene(scene) => {
                let mut tracer = scene.tracer();
                let settings = with_other_seed(&scene.settings);
                // The noise is estimated from two halves of the samples.
                if settings.samples < 2 {
                    return Ok(None);
                }
                let mut retraced = Retraced { tracer: &mut tracer, settings, channels: self.channels };
                let products = retraced.estimated_products(part, channel, asked)?;
                Ok(Some((Independent::AnotherSeed, products)))
            }
            Source::Rig(_) => {
                let mut operator = self.channel_operator(part, channel)?;
                let photo = |question: &Question<'_>| {
                    let mut product = vec![0.0; operator.rows()];
                    operator.apply(question.pattern, &mut product)?;
                    let error = operator.standard_error() / (product.len().max(1) as f64).sqrt();
                    Ok(EstimatedProduct { error: vec![error; product.len()], product, quadratic: None })
                };
                let products = asked.iter().map(photo).collect::<Result<_>>()?;
                Ok(Some((Independent::AnotherPhoto, products)))
            }
            Source::Run(_) | Source::Model(_) | Source::Matrix(_) => Ok(None),
        }
    }
}
