//! `krylux runs` and `krylux index`: the runs below a folder, the photos in their journals, and a page about the runs.

use std::path::PathBuf;

use clap::Subcommand;
use serde_json::{Value, json};

use super::Outcome;
use super::console::Console;
use super::opener;
use crate::error::{Error, Result};
use crate::io::name::Name;
use crate::lab::{KeptPhotos, KeptRun, text};
use crate::report::index::{self as page, FoundRun};

/// Show what runs take on the disk, or remove photos that can be computed again
#[derive(Subcommand)]
pub(super) enum Action {
    /// List the runs below a folder: their size, and the size of the journal that holds their photos
    #[command(after_help = "Example:\n  krylux runs list out")]
    List(ListArgs),
    /// Remove the journals of simulated runs whose scene is still there, unchanged: their photos can be traced again
    ///
    /// Nothing is removed without --delete. Results, pictures and reports stay. A run without its journal answers no further question; the
    /// same command on the scene does. Photos of rigs, and of runs that --resume may go on with, are never removed.
    #[command(
        after_help = "Examples:\n  krylux runs prune out     # says what it would remove\n  krylux runs prune out --delete"
    )]
    Prune(PruneArgs),
}

#[derive(clap::Args)]
pub(super) struct ListArgs {
    /// The folder
    #[arg(value_name = "FOLDER", default_value = "out")]
    folder: PathBuf,
}

#[derive(clap::Args)]
pub(super) struct PruneArgs {
    /// The folder
    #[arg(value_name = "FOLDER", default_value = "out")]
    folder: PathBuf,
    /// Remove the journals; without this option, only say what would be removed
    #[arg(long)]
    delete: bool,
}

pub(super) fn run(action: &Action, console: &Console) -> Result<Outcome> {
    match action {
        Action::List(args) => list(args, console),
        Action::Prune(args) => prune(args, console),
    }
}

fn list(args: &ListArgs, console: &Console) -> Result<Outcome> {
    let runs = KeptRun::below(&args.folder)?;
    for run in &runs {
        console.say(format_args!("{}, {}", line(run), in_words(&run.photos)))?;
    }
    let [all, journals] = [|run: &KeptRun| run.bytes, |run: &KeptRun| run.journal_bytes]
        .map(|of| runs.iter().map(of).sum::<u64>());
    console.say(format_args!(
        "runs      {}: {} runs, {}, of which photos {}",
        args.folder.display(),
        runs.len(),
        text::bytes(all),
        text::bytes(journals)
    ))?;
    console.summary(&json!({
        "verb": "runs list",
        "folder": Name::from(&args.folder),
        "bytes": all,
        "journal_bytes": journals,
        "runs": runs.iter().map(described).collect::<Vec<_>>(),
    }))?;
    Ok(Outcome::Done)
}

fn prune(args: &PruneArgs, console: &Console) -> Result<Outcome> {
    let runs = KeptRun::below(&args.folder)?;
    let (pruned, kept): (Vec<_>, Vec<_>) =
        runs.into_iter().partition(|run| run.photos == KeptPhotos::Recomputable);
    for run in kept.iter().filter(|run| run.photos != KeptPhotos::Absent) {
        console.say(format_args!("keeps     {}, {}", line(run), in_words(&run.photos)))?;
    }
    let mut bytes = 0;
    for run in &pruned {
        bytes += if args.delete { run.delete_photos()? } else { run.journal_bytes };
        let done = if args.delete { "removed" } else { "removes" };
        console.say(format_args!("{done:<9} {}", line(run)))?;
    }
    let size = text::bytes(bytes);
    console.say(match args.delete {
        true => format!("runs      removed the photos of {} runs, {size}", pruned.len()),
        false => format!("runs      --delete would remove the photos of {} runs, {size}", pruned.len()),
    })?;
    console.summary(&json!({
        "verb": "runs prune",
        "folder": Name::from(&args.folder),
        "deleted": args.delete,
        "bytes": bytes,
        "pruned": pruned.iter().map(described).collect::<Vec<_>>(),
        "kept": kept.iter().map(described).collect::<Vec<_>>(),
    }))?;
    Ok(Outcome::Done)
}

/// The line about a run, such as `  33.4 MiB, photos  25.9 MiB  out/carton`.
fn line(run: &KeptRun) -> String {
    let [all, journal] = [run.bytes, run.journal_bytes].map(text::bytes);
    format!("{all:>10}, photos {journal:>10}  {}", run.path.display())
}

fn in_words(photos: &KeptPhotos) -> String {
    match photos {
        KeptPhotos::Absent => "no photos".into(),
        KeptPhotos::Recomputable => "photos can be computed again".into(),
        KeptPhotos::Unique(why) => format!("photos are kept: {why}"),
    }
}

fn described(run: &KeptRun) -> Value {
    json!({
        "path": Name::from(&run.path),
        "status": run.status,
        "bytes": run.bytes,
        "journal_bytes": run.journal_bytes,
        "recomputable": run.photos == KeptPhotos::Recomputable,
        "photos": in_words(&run.photos),
    })
}

/// Write a page over the runs in a folder: a picture, the verb, the source, photos, time and status of each, and a link to its report
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  krylux index out\n  krylux index out --open")]
pub(super) struct IndexArgs {
    /// The folder; runs in folders within it are found, too
    #[arg(value_name = "DIR", default_value = "out")]
    folder: PathBuf,
    /// Replace an index.html that is not krylux's
    #[arg(long)]
    overwrite: bool,
    /// Open the page in the browser
    #[arg(long)]
    open: bool,
}

pub(super) fn index(args: &IndexArgs, console: &Console) -> Result<Outcome> {
    let file = args.folder.join(page::NAME);
    if let Ok(old) = crate::file::read(&file)
        && !args.overwrite
        && !page::is_own(&old)
    {
        return Err(Error::option(file.display().to_string(), "is the page of another program")
            .help("move it aside, or add --overwrite"));
    }
    let runs = page::find(&args.folder)?;
    if runs.is_empty() {
        let fault = "holds no run: no folder in it has a run.json";
        return Err(Error::option(args.folder.display().to_string(), fault)
            .help("name the folder that the folders of runs lie in, such as out"));
    }
    let page = page::write(&args.folder, &runs)?;
    console.say(format_args!("runs      {}", runs.len()))?;
    console.say(format_args!("page      {}", page.display()))?;
    console.summary(&json!({
        "verb": "index",
        "page": Name::from(&page),
        "runs": runs.iter().map(summary_of).collect::<Vec<_>>(),
    }))?;
    if args.open {
        opener::open(&page, console);
    }
    Ok(Outcome::Done)
}

fn summary_of(run: &FoundRun) -> Value {
    match &run.record {
        Ok(record) => json!({
            "folder": Name::from(&run.folder),
            "verb": record.verb(),
            "source": record.scene.as_ref().map(|scene| &scene.path),
            "photos": record.photos,
            "status": record.status,
            "started": record.started,
        }),
        Err(fault) => json!({ "folder": Name::from(&run.folder), "error": fault }),
    }
}
