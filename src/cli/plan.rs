//! `krylux plan`: what a verb will cost on a rig, and how good its answer will be.

use clap::Subcommand;
use serde_json::{Value, json};

use super::console::Console;
use super::opening::Opening;
use super::options::{SourceArgs, count, number};
use super::trace::TraceArgs;
use super::{Outcome, plan_ranks};
use crate::analysis::plan::Cost;
use crate::error::{Error, Result};
use crate::finding::decimal;
use crate::io::name::Name;
use crate::lab::{ChannelChoice, Lab, Plan, PlanRequest, RigSource, SourceKind};
use crate::transport::Channels;
use crate::verbs::{Compensate, Eigs, Segment};

/// Predict photos, time and error of a verb on a rig, from its virtual twin; or memory and time of a scene on several machines
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  krylux plan rig.toml segment --photos 40 --groups 2\n  krylux plan rig.toml --compare-methods compensate --target target.png --photos 12\n  krylux plan scene.glb --size 1024 --spp 64 --ranks 1,8,64"
)]
pub(super) struct Args {
    #[command(flatten)]
    source: SourceArgs,
    #[command(flatten)]
    trace: TraceArgs,
    /// Runs on the twin, each with its own noise
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = count::<u64>)]
    trials: u64,
    /// Numbers of processes (MPI ranks) on which a scene is to be traced, each on a machine like this one
    #[arg(long, value_name = "N,…", value_delimiter = ',', value_parser = count::<usize>)]
    ranks: Vec<usize>,
    /// Bandwidth of the network between the machines, in Gbit/s, for --ranks
    #[arg(long, value_name = "X", default_value_t = 10.0, value_parser = number::<f64>)]
    network: f64,
    /// Plan `compensate` by every method, each with as many photos, and say what each shows at equal frames, too
    #[arg(long)]
    compare_methods: bool,
    #[command(subcommand)]
    question: Option<Question>,
}

#[derive(Subcommand)]
enum Question {
    /// Plan `krylux segment`: how well the groups agree with those without noise, and with the true labels
    #[command(after_help = "Example:\n  krylux plan rig.toml segment --photos 40 --groups 2")]
    Segment(Segment),
    /// Plan `krylux compensate`: how much larger the residual is than that of the best pattern
    #[command(after_help = "Example:\n  krylux plan rig.toml compensate --target target.png --photos 20")]
    Compensate(Compensate),
    /// Plan `krylux eigs`: how far the eigenvalues are off
    #[command(after_help = "Example:\n  krylux plan rig.toml eigs --count 4 --photos 30")]
    Eigs(Eigs),
}

pub(super) fn run(args: &Args, console: &Console) -> Result<Outcome> {
    if !args.ranks.is_empty() && args.question.is_none() {
        return plan_ranks::run(args.ranks.as_slice(), args.network, &args.source, &args.trace, console);
    }
    let path = &args.source.source;
    let Some(question) = &args.question else {
        return Err(Error::option("plan", "it is not said what is to be planned")
            .help("give a verb on a rig (segment, compensate or eigs), or --ranks with a scene"));
    };
    if SourceKind::of(path) != SourceKind::Rig || args.trials == 0 {
        let (option, fault, help) = match args.trials {
            0 => ("--trials", "0 runs predict nothing".into(), "ask for at least 1, better 3"),
            _ => ("SOURCE", format!("{} is no rig", path.display()), "give a rig file (.toml)"),
        };
        return Err(Error::option(option, fault).help(help));
    }
    let opening = Opening::new(&args.source, &args.trace).channels(ChannelChoice::Native);
    let lab = opening.open(console)?;
    let request = match (request(question, &lab)?, args.compare_methods) {
        (request, false) => request,
        (PlanRequest::Compensate(target, options), true) => PlanRequest::CompareMethods(target, options),
        _ => {
            return Err(Error::option("--compare-methods", "only methods of a compensation are compared")
                .help("leave it out, or plan compensate"));
        }
    };
    let found = lab.plan(&request, args.trials)?;
    say(&found, console)?;
    let range =
        |values: &[f64]| json!({ "mean": mean(values), "min": least(values), "max": largest(values) });
    let figures = found.figures.iter().map(|(name, values)| (name.clone(), range(values)));
    let of_costs = |of: fn(&Cost) -> f64| range(&found.costs.iter().map(of).collect::<Vec<_>>());
    console.summary(&json!({
        "verb": "plan",
        "question": request.verb(),
        "rig": Name::from(path),
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

fn request(question: &Question, lab: &Lab) -> Result<PlanRequest> {
    let seed = lab.seed();
    Ok(match question {
        Question::Segment(question) => {
            question.check_plan()?;
            PlanRequest::Segment(question.part(), question.options(seed, None))
        }
        Question::Compensate(question) => {
            question.check_plan()?;
            let target = question.target(lab.resolution(), Channels::Luma)?;
            let is_symmetric = lab.rig().is_none_or(RigSource::is_symmetric);
            PlanRequest::Compensate(target, question.options(is_symmetric, None))
        }
        Question::Eigs(question) => PlanRequest::Eigs(question.part.into(), question.options(seed, None)),
    })
}

fn say(found: &Plan, console: &Console) -> Result<()> {
    let ideal = |name: &str| found.ideal.get(name).and_then(Value::as_f64);
    if let (Some(best), Some(uncompensated)) =
        (ideal("relative_residual"), ideal("relative_residual_uncompensated"))
    {
        console.say(format_args!(
            "best      {} of the target; {} uncompensated",
            decimal(best, 4),
            decimal(uncompensated, 4)
        ))?;
    }
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
        let [mean, least, largest] = [mean, least, largest].map(|of| decimal(of(values), 4));
        console.say(format_args!("           {name:width$}  {mean:>8}  {least:>8}  {largest:>8}"))?;
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
