//! `krylux relight`: low-rank light transport from one capture, and what it answers at no further photo.

mod args;
mod capture;
mod questions;

use anyhow::Result;
use serde_json::json;

use super::Outcome;
use super::console::Console;
use super::light::Light;
use super::live::Live;
use super::model_of_run::model_of_run;
use super::noise::percent;
use super::replay::Replay;
use super::run_folder::RunFolder;
use super::source::Source;
use crate::analysis::low_rank::SavedModel;
use crate::error::Error;
use crate::io::model;
use crate::measure::RunManifest;
use crate::report::contact_sheet::ContactSheet;
use crate::report::relighting::{RankRow, RelightingRun};
pub(super) use args::Args;
use args::BLOCK;
use questions::Answers;

pub(super) fn run(args: &Args, console: &Console) -> Result<Outcome> {
    if model::is_in(&args.source.source) {
        return from_model(args, console);
    }
    let mut source = Source::open(&args.source, &args.trace, console)?;
    if let Source::Run(run) = &source {
        return from_run(args, run, console);
    }
    // What is wrong with a file should show before anything is traced.
    args.questions().patterns(source.projector_resolution(), source.resolution(), args.channels().count())?;
    args.questions().photographs(source.resolution(), args.channels().count())?;
    args.check_for_scene(matches!(source, Source::Scene(_)))?;
    let mut folder = RunFolder::create(&args.run, &format!("{}-relight", source.name()), console)?;
    source.describe(&mut folder.manifest, args.channels());
    let outcome = captured(args, console, &mut source, &mut folder);
    folder.close(outcome)
}

/// Answers from the photos that a run of another verb took.
fn from_run(args: &Args, run: &Replay, console: &Console) -> Result<Outcome> {
    args.check_for_model()?;
    let model = model_of_run(run, console)?;
    args.questions().patterns(model.projector, model.resolution, model.channels.len())?;
    args.questions().photographs(model.resolution, model.channels.len())?;
    let mut folder = RunFolder::create(&args.run, &format!("{}-relight", model.source), console)?;
    run.describe(&mut folder.manifest);
    folder.manifest.resolution = Some(model.resolution);
    let outcome = folder
        .timed("relighting", |folder| {
            let files = model.write(&folder.path)?;
            Ok((args.questions().answers(&model, None, console)?, files))
        })
        .and_then(|(answers, files)| finish(args, &model, &answers, &[], None, files, &mut folder, console));
    folder.close(outcome)
}

/// Answers from the model that an earlier run left.
fn from_model(args: &Args, console: &Console) -> Result<Outcome> {
    args.check_for_model()?;
    let model = SavedModel::read(&args.source.source)?;
    args.questions().patterns(model.projector, model.resolution, model.channels.len())?;
    args.questions().photographs(model.resolution, model.channels.len())?;
    let mut folder = RunFolder::create(&args.run, &format!("{}-relight", model.source), console)?;
    folder.describe_file(&model::record_path(&args.source.source))?;
    folder.manifest.resolution = Some(model.resolution);
    let outcome = folder
        .timed("relighting", |_| args.questions().answers(&model, None, console))
        .and_then(|answers| finish(args, &model, &answers, &[], None, Vec::new(), &mut folder, console));
    folder.close(outcome)
}

fn captured(
    args: &Args,
    console: &Console,
    source: &mut Source,
    folder: &mut RunFolder,
) -> Result<(Outcome, String)> {
    let (name, resolution, projector) = (source.name(), source.resolution(), source.projector_resolution());
    let unit = source.unit();
    let photos = args.photos.or(source.held()).unwrap_or(40);
    folder.manifest.photos_allowed = Some(photos);
    let live = Live::new(&args.live, source, args.channels(), console);
    // A simulator is also asked for the truth, hundreds of times: that is no journal's business.
    let kept = !matches!(source, Source::Scene(_));
    let mut light: Light<'_> = folder.timed(source.preparation(), |folder| {
        source.light(&args.operator, args.channels(), kept.then_some(&*folder), console)
    })?;
    folder.describe_light(&light);
    let process = capture::Process { photos, block: args.block.unwrap_or(BLOCK), seed: args.trace.seed() };
    let model = folder.timed("photos", |_| {
        capture::model(&mut light, process, [&name, unit], [resolution, projector], &live, console)
    });
    let model = folder.record_rig(&mut light, model, console)?;
    let rank = rank_of(&model);
    folder.manifest.photos = rank as u64;
    // As soon as it is there: what follows can be asked again.
    let files = model.write(&folder.path)?;
    let curve = folder.timed("error curve", |_| capture::error_curve(&mut light, &model, console))?;
    let answers =
        folder.timed("relighting", |_| args.questions().answers(&model, Some(&mut light), console))?;
    if console.check().is_break() {
        return Err(Error::Interrupted.into());
    }
    finish(args, &model, &answers, &curve, Some(&live.strip()), files, folder, console)
}

