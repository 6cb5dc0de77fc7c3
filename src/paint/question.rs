//! The questions that the page can ask: groups, eigenvectors, and the pattern for a wanted photo.

use serde::{Deserialize, Serialize};

use super::canvas::{Canvas, Light};
use crate::analysis::planes::{self, Planes};
use crate::error::{Error, Result};
use crate::krylov::{EigsOptions, Method, SolveOptions, eigs, solve_adjoint};
use crate::lab::Answer as _;
use crate::lab::text::decimal;
use crate::operator::{Adjoint, Operator, Symmetry, delegate};
use crate::transport::Part;
use crate::verbs::{Segment, Segmented};

/// The largest number of eigenvectors or groups that a page may request.
pub(super) const MOST: usize = 32;

/// A question.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(tag = "ask", rename_all = "lowercase")]
pub enum PageQuestion {
    /// The eigenvectors of the largest eigenvalues of a part of the light.
    Eigenvectors {
        /// All light, or global light.
        light: Light,
        /// The number of eigenvectors, from 1 to 32.
        count: usize,
    },
    /// Groups of pixels that exchange light, for each of these numbers of groups. If no number is given, the light determines it.
    Groups {
        /// Numbers from 2 to 32.
        groups: Vec<usize>,
    },
    /// The pattern whose photo is nearest to a target. Each camera pixel has a weight.
    Pattern {
        /// The wanted photo, `channels × pixels`, in the unit of photos.
        target: Vec<Vec<f32>>,
        /// The weight of each camera pixel, from 0 to 1.
        weights: Vec<f32>,
    },
}

/// An answer: numbers for a JSON text, and planes.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct PageAnswer {
    /// Eigenvalues, one for each plane, or the relative residual of a pattern.
    pub values: Vec<f64>,
    /// The numbers of groups, one for each plane.
    pub groups: Vec<usize>,
    /// The result as a sentence.
    pub status: String,
    /// Eigenvectors, labels or the pattern.
    #[serde(skip)]
    pub planes: Planes,
}

impl From<&Segmented> for PageAnswer {
    fn from(answer: &Segmented) -> Self {
        let found = &answer.segmentation;
        let plane = |labels: &Vec<u8>| labels.iter().map(|&label| f64::from(label)).collect();
        Self {
            values: found.eigenvalues.clone(),
            groups: found.labels.iter().map(|(groups, _)| *groups).collect(),
            status: answer.headline(),
            planes: found.labels.iter().map(|(_, labels)| plane(labels)).collect(),
        }
    }
}

