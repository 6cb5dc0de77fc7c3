//! `krylux index`: a page over the runs of a folder.

use std::path::PathBuf;

use serde_json::json;

use super::Outcome;
use super::console::Console;
use super::opener;
use crate::error::{Error, Result};
use crate::io::name::Name;
use crate::report::index::{self, FoundRun};

/// Write a page over the runs in a folder: a picture, the verb, the source, photos, time and status of each, and a link to its report
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  krylux index out\n  krylux index out --open")]
pub(super) struct Args {
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

pub(super) fn run(args: &Args, console: &Console) -> Result<Outcome> {
    let page = args.folder.join(index::NAME);
    if let Ok(old) = crate::file::read(&page)
        && !args.overwrite
        && !index::is_own(&old)
    {
        return Err(Error::option(page.display().to_string(), "is the page of another program")
            .help("move it aside, or add --overwrite"));
    }
    let runs = index::find(&args.folder)?;
    if runs.is_empty() {
        return Err(Error::option(
            args.folder.display().to_string(),
            "holds no run: no folder in it has a run.json",
        )
        .help("name the folder that the folders of runs lie in, such as out"));
    }
    let page = index::write(&args.folder, &runs)?;
    console.say(format_args!("runs      {}", runs.len()))?;
    console.say(format_args!("page      {}", page.display()))?;
    console.summary(&json!({
        "verb": "index",
        "page": Name::from(&page),
        "runs": runs.iter().map(summary).collect::<Vec<_>>(),
    }))?;
    if args.open {
        opener::open(&page, console);
    }
    Ok(Outcome::Done)
}

fn summary(run: &FoundRun) -> serde_json::Value {
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
