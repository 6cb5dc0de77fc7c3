//! `krylux rig`: what concerns devices rather than scenes.

mod align;
mod bench;
mod calibrate;
mod check;
#[cfg(any(feature = "gige", feature = "usb3"))]
pub(super) mod describe;
mod flat_field;
mod list;
mod preview;

use std::path::PathBuf;

use clap::Subcommand;

use super::Outcome;
use super::console::Console;
use crate::error::Result;

/// Measure and check the devices of a rig
#[derive(clap::Args)]
pub(super) struct Args {
    #[command(subcommand)]
    action: Action,
}

#[derive(Subcommand)]
enum Action {
    List(list::Args),
    Preview(Box<preview::Args>),
    Align(Box<align::Args>),
    Calibrate(Box<calibrate::Args>),
    FlatField(Box<flat_field::Args>),
    Check(Box<check::Args>),
}

pub(super) fn run(args: &Args, console: &Console) -> Result<Outcome> {
    match &args.action {
        Action::List(args) => list::run(args, console),
        Action::Preview(args) => preview::run(args, console),
        Action::Align(args) => align::run(args, console),
        Action::Calibrate(args) => calibrate::run(args, console),
        Action::FlatField(args) => flat_field::run(args, console),
        Action::Check(args) => check::run(args, console),
    }
}

/// `-o` of a picture.
fn png(text: &str) -> std::result::Result<PathBuf, String> {
    let path = PathBuf::from(text);
    let is_png = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("png"));
    if is_png { Ok(path) } else { Err("give a file whose name ends in .png".into()) }
}
