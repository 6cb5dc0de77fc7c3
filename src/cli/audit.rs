//! `krylux audit`: whether a source is the linear, symmetric operator that every other verb takes it for.

use anyhow::Result;
use serde_json::json;

use super::Outcome;
use super::console::Console;
use super::light::Light;
use super::operator::OperatorArgs;
use super::options::{OutputArgs, RunArgs, SourceArgs};
use super::replay::not_for_runs;
use super::run_folder::RunFolder;
use super::source::Source;
use super::trace::TraceArgs;
use crate::analysis::audit::{Audit, AuditOptions, Exact, audit};
use crate::error::Error;
use crate::image::Resolution;
use crate::report::audit::AuditRun;
use crate::transport::{Channels, Part};

/// Check that a source is a linear, symmetric operator: exit 1 where it is not
#[derive(clap::Args)]
pub(super) struct Args {
    #[command(flatten)]
    source: SourceArgs,
    #[command(flatten)]
    trace: TraceArgs,
    #[command(flatten)]
    operator: OperatorArgs,
    /// Random patterns; symmetry is judged by all pairs of them
    #[arg(long, value_name = "N", default_value_t = 6)]
    patterns: usize,
    /// Relative deviation from additivity, homogeneity and repeatability that passes
    #[arg(long, value_name = "X", default_value_t = 0.01)]
    tolerance: f64,
    /// Asymmetry |A − Aᵀ|/|A| that passes
    #[arg(long, value_name = "X", default_value_t = 0.1)]
    asymmetry: f64,
    #[command(flatten)]
    run: RunArgs,
    #[command(flatten)]
    pub(super) output: OutputArgs,
}

pub(super) fn run(args: &Args, console: &Console) -> Result<Outcome> {
    if args.run.resume {
        return Err(Error::Option {
            option: "--resume".into(),
            fault: "an audit asks whether a photo taken twice is the same, so it keeps none".into(),
            help: "audit anew, with --overwrite or into another folder".into(),
        }
        .into());
    }
    let mut source = Source::open(&args.source, &args.trace, console)?;
    if let Source::Run(_) = source {
        return Err(not_for_runs(&args.source.source));
    }
    let mut folder = RunFolder::create(&args.run, &format!("{}-audit", source.name()), console)?;
    source.describe(&mut folder.manifest, Channels::Luma);
    let outcome = audited(args, console, &mut source, &mut folder);
    folder.close(outcome)
}

fn audited(
    args: &Args,
    console: &Console,
    source: &mut Source,
    folder: &mut RunFolder,
) -> Result<(Outcome, String)> {
    let (name, resolution, unit) = (source.name(), source.resolution(), source.unit());
    let options = AuditOptions {
        patterns: args.patterns,
        tolerance: args.tolerance,
        asymmetry: args.asymmetry,
        seed: args.trace.seed(),
        ..AuditOptions::default()
    };
    let mut light = folder
        .timed(source.preparation(), |_| source.light(&args.operator, Channels::Luma, None, console))?;
    folder.describe_light(&light);
    let found = folder.timed("photos", |_| check(&mut light, resolution, &options, console));
    // What failed by saturation has no white photo whose noise could be told.
    let whole = found.as_ref().is_ok_and(|found| !found.white.is_empty());
    folder.manifest.rig = light.record(whole)?;
    let found = found?;
    folder.manifest.photos = found.photos as u64;
    for check in &found.checks {
        console.say(check.line())?;
    }
    console.say(found.sentence())?;
    let run = AuditRun { title: format!("{name} · audit"), found: &found, unit };
    let seconds = folder.seconds();
    folder.manifest.outputs =
        folder.timed("files", |folder| run.write(&folder.path, &folder.manifest, seconds))?;
    let report = folder.path.join("report.html");
    console.say(format_args!("report    {}", report.display()))?;
    console.summary(&json!({
        "verb": "audit",
        "folder": folder.path,
        "report": report,
        "passed": found.passed(),
        "checks": found.checks,
        "seconds": folder.seconds(),
    }))?;
    let outcome = if found.passed() { Outcome::Done } else { Outcome::NotGoodEnough };
    Ok((outcome, found.sentence()))
}

fn check(
    light: &mut Light<'_>,
    resolution: Resolution,
    options: &AuditOptions,
    console: &Console,
) -> Result<Audit> {
    if let Light::Measured(rig) = light {
        return Ok(audit(&mut rig.measurement, options)?);
    }
    let direct = light.with_operator(Part::Direct, console, |operator| {
        let mut direct = vec![0.0; operator.rows()];
        operator.apply(&vec![1.0; operator.cols()], &mut direct).map(|()| direct)
    })?;
    Ok(light.with_operator(Part::Full, console, |operator| {
        audit(&mut Exact { full: operator, direct: Some(direct), resolution }, options)
    })?)
}
