//! `krylux rig`: what concerns devices rather than scenes.

mod calibrate;
mod cameras;
mod list;

use anyhow::Result;
use clap::Subcommand;

use super::Outcome;
use super::console::Console;
use super::options::OutputArgs;

/// Measure and check the devices of a rig
#[derive(clap::Args)]
pub(super) struct Args {
    #[command(subcommand)]
    action: Action,
}

#[derive(Subcommand)]
enum Action {
    List(list::Args),
    Calibrate(Box<calibrate::Args>),
}

impl Args {
    pub(super) fn output(&self) -> &OutputArgs {
        match &self.action {
            Action::List(args) => &args.output,
            Action::Calibrate(args) => &args.output,
        }
    }
}

pub(super) fn run(args: &Args, console: &Console) -> Result<Outcome> {
    match &args.action {
        Action::List(args) => list::run(args, console),
        Action::Calibrate(args) => calibrate::run(args, console),
    }
}
