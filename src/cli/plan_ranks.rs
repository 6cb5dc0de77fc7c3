//! `krylux plan SCENE --ranks`: what a scene would take on several machines.

use serde_json::json;

use super::Outcome;
use super::console::Console;
use super::opening::Opening;
use super::options::SourceArgs;
use super::trace::TraceArgs;
use crate::error::{Error, Result};
use crate::lab::Scaling;
use crate::transport::Network;

/// Photos of the question that is planned.
const PHOTOS: usize = 50;
/// Seconds until a short message arrives, as in the usual networks of clusters.
const LATENCY: f64 = 2e-5;

pub(super) fn run(
    ranks: &[usize],
    gigabits: f64,
    source: &SourceArgs,
    trace: &TraceArgs,
    console: &Console,
) -> Result<Outcome> {
    if ranks.contains(&0) || gigabits <= 0.0 {
        let (option, fault) = match ranks.contains(&0) {
            true => ("--ranks", "0 processes do nothing"),
            false => ("--network", "messages need a bandwidth above 0"),
        };
        let help = "give numbers above 0, e.g. --ranks 1,8,64 --network 10";
        return Err(Error::option(option, fault).help(help));
    }
    let network = Network { bandwidth: gigabits * 1e9 / 8.0, latency: LATENCY };
    let lab = Opening::new(source, trace).open(console)?;
    let found = lab.scaling(ranks, PHOTOS, network)?;
    say(&found, gigabits, console)?;
    console.summary(&json!({ "verb": "plan", "photos": PHOTOS, "scaling": found }))?;
    Ok(Outcome::Done)
}

fn say(found: &Scaling, gigabits: f64, console: &Console) -> Result<()> {
    let probe = &found.probe;
    console.say(format_args!(
        "measured  {:.3} µs a light path with {:.1} connections; an entry {:.1} ns to merge and {:.2} ns to multiply",
        1e6 * probe.path,
        probe.connections,
        1e9 * probe.merge,
        1e9 * probe.multiply
    ))?;
    let entries = found.processes.first().map_or(0.0, |scaled| scaled.entries);
    console.say(format_args!(
        "matrix    about {:.1} million entries; {PHOTOS} photos, and a network of {gigabits} Gbit/s",
        entries / 1e6
    ))?;
    console.say("            memory in GB   seconds")?;
    console.say(
        "  ranks     each  vectors   tracing  merging  exchange  products  messages  vectors      all  longest",
    )?;
    for scaled in &found.processes {
        console.say(format_args!(
            "  {:>5}  {:>7.2}  {:>7.2}  {:>8.1}  {:>7.1}  {:>8.1}  {:>8.1}  {:>8.1}  {:>7.1}  {:>7.1}  {}",
            scaled.processes,
            scaled.memory / 1e9,
            scaled.vectors_memory / 1e9,
            scaled.tracing,
            scaled.merging,
            scaled.exchange,
            scaled.products,
            scaled.messages,
            scaled.vectors,
            scaled.seconds(),
            scaled.binds()
        ))?;
    }
    console.say("the leader needs its vectors beside its part of the matrix")?;
    Ok(())
}
