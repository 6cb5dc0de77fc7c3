//! `krylux projector`: the helper process that owns a projector's window. It is started by krylux itself.

use anyhow::{Context, Result};

use super::Outcome;
use crate::rig;

/// Show frames on a monitor, as the program says that started this one (by standard input and output)
#[derive(clap::Args)]
pub(super) struct Args {}

pub(super) fn run(_: &Args) -> Result<Outcome> {
    rig::serve(std::io::stdin().lock(), std::io::stdout().lock()).context("the pipe to krylux")?;
    Ok(Outcome::Done)
}
