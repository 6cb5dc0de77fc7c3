//! `krylux projector`: the helper process that owns a projector's window. It is started by krylux itself.

use super::Outcome;
use crate::error::{Error, Result};
use crate::rig;

/// Show frames on a monitor, as the program says that started this one (by standard input and output)
#[derive(clap::Args)]
pub(super) struct Args {}

pub(super) fn run(_: &Args) -> Result<Outcome> {
    rig::serve_projector(std::io::stdin().lock(), std::io::stdout().lock())
        .map_err(Error::writing("the pipe to krylux"))?;
    Ok(Outcome::Done)
}
