//! `krylux rig check`: everything that can be looked at before a session, in under a minute.

mod devices;
mod disk;
mod finding;
mod known;
mod photos;

use std::path::PathBuf;

use anyhow::Result;
use serde_json::json;

use super::super::Outcome;
use super::super::console::Console;
use super::super::options::OutputArgs;
use super::bench::{Bench, RigArgs, require_rig};
use crate::error::Error;
use finding::{Finding, Findings, Grade};

/// Check a bench before a session: devices, light, frames, calibration, disk; exit 1 where something fails
#[derive(clap::Args)]
pub(in super::super) struct Args {
    #[command(flatten)]
    rig: RigArgs,
    /// Where the session's runs will go: it is looked whether there is room for their photos
    #[arg(short = 'o', long = "output", value_name = "DIR", default_value = "out")]
    folder: PathBuf,
    #[command(flatten)]
    pub(in super::super) output: OutputArgs,
}

pub(super) fn run(args: &Args, console: &Console) -> Result<Outcome> {
    require_rig(&args.rig.rig, "RIG")?;
    let mut findings = Findings::new(console);
    let whole = looked_at(args, console, &mut findings)?;
    let sentence = findings.sentence(whole);
    console.say(&sentence)?;
    let passed = findings.count(Grade::Fails) == 0;
    console.summary(&json!({
        "verb": "rig check",
        "passed": passed,
        "whole": whole,
        "sentence": sentence,
        "findings": findings.all,
    }))?;
    Ok(if passed { Outcome::Done } else { Outcome::NotGoodEnough })
}

/// One thing after the other; whether all of it could be looked at.
fn looked_at(args: &Args, console: &Console, findings: &mut Findings) -> Result<bool> {
    let source = match args.rig.source(console) {
        Ok(source) => source,
        Err(why) => {
            findings.add(Finding::error("file", &library(why)?))?;
            return Ok(false);
        }
    };
    findings.add(devices::file(&source.file))?;
    findings.add(disk::room(&args.folder, &source.file.kind.camera_info()))?;
    if !devices::devices(&source.file.kind, findings)? {
        return Ok(false);
    }
    let known = known::calibration(&source, findings)?;
    let mut bench = Bench { source, known };
    let mut shots = match bench.open(console) {
        Ok(shots) => shots,
        Err(why) => {
            findings.add(Finding::error("session", &library(why)?))?;
            return Ok(false);
        }
    };
    let looked = photos::photos(&bench, shots.as_mut(), findings).and_then(|exposure| match exposure {
        Some(exposure) => known::map(&bench, shots.as_mut(), exposure, findings).map(|()| true),
        None => Ok(false),
    });
    drop(shots);
    match looked {
        Ok(whole) => Ok(whole),
        Err(why) => {
            findings.add(Finding::error("frames", &library(why)?))?;
            Ok(false)
        }
    }
}

/// What went wrong at the bench; what went wrong elsewhere, an output that cannot be written or the user's Ctrl-C, is handed on.
fn library(why: anyhow::Error) -> Result<Error> {
    match why.downcast::<Error>()? {
        Error::Interrupted => Err(Error::Interrupted.into()),
        error => Ok(error),
    }
}
