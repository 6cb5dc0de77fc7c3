//! `krylux rig preview`: the live picture of the camera.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use serde_json::json;

use super::super::Outcome;
use super::super::console::Console;
use super::super::options::{count, free_file, time};
use super::super::pattern::Pattern;
use super::super::progress::{Bar, has_terminal};
use super::super::tev::LiveArgs;
use super::bench::{Bench, RigArgs};
use crate::bench::preview::{self, CountRange, FrameFigures, Preview};
use crate::calibrate::StructuredLight;
use crate::error::{Error, Result};
use crate::io::atomic;
use crate::io::name::Name;
use crate::measure::FrameSource;
use crate::report::preview::overlay;
use crate::report::viewer::{Plane, Viewer};
use crate::rig::RawFrame;

/// Shortest time between two writes of the file: a person sees no more, and disks are slow.
const EVERY: Duration = Duration::from_millis(250);

/// Shortest time between two lines without a terminal.
const SAID: Duration = Duration::from_secs(1);

/// Show what the camera sees, live: saturated pixels red, black ones blue, with a focus score; until Ctrl-C
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  krylux rig preview rig.toml\n  krylux rig preview rig.toml --frames 1 --pattern checker:4 -o preview.png"
)]
pub(in super::super) struct Args {
    #[command(flatten)]
    rig: RigArgs,
    /// The projected pattern: white, black, left, checker:N, stripes:N, pixel:X,Y, or a .npy, .exr or .png
    /// file (as levels)
    #[arg(long, value_name = "PATTERN", default_value = "white")]
    pattern: Pattern,
    /// Seconds of each exposure [default: the longest exposure in the rig file, else the one at which white
    /// fills 70 % of the camera's range]
    #[arg(long, value_name = "SECONDS", value_parser = time)]
    exposure: Option<f64>,
    /// Frames to take; 0: until Ctrl-C
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = count::<u64>)]
    frames: u64,
    /// The file of the picture; it is complete at any moment
    /// [default: preview.png, or the first free one of preview-2.png, preview-3.png, …]
    #[arg(short = 'o', long = "output", value_name = "FILE.png", value_parser = super::png)]
    file: Option<PathBuf>,
    #[command(flatten)]
    live: LiveArgs,
}

pub(super) fn run(args: &Args, console: &Console) -> Result<Outcome> {
    let file = args.file.clone().unwrap_or_else(|| free_file("preview", "png"));
    atomic::check_writable(&file)?;
    let mut bench = args.rig.read(console)?;
    let mut frames = bench.open(console)?;
    let mut last = None;
    let ended = watch(args, &file, (&bench, frames.as_mut()), console, &mut last);
    // The devices are free before anything else is said.
    drop(frames);
    match ended {
        // Ctrl-C is how a preview ends.
        Err(error) if !matches!(error, Error::Interrupted) => return Err(error),
        _ => {}
    }
    let Some(figures) = last else { return Err(Error::Interrupted) };
    console.say(format_args!("wrote     {}", file.display()))?;
    console.summary(&json!({ "verb": "rig preview", "file": Name::from(&file), "figures": figures }))?;
    Ok(Outcome::Done)
}

fn watch(
    args: &Args,
    file: &Path,
    (bench, frames): (&Bench, &mut dyn FrameSource),
    console: &Console,
    last: &mut Option<FrameFigures>,
) -> Result<()> {
    let image = args.pattern.image(frames.projector().resolution)?;
    let frame = Arc::new(preview::level_frame(&image, frames.projector())?);
    let exposure = match bench.exposure(args.exposure) {
        Some(exposure) => exposure,
        None => white_exposure(frames, console)?,
    };
    let range = CountRange::measure(bench.known.as_ref().map(|known| &known.camera), frames)?;
    let viewer = args.live.viewer(console);
    let mut preview = Preview::new(frames, frame, exposure, range);
    let mut line = Line { bar: console.line(), console: console.clone(), said: None };
    let mut picture = Picture { file, written: None };
    let ended = loop {
        if args.frames > 0 && preview.taken() == args.frames {
            break Ok(());
        }
        let figures = match preview.capture(frames) {
            Ok(figures) => figures,
            Err(error) => break Err(error),
        };
        line.say(&figures, &range)?;
        *last = Some(figures);
        if let Some(raw) = preview.last() {
            if let Some(viewer) = &viewer {
                show(viewer, &bench.name(), raw, range.full);
            }
            picture.show(raw, &range, false)?;
        }
    };
    if let (Some(raw), Some(figures)) = (preview.last(), &*last) {
        picture.show(raw, &range, true)?;
        console.say(figures.line(&range))?;
    }
    ended
}

/// An exposure for white. When no exposure suits white, a warning says so: there is something to be seen all
/// the same.
fn white_exposure(frames: &mut dyn FrameSource, console: &Console) -> Result<f64> {
    let (exposure, outcome) = StructuredLight::white_exposure(frames)?;
    if let Some(warning) = outcome.warning(exposure) {
        console.note(format_args!("warning: {warning}"));
    }
    Ok(exposure)
}

/// The line of figures: rewritten on a terminal, and a new line each second elsewhere.
struct Line {
    bar: Bar,
    console: Console,
    said: Option<Instant>,
}

impl Line {
    fn say(&mut self, figures: &FrameFigures, range: &CountRange) -> Result<()> {
        if has_terminal() {
            self.bar.say(&figures.short_line(range));
        } else if self.said.is_none_or(|said| said.elapsed() >= SAID) {
            self.said = Some(Instant::now());
            self.console.say(figures.line(range))?;
        }
        Ok(())
    }
}

/// The file of the picture.
struct Picture<'a> {
    file: &'a Path,
    written: Option<Instant>,
}

impl Picture<'_> {
    /// Writes a frame, unless the one before was written a moment ago. The `last` frame is always written.
    fn show(&mut self, raw: &RawFrame, range: &CountRange, last: bool) -> Result<()> {
        if !last && self.written.is_some_and(|written| written.elapsed() < EVERY) {
            return Ok(());
        }
        overlay(raw, range.black, range.full, range.limit).write_png(self.file)?;
        self.written = Some(Instant::now());
        Ok(())
    }
}

/// Shows counts in the viewer, as shares of the range.
fn show(viewer: &Viewer, name: &str, raw: &RawFrame, full: f64) {
    let channels: &[&str] = if raw.channels == 3 { &["R", "G", "B"] } else { &["Y"] };
    for channel in 0..raw.channels {
        let counts = raw.counts.iter().skip(channel).step_by(raw.channels);
        viewer.show(Plane {
            name: format!("{name} preview"),
            size: raw.resolution,
            channels,
            channel,
            values: counts.map(|&count| (f64::from(count) / full) as f32).collect(),
        });
    }
}
