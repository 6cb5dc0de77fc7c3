//! `krylux rig`: work with the devices of a rig, without a scene.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use clap::Subcommand;

use super::Outcome;
use super::asked::Asked;
use super::console::Console;
use super::opening::{Traced, builder, settings, tell};
use super::options::{ViewArgs, free_file};
use super::progress::has_terminal;
use super::tev::LiveArgs;
use super::trace::TraceArgs;
use crate::bench::align::Round;
use crate::bench::preview::{FrameFigures, LivePreview};
use crate::bench::rig_check::Finding;
use crate::error::{Error, Result};
use crate::image::Resolution;
use crate::io::atomic;
use crate::io::name::Name;
use crate::io::raster::decode_srgb;
use crate::lab::{LabBuilder, RigSource};
use crate::report::content::Content;
use crate::report::viewer::{Plane, Viewer};
use crate::verbs::rig::{
    Align, BenchRig, Calibrate, CheckBench, ListDevices, MeasureSheet, PreviewCamera, require_rig,
};

/// Measure and check the devices of a rig
#[derive(Subcommand)]
pub(super) enum Action {
    List(ListDevices),
    Preview(Box<Asked<PreviewCamera, RigArgs, LiveArgs>>),
    Align(Box<Asked<Align, RigArgs, LiveArgs>>),
    Calibrate(Box<Asked<Calibrate, Traced, ()>>),
    FlatField(Box<Asked<MeasureSheet, Traced, ()>>),
    Check(Box<Asked<CheckBench, RigArgs, ()>>),
}

/// Which rig.
#[derive(clap::Args)]
pub(super) struct RigArgs {
    /// A rig file (.toml), of real or virtual devices
    #[arg(value_name = "RIG")]
    rig: PathBuf,
    /// The graphics adapter whose name contains this, where a virtual rig's scene is traced
    #[arg(long, value_name = "NAME")]
    adapter: Option<String>,
}

impl RigArgs {
    /// Reads only the rig file.
    fn source(&self, console: &Console) -> Result<RigSource> {
        require_rig(&self.rig, "RIG")?;
        let trace = TraceArgs::for_looking(None, self.adapter.clone());
        builder(&self.rig, settings(&ViewArgs::default(), &trace), console).open_uncalibrated_rig()
    }
}

pub(super) fn run(action: &Action, console: &Console) -> Result<Outcome> {
    match action {
        Action::List(request) => {
            let (content, is_found) = request.ask()?;
            tell("rig list", &content, is_found, console)
        }
        Action::Preview(args) => preview(args, console),
        Action::Align(args) => align(args, console),
        Action::Calibrate(args) => {
            let rig = rig_builder(&args.before, console)?.open_uncalibrated_rig()?;
            tell("rig calibrate", &args.request.ask(&rig)?.content(), true, console)
        }
        Action::FlatField(args) => {
            let lab = rig_builder(&args.before, console)?.open()?;
            // The source is a rig, since other sources were refused above.
            let rig = lab.rig().ok_or(Error::Interrupted)?;
            tell("rig flat-field", &MeasureSheet::ask(rig)?, true, console)
        }
        Action::Check(args) => check(args, console),
    }
}

fn rig_builder(args: &Traced, console: &Console) -> Result<LabBuilder> {
    let source = &args.source.source;
    require_rig(source, "SOURCE").map(|()| builder(source, args.settings(), console))
}

