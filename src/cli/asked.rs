//! A verb on the command line: its request with the options that all such verbs have, from the source to the end of the run.

use clap::builder::{Resettable, StyledStr};
use clap::{ArgMatches, Command, FromArgMatches};
use serde_json::json;

use super::Outcome;
use super::console::Console;
use super::opening::{Ending, Opening, finish, in_run};
use super::options::{CheckArgs, OperatorArgs, RunArgs, SourceArgs};
use super::tev::LiveArgs;
use super::trace::TraceArgs;
use crate::error::Result;
use crate::lab::{Answer, Lab, Verb};
use crate::paint::page::Kept;

/// The command line of a verb: its request between the options that it shares with others.
pub(super) struct Asked<V, B = Before, A = After> {
    pub(super) before: B,
    pub(super) request: V,
    pub(super) after: A,
}

/// The options before those of the request.
#[derive(clap::Args)]
pub(super) struct Before {
    #[command(flatten)]
    source: SourceArgs,
    #[command(flatten)]
    trace: TraceArgs,
    #[command(flatten)]
    operator: OperatorArgs,
}

/// The options after those of the request.
#[derive(clap::Args)]
pub(super) struct After {
    #[command(flatten)]
    check: CheckArgs,
    #[command(flatten)]
    run: RunArgs,
    #[command(flatten)]
    live: LiveArgs,
}

impl<V: clap::Args, B: clap::Args, A: clap::Args> FromArgMatches for Asked<V, B, A> {
    fn from_arg_matches(matches: &ArgMatches) -> std::result::Result<Self, clap::Error> {
        Ok(Self {
            before: B::from_arg_matches(matches)?,
            request: V::from_arg_matches(matches)?,
            after: A::from_arg_matches(matches)?,
        })
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> std::result::Result<(), clap::Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

impl<V: clap::Args, B: clap::Args, A: clap::Args> clap::Args for Asked<V, B, A> {
    fn augment_args(command: Command) -> Command {
        let verb = V::augment_args(Command::new(""));
        // Groups of options bring their own comments. Those of the request are the verb's.
        let command = A::augment_args(V::augment_args(B::augment_args(command)));
        let text = |text: Option<&StyledStr>| Resettable::from(text.cloned());
        command
            .about(text(verb.get_about()))
            .long_about(text(verb.get_long_about()))
            .after_help(text(verb.get_after_help()))
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

impl<V: Verb> Asked<V> {
    /// Opens the source, asks, and writes the answer in a run of its own.
    pub(super) fn run(&self, console: &Console) -> Result<Outcome> {
        let Self { before, request, after } = self;
        // Wrong options should show before anything is written or traced.
        request.check()?;
        let channels = request.channels(&before.source.source)?;
        let opening = Opening {
            split_bounces: request.splits_bounces(),
            ..Opening::new(&before.source, &before.trace).operator(&before.operator).channels(channels)
        };
        let mut lab = opening.open_shown(&after.live, console)?;
        request.check_on(&lab)?;
        in_run(&mut lab, &after.run, V::NAME, |lab| self.answer(lab, console))
    }

    fn answer(&self, lab: &mut Lab, console: &Console) -> Result<Outcome> {
        let mut answer = lab.ask(&self.request)?;
        console.go_on()?;
        if self.after.check.is_on() {
            answer.verify(lab)?;
        }
        let content = answer.content();
        content.lines.iter().try_for_each(|line| console.say(line))?;
        content.notes.iter().for_each(|note| console.note(note));
        let (summary, kept) = (json!(content), Kept::of(&answer, &content));
        // Writing makes the arrays anew: two copies of all eigenvectors at once would take twice the memory.
        drop(content);
        let ending = Ending { run: &self.after.run, demands: Vec::new(), summary, kept };
        Ok(finish(lab, console, &answer, ending)?.1)
    }
}
