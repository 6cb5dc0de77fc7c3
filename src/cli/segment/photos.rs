//! The photos of a segmentation: of direct light, of the graph, and of its groups.

use std::str::FromStr;

use clap::ValueEnum;

use super::Question;
use crate::analysis::segment::evidence;
use crate::analysis::{
    Blurred, Capture, DirectMethod, Evidence, Segmentation, Separation, WithoutDirect, measure_direct,
};
use crate::error::{Error, Result};
use crate::image::{Blur, Resolution};
use crate::operator::Operator;
use crate::transport::Part;

/// Which light makes the graph, and what else is to be seen of it.
#[derive(clap::Args)]
pub(super) struct LightArgs {
    /// How direct light, which tells nothing of groups, is told apart
    #[arg(long, value_enum, default_value = "source", conflicts_with = "keep_direct")]
    direct: DirectArg,
    /// Photos of direct light where it is measured: of random patterns, or of squares shifted to as many places
    #[arg(long, value_name = "N", default_value_t = 16)]
    direct_photos: usize,
    /// Pixels of a square's side, for --direct patterns
    #[arg(long, value_name = "N", default_value_t = 4)]
    direct_square: usize,
    /// Blur patterns and photos alike by a Gaussian of so many pixels: less noise, and still symmetric
    #[arg(long, value_name = "PIXELS", default_value_t = 0.0)]
    blur: f64,
    /// Show where these pixels lie in the space of eigenvectors, and how far apart
    #[arg(long, value_name = "X,Y;X,Y;...", value_delimiter = ';')]
    features: Vec<Pixel>,
    /// Light each group alone, one more photo for each: how much of its light stays within it
    #[arg(long)]
    evidence: bool,
}

/// `--direct`.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum DirectArg {
    /// The source leaves it out: a simulator exactly, a rig as its file says
    #[value(alias = "simulator")]
    Source,
    /// Measured by Nayar's shifted checkerboards
    Patterns,
    /// Estimated from photos of random patterns, as the diagonal of A
    Estimator,
    /// Kept, as by a rig that cannot tell it apart
    Keep,
}

/// `--features`: a column and a row.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Pixel(usize, usize);

impl FromStr for Pixel {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let parsed =
            text.split_once(',').and_then(|(x, y)| Some((x.trim().parse().ok()?, y.trim().parse().ok()?)));
        let (x, y) = parsed.ok_or_else(|| format!("`{text}` is no pixel; write column,row as in 20,35"))?;
        Ok(Self(x, y))
    }
}

impl LightArgs {
    /// The pixels chosen, by column and row.
    pub(super) fn chosen(&self) -> Vec<(usize, usize)> {
        self.features.iter().map(|&Pixel(x, y)| (x, y)).collect()
    }

    /// What is to be photographed.
    ///
    /// # Errors
    /// [`Error::Option`] for what cannot be, before any photo.
    pub(super) fn graph(&self, question: &Question, resolution: Resolution, seed: u64) -> Result<Graph> {
        let refuse = |option: &str, fault: String, help: String| {
            Err(Error::Option { option: option.into(), fault, help })
        };
        if !(self.blur >= 0.0 && self.blur < 1000.0) {
            let help = "give a standard deviation from 0 on";
            return refuse("--blur", format!("{} pixels", self.blur), help.into());
        }
        let outside = |&(x, y): &(usize, usize)| x >= resolution.width || y >= resolution.height;
        if let Some((x, y)) = self.chosen().into_iter().find(outside) {
            let help = format!("it has {resolution} pixels; columns and rows are counted from 0");
            return refuse("--features", format!("pixel {x},{y} is outside of the picture"), help);
        }
        let direct = match self.direct {
            DirectArg::Source | DirectArg::Keep => None,
            DirectArg::Patterns => {
                let shifts = self.direct_photos.isqrt();
                if shifts < 2 || shifts * shifts != self.direct_photos {
                    let fault = format!("{} photos of shifted squares", self.direct_photos);
                    return refuse("--direct-photos", fault, "give a square from 4 on: 4, 9, 16, 25".into());
                }
                Some(DirectMethod::Checkerboards { square: self.direct_square, shifts })
            }
            DirectArg::Estimator => Some(DirectMethod::Estimator { photos: self.direct_photos }),
        };
        let part = if self.direct == DirectArg::Source { question.part() } else { Part::Full };
        Ok(Graph { part, direct, blur: self.blur, evidence: self.evidence, resolution, seed })
    }
}

/// Which light makes the graph.
pub(super) struct Graph {
    /// The part of the light that photos are to be of.
    pub(super) part: Part,
    direct: Option<DirectMethod>,
    blur: f64,
    evidence: bool,
    resolution: Resolution,
    seed: u64,
}

/// What photos have come to.
pub(super) struct Taken {
    /// Direct light, where it was measured.
    pub(super) direct: Option<Separation>,
    pub(super) segmentation: Segmentation,
    pub(super) evidence: Vec<Evidence>,
}

impl Graph {
    /// Photos beside those of the method.
    pub(super) fn beside(&self, question: &Question) -> usize {
        let groups: usize = if self.evidence { question.groups().iter().sum() } else { 0 };
        let direct = self.direct.map_or(0, |by| match by {
            DirectMethod::Checkerboards { shifts, .. } => shifts * shifts,
            DirectMethod::Estimator { photos } => photos,
        });
        groups + direct
    }

    /// Takes all photos with `operator`, of [`Graph::part`].
    pub(super) fn photograph(&self, operator: &mut dyn Operator, capture: &mut Capture) -> Result<Taken> {
        let direct =
            self.direct.map(|by| measure_direct(operator, self.resolution, by, self.seed)).transpose()?;
        let mut work = |operator: &mut dyn Operator| -> Result<(Segmentation, Vec<Evidence>)> {
            capture.run(operator)?;
            let segmentation = capture.segmentation()?;
            let counts = segmentation.labels.iter().filter(|_| self.evidence);
            let evidence = counts.map(|(_, labels)| evidence(operator, labels)).collect::<Result<_>>()?;
            Ok((segmentation, evidence))
        };
        let mut blurred = |operator: &mut dyn Operator| match Blur::new(self.resolution, self.blur) {
            Some(blur) => work(&mut Blurred::new(operator, blur)?),
            None => work(operator),
        };
        let (segmentation, evidence) = match &direct {
            Some(direct) => blurred(&mut WithoutDirect::new(operator, &direct.direct)?)?,
            None => blurred(operator)?,
        };
        Ok(Taken { direct, segmentation, evidence })
    }
}
