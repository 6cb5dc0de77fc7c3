//! `krylux audit`: whether a source is the linear, symmetric operator that every other verb takes it for.

use serde_json::json;

use super::Outcome;
use super::console::Console;
use super::opening::{Ending, Opening, finish, in_run};
use super::options::{OperatorArgs, RunArgs, SourceArgs, count, number};
use super::trace::TraceArgs;
use crate::bench::audit::AuditOptions;
use crate::error::{Error, Result};
use crate::lab::Lab;
use crate::paint::page::Kept;

/// Check that a source is a linear, symmetric operator: exit 1 where it is not
#[derive(clap::Args)]
#[command(after_help = "Example:\n  krylux audit rig.toml")]
pub(super) struct Args {
    #[command(flatten)]
    source: SourceArgs,
    #[command(flatten)]
    trace: TraceArgs,
    #[command(flatten)]
    operator: OperatorArgs,
    /// Random patterns; symmetry is judged by all pairs of them
    #[arg(long, value_name = "N", default_value_t = 6, value_parser = count::<usize>)]
    patterns: usize,
    /// Relative deviation from additivity, homogeneity and repeatability that passes
    #[arg(long, value_name = "X", default_value_t = 0.01, value_parser = number::<f64>)]
    tolerance: f64,
    /// Asymmetry |A − Aᵀ|/|A| that passes
    #[arg(long, value_name = "X", default_value_t = 0.1, value_parser = number::<f64>)]
    asymmetry: f64,
    #[command(flatten)]
    run: RunArgs,
}

pub(super) fn run(args: &Args, console: &Console) -> Result<Outcome> {
    if args.run.resume {
        return Err(Error::option(
            "--resume",
            "an audit asks whether a photo taken twice is the same, so it keeps none",
        )
        .help("audit anew, with --overwrite or into another folder"));
    }
    let opening = Opening::new(&args.source, &args.trace).operator(&args.operator);
    let mut lab = opening.open(console)?;
    lab.check_for_audit()?;
    in_run(&mut lab, &args.run, "audit", |lab| answer(args, lab, console))
}

fn answer(args: &Args, lab: &mut Lab, console: &Console) -> Result<Outcome> {
    let options = AuditOptions {
        patterns: args.patterns,
        tolerance: args.tolerance,
        asymmetry: args.asymmetry,
        seed: lab.seed(),
        ..AuditOptions::default()
    };
    let found = lab.audit(&options)?;
    for check in &found.checks {
        console.say(check)?;
    }
    for finding in &found.devices {
        console.say(finding)?;
    }
    console.say(found.sentence())?;
    let summary = json!({ "passed": found.passed(), "checks": found.checks, "devices": found.devices });
    Ok(finish(
        lab,
        console,
        &found,
        Ending { run: &args.run, demands: Vec::new(), summary, kept: Kept::default() },
    )?
    .1)
}