impl Canvas<'_> {
    /// Answers a question.
    ///
    /// # Errors
    /// [`Error::Option`] for a question that this source cannot answer; the errors of the methods used.
    pub fn answer(&mut self, question: &PageQuestion) -> Result<PageAnswer> {
        match question {
            PageQuestion::Eigenvectors { light, count } => self.eigenvectors(*light, *count),
            PageQuestion::Groups { groups } => self.groups(groups),
            PageQuestion::Pattern { target, weights } => self.pattern_for(target, weights),
        }
    }

    fn eigenvectors(&mut self, light: Light, count: usize) -> Result<PageAnswer> {
        let Some(part) = light.part() else {
            return refused("eigenvectors of single bounces", "choose all, direct or global light");
        };
        let count = count.clamp(1, MOST);
        let options = EigsOptions { count, products: 60.max(4 * count), ..EigsOptions::default() };
        let found = eigs(&mut self.operators(part)?[0], &options)?;
        let values = found.values.iter().zip(&found.residuals);
        let worst = values.map(|(value, residual)| residual / value.abs().max(f64::MIN_POSITIVE));
        let worst = worst.fold(0.0, f64::max);
        let (products, of_channel) = (found.stats.products, self.of_channel());
        let status = format!("{products} products; relative residuals up to {worst:.1e}{of_channel}");
        Ok(PageAnswer { values: found.values, groups: Vec::new(), status, planes: found.vectors })
    }

    fn groups(&mut self, groups: &[usize]) -> Result<PageAnswer> {
        let groups: Vec<usize> =
            groups.iter().copied().filter(|groups| (2..=MOST).contains(groups)).collect();
        let eigenvectors = groups.iter().copied().max().unwrap_or(0).max(10);
        let request = Segment { groups, eigenvectors, ..Segment::default() };
        let resolution = self.camera();
        let global = &mut self.operators(Part::Global)?[0];
        let mut answer = PageAnswer::from(&request.run(global, resolution, 0)?);
        answer.status += self.of_channel();
        Ok(answer)
    }

    fn of_channel(&self) -> &'static str {
        if self.channels() > 1 { "; of red light" } else { "" }
    }

    /// The pattern for a target, computed by FISTA. If all pixels have the same weight, krylov-box is used, since it needs fewer photos.
    fn pattern_for(&mut self, target: &[Vec<f32>], weights: &[f32]) -> Result<PageAnswer> {
        let pixels = self.camera().pixels();
        if self.projector().pixels() != pixels {
            return refused(
                "a pattern for a wanted photo, where camera and projector have different pixels",
                "use a coaxial rig",
            );
        }
        let is_valid = |plane: &[f32]| plane.len() == pixels && plane.iter().all(|value| value.is_finite());
        if target.len() != self.channels()
            || !target.iter().all(|plane| is_valid(plane))
            || !is_valid(weights)
        {
            return refused("a target that does not have the photo's pixels", "send planes as the photo has");
        }
        let weights: Vec<f64> = weights.iter().map(|&weight| f64::from(weight.clamp(0.0, 1.0))).collect();
        let ambient = self.ambient_of(Light::All).cloned().unwrap_or_default();
        let white = planes::difference(self.white()?, &ambient);
        let products = if self.is_live() { 30 } else { 200 };
        let is_even = weights.iter().all(|&weight| weight == 1.0);
        let method = if is_even { Method::KrylovBox } else { Method::Fista };
        let mut answer = PageAnswer::default();
        let channels = self.operators(Part::Full)?.iter_mut().zip(white);
        for (channel, (operator, white)) in channels.enumerate() {
            let wanted = target[channel].iter().zip(&ambient[channel]).zip(&weights);
            let b: Vec<f64> =
                wanted.map(|((&target, ambient), weight)| weight * (f64::from(target) - ambient)).collect();
            // With weights, the start is a black pattern. Light that affects no weighted pixel then stays off.
            let x0 = (!is_even).then(|| vec![0.0; pixels]);
            let options =
                SolveOptions { products, rtol: 1e-3, diagonal: Some(white), x0, ..SolveOptions::default() };
            let found = solve_adjoint(method, &mut Weighted { operator, weights: &weights }, &b, &options)?;
            answer.values.push(found.residual);
            answer.planes.push(found.x);
        }
        let worst = answer.values.iter().copied().fold(0.0, f64::max);
        answer.status = format!("relative residual {}", decimal(worst, 4));
        Ok(answer)
    }
}

fn refused<T>(what: &str, help: &str) -> Result<T> {
    Err(Error::option("question", format!("{what} cannot be answered")).help(help))
}

/// The operator `W A`: each camera pixel of `A` is multiplied by its weight.
struct Weighted<'a, O> {
    operator: &'a mut O,
    weights: &'a [f64],
}

impl<O: Adjoint> Operator for Weighted<'_, O> {
    delegate!(operator: rows, cols, observer);

    fn symmetry(&self) -> Symmetry {
        Symmetry::General
    }

    fn apply(&mut self, x: &[f64], y: &mut [f64]) -> Result<()> {
        self.operator.apply(x, y)?;
        y.iter_mut().zip(self.weights).for_each(|(y, weight)| *y *= weight);
        Ok(())
    }
}

impl<O: Adjoint> Adjoint for Weighted<'_, O> {
    fn apply_adjoint(&mut self, y: &[f64], x: &mut [f64]) -> Result<()> {
        let weighted: Vec<f64> = y.iter().zip(self.weights).map(|(y, weight)| y * weight).collect();
        self.operator.apply_adjoint(&weighted, x)
    }
}
