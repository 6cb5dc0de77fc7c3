//! `krylux rig preview`: what the camera sees, again and again.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhow::Result;
use serde_json::json;

use super::super::Outcome;
use super::super::console::{Bar, Console};
use super::super::live::LiveArgs;
use super::super::options::OutputArgs;
use super::super::pattern::Pattern;
use super::bench::{Bench, RigArgs};
use super::figures::{Figures, Range};
use crate::error::Error;
use crate::image::Image;
use crate::io::atomic;
use crate::measure::calibrate::{Observer, Reach};
use crate::measure::{CaptureRequest, FrameSource, focus};
use crate::report::preview;
use crate::report::viewer::{Plane, Viewer};
use crate::rig::{Frame, RawFrame};

/// The file is written at most so often: whoever looks at it sees no more, and disks are slow.
const EVERY: Duration = Duration::from_millis(250);

/// Without a terminal, a line at most so often.
const SAID: Duration = Duration::from_secs(1);

/// Show what the camera sees, live: saturated pixels red, black ones blue, with a focus score; until Ctrl-C
#[derive(clap::Args)]
pub(in super::super) struct Args {
    #[command(flatten)]
    rig: RigArgs,
    /// What is projected meanwhile: white, black, left, checker:N, stripes:N, pixel:X,Y, or a .npy, .exr or .png file (as levels)
    #[arg(long, value_name = "PATTERN", default_value = "white")]
    pattern: Pattern,
    /// Seconds of each exposure [default: the longest of the rig file's, or what white fills 70 % of the camera's range in]
    #[arg(long, value_name = "SECONDS", value_parser = super::seconds)]
    exposure: Option<f64>,
    /// Frames to be taken; 0: until Ctrl-C
    #[arg(long, value_name = "N", default_value_t = 0)]
    frames: u64,
    /// Where the picture goes; it is there as a whole at any moment
    #[arg(short = 'o', long = "output", value_name = "FILE.png", default_value = "preview.png", value_parser = super::png)]
    file: PathBuf,
    #[command(flatten)]
    live: LiveArgs,
    #[command(flatten)]
    pub(in super::super) output: OutputArgs,
}

pub(super) fn run(args: &Args, console: &Console) -> Result<Outcome> {
    atomic::check_writable(&args.file)?;
    let mut bench = args.rig.read(console)?;
    let mut shots = bench.open(console)?;
    let mut last = None;
    let ended = watch(args, &bench, shots.as_mut(), console, &mut last);
    // The devices are free before anything else is said.
    drop(shots);
    match ended {
        // Ctrl-C is how a preview ends.
        Err(error) if !matches!(error.downcast_ref(), Some(Error::Interrupted)) => return Err(error),
        _ => {}
    }
    let Some(figures) = last else { return Err(Error::Interrupted.into()) };
    console.say(format_args!("wrote     {}", args.file.display()))?;
    console.summary(&json!({ "verb": "rig preview", "file": args.file, "figures": figures }))?;
    Ok(Outcome::Done)
}

fn watch(
    args: &Args,
    bench: &Bench,
    shots: &mut dyn FrameSource,
    console: &Console,
    last: &mut Option<Figures>,
) -> Result<()> {
    let frame = frame(&args.pattern, shots)?;
    let exposure = match bench.exposure(args.exposure) {
        Some(exposure) => exposure,
        None => chosen(shots, console)?,
    };
    let range = range(bench, shots)?;
    let viewer = args.live.viewer(console);
    let began = shots.effort().seconds;
    let (mut before, mut best): (Option<RawFrame>, Option<f64>) = (None, None);
    let mut line = Line { bar: console.line(), console: console.clone(), said: None };
    let mut picture = Picture { file: &args.file, written: None };
    let mut number = 0;
    let ended = loop {
        if args.frames > 0 && number == args.frames {
            break Ok(());
        }
        let shot = CaptureRequest { frame: Arc::clone(&frame), exposure, take: number as u32 };
        let raw = match shots.capture(&shot) {
            Ok(raw) => raw,
            Err(error) => break Err(error),
        };
        number += 1;
        let score = before.as_ref().and_then(|before| focus(before, &raw, range.black, range.limit));
        best = best.into_iter().chain(score).reduce(f64::max);
        let seconds = shots.effort().seconds - began;
        let per_second = number as f64 / seconds.max(f64::MIN_POSITIVE);
        let figures = Figures::of(&raw, &range, (number, per_second), [score, best]);
        line.say(&figures, &range)?;
        *last = Some(figures);
        if let Some(viewer) = &viewer {
            show(viewer, &bench.name(), &raw, range.full);
        }
        picture.show(&raw, &range, false)?;
        before = Some(raw);
    };
    if let (Some(raw), Some(figures)) = (&before, &*last) {
        picture.show(raw, &range, true)?;
        console.say(figures.line(&range))?;
    }
    Ok(ended?)
}

