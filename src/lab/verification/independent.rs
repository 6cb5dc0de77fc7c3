//! Light that is independent of an answer: light paths with another seed, or a further photo of a rig (for a compensation, of its pattern).

use std::f64::consts::SQRT_2;
use std::sync::{Arc, Mutex};

use super::{AS_A_RIG_STATES, Light, Predicted, photos_compared};
use crate::analysis::Compensation;
use crate::error::Result;
use crate::image::Image;
use crate::io::manifest::Independent;
use crate::lab::lock;
use crate::lab::source::Source;
use crate::lab::transport::LightTransport;
use crate::lab::{Lab, LabOperator, Verified};
use crate::operator::{Operator, product};
use crate::render::TraceSettings;
use crate::transport::{EstimatedProduct, Part, Question, Retraced, pooled, with_other_seed};

impl Lab {
    /// Operators of a scene, one for each channel, traced with another seed. Each product traces the scene once more and states its errors.
    /// Returns `None` for other sources. Also returns `None` for one light path per pixel, because the noise is then unknown.
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

    /// Products by light that is independent of the answer, if such light exists. For a scene, `paths` makes the settings of the check from
    /// those of the run. The check then has another seed as well.
    pub(super) fn independent(
        &mut self,
        part: Part,
        channel: usize,
        asked: &[Question<'_>],
        paths: fn(&TraceSettings) -> TraceSettings,
    ) -> Result<Option<(Light, Vec<EstimatedProduct>)>> {
        match &self.source {
            Source::Scene(scene) => {
                let mut tracer = scene.tracer();
                let settings = with_other_seed(&paths(&scene.settings));
                // The noise is estimated from two halves of the samples, so at least two samples are necessary.
                if settings.samples < 2 {
                    return Ok(None);
                }
                let mut retraced = Retraced { tracer: &mut tracer, settings, channels: self.channels };
                let products = retraced.estimated_products(part, channel, asked)?;
                // The variance of independent samples is inversely proportional to their number. The variance of Sobol points falls
                // faster, so the noise of the run may be smaller than this, but not larger.
                let own = f64::from(settings.samples) / f64::from(scene.settings.samples);
                Ok(Some((Light { by: Independent::AnotherSeed, own }, products)))
            }
            Source::Rig(_) => {
                let mut operator = self.channel_operator(part, channel)?;
                let photo = |question: &Question<'_>| {
                    let product = product(&mut operator, question.pattern)?;
                    let error = operator.standard_error() / (product.len().max(1) as f64).sqrt();
                    Ok(EstimatedProduct { error: vec![error; product.len()], product, quadratic: None })
                };
                let products = asked.iter().map(photo).collect::<Result<_>>()?;
                Ok(Some((Light { by: Independent::AnotherPhoto, own: AS_A_RIG_STATES }, products)))
            }
            Source::Run(_) | Source::Model(_) | Source::Matrix(_) => Ok(None),
        }
    }

    /// Verifies a compensation with a photo of its pattern by independent light. The photo includes the ambient light. The residual is
    /// computed from the photo without noise. A rig whose colours mix is not supported. Fails as [`Lab::operator`].
    pub fn verify_compensation(&mut self, found: &Compensation) -> Result<Option<Verified>> {
        let ambient = self.ambient()?;
        let mut predicted = self.predicted(&[(&found.pattern, &found.observed)], &ambient);
        let target = self.predicted(&[(&found.pattern, &found.target)], &ambient);
        if matches!(self.source, Source::Rig(_))
            && let Some(rig) = lock(self.transport()?).rig()
        {
            // For each of the two photos, the pattern is rounded to the projector's levels. The two errors are independent, hence √2.
            let rounding = rig.measurement.rounding(&found.pattern)?;
            predicted.iter_mut().zip(rounding).for_each(|(one, norm)| one.stated = SQRT_2 * norm);
        }
        let Some((light, products)) = self.photo_of(&found.pattern, &predicted)? else { return Ok(None) };
        let [mut off, mut size] = [0.0; 2];
        for (target, product) in target.iter().zip(&products) {
            let squares = product.squares(&target.photo);
            off += squares.difference - squares.noise;
            size += target.photo.iter().map(|value| value * value).sum::<f64>();
        }
        let resolution = found.observed.resolution();
        let seen = |(product, ambient): (&EstimatedProduct, &Vec<f64>)| -> Vec<f64> {
            product.product.iter().zip(ambient).map(|(product, ambient)| product + ambient).collect()
        };
        let seen: Vec<Vec<f64>> = products.iter().zip(&ambient.planes()).map(seen).collect();
        let photo = Image::from_planes(resolution, &seen)?;
        let errors: Vec<Vec<f64>> = products.iter().map(|product| product.error.clone()).collect();
        let errors = Image::from_planes(resolution, &errors)?;
        // The photo of a rig states standard errors. Light paths give a single draw of the error, so their errors are pooled.
        let standard_error = if light.by == Independent::AnotherSeed { pooled(&errors)? } else { errors };
        let compared = photos_compared(light, &predicted, &products);
        let verification = self.checked(light.by, "the photo of the compensation", &compared, |_| None);
        let residual = (off.max(0.0) / size).sqrt();
        Ok(verification.map(|verification| Verified {
            residual: Some(residual),
            photo: Some([photo, standard_error]),
            ..verification.into()
        }))
    }

    /// The photo of a pattern within `[0, 1]` by independent light, for each channel, without ambient light. A rig states errors per pixel.
    fn photo_of(
        &mut self,
        pattern: &Image,
        predicted: &[Predicted],
    ) -> Result<Option<(Light, Vec<EstimatedProduct>)>> {
        if !matches!(self.source, Source::Rig(_)) {
            return self.products_of(Part::Full, predicted);
        }
        let (photo, errors) = lock(self.transport()?).photograph_with_error(pattern)?;
        let Some(errors) = errors else { return Ok(None) };
        let product =
            |(product, error): (Vec<f64>, Vec<f64>)| EstimatedProduct { product, error, quadratic: None };
        Ok(Some((
            Light { by: Independent::AnotherPhoto, own: AS_A_RIG_STATES },
            photo.planes().into_iter().zip(errors.planes()).map(product).collect(),
        )))
    }
}
