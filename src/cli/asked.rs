//! A verb on the command line: its request with the options that all such verbs have, from the source to the end of the run.

use clap::{ArgMatches, Command, FromArgMatches};
use serde_json::json;

use super::Outcome;
use super::console::Console;
use super::opening::{Ending, Opening, finish, in_run};
use super::operator::OperatorArgs;
use super::options::{CheckArgs, RunArgs, SourceArgs};
use super::tev::LiveArgs;
use super::trace::TraceArgs;
use crate::error::Result;
use crate::lab::{Answer, Lab, Verb};
use crate::paint::page::Kept;

/// The command line of a verb.
pub(super) struct Asked<V> {
    request: V,
    common: Common,
}

/// The options beside the request.
#[derive(clap::Args)]
struct Common {
    #[command(flatten)]
    source: SourceArgs,
    #[command(flatten)]
    trace: TraceArgs,
    #[command(flatten)]
    operator: OperatorArgs,
    #[command(flatten)]
    check: CheckArgs,
    #[command(flatten)]
    run: RunArgs,
    #[command(flatten)]
    live: LiveArgs,
}

impl<V: clap::Args> FromArgMatches for Asked<V> {
    fn from_arg_matches(matches: &ArgMatches) -> std::result::Result<Self, clap::Error> {
        Ok(Self { request: V::from_arg_matches(matches)?, common: Common::from_arg_matches(matches)? })
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> std::result::Result<(), clap::Error> {
        self.request.update_from_arg_matches(matches)?;
        self.common.update_from_arg_matches(matches)
    }
}

impl<V: clap::Args> clap::Args for Asked<V> {
    fn augment_args(command: Command) -> Command {
        // The request's own comment and examples are those of the verb.
        V::augment_args(<Common as clap::Args>::augment_args(command))
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

impl<V: Verb> Asked<V> {
    /// Opens the source, asks, and writes the answer in a run of its own.
    pub(super) fn run(&self, console: &Console) -> Result<Outcome> {
        let Self { request, common } = self;
        // Wrong options should show before anything is written or traced.
        request.check()?;
        let channels = request.channels(&common.source.source)?;
        let opening = Opening {
            split_bounces: request.splits_bounces(),
            ..Opening::new(&common.source, &common.trace).operator(&common.operator).channels(channels)
        };
        let mut lab = opening.open_shown(&common.live, console)?;
        request.check_on(&lab)?;
        in_run(&mut lab, &common.run, V::NAME, |lab| self.answer(lab, console))
    }

    fn answer(&self, lab: &mut Lab, console: &Console) -> Result<Outcome> {
        let mut answer = lab.ask(&self.request)?;
        console.go_on()?;
        if self.common.check.is_on() {
            answer.verify(lab)?;
        }
        let content = answer.content();
        content.lines.iter().try_for_each(|line| console.say(line))?;
        content.notes.iter().for_each(|note| console.note(note));
        let (summary, kept) = (json!(content), Kept::of(&answer, &content));
        let ending = Ending { run: &self.common.run, demands: Vec::new(), summary, kept };
        Ok(finish(lab, console, &answer, ending)?.1)
    }
}
