//! `krylux plan`: the predicted cost of a verb on a rig, or of a scene on several machines.

use super::Outcome;
use super::asked::Asked;
use super::console::Console;
use super::opening::{Traced, tell};
use crate::error::Result;
use crate::verbs::Plan;

pub(super) fn run(args: &Asked<Plan, Traced, ()>, console: &Console) -> Result<Outcome> {
    args.request.check(&args.before.source.source)?;
    let lab = args.before.opening().channels(args.request.channels()).open(console)?;
    tell("plan", &args.request.ask(&lab)?, true, console)
}
