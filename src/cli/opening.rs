//! From the options of a verb to an open laboratory, and from its answer to the end of the run.

use std::path::Path;

use serde_json::{Value, json};

use super::Outcome;
use super::console::Console;
use super::options::{OperatorArgs, RunArgs, SourceArgs, ViewArgs};
use super::tev::LiveArgs;
use super::trace::TraceArgs;
use super::{embedded_page, opener, options::KeepArgs};
use crate::error::{Error, Result};
use crate::finding::{Finding, Grade};
use crate::io::name::Name;
use crate::lab::{
    Answer, ChannelChoice, Lab, LabBuilder, RunOptions, Saved, Settings, SharedObserver, SourceKind,
};
use crate::paint::Canvas;
use crate::paint::page::Kept;
use crate::report::content::Content;

/// The options that open a source.
pub(super) struct Opening<'a> {
    pub(super) source: &'a Path,
    pub(super) view: &'a ViewArgs,
    pub(super) trace: &'a TraceArgs,
    pub(super) operator: Option<&'a OperatorArgs>,
    pub(super) channels: ChannelChoice,
    pub(super) split_bounces: bool,
}

impl<'a> Opening<'a> {
    /// A source in one gray channel.
    pub(super) fn new(source: &'a SourceArgs, trace: &'a TraceArgs) -> Self {
        Self {
            source: &source.source,
            view: &source.view,
            trace,
            operator: None,
            channels: ChannelChoice::Luma,
            split_bounces: false,
        }
    }

    /// How the photos of a scene are computed.
    pub(super) fn operator(self, operator: &'a OperatorArgs) -> Self {
        Self { operator: Some(operator), ..self }
    }

    /// Gray or coloured photos.
    pub(super) fn channels(self, channels: impl Into<ChannelChoice>) -> Self {
        Self { channels: channels.into(), ..self }
    }

    /// The settings of the laboratory.
    pub(super) fn settings(&self, console: &Console) -> Settings {
        Settings {
            view: self.view.clone(),
            trace: self.trace.overrides,
            adapter: self.trace.adapter.clone(),
            cache: self.trace.cache.choice(),
            channels: self.channels,
            split_bounces: self.split_bounces,
            operator: self.operator.copied().unwrap_or_default(),
            team: console.team(),
        }
    }

    /// The builder, watched by the console.
    pub(super) fn builder(&self, console: &Console) -> LabBuilder {
        let observer = SharedObserver(std::sync::Arc::new(console.clone()));
        let builder = Lab::builder(self.source).settings(self.settings(console)).observer(observer);
        builder.allow_programs(console.allows_programs())
    }

    /// Opens the source.
    pub(super) fn open(&self, console: &Console) -> Result<Lab> {
        self.builder(console).open()
    }

    /// Opens the source, whose photos are shown where the user wants to see them.
    pub(super) fn open_shown(&self, live: &LiveArgs, console: &Console) -> Result<Lab> {
        let lab = self.open(console)?;
        live.show(&lab, console);
        Ok(lab)
    }
}

impl From<&RunArgs> for RunOptions {
    fn from(args: &RunArgs) -> Self {
        Self { folder: args.folder.clone(), overwrite: args.overwrite, resume: args.resume }
    }
}

/// Runs `work` in its own run: the folder is there before the first photo. An error ends the run and stands in its record.
pub(super) fn in_run<T>(
    lab: &mut Lab,
    run: &RunArgs,
    verb: &str,
    work: impl FnOnce(&mut Lab) -> Result<T>,
) -> Result<T> {
    if run.paint && !matches!(lab.kind(), SourceKind::Scene | SourceKind::Matrix) {
        return Err(Error::option(
            "--paint",
            "the page holds the light transport matrix, which a rig or a run does not have in memory",
        )
        .help("leave it out; `krylux paint` serves a page for them"));
    }
    lab.begin_run(verb, &run.into())?;
    let mut outcome = work(lab);
    // Devices do not know whether there is a run to go on with. An audit keeps no photos.
    if let (Err(Error::Rig { help, .. }), true) = (&mut outcome, verb != "audit") {
        help.push_str("; go on with --resume: the photos taken so far are kept");
    }
    if let Err(error) = &outcome {
        lab.abort(error);
    }
    outcome
}