/// What is shown: values from 0 to 1 as levels, whatever light these make.
fn frame(pattern: &Pattern, shots: &dyn FrameSource) -> Result<Arc<Frame>> {
    let projector = shots.projector();
    let (size, channels, top) = (projector.resolution, projector.channels, f32::from(projector.highest()));
    let image: Image = pattern.image(size)?;
    let level = |sample: usize| {
        let channel = (sample % channels).min(image.channels() - 1);
        let value = image.samples()[sample / channels * image.channels() + channel];
        (value.clamp(0.0, 1.0) * top).round() as u16
    };
    Ok(Arc::new(Frame::new(size, channels, (0..size.pixels() * channels).map(level).collect())?))
}

/// An exposure for white; one that does not suit it is named, as there is something to be seen all the same.
fn chosen(shots: &mut dyn FrameSource, console: &Console) -> Result<f64> {
    let (exposure, reach) = Observer::white_exposure(shots)?;
    match reach {
        Reach::Filled => {}
        Reach::TooBright => console.note(format_args!(
            "warning: white saturates the camera even at {exposure} s, its shortest exposure: close the lens, or lower its gain"
        )),
        Reach::TooDark => console.note(format_args!(
            "warning: white is hardly seen even at {exposure} s, the longest exposure: take off the lens cap, or open the lens"
        )),
    }
    Ok(exposure)
}

/// What calibration says of counts, or what a dark frame does.
fn range(bench: &Bench, shots: &mut dyn FrameSource) -> Result<Range> {
    let camera = shots.camera();
    let full = f64::from((1_u32 << camera.bits) - 1);
    if let Some(known) = &bench.known {
        return Ok(Range { black: known.camera.black, limit: known.camera.saturation, full });
    }
    let (shortest, projector) = (camera.exposures[0], shots.projector());
    let dark = Frame::filled(projector.resolution, projector.channels, 0);
    let raw = shots.capture(&CaptureRequest { frame: Arc::new(dark), exposure: shortest, take: 0 })?;
    let mut counts = raw.counts;
    let middle = counts.len() / 2;
    let black = f64::from(*counts.select_nth_unstable(middle).1);
    Ok(Range { black, limit: full, full })
}

/// The line of figures: rewritten on a terminal, now and then a new one elsewhere.
struct Line {
    bar: Bar,
    console: Console,
    said: Option<Instant>,
}

impl Line {
    fn say(&mut self, figures: &Figures, range: &Range) -> Result<()> {
        if self.console.has_terminal() {
            self.bar.say(&figures.short(range));
        } else if self.said.is_none_or(|said| said.elapsed() >= SAID) {
            self.said = Some(Instant::now());
            self.console.say(figures.line(range))?;
        }
        Ok(())
    }
}

/// The file.
struct Picture<'a> {
    file: &'a Path,
    written: Option<Instant>,
}

impl Picture<'_> {
    /// Writes a frame, if it is time for one or the `last`.
    fn show(&mut self, raw: &RawFrame, range: &Range, last: bool) -> crate::Result<()> {
        if !last && self.written.is_some_and(|written| written.elapsed() < EVERY) {
            return Ok(());
        }
        preview::overlay(raw, range.black, range.full, range.limit).write_png(self.file)?;
        self.written = Some(Instant::now());
        Ok(())
    }
}

/// Counts as shares of the range.
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