/// Prints each finding as soon as it is known.
fn check(args: &Asked<CheckBench, RigArgs, ()>, console: &Console) -> Result<Outcome> {
    require_rig(&args.before.rig, "RIG")?;
    // The error of an output that cannot be written, such as a closed pipe.
    let mut unwritten = Ok(());
    let mut say = |finding: &Finding| {
        unwritten = console.say(finding);
        if unwritten.is_ok() { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
    };
    let checked = args.request.ask(args.before.source(console), &mut say);
    unwritten?;
    let findings = checked?;
    tell("rig check", &CheckBench::content(&findings), findings.passed(), console)
}

fn align(args: &Asked<Align, RigArgs, LiveArgs>, console: &Console) -> Result<Outcome> {
    let request = &args.request;
    let file = request.file.clone().unwrap_or_else(|| free_file("align", "png"));
    atomic::check_writable(&file)?;
    let bench = BenchRig::new(args.before.source(console)?);
    let viewer = args.after.viewer(console);
    let mut last = None;
    let ended = request.ask(&bench, |number, round| {
        request.content(number, &round).lines.iter().try_for_each(|line| console.say(line))?;
        if let Round::Found(found) = &round {
            let picture = found.picture();
            picture.write_png(&file)?;
            let value = |byte: u8| decode_srgb(f32::from(byte) / 255.0);
            let name = format!("{} align", bench.source.name());
            show(viewer.as_ref(), &name, picture.resolution(), (3, picture.bytes()), value);
        }
        last = Some((number, round));
        Ok(())
    });
    require_unless_stopped(ended)?;
    let Some((rounds, round)) = &last else { return Err(Error::Interrupted) };
    let is_aligned = request.is_aligned(round);
    let mut content = Content::default();
    if matches!(round, Round::Found(_)) {
        content.line(format_args!("wrote     {}", file.display()));
    }
    content.fact("file", Name::from(&file));
    content.fact("rounds", rounds);
    content.fact("aligned", is_aligned);
    content.fact("last", request.content(*rounds, round));
    tell("rig align", &content, is_aligned, console)
}

/// Ctrl-C is the normal end of a preview or an alignment, and is no error here.
fn require_unless_stopped(ended: Result<()>) -> Result<()> {
    ended.or_else(|error| if matches!(error, Error::Interrupted) { Ok(()) } else { Err(error) })
}

/// The shortest time between two writes of the file. A person sees no faster changes, and disks are slow.
const EVERY: Duration = Duration::from_millis(250);

/// The shortest time between two lines without a terminal.
const SAID: Duration = Duration::from_secs(1);

fn preview(args: &Asked<PreviewCamera, RigArgs, LiveArgs>, console: &Console) -> Result<Outcome> {
    let request = &args.request;
    let file = request.file.clone().unwrap_or_else(|| free_file("preview", "png"));
    atomic::check_writable(&file)?;
    let bench = BenchRig::new(args.before.source(console)?);
    let viewer = args.after.viewer(console);
    let name = format!("{} preview", bench.source.name());
    let mut last = None;
    let ended = bench.preview(&request.pattern.image(bench.source.resolution())?, request.exposure);
    let ended = ended.and_then(|mut preview| {
        let ended = watch(request.frames, &mut preview, &file, (viewer.as_ref(), &name), console);
        let figures = preview.figures().cloned();
        if let (Some(raw), Some(figures)) = (preview.last(), &figures) {
            preview.range().paint(raw).write_png(&file)?;
            console.say(figures.line(preview.range()))?;
        }
        last = figures;
        ended
    });
    // The devices are already released here, before anything else is printed.
    require_unless_stopped(ended)?;
    let figures: FrameFigures = last.ok_or(Error::Interrupted)?;
    let mut content = Content::default();
    content.line(format_args!("wrote     {}", file.display()));
    content.fact("file", Name::from(&file));
    content.fact("figures", figures);
    tell("rig preview", &content, true, console)
}

/// Takes `frames` frames, or for 0 any number until Ctrl-C. A terminal rewrites the line of figures. Elsewhere, a new line is written each
/// second.
fn watch(
    frames: u64,
    preview: &mut LivePreview,
    file: &Path,
    (viewer, name): (Option<&Viewer>, &str),
    console: &Console,
) -> Result<()> {
    let line = console.line();
    let [mut said, mut written]: [Option<Instant>; 2] = [None; 2];
    let is_due = |last: Option<Instant>, pause| last.is_none_or(|last| last.elapsed() >= pause);
    while frames == 0 || preview.taken() < frames {
        let figures = preview.capture()?;
        let range = *preview.range();
        if has_terminal() {
            line.say(&figures.short_line(&range));
        } else if is_due(said, SAID) {
            said = Some(Instant::now());
            console.say(figures.line(&range))?;
        }
        let Some(raw) = preview.last() else { continue };
        let share = |count: u16| (f64::from(count) / range.full) as f32;
        show(viewer, name, raw.resolution, (raw.channels, &raw.counts), share);
        if is_due(written, EVERY) {
            range.paint(raw).write_png(file)?;
            written = Some(Instant::now());
        }
    }
    Ok(())
}

/// Shows interleaved samples in the viewer, if there is a viewer.
fn show<T: Copy>(
    viewer: Option<&Viewer>,
    name: &str,
    size: Resolution,
    (count, samples): (usize, &[T]),
    value: impl Fn(T) -> f32,
) {
    let channels: &[&str] = if count == 3 { &["R", "G", "B"] } else { &["Y"] };
    for (viewer, channel) in viewer.iter().flat_map(|viewer| (0..count).map(move |channel| (viewer, channel)))
    {
        let values = samples.iter().skip(channel).step_by(count).map(|&sample| value(sample)).collect();
        viewer.show(Plane { name: name.to_owned(), size, channels, channel, values });
    }
}

/// Print what a camera can do, as JSON; krylux starts this itself
#[cfg(any(feature = "gige", feature = "usb3"))]
#[derive(clap::Args)]
pub(super) struct DescribeCamera {
    /// The kind of camera: gige or usb3
    kind: String,
    /// The address or the serial number; of USB cameras the only one, where it is left out
    place: Option<String>,
}

#[cfg(any(feature = "gige", feature = "usb3"))]
impl DescribeCamera {
    /// Runs the process that reads the description of a camera.
    pub(super) fn run(&self, console: &Console) -> Result<Outcome> {
        let abilities = match (self.kind.as_str(), &self.place) {
            #[cfg(feature = "gige")]
            ("gige", Some(place)) => place.parse().ok().map(crate::rig::gige_camera_abilities),
            #[cfg(feature = "usb3")]
            ("usb3", place) => Some(crate::rig::usb_camera_abilities(place.as_deref())),
            _ => None,
        };
        let unknown = || {
            let fault = format!("a camera of kind {} has no description, or no address is given", self.kind);
            Error::option("KIND", fault).help("give gige and an address, or usb3 and a serial number")
        };
        console.summary(&serde_json::json!(abilities.ok_or_else(unknown)??))?;
        Ok(Outcome::Done)
    }
}
