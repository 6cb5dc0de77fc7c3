//! What is asked of a model: patterns to relight with, dual photographs, photos without interreflections.

use std::path::{Path, PathBuf};

use anyhow::Result;

use super::super::console::Console;
use super::super::light::Light;
use super::super::pattern::Pattern;
use crate::analysis::low_rank::SavedModel;
use crate::analysis::low_rank::cancel_interreflections;
use crate::error::Error;
use crate::image::{Image, Resolution};
use crate::io::picture;
use crate::operator::{Adjoint, Operator};
use crate::report::relighting::{Dual, Reduced, Relit};
use crate::report::separation::{Planes, relative_error};
use crate::transport::Part;

/// Products with the model, or with the true matrix, for one photo without interreflections.
const PRODUCTS: usize = 200;

/// As given on the command line.
pub(super) struct Questions<'a> {
    pub(super) patterns: &'a [Pattern],
    pub(super) dual: bool,
    pub(super) photographs: &'a [PathBuf],
}

/// What came of them.
pub(super) struct Answers {
    pub(super) relit: Vec<Relit>,
    pub(super) duals: Vec<Dual>,
    pub(super) reduced: Vec<Reduced>,
}

impl Questions<'_> {
    /// The patterns, white where none is given, by name, for a model of so many channels. For dual photographs they must fit the
    /// camera, too.
    pub(super) fn patterns(
        &self,
        projector: Resolution,
        camera: Resolution,
        channels: usize,
    ) -> Result<Vec<(String, Image)>> {
        let white = [Pattern::White];
        let patterns = if self.patterns.is_empty() { &white } else { self.patterns };
        let mut found = Vec::new();
        for pattern in patterns {
            if self.dual {
                pattern.image(camera)?;
            }
            let (name, image) = (pattern.to_string(), pattern.image(projector)?);
            if image.channels() > channels {
                return Err(Error::Option {
                    option: "--pattern".into(),
                    fault: format!("{name} is coloured, but the model is gray"),
                    help: "give a gray pattern, or capture with --channels rgb".into(),
                }
                .into());
            }
            found.push((name, image));
        }
        Ok(found)
    }

    /// The photos to be reduced, by name, in as many channels as the model has. A coloured photo is weighed by luminance for a gray
    /// model.
    pub(super) fn photographs(&self, camera: Resolution, channels: usize) -> Result<Vec<(String, Planes)>> {
        self.photographs.iter().map(|path| photograph(path, camera, channels)).collect()
    }

    /// Asks the model, and `light`, where there is one that simulates, for the truth.
    pub(super) fn answers(
        &self,
        model: &SavedModel,
        mut light: Option<&mut Light<'_>>,
        console: &Console,
    ) -> Result<Answers> {
        let mut answers = Answers { relit: Vec::new(), duals: Vec::new(), reduced: Vec::new() };
        let channels = model.channels.len();
        for (name, pattern) in self.patterns(model.projector, model.resolution, channels)? {
            answers.relit.push(relit(model, light.as_deref_mut(), &name, pattern, console)?);
        }
        if self.dual {
            for (name, pattern) in self.patterns(model.resolution, model.resolution, channels)? {
                answers.duals.push(dual(model, light.as_deref_mut(), name, &pattern, console)?);
            }
        }
        for (name, mut photo) in self.photographs(model.resolution, channels)? {
            for (photo, ambient) in photo.iter_mut().zip(model.ambient.planes()) {
                photo.iter_mut().zip(ambient).for_each(|(photo, ambient)| *photo -= ambient);
            }
            answers.reduced.push(reduced(model, light.as_deref_mut(), name, &photo, console)?);
        }
        Ok(answers)
    }
}

fn photograph(path: &Path, camera: Resolution, channels: usize) -> Result<(String, Planes)> {
    let image = picture::read(path)?;
    let unusable = |fault: String, help: String| Error::Data { path: path.to_path_buf(), fault, help };
    if image.resolution() != camera {
        let fault = format!("it has {} pixels, but the camera has {camera}", image.resolution());
        return Err(unusable(fault, "give a photo of this camera".into()).into());
    }
    let planes = match (image.channels(), channels) {
        (3, 1) => {
            let [r, g, b] = [0, 1, 2].map(|channel| image.plane(channel));
            vec![(0..r.len()).map(|i| 0.2126 * r[i] + 0.7152 * g[i] + 0.0722 * b[i]).collect()]
        }
        (1, 3) => {
            let fault = "it is gray, but the model has three channels".into();
            return Err(
                unusable(fault, "give a coloured photo, or capture with --channels luma".into()).into()
            );
        }
        _ => image.planes(),
    };
    Ok((path.display().to_string(), planes))
}

/// A pattern's plane for a channel: a gray one lights all alike.
fn plane(pattern: &Image, channel: usize) -> Vec<f64> {
    pattern.plane(channel.min(pattern.channels() - 1))
}

