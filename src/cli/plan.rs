//! `krylux plan`: what a verb will cost on a rig, and how good its answer will be.

use clap::Subcommand;
use serde_json::{Value, json};

use super::console::Console;
use super::opening::Opening;
use super::options::{OutputArgs, SourceArgs, count};
use super::trace::TraceArgs;
use super::{Outcome, compensate, eigs, segment};
use crate::analysis::plan::{Cost, Planner};
use crate::error::{Error, Result};
use crate::lab::{ChannelChoice, SourceKind};
use crate::observer::{OnStep, Step};
use crate::transport::Channels;

/// Predict photos, time and error of a verb on a rig, from its virtual twin
#[derive(clap::Args)]
pub(super) struct Args {
    #[command(flatten)]
    source: SourceArgs,
    #[command(flatten)]
    trace: TraceArgs,
    /// Runs on the twin, each with its own noise
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = count::<u64>)]
    trials: u64,
    #[command(flatten)]
    pub(super) output: OutputArgs,
    #[command(subcommand)]
    question: Question,
}

#[derive(Subcommand)]
enum Question {
    /// Plan `krylux segment`: how well the groups agree with those without noise, and with the true labels
    Segment(segment::Question),
    /// Plan `krylux compensate`: how much larger the residual is than that of the best pattern
    Compensate(compensate::Question),
    /// Plan `krylux eigs`: how far the eigenvalues are off
    Eigs(eigs::Question),
}

/// The trials of one question.
struct Trials {
    costs: Vec<Cost>,
    /// What is predicted of each answer: a name, and a value for each trial.
    figures: Vec<(String, Vec<f64>)>,
    /// What the figures are held against, by name.
    ideal: Value,
    trials: Value,
}

