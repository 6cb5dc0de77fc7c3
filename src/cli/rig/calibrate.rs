//! `krylux rig calibrate`: from captures to a calibration folder.

use std::path::{Path, PathBuf};

use clap::ValueEnum;
use serde_json::json;

use super::super::Outcome;
use super::super::console::Console;
use super::super::opening::Opening;
use super::super::options::SourceArgs;
use super::super::trace::TraceArgs;
use super::bench::require_rig;
use crate::calibrate::{CalibrateOptions, MapBy};
use crate::error::Result;
use crate::io::name::Name;
use crate::lab::{Calibrated, RigSource, RunOptions};

/// Measure a rig's devices from captures alone: responses, noise, pixel map, uneven brightness, latency, drift
#[derive(clap::Args)]
#[command(after_help = "Example:\n  krylux rig calibrate rig.toml --use")]
pub(in super::super) struct Args {
    #[command(flatten)]
    source: SourceArgs,
    #[command(flatten)]
    trace: TraceArgs,
    /// Frames averaged for each level and pattern
    #[arg(long, value_name = "N", default_value_t = 2)]
    takes: u32,
    /// Levels of the projector that are shown at most; those between them are interpolated [default: 257, or 33 where more than
    /// half a second passes from one frame to the next]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(3..))]
    levels: Option<u16>,
    /// What the pixel map is made from [default: Gray codes, or a checkerboard where the camera has less than 1.5 pixels
    /// for each of the projector's along an axis]
    #[arg(long, value_enum)]
    map: Option<MapArg>,
    /// Where the calibration goes; --use, or the line `calibration = …` in the rig file, makes verbs use it [default: what the
    /// rig file names, or NAME-calibration beside it; with a number behind it where an earlier calibration is there, which stays as it is]
    #[arg(short = 'o', long = "output", value_name = "DIR")]
    folder: Option<PathBuf>,
    /// Use it from now on: write the line `calibration = …` into the rig file as soon as the calibration is whole. Comments and all else in the file
    /// stay as they are
    #[arg(long = "use")]
    is_used: bool,
    /// Calibrate anew into a folder that holds a calibration's photos, and throw these away
    #[arg(long)]
    overwrite: bool,
    /// Go on with the calibration in the folder: no photo that is in its journal is taken again
    #[arg(long, conflicts_with = "overwrite")]
    resume: bool,
}

#[derive(Clone, Copy, ValueEnum)]
enum MapArg {
    /// Gray codes with their inverses
    GrayCode,
    /// The corners of a checkerboard
    Checkerboard,
}

pub(super) fn run(args: &Args, console: &Console) -> Result<Outcome> {
    require_rig(&args.source.source, "SOURCE")?;
    let rig = Opening::new(&args.source, &args.trace).builder(console).open_uncalibrated_rig()?;
    let options = CalibrateOptions {
        takes: args.takes,
        levels: args.levels.map(usize::from),
        map: args.map.map(|map| match map {
            MapArg::GrayCode => MapBy::GrayCode,
            MapArg::Checkerboard => MapBy::Checkerboard,
        }),
        ..CalibrateOptions::default()
    };
    let again = args.overwrite || args.resume;
    let folder = args.folder.clone().unwrap_or_else(|| rig.next_calibration_folder(again));
    let run = RunOptions { folder: Some(folder), overwrite: args.overwrite, resume: args.resume };
    let Calibrated { report, effort, folder, .. } = rig.calibrate(&options, &run)?;
    for [of, text] in report.lines() {
        console.say(format_args!("{of:<9} {text}"))?;
    }
    console.say(format_args!("wrote     {}", folder.display()))?;
    let is_named = name_it(args, &rig, &folder, console)?;
    console
        .summary(&json!({ "verb": "rig calibrate", "folder": Name::from(&folder), "used": is_named, "effort": effort, "report": report }))?;
    Ok(Outcome::Done)
}

/// Sees to it that the rig file names the calibration, or says how. Returns whether the file names it.
fn name_it(args: &Args, rig: &RigSource, folder: &Path, console: &Console) -> Result<bool> {
    let file = rig.file.path.display();
    if rig.names_calibration(folder) {
        return Ok(true);
    }
    if args.is_used {
        rig.name_calibration(folder)?;
        let earlier = rig.file.calibration.as_ref();
        let earlier =
            earlier.map(|earlier| format!("; before, it was {}", earlier.display())).unwrap_or_default();
        console.say(format_args!("used      by {file} from now on{earlier}"))?;
    } else {
        console.note(format_args!(
            "note: no verb uses it yet; name it in {file} as `calibration = {:?}` (relative to that file), or give --use, which writes this line",
            folder.file_name().unwrap_or(folder.as_os_str())
        ));
    }
    Ok(args.is_used)
}
