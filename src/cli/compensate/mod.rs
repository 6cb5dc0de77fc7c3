//! `krylux compensate`: what to project, so that the scene looks like a target.

mod by_model;
mod prior;
mod question;
mod verdict;

use std::path::PathBuf;

use anyhow::Result;

use super::Outcome;
use super::console::Console;
use super::live::{Live, LiveArgs};
use super::operator::OperatorArgs;
use super::options::{ChannelsArg, OutputArgs, RunArgs, SourceArgs};
use super::run_folder::RunFolder;
use super::source::Source;
use super::trace::TraceArgs;
use crate::analysis::compensate::{compare_methods, compensate_with};
use crate::analysis::{CompensateOptions, Compensation, MethodRun, Prior, Target};
use crate::error::Error;
use crate::image::Image;
use crate::io::model;
use crate::observer::{OnStep, Step};
use crate::operator::Observed;
use crate::report::compensation::{CompensationExtras, CompensationRun};
use crate::report::contact_sheet::ContactSheet;
use crate::transport::{Channels, Part};
use prior::ColorArgs;
pub(super) use question::Question;

/// Find what to project so that the scene looks like a target image
#[derive(clap::Args)]
pub(super) struct Args {
    #[command(flatten)]
    source: SourceArgs,
    #[command(flatten)]
    question: Question,
    /// The radiance that 1 in the target stands for, in W/(m² sr), or in DN/s on a rig [default: half the median of the white photo]
    #[arg(long, value_name = "L")]
    peak: Option<f64>,
    /// The folder of a run on this source, of `krylux relight` or of any verb that keeps its photos: a model of the light answers, and
    /// --photos only correct it. A run of `krylux relight`, given as SOURCE itself, answers without any photo
    #[arg(long, value_name = "FOLDER")]
    model: Option<PathBuf>,
    #[command(flatten)]
    trace: TraceArgs,
    /// One gray system, or red, green and blue as three
    #[arg(long, value_enum, default_value = "luma")]
    channels: ChannelsArg,
    #[command(flatten)]
    colors: ColorArgs,
    /// Give every method as many photos, and show them all on one plot
    #[arg(long)]
    compare_methods: bool,
    #[command(flatten)]
    operator: OperatorArgs,
    #[command(flatten)]
    run: RunArgs,
    #[command(flatten)]
    live: LiveArgs,
    #[command(flatten)]
    pub(super) output: OutputArgs,
}

impl Args {
    /// A comparison with another method is for free where photos are products. `held` as in [`Source::held`].
    fn options(&self, baseline: bool, symmetric: bool, held: Option<usize>) -> CompensateOptions {
        CompensateOptions { peak: self.peak, baseline, ..self.question.options_on(symmetric, held) }
    }

    fn channels(&self) -> Channels {
        self.channels.into()
    }
}

pub(super) fn run(args: &Args, console: &Console) -> Result<Outcome> {
    if args.model.is_some() || model::is_in(&args.source.source) {
        return by_model::run(args, console);
    }
    // What is wrong with the options or the files should show before anything is written or traced.
    args.options(true, true, None).check()?;
    args.colors.check(args.channels())?;
    let mut source = Source::open(&args.source, &args.trace, console)?;
    let target = args.question.target(source.resolution(), args.channels())?;
    let mut folder = RunFolder::create(&args.run, &format!("{}-compensate", source.name()), console)?;
    source.describe(&mut folder.manifest, args.channels());
    let outcome = answer(args, console, &target, &mut source, &mut folder);
    folder.close(outcome)
}

fn answer(
    args: &Args,
    console: &Console,
    target: &Image,
    source: &mut Source,
    folder: &mut RunFolder,
) -> Result<(Outcome, String)> {
    let name = source.name();
    let unit = source.unit();
    let held = source.held();
    let live = Live::new(&args.live, source, args.channels(), console);
    let geometry = prior::geometry(&args.options(true, true, held), source);
    let mut light = folder.timed(source.preparation(), |folder| {
        source.light(&args.operator, args.channels(), Some(folder), console)
    })?;
    folder.describe_light(&light);
    let wish = Target::new(target, &light.ambient(console)?)?;
    let (crosstalk, learned) = args.colors.crosstalk(&mut light, console)?;
    let symmetric = crosstalk.is_none() && prior::is_symmetric(&mut light, console);
    let options = args.options(light.is_simulated(), symmetric, held);
    folder.manifest.photos_allowed = Some(options.photos);
    let direct = prior::direct(&options, &mut light, console)?;
    let prior = Prior { direct, geometry, crosstalk, photos: learned, start: None };
    live.expect(1 + options.photos);
    let found = folder.timed("photos", |_| {
        light.with_channels(Part::Full, console, |channels| {
            let observer = OnStep::new(|step: &Step<'_>| live.so_far(step.estimate));
            let mut channels = live.watch_all(channels);
            let mut channels: Vec<_> =
                channels.iter_mut().map(|channel| Observed::new(channel, &observer)).collect();
            let found = compensate_with(&mut channels, &wish, &options, &prior)?;
            let methods = if args.compare_methods {
                compare_methods(&mut channels, &wish, &options, &prior)?
            } else {
                Vec::new()
            };
            crate::Result::Ok((found, methods))
        })
    });
    live.pause();
    let (found, methods) = folder.record_rig(&mut light, found, console)?;
    if console.check().is_break() {
        return Err(Error::Interrupted.into());
    }
    finish(console, (&found, &methods), &options, (&name, unit, Some(&live.strip())), folder)
}

/// Says what was found, and writes it.
fn finish(
    console: &Console,
    (found, methods): (&Compensation, &[MethodRun]),
    options: &CompensateOptions,
    (name, unit, strip): (&str, &str, Option<&ContactSheet>),
    folder: &mut RunFolder,
) -> Result<(Outcome, String)> {
    let compared: usize = methods.iter().map(|run| run.photos).sum();
    folder.manifest.photos = (found.photos + found.preparation + compared) as u64;
    let method = options.method.facts().name;
    verdict::say(found, method, methods, console)?;

    let title = format!("{name} · light transport compensation");
    let run = CompensationRun {
        title,
        found,
        method,
        floor: options.floor,
        extras: CompensationExtras { methods, lift: options.lift },
        unit,
        strip,
    };
    let seconds = folder.seconds();
    folder.manifest.outputs =
        folder.timed("files", |folder| run.write(&folder.path, &folder.manifest, seconds))?;
    let report = folder.path.join("report.html");
    console.say(format_args!("project   {}", folder.path.join("compensation.npy").display()))?;
    console.say(format_args!("report    {}", report.display()))?;
    console.summary(&verdict::summary(folder, &report, method, found, methods))?;
    let outcome = if found.good { Outcome::Done } else { Outcome::NotGoodEnough };
    Ok((outcome, run.sentence()))
}