pub(super) fn run(args: &Args, console: &Console) -> Result<Outcome> {
    let path = &args.source.source;
    if SourceKind::of(path) != SourceKind::Rig || args.trials == 0 {
        let (option, fault, help) = match args.trials {
            0 => ("--trials", "0 runs predict nothing".into(), "ask for at least 1, better 3"),
            _ => ("SOURCE", format!("{} is no rig", path.display()), "give a rig file (.toml)"),
        };
        return Err(Error::Option { option: option.into(), fault, help: help.into() });
    }
    let opening = Opening::new(&args.source, &args.trace).channels(ChannelChoice::Native);
    let lab = opening.open(console)?;
    let Some(rig) = lab.rig() else { return Err(Error::Interrupted) };
    // The true labels are the scene's, which is traced next.
    let truth = match args.question {
        Question::Segment(_) => lab.truth()?.map(|truth| truth.labels),
        Question::Compensate(_) | Question::Eigs(_) => None,
    };
    let twin = rig.twin()?;
    let observer = OnStep::new(|_: &Step<'_>| console.check());
    let planner = Planner {
        rig: rig.devices()?,
        twin: &twin,
        calibration: &rig.calibration,
        measurement: &rig.file.measurement,
        observer: &observer,
    };
    // Not the seed of the rig itself: a prediction must not know the noise.
    let seeds = (1..=args.trials).map(|trial| planner.rig.seed.wrapping_add(trial));
    let seeds: Vec<u64> = seeds.collect();
    let (verb, found) = match &args.question {
        Question::Segment(question) => {
            ("segment", of_segment(args, question, &planner, truth.as_deref(), &seeds, console)?)
        }
        Question::Compensate(question) => ("compensate", of_compensate(question, &planner, &seeds, console)?),
        Question::Eigs(question) => ("eigs", of_eigs(args, question, &planner, &seeds, console)?),
    };
    if console.check().is_break() {
        return Err(Error::Interrupted);
    }
    say(&found, console)?;
    let range =
        |values: &[f64]| json!({ "mean": mean(values), "min": least(values), "max": largest(values) });
    let figures = found.figures.iter().map(|(name, values)| (name.clone(), range(values)));
    let of_costs = |of: fn(&Cost) -> f64| range(&found.costs.iter().map(of).collect::<Vec<_>>());
    console.summary(&json!({
        "verb": "plan",
        "question": verb,
        "rig": path,
        "photos": of_costs(|cost| cost.photos as f64),
        "patterns": of_costs(|cost| cost.patterns as f64),
        "frames": of_costs(|cost| cost.frames as f64),
        "seconds": of_costs(|cost| cost.seconds),
        "figures": figures.collect::<serde_json::Map<_, _>>(),
        "ideal": found.ideal,
        "trials": found.trials,
    }))?;
    Ok(Outcome::Done)
}

fn of_segment(
    args: &Args,
    question: &segment::Question,
    planner: &Planner<'_>,
    labels: Option<&[u8]>,
    seeds: &[u64],
    console: &Console,
) -> Result<Trials> {
    let (part, mut options) = (question.part(), question.options(args.trace.overrides().vector_seed(), None));
    options.resolution = Some(planner.rig.scene.size());
    let ideal = planner.ideal_segmentation(part, &options)?;
    options.groups = ideal.labels.iter().map(|(groups, _)| *groups).collect();
    let trials =
        each(seeds, console, &mut |seed| planner.segmentation(part, &options, &ideal, labels, seed))?;
    let mut figures = Vec::new();
    for (index, groups) in options.groups.iter().enumerate() {
        let agreement = trials.iter().map(|trial| trial.agreement[index].1);
        figures.push((format!("{groups} groups against those without noise"), agreement.collect()));
        let truth: Vec<f64> = trials.iter().filter_map(|trial| Some(trial.truth.get(index)?.1)).collect();
        if !truth.is_empty() {
            figures.push((format!("{groups} groups against the true labels"), truth));
        }
    }
    let costs = trials.iter().map(|trial| trial.cost).collect();
    Ok(Trials { costs, figures, ideal: json!({ "eigenvalues": ideal.eigenvalues }), trials: json!(trials) })
}

fn of_compensate(
    question: &compensate::Question,
    planner: &Planner<'_>,
    seeds: &[u64],
    console: &Console,
) -> Result<Trials> {
    let options = question.options();
    options.check()?;
    let target = question.target(planner.rig.scene.size(), Channels::Luma)?;
    let ideal = planner.ideal_compensation(&target, &options)?;
    let trials = each(seeds, console, &mut |seed| planner.compensation(&ideal, &options, seed))?;
    let figures = vec![
        ("residual".into(), trials.iter().map(|trial| trial.residual).collect()),
        (
            "more than the best pattern's, as a share".into(),
            trials.iter().map(|trial| trial.excess).collect(),
        ),
    ];
    console.say(format_args!(
        "best      {:.4} of the target; {:.4} uncompensated",
        ideal.optimum, ideal.uncompensated
    ))?;
    let costs = trials.iter().map(|trial| trial.cost).collect();
    let ideal =
        json!({ "relative_residual": ideal.optimum, "relative_residual_uncompensated": ideal.uncompensated });
    Ok(Trials { costs, figures, ideal, trials: json!(trials) })
}

fn of_eigs(
    args: &Args,
    question: &eigs::Question,
    planner: &Planner<'_>,
    seeds: &[u64],
    console: &Console,
) -> Result<Trials> {
    let (part, options) = (question.part(), question.options(args.trace.overrides().vector_seed(), None));
    let ideal = planner.ideal_eigenpairs(part, &options)?;
    let trials = each(seeds, console, &mut |seed| planner.eigenvalues(part, &options, &ideal, seed))?;
    let of = |index: usize| trials.iter().filter_map(move |trial| trial.errors.get(index).copied()).collect();
    let name = |index: usize| format!("error of eigenvalue {}, relative to the largest", index + 1);
    let figures = (0..ideal.values.len()).map(|index| (name(index), of(index))).collect();
    let costs = trials.iter().map(|trial| trial.cost).collect();
    Ok(Trials { costs, figures, ideal: json!({ "eigenvalues": ideal.values }), trials: json!(trials) })
}

/// Runs one trial for each seed.
fn each<T>(seeds: &[u64], console: &Console, trial: &mut dyn FnMut(u64) -> Result<T>) -> Result<Vec<T>> {
    let bar = console.bar("trials");
    let mut trials = Vec::new();
    for (done, &seed) in seeds.iter().enumerate() {
        if bar.at(done as u64, seeds.len() as u64).is_break() {
            return Err(Error::Interrupted);
        }
        trials.push(trial(seed)?);
    }
    Ok(trials)
}

fn say(found: &Trials, console: &Console) -> Result<()> {
    console.say("           photos  patterns   frames   seconds on the rig")?;
    for (trial, cost) in found.costs.iter().enumerate() {
        console.say(format_args!(
            "  trial {:<2} {:>6}  {:>8}  {:>7}  {:>8.1}",
            trial + 1,
            cost.photos,
            cost.patterns,
            cost.frames,
            cost.seconds
        ))?;
    }
    let width = found.figures.iter().map(|(name, _)| name.chars().count()).max().unwrap_or(0);
    console.say(format_args!("           {:width$}      mean     least   largest", ""))?;
    for (name, values) in &found.figures {
        let [mean, least, largest] = [mean(values), least(values), largest(values)];
        console.say(format_args!("           {name:width$}  {mean:>8.4}  {least:>8.4}  {largest:>8.4}"))?;
    }
    Ok(())
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

fn least(values: &[f64]) -> f64 {
    values.iter().copied().fold(f64::INFINITY, f64::min)
}

fn largest(values: &[f64]) -> f64 {
    values.iter().copied().fold(f64::NEG_INFINITY, f64::max)
}
