//! `krylux rig calibrate`: from captures to a calibration folder.

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
use crate::measure::calibrate::{CalibrateOptions, CalibrationReport, MapBy, calibrate};
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
    /// What the pixel map is made from [default: Gray codes, or a checkerboard where the camera is the coarser one]
    #[arg(long, value_enum)]
    map: Option<MapArg>,
    /// Where the calibration goes; name it as `calibration` in the rig file [default: what the rig file names, or
    /// NAME-calibration beside it]
    #[arg(short = 'o', long = "output", value_name = "DIR")]
    folder: Option<PathBuf>,
    /// Calibrate anew into a folder that holds a calibration's photos, and throw these away
    #[arg(long)]
    overwrite: bool,
    /// Go on with the calibration in the folder: no photo that is in its journal is taken again
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
    let mut shots = JournaledFrames::new(journal, rig.opener(console))?.reporting(warn);
    let options = CalibrateOptions {
        takes: args.takes,
        map: args.map.map(|map| match map {
            MapArg::GrayCode => MapBy::GrayCode,
            MapArg::Checkerboard => MapBy::Checkerboard,
        }),
    };
    let (found, report) = calibrate(&mut shots, &options, &mut |step| {
        console.detail(format_args!("measuring {step}"));
        console.check()
    })?;
    found.save(&folder.path)?;
    calibration::write(&folder.path, &found, &report)?;
    let effort = shots.effort();
    folder.manifest.photos = effort.taken + effort.replayed;
    let lines = lines(&report);
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

/// What was measured, line by line: of what, and the figures.
fn lines(report: &CalibrationReport) -> Vec<[String; 2]> {
    let (camera, map, stability) = (&report.camera, &report.map, &report.stability);
    let percent = |share: f64| 100.0 * share;
    let mut lines = Vec::new();
    let mut say = |of: &str, text: String| lines.push([of.to_owned(), text]);
    say("camera", format!("black level {} DN, read noise {} DN", camera.black, camera.read_noise));
    let well = if camera.plateau_reached { "" } else { " at least: it was never full" };
    say("", format!("gain {} electrons per DN, full well {} electrons{well}", camera.gain, camera.full_well));
    let response = if camera.linear { "linear" } else { "bent, and straightened" };
    let departure = percent(camera.departure);
    say("", format!("response {response} (departs by {departure:.2} % of the range beyond noise)"));
    say(
        "",
        format!("{} DN/s without a pattern; white fills it in {:.4} s", camera.dark_rate, camera.exposure),
    );
    for (channel, projector) in report.projector.iter().enumerate() {
        say(
            "projector",
            format!(
                "channel {channel}: gamma {}, which leaves {:.3} % of white; black and ambient {} % of white",
                projector.gamma,
                percent(projector.gamma_residual),
                projector.black.scaled(100.0)
            ),
        );
    }
    let by = match map.by {
        MapBy::GrayCode => "Gray codes",
        MapBy::Checkerboard => "a checkerboard",
    };
    let kind = if map.lens.is_some() { "homography and lens" } else { "pixel by pixel: no common map fits" };
    say("pixels", format!("by {by}, {} points, {kind}", map.points));
    say(
        "",
        format!(
            "within {:.3} pixels of the projector (points scatter by {:.2}); {:.1} % unreliable, {:.1} % unseen",
            map.error,
            map.rms,
            percent(map.unreliable),
            percent(map.masked)
        ),
    );
    say(
        "stability",
        format!(
            "light is there after {} s; drifts {} % per hour (watched for {:.0} s)",
            stability.settle,
            stability.drift_per_hour.scaled(100.0),
            stability.watched
        ),
    );
    say("", format!("noise of one white photo {:.3} % a pixel", percent(stability.white_noise)));
    say(
        "frames",
        format!(
            "{} taken, {} refused, in {:.0} s of the rig's time",
            report.effort.taken,
            report.effort.dropped + report.effort.repeated + report.effort.late,
            report.effort.seconds
        ),
    );
    lines
}