/// The true products with all of the light, where it is simulated.
fn truth(
    light: Option<&mut Light<'_>>,
    console: &Console,
    product: impl Fn(&mut dyn Adjoint, usize) -> crate::Result<Vec<f64>>,
) -> Result<Option<Planes>> {
    let Some(light) = light.filter(|light| light.matrix().is_some()) else { return Ok(None) };
    let planes = light.with_channels(Part::Full, console, |channels| {
        let each = channels.iter_mut().enumerate();
        each.map(|(channel, operator)| product(operator, channel)).collect::<crate::Result<Planes>>()
    })?;
    Ok(Some(planes))
}

fn relit(
    model: &SavedModel,
    light: Option<&mut Light<'_>>,
    name: &str,
    pattern: Image,
    console: &Console,
) -> Result<Relit> {
    let by_rank = |rank: usize| -> Planes {
        let each = model.channels.iter().enumerate();
        each.map(|(channel, of)| of.truncated(rank).relight(&plane(&pattern, channel))).collect()
    };
    let ranks = model.channels.iter().map(crate::analysis::LowRank::rank).max().unwrap_or(0);
    let found = by_rank(ranks);
    let truth = truth(light, console, |operator, channel| {
        let mut photo = vec![0.0; operator.rows()];
        operator.apply(&plane(&pattern, channel), &mut photo)?;
        Ok(photo)
    })?;
    let errors = match &truth {
        Some(truth) => (1..=ranks).map(|rank| relative_error(&by_rank(rank), truth)).collect(),
        None => Vec::new(),
    };
    Ok(Relit {
        name: name.to_owned(),
        relit: seen(model, &found)?,
        truth: truth.as_ref().map(|truth| seen(model, truth)).transpose()?,
        pattern,
        errors,
    })
}

/// A photo as the camera sees it: with ambient light.
fn seen(model: &SavedModel, light: &Planes) -> Result<Image> {
    let ambient = model.ambient.planes();
    let planes: Planes = light
        .iter()
        .zip(&ambient)
        .map(|(light, ambient)| light.iter().zip(ambient).map(|(light, ambient)| light + ambient).collect())
        .collect();
    Ok(Image::from_planes(model.resolution, &planes)?)
}

fn dual(
    model: &SavedModel,
    light: Option<&mut Light<'_>>,
    name: String,
    pattern: &Image,
    console: &Console,
) -> Result<Dual> {
    let each = model.channels.iter().enumerate();
    let found: Planes = each.map(|(channel, of)| of.dual(&plane(pattern, channel))).collect();
    let truth = truth(light, console, |operator, channel| {
        let mut photo = vec![0.0; operator.cols()];
        operator.apply_adjoint(&plane(pattern, channel), &mut photo)?;
        Ok(photo)
    })?;
    Ok(Dual {
        name,
        image: Image::from_planes(model.projector, &found)?,
        error: truth.map(|truth| relative_error(&found, &truth)),
    })
}

fn reduced(
    model: &SavedModel,
    light: Option<&mut Light<'_>>,
    name: String,
    photo: &Planes,
    console: &Console,
) -> Result<Reduced> {
    if model.channels.iter().any(|of| of.direct().is_empty()) {
        return Err(Error::Option {
            option: "--inverse".into(),
            fault: "the direct light of this rig is no diagonal, so a photo cannot be reduced to it pixel by pixel"
                .into(),
            help: "leave it out, or use pinholes behind one beam splitter".into(),
        }
        .into());
    }
    let (mut found, mut residual) = (Planes::new(), 0.0_f64);
    for (of, photo) in model.channels.iter().zip(photo) {
        let cancelled = cancel_interreflections(&mut of.global(), of.direct(), photo, PRODUCTS)?;
        residual = residual.max(cancelled.residual);
        found.push(cancelled.direct);
    }
    let truth = match light.filter(|light| light.matrix().is_some()) {
        Some(light) => Some(light.with_channels(Part::Global, console, |channels| {
            let each = channels.iter_mut().zip(&model.channels).zip(photo);
            let one = |operator: &mut dyn Operator, direct: &[f64], photo: &[f64]| {
                Ok(cancel_interreflections(operator, direct, photo, PRODUCTS)?.direct)
            };
            each.map(|((operator, of), photo)| one(operator, of.direct(), photo))
                .collect::<crate::Result<Planes>>()
        })?),
        None => None,
    };
    let image = |planes: &Planes| Image::from_planes(model.resolution, planes);
    Ok(Reduced {
        name,
        photo: image(photo)?,
        direct: image(&found)?,
        error: truth.as_ref().map(|truth| relative_error(&found, truth)),
        truth: truth.as_ref().map(image).transpose()?,
        residual,
    })
}
