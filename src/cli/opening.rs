//! Opens a laboratory from the options of a verb, and ends the run once the verb has its answer.

use std::path::Path;

use serde_json::{Value, json};

use super::Outcome;
use super::console::Console;
use super::options::{KeepArgs, RunArgs, SourceArgs, ViewArgs};
use super::tev::LiveArgs;
use super::trace::TraceArgs;
use crate::error::{Error, Result};
use crate::lab::{Lab, LabBuilder, RunOptions, Settings, SharedObserver, SourceKind};
use crate::report::content::Content;

/// The settings for a source with one gray channel.
pub(super) fn settings(view: &ViewArgs, trace: &TraceArgs) -> Settings {
    Settings {
        view: view.clone(),
        trace: trace.overrides,
        adapter: trace.adapter.clone(),
        cache: trace.cache.choice(),
        ..Settings::default()
    }
}

/// The builder of the laboratory, with the console as observer.
pub(super) fn builder(source: &Path, settings: Settings, console: &Console) -> LabBuilder {
    let observer = SharedObserver(std::sync::Arc::new(console.clone()));
    let settings = Settings { team: console.team(), ..settings };
    let builder = Lab::builder(source).settings(settings).observer(observer);
    builder.allow_programs(console.allows_programs())
}

/// Opens the source. If `live` names an image viewer, the viewer shows the photos.
pub(super) fn open_shown(builder: LabBuilder, live: &LiveArgs, console: &Console) -> Result<Lab> {
    let lab = builder.open()?;
    live.show(&lab, console);
    Ok(lab)
}

impl From<&RunArgs> for RunOptions {
    fn from(args: &RunArgs) -> Self {
        Self { folder: args.folder.clone(), overwrite: args.overwrite, resume: args.resume }
    }
}

/// Runs `work` in a new run, whose folder exists before the first photo. An error ends the run and is written into its record.
pub(super) fn in_run<T>(
    lab: &mut Lab,
    run: &RunArgs,
    verb: &str,
    work: impl FnOnce(&mut Lab) -> Result<T>,
) -> Result<T> {
    if run.paint && !matches!(lab.kind(), SourceKind::Scene | SourceKind::Matrix) {
        let fault = "the page holds the light transport matrix, which a rig or a run does not have in memory";
        let help = "leave it out; `krylux paint` serves a page for them";
        return Err(Error::option("--paint", fault).help(help));
    }
    lab.begin_run(verb, &run.into())?;
    let mut outcome = work(lab);
    // The devices do not know whether the verb has `--resume`, so their messages get this help here.
    if let (Err(Error::Rig { help, .. }), true) = (&mut outcome, lab.keeps_photos()) {
        help.push_str("; go on with --resume: the photos taken so far are kept");
    }
    if let Err(error) = &outcome {
        lab.abort(error);
    }
    outcome
}

/// Works like [`in_run`], for verbs that write single files. There is a run only if `--journal` names its folder, which only a rig accepts.
pub(super) fn in_journal<T>(
    lab: &mut Lab,
    keep: &KeepArgs,
    verb: &str,
    work: impl FnOnce(&mut Lab) -> Result<T>,
) -> Result<T> {
    match keep.run() {
        // There is no run to continue, so a missing photo gets another help.
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

/// Adds the fields of `more` to `summary`. They replace existing fields of the same names.
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
    /// The settings for a source with one gray channel.
    pub(super) fn settings(&self) -> Settings {
        settings(&self.source.view, &self.trace)
    }
}

/// Prints the lines of an answer without a folder, its notes, and the summary.
pub(super) fn tell(verb: &str, content: &Content<'_>, is_good: bool, console: &Console) -> Result<Outcome> {
    content.lines.iter().try_for_each(|line| console.say(line))?;
    content.notes.iter().for_each(|note| console.note(note));
    let mut summary = json!({ "verb": verb });
    merge(&mut summary, json!(content));
    console.summary(&summary)?;
    Ok(if is_good { Outcome::Done } else { Outcome::NotGoodEnough })
}
