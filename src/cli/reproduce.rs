//! `krylux reproduce`: the figures of the paper, reproduced and compared with bounds.

use std::sync::Arc;

use clap::ValueEnum;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use serde_json::json;

use super::Outcome;
use super::console::Console;
use super::opener;
use super::options::RunArgs;
use crate::error::{Error, Result};
use crate::io::name::Name;
use crate::lab::text::decimal;
use crate::lab::{RunFolder, SharedObserver};
use crate::paper::{self, BenchOptions, Figure, Gallery, Reproduced, Rig};

/// Make the paper's figures again: pictures, numbers and a page that holds them beside what the paper says
#[derive(clap::Args)]
#[command(
    after_help = "The folder has the page, and all numbers as a table: figures.md.\n\nExamples:\n  krylux reproduce fig4 fig11 --quick -o paper\n  krylux reproduce all --rig both -o paper"
)]
pub(super) struct Args {
    /// Which figures
    #[arg(value_name = "FIGURE", required = true, value_parser = figure())]
    figures: Vec<Option<Figure>>,
    /// Photos without devices' faults, through a virtual projector and camera with theirs, or one after the other
    #[arg(long, value_enum, default_value = "ideal")]
    rig: RigArg,
    /// Small and noisy, in seconds: to see that everything runs
    #[arg(long)]
    quick: bool,
    /// The graphics adapter whose name contains this; `krylux info` lists them
    #[arg(long, value_name = "NAME")]
    adapter: Option<String>,
    #[command(flatten)]
    run: RunArgs,
}

/// Parses the name of a figure; `None` means all figures.
fn figure() -> impl TypedValueParser<Value = Option<Figure>> {
    let named = Figure::ALL.map(|figure| PossibleValue::new(figure.name()).help(figure.title()));
    PossibleValuesParser::new(named.into_iter().chain([PossibleValue::new("all").help("All of them")]))
        .map(|name| Figure::ALL.into_iter().find(|figure| figure.name() == name))
}

#[derive(Clone, Copy, ValueEnum)]
enum RigArg {
    Ideal,
    Virtual,
    Both,
}

impl Args {
    /// The requested figures in the order of the paper, each once.
    fn figures(&self) -> Vec<Figure> {
        let asked = |figure: &Figure| self.figures.iter().any(|one| one.is_none_or(|one| one == *figure));
        Figure::ALL.into_iter().filter(asked).collect()
    }

    fn rigs(&self) -> &'static [Rig] {
        match self.rig {
            RigArg::Ideal => &[Rig::Ideal],
            RigArg::Virtual => &[Rig::Virtual],
            RigArg::Both => &[Rig::Ideal, Rig::Virtual],
        }
    }
}

pub(super) fn run(args: &Args, console: &Console) -> Result<Outcome> {
    if args.run.resume {
        return Err(Error::option("--resume", "figures are made anew each time, and keep no journal")
            .help("leave it out, and add --overwrite to write into the same folder"));
    }
    let observer = SharedObserver(Arc::new(console.clone()));
    let mut folder = RunFolder::create(&(&args.run).into(), "reproduce", None, &observer)?;
    match reproduce(args, console, &mut folder) {
        Ok((outcome, message)) => {
            folder.close(Ok(&message))?;
            if args.run.open {
                opener::open(folder.path.join("report.html"), console);
            }
            Ok(outcome)
        }
        Err(error) => {
            // A failure to record the error is ignored, since the error itself is more important.
            let _ = folder.close(Err(&error));
            Err(error)
        }
    }
}

fn reproduce(args: &Args, console: &Console, folder: &mut RunFolder) -> Result<(Outcome, String)> {
    let benches = args.rigs().iter().map(|&rig| BenchOptions {
        rig,
        quick: args.quick,
        adapter: args.adapter.clone(),
        team: console.team(),
    });
    let observer = SharedObserver(Arc::new(console.clone()));
    let mut said = |one: &Reproduced| say(one, args.quick, console);
    let made = paper::reproduce_all(&args.figures(), benches, &observer, &mut said)?;
    let gallery = Gallery { made: &made, quick: args.quick };
    let report = gallery.write_into(folder)?;
    console.say(format_args!("report    {}", report.display()))?;
    console.say(format_args!("table     {}", folder.path.join("figures.md").display()))?;
    let verdict = gallery.verdict();
    console.say(format_args!("verdict   {}", verdict.sentence))?;
    let all_met = made.iter().all(Reproduced::is_met);
    console.summary(&json!({
        "verb": "reproduce",
        "folder": Name::from(&folder.path),
        "report": Name::from(&report),
        "quick": args.quick,
        "met": all_met,
        "figures": gallery.summary(),
        "seconds": folder.seconds(),
    }))?;
    // The bounds hold only for pictures of full size, so a quick run is not judged by them.
    let is_good = all_met || args.quick;
    Ok((if is_good { Outcome::Done } else { Outcome::NotGoodEnough }, verdict.sentence))
}

/// Prints a line for the figure, and a line for each number that misses its bound. In a quick run, whose pictures are too small for the
/// bounds, only the first line is printed.
fn say(made: &Reproduced, quick: bool, console: &Console) -> Result<()> {
    let verdict = match (quick, made.is_met()) {
        (true, _) => "made",
        (false, true) => "met",
        (false, false) => "NOT MET",
    };
    console.say(format_args!(
        "{:<9} {verdict}, {} photos, {:.1} s ({} rig)",
        made.figure.name(),
        made.photos,
        made.seconds,
        made.rig.name()
    ))?;
    for check in &made.checks {
        let line = format!("          {:<12} {}", decimal(check.value, 6), check.what);
        if quick || check.is_met() {
            console.detail(line);
        } else {
            console.say(line)?;
        }
        if !quick && !check.cause().is_empty() {
            console.detail(format!("          {}", check.cause()));
        }
    }
    Ok(())
}
