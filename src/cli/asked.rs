//! The declared verbs on the command line. Their options are those of the request, and the options that all of these verbs share.

use clap::builder::{Resettable, StyledStr};
use clap::error::ErrorKind;
use clap::{ArgMatches, Args, Command, FromArgMatches, Subcommand};
use serde_json::{Value, json};

use super::console::Console;
use super::opening::{builder, in_run, merge, open_shown, settings};
use super::options::{CheckArgs, OperatorArgs, RunArgs, SourceArgs};
use super::tev::LiveArgs;
use super::trace::TraceArgs;
use super::{Outcome, embedded_page, opener};
use crate::error::{Error, Result};
use crate::finding::Grade;
use crate::io::name::Name;
use crate::lab::{Answer, Lab, Settings};
use crate::paint::Canvas;
use crate::paint::page::{EmbedOptions, Kept, Precision};
use crate::verbs::{AnyVerb, Declared, VERBS};

/// A verb of the list on the command line.
pub(super) struct AskedVerb {
    name: &'static str,
    before: Before,
    request: Box<dyn AnyVerb>,
    check: Option<CheckArgs>,
    after: After,
}

/// The options before those of the request.
#[derive(Args)]
struct Before {
    #[command(flatten)]
    source: SourceArgs,
    #[command(flatten)]
    trace: TraceArgs,
    #[command(flatten)]
    operator: OperatorArgs,
}

/// The options after those of the request.
#[derive(Args)]
struct After {
    #[command(flatten)]
    run: RunArgs,
    #[command(flatten)]
    live: LiveArgs,
}

