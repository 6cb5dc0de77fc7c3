//! `krylux reproduce` in a build without the figures of the paper.

use super::Outcome;
use crate::error::{Error, Result};

/// Make the paper's figures again (not in this build of krylux)
#[derive(clap::Args)]
#[command(after_help = "Example:\n  krylux reproduce all")]
pub(super) struct Args {
    #[arg(hide = true, trailing_var_arg = true, allow_hyphen_values = true)]
    words: Vec<String>,
}

impl Args {
    pub(super) fn run(&self) -> Result<Outcome> {
        let named = [&["reproduce".to_owned()], self.words.as_slice()].concat().join(" ");
        Err(Error::option(&named, "this build of krylux leaves out the figures of the paper")
            .help("build krylux with its default features: cargo install --path . --locked"))
    }
}