/// Photos of the capture; a colour photo is one for each channel.
fn rank_of(model: &SavedModel) -> usize {
    model.channels.iter().map(crate::analysis::LowRank::rank).max().unwrap_or(0)
}

#[allow(clippy::too_many_arguments, reason = "a capture and a model end alike")]
fn finish(
    args: &Args,
    model: &SavedModel,
    answers: &Answers,
    curve: &[RankRow],
    strip: Option<&ContactSheet>,
    mut files: Vec<String>,
    folder: &mut RunFolder,
    console: &Console,
) -> Result<(Outcome, String)> {
    // Without a capture there is none.
    let photos = strip.map_or(0, |_| rank_of(model));
    let mut run = RelightingRun {
        title: format!("{} · low-rank light transport", model.source),
        photos,
        rank: rank_of(model),
        unit: &model.unit,
        relit: &answers.relit,
        duals: &answers.duals,
        reduced: &answers.reduced,
        curve,
        good: true,
        strip,
    };
    let worst = run.worst();
    run.good = match (args.max_error, worst) {
        (Some(most), Some(worst)) => worst <= most,
        _ => true,
    };
    let seconds = folder.seconds();
    let write = |manifest: &RunManifest, folder: &std::path::Path| run.write(folder, manifest, seconds);
    files.extend(folder.timed("files", |folder| write(&folder.manifest, &folder.path))?);
    folder.manifest.outputs = files;
    let report = folder.path.join("report.html");
    console.say(format_args!("photos    {photos}; the model has rank {}", run.rank))?;
    for relit in run.relit {
        match relit.errors.last() {
            Some(error) => {
                console.say(format_args!("relit     {}: within {} %", relit.name, percent(*error)))?;
            }
            None => console.say(format_args!("relit     {}", relit.name))?,
        }
    }
    for reduced in run.reduced {
        let error = reduced.error.map(|error| format!(", within {} %", percent(error))).unwrap_or_default();
        console.say(format_args!("direct    of {}{error}", reduced.name))?;
    }
    if let Some(row) = curve.last() {
        let optimal = row.optimal.map(|optimal| {
            format!(
                "; the best of rank {} {} %, ratio {:.3}",
                row.photos,
                percent(optimal),
                row.error / optimal
            )
        });
        console.say(format_args!(
            "matrix    within {} %{}",
            percent(row.error),
            optimal.unwrap_or_default()
        ))?;
    }
    console.say(format_args!("report    {}", report.display()))?;
    console.summary(&json!({
        "verb": "relight",
        "folder": folder.path,
        "report": report,
        "photos": photos,
        "rank": run.rank,
        "relit": run.relit.iter().map(|relit| json!({
            "pattern": relit.name,
            "relative_error": relit.errors.last(),
        })).collect::<Vec<_>>(),
        "dual": run.duals.iter().map(|dual| json!({
            "pattern": dual.name,
            "relative_error": dual.error,
        })).collect::<Vec<_>>(),
        "inverse": run.reduced.iter().map(|reduced| json!({
            "photo": reduced.name,
            "residual": reduced.residual,
            "relative_error": reduced.error,
        })).collect::<Vec<_>>(),
        "matrix": curve.last(),
        "seconds": folder.seconds(),
    }))?;
    if let (false, Some(worst), Some(most)) = (run.good, worst, args.max_error) {
        console.note(format_args!("the error of a relit photo, {worst:.5}, is above {most}"));
    }
    Ok((if run.good { Outcome::Done } else { Outcome::NotGoodEnough }, run.sentence()))
}
