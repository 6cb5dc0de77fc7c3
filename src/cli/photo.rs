//! `krylux photo`: one photo of a scene under a pattern.

use std::path::PathBuf;

use anyhow::Result;
use serde_json::json;

use super::Outcome;
use super::console::Console;
use super::live::{Live, LiveArgs};
use super::measured::Measured;
use super::noise::percent;
use super::operator::OperatorArg;
use super::options::{ChannelsArg, KeepArgs, OutputArgs, SourceArgs};
use super::pattern::Pattern;
use super::rig_source::RigSource;
use super::run_folder::RunFolder;
use super::simulation::{Simulation, with_bar};
use super::source::{self, Source};
use super::trace::TraceArgs;
use crate::image::Image;
use crate::io::picture;
use crate::measure::RigRecord;
use crate::transport::{Channels, Retraced, Simulated, Transport};

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
    /// Gray or coloured [default: rgb; a rig's photo is what its camera sees]
    #[arg(long, value_enum)]
    channels: Option<ChannelsArg>,
    /// Trace for this one photo, or build the matrix and multiply (the same photo, to rounding); auto multiplies if the
    /// matrix is in the cache
    #[arg(long, value_enum, default_value = "auto")]
    operator: OperatorArg,
    /// Where the photo goes, by extension: .exr and .npy keep the radiance, .png is for people; may be given several times
    #[arg(short = 'o', long = "output", value_name = "FILE", default_value = "photo.png")]
    files: Vec<PathBuf>,
    #[command(flatten)]
    keep: KeepArgs,
    #[command(flatten)]
    live: LiveArgs,
    #[command(flatten)]
    pub(super) output: OutputArgs,
}

pub(super) fn run(args: &Args, console: &Console) -> Result<Outcome> {
    args.files.iter().try_for_each(|file| picture::check_writable(file))?;
    let mut source = Source::open(&args.source, &args.trace, console)?;
    let pattern = args.pattern.image(source.projector_resolution())?;
    let Taken { photo, noise, of, facts, .. } = match &mut source {
        Source::Scene(simulation) => {
            args.keep.refuse()?;
            of_scene(args, simulation, &pattern, console)?
        }
        Source::Rig(rig) => of_rig(args, rig, &pattern, console)?,
        Source::Run(run) => {
            args.keep.refuse()?;
            of_devices(args, run.measured(args.channels.map(Into::into), console)?, &pattern)?
        }
    };
    let channels = Channels::of(photo.channels());
    let live = Live::new(&args.live, &source, channels, console);
    for (channel, plane) in photo.planes().iter().enumerate() {
        live.show(
            "pattern",
            pattern.resolution(),
            channel,
            &pattern.plane(channel.min(pattern.channels() - 1)),
        );
        live.show("photo", photo.resolution(), channel, plane);
    }
    for file in &args.files {
        picture::write(file, &photo)?;
        console.say(format_args!("wrote     {}", file.display()))?;
    }
    let (mean, low, high) = statistics(&photo);
    let unit = source.unit();
    console.say(format_args!("radiance  mean {mean:.5}, from {low:.5} to {high:.5} {unit}"))?;
    if let Some(noise) = noise {
        console.say(format_args!("noise     {} % of {of}", percent(noise)))?;
    }
    let mut summary = json!({
        "verb": "photo",
        "files": args.files,
        "resolution": photo.resolution(),
        "noise": noise,
        "radiance": { "mean": mean, "min": low, "max": high },
        "unit": unit,
    });
    summary[facts.0] = facts.1;
    console.summary(&summary)?;
    Ok(Outcome::Done)
}

/// A photo, and how far it is from the truth.
struct Taken {
    photo: Image,
    /// Relative, where that is known.
    noise: Option<f64>,
    /// What the noise is relative to.
    of: &'static str,
    /// What the summary has about how it was taken, by name.
    facts: (&'static str, serde_json::Value),
    /// What it has cost on a rig.
    rig: Option<RigRecord>,
}

fn of_scene(args: &Args, simulation: &mut Simulation, pattern: &Image, console: &Console) -> Result<Taken> {
    let channels = args.channels.unwrap_or(ChannelsArg::Rgb).into();
    let settings = simulation.settings;
    let facts = ("samples_per_pixel", json!(settings.samples));
    let replayed = match args.operator {
        OperatorArg::Retrace => None,
        OperatorArg::Replay => Some(simulation.assemble(channels, console)?),
        // A single photo is never worth a matrix that is not there yet.
        OperatorArg::Auto => simulation.look_up(channels, console),
    };
    if let Some(traced) = replayed {
        let noise = traced.noise.as_ref().map(|noise| noise.white_relative);
        let photo = Simulated { traced }.photograph(pattern)?;
        return Ok(Taken { photo, noise, of: "the white photo", facts, rig: None });
    }
    let (photo, error) = with_bar(&mut simulation.tracer, console, |tracer| {
        Retraced { tracer, settings, channels }.photograph_with_error(pattern)
    })?;
    let noise = (settings.samples > 1).then(|| norm(&error) / norm(&photo));
    Ok(Taken { photo, noise: noise.filter(|noise| noise.is_finite()), of: "the photo", facts, rig: None })
}

/// Takes the photo with the rig, and keeps it where it is to be kept.
fn of_rig(args: &Args, rig: &mut RigSource, pattern: &Image, console: &Console) -> Result<Taken> {
    let channels = args.channels.map(Into::into);
    let Some(wanted) = args.keep.run() else {
        return of_devices(args, rig.measured(channels, None, console)?, pattern);
    };
    let mut folder = RunFolder::create(&wanted, "photo", console)?;
    rig.describe(&mut folder.manifest);
    let seen = channels.unwrap_or(rig.channels());
    let outcome = rig
        .journal(&folder, seen, console)
        .and_then(|journal| rig.measured(channels, Some(journal), console))
        .and_then(|measured| of_devices(args, measured, pattern));
    if let Ok(taken) = &outcome {
        folder.manifest.photos = 1;
        folder.manifest.rig = taken.rig.clone();
    }
    folder.close(outcome.map(|taken| (taken, "photographed".to_owned())))
}

/// The light of the pattern alone: the black photo, with all other light, is subtracted if the rig file does not say otherwise.
fn of_devices(args: &Args, mut measured: Measured, pattern: &Image) -> Result<Taken> {
    if args.operator != OperatorArg::Auto {
        return Err(source::not_for_rigs("--operator"));
    }
    let photo = measured.measurement.photograph(pattern)?;
    let noise = norm(&photo.errors_to_image()?) / norm(&photo.to_image()?);
    let rig = measured.record(true)?;
    let facts = ("rig", json!(rig));
    Ok(Taken {
        photo: photo.to_image()?,
        noise: Some(noise).filter(|noise| noise.is_finite()),
        of: "the photo",
        facts,
        rig: Some(rig),
    })
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