/// As [`in_run`], for verbs that leave single files: with a run only where `--journal` names its folder, which only a rig has a use for.
pub(super) fn in_journal<T>(
    lab: &mut Lab,
    keep: &KeepArgs,
    verb: &str,
    work: impl FnOnce(&mut Lab) -> Result<T>,
) -> Result<T> {
    match keep.run() {
        // There is no run to go on with.
        None => work(lab).map_err(|error| match error {
            Error::NotTaken { path, fault, .. } => {
                let help = "give the file of the scene or the rig as SOURCE instead of the run";
                Error::not_taken(path, fault).help(help)
            }
            other => other,
        }),
        Some(_) if lab.kind() != SourceKind::Rig => {
            let fault = "only photos of a rig are kept: those of a scene are computed from it, and those of a run are there";
            Err(Error::option("--journal", fault).help("leave it out"))
        }
        Some(run) => in_run(lab, &run, verb, work),
    }
}

/// How an answer is reported in the end.
pub(super) struct Ending<'a> {
    pub(super) run: &'a RunArgs,
    /// Whether the answer is what was asked for, beside what it says of itself.
    pub(super) demands: Vec<Finding>,
    /// What the machine-readable summary has beside what all verbs have in common.
    pub(super) summary: Value,
    /// What the painting page shows without asking.
    pub(super) kept: Kept,
}

/// Writes an answer into the folder of the open run, says where, and prints the summary.
pub(super) fn finish(
    lab: &mut Lab,
    console: &Console,
    answer: &impl Answer,
    ending: Ending<'_>,
) -> Result<(Saved, Outcome)> {
    console.go_on()?;
    let [noise, rig, verification] = match lab.run() {
        Some(run) => {
            let manifest = &run.manifest;
            if let Some(found) = &manifest.verification {
                console.say(format_args!("checked   by {}: {found}", found.by))?;
                console.say(format_args!("          {}", found.sentence()))?;
            }
            [json!(manifest.noise), json!(manifest.rig), json!(manifest.verification)]
        }
        None => [Value::Null, Value::Null, Value::Null],
    };
    let saved = lab.finish_with(answer, ending.demands)?;
    for finding in saved.findings.iter().filter(|finding| finding.grade != Grade::Ok) {
        console.say(format_args!("finding   {finding}"))?;
    }
    console.say(format_args!("report    {}", saved.report.display()))?;
    let mut summary = json!({
        "verb": answer.verb(),
        "folder": Name::from(&saved.folder),
        "report": Name::from(&saved.report),
        "noise": noise,
        "rig": rig,
        "verification": verification,
        "findings": saved.findings,
        "seconds": saved.seconds,
    });
    if ending.run.paint {
        let page = saved.folder.join("paint.html");
        summary["paint"] = embedded_page::write(&page, &mut Canvas::new(lab)?, ending.kept, console)?;
    }
    merge(&mut summary, ending.summary);
    console.summary(&summary)?;
    if ending.run.open {
        opener::open(&saved.report, console);
    }
    let outcome = Outcome::of(&saved.findings);
    Ok((saved, outcome))
}

/// Adds the fields of `more`, which replace those of the same name.
pub(super) fn merge(summary: &mut Value, more: Value) {
    if let (Some(fields), Value::Object(more)) = (summary.as_object_mut(), more) {
        fields.extend(more);
    }
}

/// A source, and how a scene is traced.
#[derive(clap::Args)]
pub(super) struct Traced {
    #[command(flatten)]
    pub(super) source: SourceArgs,
    #[command(flatten)]
    pub(super) trace: TraceArgs,
}

impl Traced {
    /// How the source is opened.
    pub(super) fn opening(&self) -> Opening<'_> {
        Opening::new(&self.source, &self.trace)
    }
}

/// Says what an answer without a folder contains, and prints the summary.
pub(super) fn tell(verb: &str, content: &Content<'_>, is_good: bool, console: &Console) -> Result<Outcome> {
    content.lines.iter().try_for_each(|line| console.say(line))?;
    content.notes.iter().for_each(|note| console.note(note));
    let mut summary = json!({ "verb": verb });
    merge(&mut summary, json!(content));
    console.summary(&summary)?;
    Ok(if is_good { Outcome::Done } else { Outcome::NotGoodEnough })
}
