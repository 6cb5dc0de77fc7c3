//! `krylux plan`: the predicted cost of a verb on a rig, or of a scene on several machines.

use super::Outcome;
use super::asked::Asked;
use super::console::Console;
use super::opening::{Traced, builder, tell};
use crate::error::Result;
use crate::lab::Settings;
use crate::verbs::Plan;

pub(super) fn run(args: &Asked<Plan, Traced, ()>, console: &Console) -> Result<Outcome> {
    let source = &args.before.source.source;
    args.request.check(source)?;
    let settings = Settings { channels: args.request.channels(), ..args.before.settings() };
    let lab = builder(source, settings, console).open()?;
    tell("plan", &args.request.ask(&lab)?, true, console)
}
