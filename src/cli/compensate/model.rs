//! A new target on a scene that an earlier run captured: answered by the model that the run left.

use std::path::Path;
use std::sync::Arc;

use super::{Args, conclude};
use crate::analysis::compensate::compensate_by_model;
use crate::analysis::low_rank::SavedModel;
use crate::analysis::{CompensateOptions, Target};
use crate::cli::Outcome;
use crate::cli::console::Console;
use crate::cli::opening::{Opening, in_run};
use crate::error::{Error, Result};
use crate::lab::{ChannelChoice, Compensated, SharedObserver, open_model};
use crate::transport::Channels;

pub(super) fn run(args: &Args, console: &Console) -> Result<Outcome> {
    // A model takes no photos: a budget of 0 is fine.
    let options = CompensateOptions { photos: 1, ..args.options(false, true, None) };
    options.check()?;
    match &args.model {
        Some(folder) => corrected(args, folder, &options, console),
        None => by_model_alone(args, &options, console),
    }
}

/// Answers by the model in the folder that is the source; no photo is taken.
fn by_model_alone(args: &Args, options: &CompensateOptions, console: &Console) -> Result<Outcome> {
    let opening = Opening::new(&args.source, &args.trace).channels(ChannelChoice::Native);
    let mut lab = opening.open(console)?;
    let mut model = lab.model()?;
    let target = target(args, &model)?;
    in_run(&mut lab, &args.run, "compensate", |lab| {
        let found = lab.timed("model", |_| {
            let mut no_photos = |_: &[Vec<f64>]| Err(Error::Interrupted);
            compensate_by_model(&mut model.channels, &target, options, 0, &mut no_photos)
        })?;
        let names = (model.source.as_str(), model.unit.as_str());
        let answer =
            Compensated { model: Some(names), has_photos: false, ..Compensated::new(&found, options) };
        conclude(args, &answer, lab, console)
    })
}

/// Answers by a model, corrected by photos of the source.
fn corrected(args: &Args, folder: &Path, options: &CompensateOptions, console: &Console) -> Result<Outcome> {
    let observer = SharedObserver(Arc::new(console.clone()));
    let mut model = open_model(folder, &observer)?;
    let target = target(args, &model)?;
    let channels = Channels::of(model.channels.len());
    let opening = Opening::new(&args.source, &args.trace).operator(&args.operator).channels(channels);
    let mut lab = opening.open_shown(&args.live, console)?;
    lab.check_model(&model)?;
    in_run(&mut lab, &args.run, "compensate", |lab| {
        let found = lab.compensate_by_model(&mut model, &target, options, args.question.corrections())?;
        conclude(args, &Compensated::new(&found, options), lab, console)
    })
}

fn target(args: &Args, model: &SavedModel) -> Result<Target> {
    let channels = Channels::of(model.channels.len());
    let target = args.question.target(model.resolution, channels)?;
    Target::new(&target, &model.ambient)
}