impl FromArgMatches for AskedVerb {
    fn from_arg_matches(matches: &ArgMatches) -> std::result::Result<Self, clap::Error> {
        let found = matches.subcommand().and_then(|(name, of)| Some((Declared::named(name)?, of)));
        let (verb, matches) = found.ok_or_else(|| clap::Error::new(ErrorKind::InvalidSubcommand))?;
        let is_checked = verb.is_checked;
        Ok(Self {
            name: verb.name,
            before: Before::from_arg_matches(matches)?,
            request: (verb.from_matches)(matches)?,
            check: is_checked.then(|| CheckArgs::from_arg_matches(matches)).transpose()?,
            after: After::from_arg_matches(matches)?,
        })
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> std::result::Result<(), clap::Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

impl Subcommand for AskedVerb {
    fn augment_subcommands(command: Command) -> Command {
        VERBS.iter().fold(command, |command, verb| command.subcommand(command_of(verb)))
    }

    fn augment_subcommands_for_update(command: Command) -> Command {
        Self::augment_subcommands(command)
    }

    fn has_subcommand(name: &str) -> bool {
        Declared::named(name).is_some()
    }
}

fn command_of(verb: &Declared) -> Command {
    let declared = (verb.augment)(Command::new(verb.name));
    let command = (verb.augment)(Before::augment_args(Command::new(verb.name)));
    let command = if verb.is_checked { CheckArgs::augment_args(command) } else { command };
    described_as(&declared, After::augment_args(command))
}

/// Gives the command the help texts of the request. Each added group of options has replaced them by its own texts.
fn described_as(request: &Command, command: Command) -> Command {
    let text = |text: Option<&StyledStr>| Resettable::from(text.cloned());
    command
        .about(text(request.get_about()))
        .long_about(text(request.get_long_about()))
        .after_help(text(request.get_after_help()))
}

impl AskedVerb {
    /// Opens the source, makes the request, and writes the answer in a new run.
    pub(super) fn run(&self, console: &Console) -> Result<Outcome> {
        let Self { before, request, after, .. } = self;
        if let (true, Some(fault)) = (after.run.resume, request.not_resumed()) {
            let help = format!("{} anew, with --overwrite or into another folder", self.name);
            return Err(Error::option("--resume", fault).help(help));
        }
        // Wrong options are reported before anything is written or traced.
        request.check()?;
        let channels = request.channels(&before.source.source)?;
        let settings = Settings {
            operator: before.operator,
            channels,
            split_bounces: request.splits_bounces(),
            ..settings(&before.source.view, &before.trace)
        };
        let builder = builder(&before.source.source, settings, console);
        let mut lab = open_shown(builder, &after.live, console)?;
        request.check_on(&lab)?;
        in_run(&mut lab, &after.run, self.name, |lab| self.answer(lab, console))
    }

    fn answer(&self, lab: &mut Lab, console: &Console) -> Result<Outcome> {
        let mut answer = self.request.ask(lab)?;
        console.go_on()?;
        if self.check.as_ref().is_some_and(CheckArgs::is_on) {
            answer.verify(lab)?;
        }
        let content = answer.content();
        console.say(format_args!("found     {}", answer.headline()))?;
        content.lines.iter().try_for_each(|line| console.say(line))?;
        content.notes.iter().for_each(|note| console.note(note));
        let (summary, kept) = (json!(content), Kept::of(&*answer, &content));
        // When the answer is written, its arrays are made again. Two copies of all eigenvectors would take twice the memory.
        drop(content);
        self.finish(lab, &*answer, (summary, kept), console)
    }

    /// Writes an answer into the folder of the open run, and prints the path of the report and the summary. `kept` contains the answers
    /// that the painting page shows without a request.
    fn finish(
        &self,
        lab: &mut Lab,
        answer: &dyn Answer,
        (facts, kept): (Value, Kept),
        console: &Console,
    ) -> Result<Outcome> {
        console.go_on()?;
        let is_asked = self.check.as_ref().is_some_and(CheckArgs::is_on);
        let unchecked = lab.has_no_other_light().filter(|_| is_asked);
        let [noise, rig, verification] = match lab.run() {
            Some(run) => {
                let manifest = &run.manifest;
                if let Some(found) = &manifest.verification {
                    console.say(format_args!("checked   {}", found.sentence()))?;
                } else if let Some(why) = unchecked {
                    console.say(format_args!("checked   not checked: {why}"))?;
                }
                [json!(manifest.noise), json!(manifest.rig), json!(manifest.verification)]
            }
            None => Default::default(),
        };
        let saved = lab.finish(answer)?;
        for finding in saved.findings.iter().filter(|finding| finding.grade != Grade::Ok) {
            console.say(format_args!("finding   {finding}"))?;
        }
        console.say(format_args!("report    {}", saved.report.display()))?;
        let mut summary = json!({
            "verb": self.name,
            "folder": Name::from(&saved.folder),
            "report": Name::from(&saved.report),
            "noise": noise,
            "rig": rig,
            "verification": verification,
            "findings": saved.findings,
            "seconds": saved.seconds,
        });
        if self.after.run.paint {
            let page = saved.folder.join("paint.html");
            let max_bytes = Some(embedded_page::MAX_BYTES);
            let options = EmbedOptions { precision: Precision::Half, max_bytes, kept };
            summary["paint"] = embedded_page::write(&page, &mut Canvas::new(lab)?, &options, console)?;
        }
        merge(&mut summary, facts);
        console.summary(&summary)?;
        if self.after.run.open {
            opener::open(&saved.report, console);
        }
        Ok(Outcome::of(&saved.findings))
    }
}

/// The command line of a verb that is not in the list. The options of its request are between two groups of options.
pub(super) struct Asked<V, B, A> {
    pub(super) before: B,
    pub(super) request: V,
    pub(super) after: A,
}

impl<V: Args, B: Args, A: Args> FromArgMatches for Asked<V, B, A> {
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

impl<V: Args, B: Args, A: Args> Args for Asked<V, B, A> {
    fn augment_args(command: Command) -> Command {
        let request = V::augment_args(Command::new(""));
        described_as(&request, A::augment_args(V::augment_args(B::augment_args(command))))
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}
