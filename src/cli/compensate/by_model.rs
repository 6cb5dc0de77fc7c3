//! A new target on a scene that `krylux relight` captured: answered by the model that it left.

use anyhow::Result;

use super::super::Outcome;
use super::super::channel::ChannelOperator;
use super::super::console::Console;
use super::super::journal;
use super::super::live::{Live, Watched};
use super::super::model_of_run::model_of_run;
use super::super::replay::Replay;
use super::super::run_folder::RunFolder;
use super::super::source::Source;
use super::{Args, finish};
use crate::analysis::compensate::compensate_by_model;
use crate::analysis::low_rank::SavedModel;
use crate::analysis::{CompensateOptions, Compensation, Target};
use crate::error::Error;
use crate::io::model;
use crate::journal::Journal;
use crate::operator::Operator;
use crate::transport::{Channels, Part};

pub(super) fn run(args: &Args, console: &Console) -> Result<Outcome> {
    // A model takes no photos: a budget of 0 is fine.
    let options = CompensateOptions { photos: 1, ..args.options(false, true, None) };
    options.check()?;
    let path = args.model.as_ref().unwrap_or(&args.source.source);
    let mut model = if model::is_in(path) {
        SavedModel::read(path)?
    } else if Journal::is_in(&journal::folder(path)) {
        model_of_run(&Replay::open(path)?, console)?
    } else {
        return Err(Error::Data {
            path: path.clone(),
            fault: "there is no model in this folder, and there are no photos to make one of".into(),
            help: "give the folder of a `krylux relight` run, or of another run that kept its photos".into(),
        }
        .into());
    };
    let channels = Channels::of(model.channels.len());
    let target = args.question.target(model.resolution, channels)?;
    let wish = Target::new(&target, &model.ambient)?;
    if args.model.is_none() {
        refuse_trace(args)?;
        let mut folder = RunFolder::create(&args.run, &format!("{}-compensate", model.source), console)?;
        folder.describe_file(&model::record_path(path))?;
        folder.manifest.resolution = Some(model.resolution);
        let outcome = folder
            .timed("model", |_| {
                compensate_by_model(&mut model.channels, &wish, &options, 0, &mut |_| Err(Error::Interrupted))
            })
            .map_err(Into::into)
            .and_then(|found| {
                finish(console, (&found, &[]), &options, (&model.source, &model.unit, None), &mut folder)
            });
        return folder.close(outcome);
    }
    let mut source = Source::open(&args.source, &args.trace, console)?;
    fits(&source, &model)?;
    let mut folder = RunFolder::create(&args.run, &format!("{}-compensate", source.name()), console)?;
    source.describe(&mut folder.manifest, channels);
    let (name, unit) = (source.name(), source.unit());
    let live = Live::new(&args.live, &source, channels, console);
    let outcome =
        corrected(args, console, &mut source, channels, &mut model, &wish, &options, &mut folder, &live)
            .and_then(|found| {
                finish(console, (&found, &[]), &options, (&name, unit, Some(&live.strip())), &mut folder)
            });
    folder.close(outcome)
}

/// Without a scene nothing is traced.
fn refuse_trace(args: &Args) -> Result<()> {
    match args.trace.given() {
        Some(option) => Err(Error::Option {
            option: option.into(),
            fault: format!("{} holds a model, and nothing is traced", args.source.source.display()),
            help: "leave it out, or give the scene as SOURCE and this folder by --model".into(),
        }
        .into()),
        None => Ok(()),
    }
}

fn fits(source: &Source, model: &SavedModel) -> Result<()> {
    if source.resolution() == model.resolution && source.projector_resolution() == model.projector {
        return Ok(());
    }
    Err(Error::Option {
        option: "--model".into(),
        fault: format!(
            "its photos have {} pixels, but those of {} have {}",
            model.resolution,
            source.name(),
            source.resolution()
        ),
        help: format!("give --size {}, or the source that it was captured from", model.resolution),
    }
    .into())
}

/// By the model, corrected by photos of the source.
#[allow(clippy::too_many_arguments, reason = "one call, of what a run consists of")]
fn corrected(
    args: &Args,
    console: &Console,
    source: &mut Source,
    channels: Channels,
    model: &mut SavedModel,
    wish: &Target,
    options: &CompensateOptions,
    folder: &mut RunFolder,
    live: &Live,
) -> Result<Compensation> {
    let mut light = folder.timed(source.preparation(), |folder| {
        source.light(&args.operator, channels, Some(folder), console)
    })?;
    folder.describe_light(&light);
    live.expect(args.question.corrections());
    let found = folder.timed("photos", |_| {
        light.with_channels(Part::Full, console, |operators| {
            let mut operators = live.watch_all(operators);
            let mut photograph = |patterns: &[Vec<f64>]| {
                let each = operators.iter_mut().zip(patterns);
                let photo = |(operator, pattern): (&mut Watched<'_, ChannelOperator<'_>>, &Vec<f64>)| {
                    let mut photo = vec![0.0; pattern.len()];
                    operator.apply(pattern, &mut photo)?;
                    crate::Result::Ok(photo)
                };
                each.map(photo).collect()
            };
            compensate_by_model(
                &mut model.channels,
                wish,
                options,
                args.question.corrections(),
                &mut photograph,
            )
        })
    });
    live.pause();
    folder.record_rig(&mut light, found, console)
}
