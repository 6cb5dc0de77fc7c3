//! The photos of a segmentation: of direct light, of the graph, and of its groups.

use anyhow::Result;
use clap::ValueEnum;

use crate::analysis::segment::evidence;
use crate::analysis::{
    Blurred, Capture, DirectBy, Evidence, Segmentation, Separation, WithoutDirect, measure_direct,
};
use crate::error::Error;
use crate::image::{Blur, Resolution};
use crate::krylov::Monitor;
use crate::operator::Operator;
use crate::transport::Part;

/// `--direct`.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum DirectArg {
    /// The source leaves it out: a simulator exactly, a rig as its file says
    Simulator,
    /// Measured by Nayar's shifted checkerboards
    Patterns,
    /// Estimated from photos of random patterns, as the diagonal of A
    Estimator,
    /// Kept, as by a rig that cannot tell it apart
    Keep,
}

/// Which part of the light makes the graph.
pub(super) struct Question {
    pub(super) direct: DirectArg,
    /// Photos of direct light, where it is measured.
    pub(super) direct_photos: usize,
    /// Squares of the checkerboards, in pixels.
    pub(super) square: usize,
    /// Standard deviation in pixels; 0 is none.
    pub(super) blur: f64,
    pub(super) resolution: Resolution,
    pub(super) seed: u64,
}

/// What photos have come to.
pub(super) struct Taken {
    pub(super) direct: Option<Separation>,
    pub(super) segmentation: Segmentation,
    pub(super) evidence: Vec<Evidence>,
}

impl Question {
    /// Refuses what cannot be asked.
    pub(super) fn check(&self) -> crate::Result<()> {
        let refuse = |option: &str, fault: String, help: &str| {
            Err(Error::Option { option: option.into(), fault, help: help.into() })
        };
        if !(self.blur >= 0.0 && self.blur < 1000.0) {
            return refuse("--blur", format!("{} pixels", self.blur), "give a standard deviation from 0 on");
        }
        let shifts = self.direct_photos.isqrt();
        if self.direct == DirectArg::Patterns && (shifts < 2 || shifts * shifts != self.direct_photos) {
            let fault = format!("{} photos of shifted squares", self.direct_photos);
            return refuse("--direct-photos", fault, "give a square from 4 on: 4, 9, 16, 25");
        }
        Ok(())
    }

    /// The part of the light that photos are to be of.
    pub(super) fn part(&self) -> Part {
        match self.direct {
            DirectArg::Simulator => Part::Global,
            DirectArg::Patterns | DirectArg::Estimator | DirectArg::Keep => Part::Full,
        }
    }

    fn measured(&self) -> Option<DirectBy> {
        match self.direct {
            DirectArg::Simulator | DirectArg::Keep => None,
            DirectArg::Patterns => {
                Some(DirectBy::Patterns { square: self.square, shifts: self.direct_photos.isqrt() })
            }
            DirectArg::Estimator => Some(DirectBy::Estimator { photos: self.direct_photos }),
        }
    }

    /// Takes all photos with `operator`, of [`Question::part`]. Groups are lit alone if `lit`.
    pub(super) fn ask(
        &self,
        operator: &mut dyn Operator,
        capture: &mut Capture,
        lit: bool,
        monitor: &mut Monitor<'_>,
    ) -> Result<Taken> {
        let by = self.measured();
        let direct = by.map(|by| measure_direct(operator, self.resolution, by, self.seed)).transpose()?;
        let mut work = |operator: &mut dyn Operator| -> Result<(Segmentation, Vec<Evidence>)> {
            capture.run(operator, monitor)?;
            let segmentation = capture.segmentation()?;
            let counts = segmentation.labels.iter().filter(|_| lit);
            let evidence =
                counts.map(|(_, labels)| evidence(operator, labels)).collect::<crate::Result<_>>()?;
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
