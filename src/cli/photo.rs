//! `krylux photo`: one photo of a scene under a pattern.

use std::path::PathBuf;

use anyhow::Result;
use serde_json::json;

use super::Outcome;
use super::console::Console;
use super::noise::percent;
use super::operator::OperatorArg;
use super::options::{ChannelsArg, OutputArgs, SourceArgs};
use super::pattern::Pattern;
use super::simulation::Simulation;
use super::source::Source;
use super::trace::TraceArgs;
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
    /// Trace for this one photo, or build the matrix and multiply (the same photo, to rounding); auto multiplies if the
    /// matrix is in the cache
    #[arg(long, value_enum, default_value = "auto")]
    operator: OperatorArg,
    /// Where the photo goes, by extension: .exr and .npy keep the radiance, .png is for people; may be given several times
    #[arg(short = 'o', long = "output", value_name = "FILE", default_value = "photo.png")]
    files: Vec<PathBuf>,
    #[command(flatten)]
    pub(super) output: OutputArgs,
}

pub(super) fn run(args: &Args, console: &Console) -> Result<Outcome> {
    args.files.iter().try_for_each(|file| picture::check_writable(file))?;
    let mut source = Source::open(&args.source, &args.trace, console)?;
    let pattern = args.pattern.image(source.projector_resolution())?;
    let simulation = source.simulation()?;
    let settings = simulation.settings;
    let Taken { photo, noise, is_replayed } = of_scene(args, simulation, &pattern, console)?;
    for file in &args.files {
        picture::write(file, &photo)?;
        console.say(format_args!("wrote     {}", file.display()))?;
    }
    let (mean, low, high) = statistics(&photo);
    console.say(format_args!("radiance  mean {mean:.5}, from {low:.5} to {high:.5} W/(m² sr)"))?;
    if let Some(noise) = noise {
        let of = if is_replayed { "the white photo" } else { "the photo" };
        console.say(format_args!("noise     {} % of {of}", percent(noise)))?;
    }
    console.summary(&json!({
        "verb": "photo",
        "files": args.files,
        "resolution": settings.resolution,
        "samples_per_pixel": settings.samples,
        "noise": noise,
        "radiance": { "mean": mean, "min": low, "max": high },
    }))?;
    Ok(Outcome::Done)
}

/// A photo, and how far it is from the truth.
struct Taken {
    photo: Image,
    /// Relative, where that is known.
    noise: Option<f64>,
    /// From a matrix, whose noise is that of the white photo.
    is_replayed: bool,
}

fn of_scene(args: &Args, simulation: &mut Simulation, pattern: &Image, console: &Console) -> Result<Taken> {
    let channels = args.channels.into();
    let replayed = match args.operator {
        OperatorArg::Retrace => None,
        OperatorArg::Replay => Some(simulation.assemble(channels, console)?),
        // A single photo is never worth a matrix that is not there yet.
        OperatorArg::Auto => simulation.look_up(channels, console),
    };
    let Some(traced) = replayed else {
        let bar = console.bar("tracing");
        let mut progress = |progress: crate::render::Progress| bar.at(progress.done, progress.total);
        let settings = simulation.settings;
        let mut rig =
            Retraced { tracer: &mut simulation.tracer, settings, channels, progress: &mut progress };
        let (photo, error) = rig.photograph_with_error(pattern)?;
        let noise = (settings.samples > 1).then(|| norm(&error) / norm(&photo));
        return Ok(Taken { photo, noise: noise.filter(|noise| noise.is_finite()), is_replayed: false });
    };
    let noise = traced.noise.as_ref().map(|noise| noise.white_relative);
    Ok(Taken { photo: Simulated { traced }.photograph(pattern)?, noise, is_replayed: true })
}

fn norm(image: &Image) -> f64 {
    image.samples().iter().map(|&sample| f64::from(sample).powi(2)).sum::<f64>().sqrt()
}

/// Mean, least and greatest sample.
fn statistics(photo: &Image) -> (f64, f64, f64) {
    let samples = || photo.samples().iter().map(|&sample| f64::from(sample));
    let mean = samples().sum::<f64>() / photo.samples().len() as f64;
    (mean, samples().fold(f64::INFINITY, f64::min), samples().fold(f64::NEG_INFINITY, f64::max))
}
