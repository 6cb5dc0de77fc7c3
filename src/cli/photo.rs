//! `krylux photo`: one photo of a scene under a pattern.

use std::path::PathBuf;

use serde_json::json;

use super::Outcome;
use super::console::Console;
use super::opening::{Opening, in_journal, merge};
use super::options::{ChannelsArg, KeepArgs, OperatorArgs, SourceArgs, named_or_free};
use super::pattern::Pattern;
use super::tev::LiveArgs;
use super::trace::TraceArgs;
use crate::error::{Error, Result};
use crate::finding::Grade;
use crate::image::Image;
use crate::io::name::Name;
use crate::io::picture;
use crate::lab::{
    ChannelChoice, Lab, OperatorChoice, SinglePhoto, SourceKind, byte_count,
    text::{decimal, percent},
};

/// Take one photo of a scene under a pattern
#[derive(clap::Args)]
#[command(after_help = "Example:\n  krylux photo scene.glb --pattern checker:8 -o photo.exr -o photo.png")]
pub(super) struct Args {
    #[command(flatten)]
    source: SourceArgs,
    #[command(flatten)]
    trace: TraceArgs,
    /// What is projected: white, black, left, checker:N, stripes:N, pixel:X,Y, or a .npy, .exr or .png file
    #[arg(long, value_name = "PATTERN", default_value = "white")]
    pattern: Pattern,
    /// Gray or coloured [default: rgb; a rig's photo is what its camera sees]
    #[arg(long, value_enum)]
    channels: Option<ChannelsArg>,
    /// Trace for this one photo, or build the matrix and multiply (the same photo, to rounding); auto multiplies if the
    /// matrix is in the cache
    #[arg(long, value_enum, default_value = "auto")]
    operator: OperatorChoice,
    /// The memory that the photo may take, or the matrix while it is assembled, e.g. 8GiB or 500MB [default: half of the machine's]
    #[arg(long, value_name = "BYTES", value_parser = byte_count)]
    memory: Option<u64>,
    /// Where the photo goes, by extension: .exr and .npy keep the radiance, .png is for people; may be given several times
    /// [default: photo.png, or the first free one of photo-2.png, photo-3.png, …]
    #[arg(short = 'o', long = "output", value_name = "FILE")]
    files: Vec<PathBuf>,
    /// Where the standard error of each pixel goes, as an image like the photo's; a scene is then traced for this photo
    #[arg(long, value_name = "FILE")]
    error: Option<PathBuf>,
    #[command(flatten)]
    keep: KeepArgs,
    #[command(flatten)]
    live: LiveArgs,
}

pub(super) fn run(args: &Args, console: &Console) -> Result<Outcome> {
    let files = named_or_free(&args.files, "photo", "png");
    files.iter().chain(&args.error).try_for_each(|file| picture::check_writable(file))?;
    let channels = args.channels.map_or(ChannelChoice::Native, Into::into);
    let opening = Opening::new(&args.source, &args.trace).channels(channels);
    let mut settings = opening.settings(console);
    settings.operator = OperatorArgs { choice: args.operator, memory: args.memory, ..settings.operator };
    let is_scene = SourceKind::of(&args.source.source) == SourceKind::Scene;
    if args.error.is_some() && is_scene && args.operator == OperatorChoice::Auto {
        settings.operator.choice = OperatorChoice::Retrace;
    }
    let mut lab = opening.builder(console).settings(settings).open()?;
    args.live.show(&lab, console);
    let pattern = args.pattern.image(lab.projector_resolution())?;
    in_journal(&mut lab, &args.keep, "photo", |lab| {
        let taken = lab.single_photo(&pattern)?;
        write(args, &files, lab, &pattern, &taken, console)?;
        lab.end_run(1, "photographed")?;
        let found = taken.rig.map_or(Vec::new(), |rig| rig.findings);
        for finding in found.iter().filter(|finding| finding.grade != Grade::Ok) {
            console.say(format_args!("finding   {finding}"))?;
        }
        Ok(Outcome::of(&found))
    })
}

fn write(
    args: &Args,
    files: &[PathBuf],
    lab: &mut Lab,
    pattern: &Image,
    taken: &SinglePhoto,
    console: &Console,
) -> Result<()> {
    let photo = &taken.photo;
    for (channel, plane) in photo.planes().iter().enumerate() {
        let shown = pattern.plane(channel.min(pattern.channels() - 1));
        let progress = console.progress();
        progress.show("pattern", pattern.resolution(), channel, &shown);
        progress.show("photo", photo.resolution(), channel, plane);
    }
    for file in files {
        picture::write(file, photo)?;
        console.say(format_args!("wrote     {}", file.display()))?;
    }
    if let Some(file) = &args.error {
        let Some(error) = &taken.standard_error else { return Err(unknown_error()) };
        picture::write(file, error)?;
        console.say(format_args!("wrote     {}", file.display()))?;
    }
    let (mean, low, high) = statistics(photo);
    let unit = lab.unit();
    let [shown_mean, least, greatest] = [mean, low, high].map(|value| decimal(value, 5));
    console.say(format_args!("radiance  mean {shown_mean}, from {least} to {greatest} {unit}"))?;
    let of = if taken.is_of_white { "the white photo" } else { "the photo" };
    if let Some(noise) = taken.noise {
        console.say(format_args!("noise     {} % of {of}", percent(noise)))?;
    }
    let mut summary = json!({
        "verb": "photo",
        "files": files.iter().map(Name::from).collect::<Vec<_>>(),
        "error_file": args.error.as_ref().map(Name::from),
        "resolution": photo.resolution(),
        "noise": taken.noise,
        "radiance": { "mean": mean, "min": low, "max": high },
        "unit": unit,
    });
    let more = match lab.kind() {
        SourceKind::Scene => json!({ "samples_per_pixel": lab.trace_settings().map(|s| s.samples) }),
        _ => json!({ "rig": taken.rig }),
    };
    merge(&mut summary, more);
    console.summary(&summary)
}

fn unknown_error() -> Error {
    let help = "of a scene, give --spp 2 or more, and leave out --operator replay; of other sources only a rig knows it";
    Error::option("--error", "the standard error of this photo is not known").help(help)
}

/// Mean, least and greatest sample.
fn statistics(photo: &Image) -> (f64, f64, f64) {
    let samples = || photo.samples().iter().map(|&sample| f64::from(sample));
    let mean = samples().sum::<f64>() / photo.samples().len() as f64;
    (mean, samples().fold(f64::INFINITY, f64::min), samples().fold(f64::NEG_INFINITY, f64::max))
}
