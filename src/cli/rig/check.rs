//! `krylux rig check`: everything that can be checked before a session, in under a minute.

use std::ops::ControlFlow;
use std::path::PathBuf;

use serde_json::json;

use super::super::Outcome;
use super::super::console::Console;
use super::bench::{Bench, RigArgs, require_rig};
use crate::bench::rig_check::{self, Finding, Findings, RigToCheck};
use crate::error::Result;
use crate::rig::Helper;

/// Check a bench before a session: devices, light, frames, calibration, disk; exit 1 where something fails
#[derive(clap::Args)]
#[command(after_help = "Example:\n  krylux rig check rig.toml")]
pub(in super::super) struct Args {
    #[command(flatten)]
    rig: RigArgs,
    /// The folder of the session's runs; its disk is checked for free space
    #[arg(short = 'o', long = "output", value_name = "DIR", default_value = "out")]
    folder: PathBuf,
}

pub(super) fn run(args: &Args, console: &Console) -> Result<Outcome> {
    require_rig(&args.rig.rig, "RIG")?;
    // An output that cannot be written, such as a closed pipe.
    let mut unwritten = None;
    let mut say = |finding: &Finding| match console.say(finding) {
        Ok(()) => ControlFlow::Continue(()),
        Err(error) => {
            unwritten = Some(error);
            ControlFlow::Break(())
        }
    };
    let checked = check(args, console, &mut say);
    if let Some(error) = unwritten {
        return Err(error);
    }
    let findings = checked?;
    let (sentence, passed) = (findings.sentence(), findings.passed());
    console.say(&sentence)?;
    console.summary(&json!({
        "verb": "rig check",
        "passed": passed,
        "whole": findings.complete,
        "sentence": sentence,
        "findings": findings.all,
    }))?;
    Ok(if passed { Outcome::Done } else { Outcome::NotGoodEnough })
}

fn check(args: &Args, console: &Console, say: &mut rig_check::Report<'_>) -> Result<Findings> {
    let source = match args.rig.source(console) {
        Ok(source) => source,
        // Only errors of the rig are findings.
        Err(error) => return rig_check::unreadable(error, say),
    };
    if let Err(error) = source.require_programs_allowed() {
        return rig_check::unreadable(error, say);
    }
    let file = source.file.clone();
    let mut bench = Bench { source, known: None };
    let rig = RigToCheck {
        file: &file,
        folder: &args.folder,
        helper: &Helper::find,
        open: &mut || bench.open(console),
    };
    rig_check::check(rig, say)
}
