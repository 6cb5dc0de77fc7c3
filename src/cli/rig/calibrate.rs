//! `krylux rig calibrate`: measures a rig, and writes a calibration folder.

use std::path::PathBuf;

use anyhow::Result;
use clap::ValueEnum;
use serde_json::json;

use super::super::console::Console;
use super::super::journal;
use super::super::options::{OutputArgs, RunArgs, SourceArgs};
use super::super::rig_source::RigSource;
use super::super::run_folder::RunFolder;
use super::super::trace::TraceArgs;
use super::super::{Outcome, simulation};
use super::bench::require_rig;
use crate::measure::calibrate::{CalibrateOptions, MapBy, calibrate};
use crate::measure::{FrameSource, JournaledFrames};
use crate::report::calibration;

/// Measure a rig's devices from captures alone: responses, noise, pixel map, latency, drift
#[derive(clap::Args)]
pub(in super::super) struct Args {
    #[command(flatten)]
    source: SourceArgs,
    #[command(flatten)]
    trace: TraceArgs,
    /// Frames averaged for each level and pattern
    #[arg(long, value_name = "N", default_value_t = 2)]
    takes: u32,
    /// What the pixel map is made from [default: Gray codes, or a checkerboard when the camera is coarser
    /// than the projector]
    #[arg(long, value_enum)]
    map: Option<MapArg>,
    /// The folder of the calibration; name it as `calibration` in the rig file [default: the folder that the
    /// rig file names, or NAME-calibration beside it]
    #[arg(short = 'o', long = "output", value_name = "DIR")]
    folder: Option<PathBuf>,
    /// Calibrate again into a folder that holds a calibration, and delete its photos
    #[arg(long)]
    overwrite: bool,
    /// Continue the calibration in the folder: no photo in its journal is taken again
    #[arg(long, conflicts_with = "overwrite")]
    resume: bool,
    #[command(flatten)]
    pub(in super::super) output: OutputArgs,
}

#[derive(Clone, Copy, ValueEnum)]
enum MapArg {
    /// Gray codes with their inverses
    GrayCode,
    /// The corners of a checkerboard
    Checkerboard,
}

pub(super) fn run(args: &Args, console: &Console) -> Result<Outcome> {
    let path = &args.source.source;
    require_rig(path, "SOURCE")?;
    let mut rig = RigSource::uncalibrated(&args.source, &args.trace, console)?;
    let folder = args
        .folder
        .clone()
        .or_else(|| rig.file.calibration.clone())
        .unwrap_or_else(|| path.with_file_name(format!("{}-calibration", simulation::short_name(path))));
    let wanted =
        RunArgs { folder: Some(folder), overwrite: args.overwrite, open: false, resume: args.resume };
    let mut folder = RunFolder::create(&wanted, "calibration", console)?;
    rig.describe(&mut folder.manifest);
    let outcome = measure(args, console, &mut rig, &mut folder);
    folder.close(outcome)
}

fn measure(
    args: &Args,
    console: &Console,
    rig: &mut RigSource,
    folder: &mut RunFolder,
) -> Result<(Outcome, String)> {
    let journal = folder.journal(&rig.identity()?, console)?;
    let warn = journal::warning(&journal, console);
    let mut frames = JournaledFrames::new(journal, rig.opener(console))?.reporting(warn);
    let options = CalibrateOptions {
        takes: args.takes,
        map: args.map.map(|map| match map {
            MapArg::GrayCode => MapBy::GrayCode,
            MapArg::Checkerboard => MapBy::Checkerboard,
        }),
    };
    let (found, report) = calibrate(&mut frames, &options, &mut |step| {
        console.detail(format_args!("measuring {step}"));
        console.check()
    })?;
    found.save(&folder.path)?;
    calibration::write(&folder.path, &found, &report)?;
    let effort = frames.effort();
    folder.manifest.photos = effort.taken + effort.replayed;
    let lines = report.lines();
    say(&lines, console)?;
    let title = format!("{} · calibration", rig.name());
    let seconds = folder.seconds();
    calibration::write_page(&folder.path, (title, &lines), (&found, &report), &folder.manifest, seconds)?;
    console.say(format_args!("wrote     {}", folder.path.display()))?;
    if rig.file.calibration.as_deref() != Some(folder.path.as_path()) {
        console.note(format_args!(
            "note: name it in {} as `calibration = {:?}` (relative to that file), and every verb will use it",
            rig.file.path.display(),
            folder.path.file_name().unwrap_or(folder.path.as_os_str())
        ));
    }
    console.summary(
        &json!({ "verb": "rig calibrate", "folder": folder.path, "effort": effort, "report": report }),
    )?;
    Ok((Outcome::Done, "calibrated".into()))
}

fn say(lines: &[[String; 2]], console: &Console) -> Result<()> {
    lines.iter().try_for_each(|[of, text]| console.say(format_args!("{of:<9} {text}")))
}
