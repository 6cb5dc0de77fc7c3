//! `krylux rig calibrate`: from captures to a calibration folder.

use std::path::PathBuf;

use clap::ValueEnum;
use serde_json::json;

use super::super::Outcome;
use super::super::console::Console;
use super::super::opening::Opening;
use super::super::options::SourceArgs;
use super::super::trace::TraceArgs;
use super::bench::require_rig;
use crate::error::Result;
use crate::lab::{Calibrated, RunOptions};
use crate::measure::calibrate::{CalibrateOptions, MapBy};

/// Measure a rig's devices from captures alone: responses, noise, pixel map, uneven brightness, latency, drift
#[derive(clap::Args)]
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
    /// Where the calibration goes; name it as `calibration` in the rig file [default: what the rig file
    /// names, or NAME-calibration beside it]
    #[arg(short = 'o', long = "output", value_name = "DIR")]
    folder: Option<PathBuf>,
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
    let folder = args.folder.clone().unwrap_or_else(|| rig.calibration_folder());
    let run = RunOptions { folder: Some(folder), overwrite: args.overwrite, resume: args.resume };
    let Calibrated { report, effort, folder, .. } = rig.calibrate(&options, &run)?;
    for [of, text] in report.lines() {
        console.say(format_args!("{of:<9} {text}"))?;
    }
    console.say(format_args!("wrote     {}", folder.display()))?;
    if !rig.names_calibration(&folder) {
        console.note(format_args!(
            "note: name it in {} as `calibration = {:?}` (relative to that file), and every verb will use it",
            rig.file.path.display(),
            folder.file_name().unwrap_or(folder.as_os_str())
        ));
    }
    console
        .summary(&json!({ "verb": "rig calibrate", "folder": folder, "effort": effort, "report": report }))?;
    Ok(Outcome::Done)
}
