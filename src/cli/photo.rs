//! `krylux photo`: one photo of a scene under a pattern.

use std::path::PathBuf;

use anyhow::Result;
use clap::ValueEnum;
use serde_json::json;

use super::console::Console;
use super::options::{ChannelsArg, OutputArgs, SourceArgs, TraceArgs};
use super::pattern::Pattern;
use super::{Outcome, simulation};
use crate::image::Image;
use crate::report::picture;
use crate::transport::{Retraced, Simulated, Transport};

/// Take one photo of a scene under a pattern
#[derive(clap::Args)]
pub(super) struct Args {
    #[command(flatten)]
    source: SourceArgs,
    #[command(flatten)]
    trace: TraceArgs,
    /// What is projected: white, black, left, checker:N, stripes:N, pixel:X,Y, or a .npy, .exr or .png file
    #[arg(long, value_name = "PATTERN", default_value = "white")]
    pattern: Pattern,
    /// Gray or coloured
    #[arg(long, value_enum, default_value = "rgb")]
    channels: ChannelsArg,
    /// Trace for this one photo, or build the matrix and multiply (the same photo to rounding)
    #[arg(long, value_enum, default_value = "retrace")]
    operator: OperatorArg,
    /// Where the photo goes, by extension: .exr and .npy keep the radiance, .png is for people; may be given several times
    #[arg(short = 'o', long = "output", value_name = "FILE", default_value = "photo.png")]
    files: Vec<PathBuf>,
    #[command(flatten)]
    pub(super) output: OutputArgs,
}

#[derive(Clone, Copy, ValueEnum)]
enum OperatorArg {
    Retrace,
    Replay,
}

pub(super) fn run(args: &Args, console: &Console) -> Result<Outcome> {
    let settings = args.trace.settings();
    args.files.iter().try_for_each(|file| picture::check_writable(file))?;
    let scene = simulation::load(&args.source, console)?;
    let pattern = args.pattern.image(settings.resolution)?;
    let mut tracer = simulation::open(&scene, &args.trace, console)?;
    let channels = args.channels.into();
    let photo = match args.operator {
        OperatorArg::Retrace => {
            let bar = console.bar("tracing");
            let mut progress = |progress: crate::render::Progress| bar.at(progress.done, progress.total);
            Retraced { tracer: &mut tracer, settings, channels, progress: &mut progress }
                .photograph(&pattern)?
        }
        OperatorArg::Replay => {
            let traced = simulation::assemble(&mut tracer, &args.trace, channels, console)?;
            Simulated { traced }.photograph(&pattern)?
        }
    };
    for file in &args.files {
        picture::write(file, &photo)?;
        console.say(format_args!("wrote     {}", file.display()))?;
    }
    let (mean, low, high) = statistics(&photo);
    console.say(format_args!("radiance  mean {mean:.5}, from {low:.5} to {high:.5} W/(m² sr)"))?;
    console.summary(&json!({
        "verb": "photo",
        "files": args.files,
        "resolution": settings.resolution,
        "samples_per_pixel": settings.samples,
        "radiance": { "mean": mean, "min": low, "max": high },
    }))?;
    Ok(Outcome::Done)
}

/// Mean, least and greatest sample.
fn statistics(photo: &Image) -> (f64, f64, f64) {
    let samples = || photo.samples().iter().map(|&sample| f64::from(sample));
    let mean = samples().sum::<f64>() / photo.samples().len() as f64;
    (mean, samples().fold(f64::INFINITY, f64::min), samples().fold(f64::NEG_INFINITY, f64::max))
}
