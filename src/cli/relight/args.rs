//! What `krylux relight` is asked.

use std::path::PathBuf;

use anyhow::Result;

use super::super::live::LiveArgs;
use super::super::operator::OperatorArgs;
use super::super::options::{ChannelsArg, OutputArgs, RunArgs, SourceArgs};
use super::super::pattern::Pattern;
use super::super::trace::TraceArgs;
use super::questions::Questions;
use crate::error::Error;
use crate::transport::Channels;

/// Enough to tell the twelve cups of a carton apart.
pub(super) const BLOCK: usize = 12;

/// Capture light transport in a few dozen photos, and relight the scene with any pattern
///
/// The run's folder keeps the model. Given as SOURCE, it relights with other patterns without any photo, and without a
/// graphics device. So does the folder of a `segment`, `eigs` or `compensate` run: a model is made of the photos in its journal
/// (a rough one of `eigs` without `--part global`, whose photos go to direct light).
#[derive(clap::Args)]
pub(in crate::cli) struct Args {
    #[command(flatten)]
    pub(super) source: SourceArgs,
    #[command(flatten)]
    pub(super) trace: TraceArgs,
    /// One gray system, or red, green and blue as three [default: luma, or what the model has]
    #[arg(long, value_enum)]
    pub(super) channels: Option<ChannelsArg>,
    /// Photos of the capture [default: 40, or as many as the run that is SOURCE might take]
    #[arg(long, value_name = "N")]
    pub(super) photos: Option<usize>,
    /// Patterns of the capture that are chosen beforehand, white and smooth random ones; the others are photos projected back. 1 is
    /// white alone, as for rigs that are not coaxial [default: 12]
    #[arg(long, value_name = "N")]
    pub(super) block: Option<usize>,
    /// Relight with it: white, black, left, checker:N, stripes:N, pixel:X,Y, or a .npy, .exr or .png file; may be given several
    /// times [default: white]
    #[arg(long = "pattern", value_name = "PATTERN")]
    pub(super) patterns: Vec<Pattern>,
    /// Light the scene from the camera by each pattern, as the projector would see it
    #[arg(long)]
    pub(super) dual: bool,
    /// Take the interreflections out of this photo: a .npy, .exr or .png file of radiance; may be given several times
    #[arg(long = "inverse", value_name = "PHOTO")]
    pub(super) photographs: Vec<PathBuf>,
    /// Exit status 1 if a relit photo differs from the true one by more than this share of it (scenes only)
    #[arg(long, value_name = "X")]
    pub(super) max_error: Option<f64>,
    #[command(flatten)]
    pub(super) operator: OperatorArgs,
    #[command(flatten)]
    pub(super) run: RunArgs,
    #[command(flatten)]
    pub(super) live: LiveArgs,
    #[command(flatten)]
    pub(in crate::cli) output: OutputArgs,
}

impl Args {
    pub(super) fn channels(&self) -> Channels {
        self.channels.map_or(Channels::Luma, Into::into)
    }

    pub(super) fn questions(&self) -> Questions<'_> {
        Questions { patterns: &self.patterns, dual: self.dual, photographs: &self.photographs }
    }

    /// A rig takes no true photos beside those of the capture.
    pub(super) fn check_for_scene(&self, is_scene: bool) -> Result<()> {
        if is_scene || self.max_error.is_none() {
            return Ok(());
        }
        Err(Error::Option {
            option: "--max-error".into(),
            fault: "a rig does not know the true photos of patterns that it never showed".into(),
            help: "leave it out, or give a scene".into(),
        }
        .into())
    }

    /// A model is what it is: what says how it is captured must not be given with it.
    pub(super) fn check_for_model(&self) -> Result<()> {
        let given = [
            (self.photos.is_some(), "--photos"),
            (self.block.is_some(), "--block"),
            (self.channels.is_some(), "--channels"),
            (self.max_error.is_some(), "--max-error"),
        ];
        let given = given.into_iter().find(|(is_given, _)| *is_given).map(|(_, name)| name);
        match given.or(self.trace.given()) {
            Some(option) => Err(Error::Option {
                option: option.into(),
                fault: format!(
                    "{} holds a model that is captured already, and no scene to hold it against",
                    self.source.source.display()
                ),
                help: "leave it out, or give the scene or the rig".into(),
            }
            .into()),
            None => Ok(()),
        }
    }
}
