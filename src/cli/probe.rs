//! `krylux probe`: a photo of which only some light paths are let through.

use anyhow::Result;
use clap::ValueEnum;
use serde_json::json;

use super::Outcome;
use super::console::Console;
use super::live::{Live, LiveArgs};
use super::noise::percent;
use super::operator::OperatorArgs;
use super::options::{ChannelsArg, OutputArgs, RunArgs, SourceArgs};
use super::run_folder::RunFolder;
use super::separate::weigh;
use super::source::Source;
use super::trace::TraceArgs;
use crate::analysis::probe::{Probed, Probing, probe};
use crate::error::Error;
use crate::operator::Operator;
use crate::report::probing::ProbingRun;
use crate::report::separation::{Planes, relative_error};
use crate::transport::Part;

/// Probe light transport: a photo of which only direct, indirect, near or far light paths are let through
#[derive(clap::Args)]
pub(super) struct Args {
    #[command(flatten)]
    source: SourceArgs,
    #[command(flatten)]
    trace: TraceArgs,
    /// One gray system, or red, green and blue as three
    #[arg(long, value_enum, default_value = "luma")]
    channels: ChannelsArg,
    /// Which paths are let through, by how far from its own pixel light comes back
    #[arg(long, value_enum, value_name = "NAME", default_value = "indirect")]
    paths: PathsArg,
    /// Near is weighed by exp(−d²/2σ²) of the distance d in pixels [default: a sixteenth of the width]
    #[arg(long, value_name = "σ")]
    sigma: Option<f64>,
    /// Random patterns; near-indirect takes two photos for each, and indirect and far a white one more [default: 100, or as many as
    /// the run that is SOURCE might take]
    #[arg(long, value_name = "N")]
    photos: Option<usize>,
    #[command(flatten)]
    operator: OperatorArgs,
    #[command(flatten)]
    run: RunArgs,
    #[command(flatten)]
    live: LiveArgs,
    #[command(flatten)]
    pub(super) output: OutputArgs,
}

#[derive(Clone, Copy, ValueEnum)]
enum PathsArg {
    /// Back to the pixel that they started from
    Direct,
    /// All others
    Indirect,
    /// Back near to where they started, direct light among them
    Near,
    /// All others
    Far,
    /// Near, without direct light
    NearIndirect,
}

pub(super) fn run(args: &Args, console: &Console) -> Result<Outcome> {
    let mut source = Source::open(&args.source, &args.trace, console)?;
    let sigma = args.sigma.unwrap_or_else(|| (source.resolution().width as f64 / 16.0).max(1.0));
    let probing = match args.paths {
        PathsArg::Direct => Probing::Direct,
        PathsArg::Indirect => Probing::Indirect,
        PathsArg::Near => Probing::Near { sigma },
        PathsArg::Far => Probing::Far { sigma },
        PathsArg::NearIndirect => Probing::NearIndirect { sigma },
    };
    probing.check()?;
    let mut folder = RunFolder::create(&args.run, &format!("{}-probe", source.name()), console)?;
    source.describe(&mut folder.manifest, args.channels.into());
    let outcome = answer(args, probing, console, &mut source, &mut folder);
    folder.close(outcome)
}

fn answer(
    args: &Args,
    probing: Probing,
    console: &Console,
    source: &mut Source,
    folder: &mut RunFolder,
) -> Result<(Outcome, String)> {
    let (name, resolution, seed) = (source.name(), source.resolution(), args.trace.seed());
    let (unit, photos) = (source.unit(), args.photos.or(source.held()).unwrap_or(100));
    folder.manifest.photos_allowed = Some(photos);
    let live = Live::new(&args.live, source, args.channels.into(), console);
    let mut light = folder.timed(source.preparation(), |folder| {
        source.light(&args.operator, args.channels.into(), Some(folder), console)
    })?;
    folder.describe_light(&light);
    live.expect(probing.photos(photos));
    let found: crate::Result<Vec<Probed>> = folder.timed("photos", |_| {
        light.with_channels(Part::Full, console, |channels| {
            let one = |operator: &mut dyn Operator| probe(operator, resolution, probing, photos, seed);
            live.watch_all(channels).iter_mut().map(|operator| one(operator)).collect()
        })
    });
    live.pause();
    let found = folder.record_rig(&mut light, found, console)?;
    if console.check().is_break() {
        return Err(Error::Interrupted.into());
    }
    let truth: Option<Planes> = match light.matrix() {
        Some(traced) => {
            let mut planes = vec![vec![0.0; resolution.pixels()]; found.len()];
            for (channel, plane) in planes.iter_mut().enumerate() {
                weigh(&traced.matrix.to_csr(Part::Full, channel)?, resolution, probing, plane);
            }
            Some(planes)
        }
        None => None,
    };
    let photos = found.first().map_or(0, |found| found.photos);
    folder.manifest.photos = photos as u64;
    let values: Planes = found.iter().map(|found| found.values.clone()).collect();
    let standard_errors: Planes = found.into_iter().map(|found| found.standard_errors).collect();
    let run = ProbingRun {
        title: format!("{name} · probing of light transport"),
        probing,
        photos,
        resolution,
        unit,
        values: &values,
        standard_errors: &standard_errors,
        truth: truth.as_ref(),
        strip: &live.strip(),
    };
    let seconds = folder.seconds();
    folder.manifest.outputs =
        folder.timed("files", |folder| run.write(&folder.path, &folder.manifest, seconds))?;
    let report = folder.path.join("report.html");
    let error = truth.as_ref().map(|truth| relative_error(&values, truth));
    console.say(format_args!("photos    {photos}, for {}", probing.in_words()))?;
    console.say(format_args!("noise     {} % (standard error)", percent(run.noise())))?;
    if let Some(error) = error {
        console.say(format_args!("error     {} % of what the matrix itself says", percent(error)))?;
    }
    console.say(format_args!("report    {}", report.display()))?;
    console.summary(&json!({
        "verb": "probe",
        "folder": folder.path,
        "report": report,
        "paths": probing.in_words(),
        "photos": photos,
        "relative_standard_error": run.noise(),
        "relative_error": error,
        "seconds": folder.seconds(),
    }))?;
    Ok((Outcome::Done, run.sentence()))
}
