//! `index.html`: a page about the runs in a folder, each with a picture, its facts and a link.

use std::path::{Path, PathBuf};

use super::html::{Block, Outcome, Report, RunCard, Section, Verdict};
use super::run::outcome as of_findings;
use crate::error::{Error, Result};
use crate::file;
use crate::io::manifest::Status;
use crate::measure::RunManifest;

/// The page's file.
pub const NAME: &str = "index.html";

/// The maximum depth of folders in the search for runs.
const DEEPEST: usize = 4;

/// A run that the search found.
#[derive(Clone, Debug)]
pub struct FoundRun {
    /// The run's folder, relative to the searched folder.
    pub folder: PathBuf,
    /// The run's record, or the reason why it cannot be read.
    pub record: std::result::Result<RunManifest, String>,
    /// Whether the run has a report page.
    pub has_page: bool,
}

/// The runs below a folder, the last started run first. Links and folders inside a run are not searched. Fails with [`Error::Read`].
pub fn find(folder: &Path) -> Result<Vec<FoundRun>> {
    let mut runs = Vec::new();
    look_through(folder, Path::new(""), DEEPEST, &mut runs)?;
    let started =
        |run: &FoundRun| run.record.as_ref().map(|record| record.started.clone()).unwrap_or_default();
    runs.sort_by(|a, b| started(b).cmp(&started(a)).then_with(|| a.folder.cmp(&b.folder)));
    Ok(runs)
}

fn look_through(root: &Path, below: &Path, depth: usize, runs: &mut Vec<FoundRun>) -> Result<()> {
    let folder = root.join(below);
    let entries = std::fs::read_dir(&folder).map_err(Error::reading(&folder))?;
    for entry in entries {
        let entry = entry.map_err(Error::reading(&folder))?;
        // Links are not followed, because they may form cycles.
        let is_folder = entry.file_type().is_ok_and(|kind| kind.is_dir());
        if !is_folder || entry.file_name().to_string_lossy().starts_with('.') {
            continue;
        }
        let below = below.join(entry.file_name());
        let path = root.join(&below);
        if path.join("run.json").is_file() {
            let record = RunManifest::read(&path.join("run.json")).map_err(|error| error.to_string());
            runs.push(FoundRun { folder: below, record, has_page: path.join("report.html").is_file() });
        } else if depth > 1 {
            // An unreadable subfolder is skipped, since its runs could not be shown.
            let _ = look_through(root, &below, depth - 1, runs);
        }
    }
    Ok(())
}

/// Writes the page into the searched folder. A link in place of the page is refused. Fails with [`Error::Write`].
pub fn write(folder: &Path, runs: &[FoundRun]) -> Result<PathBuf> {
    file::follow_no_links_below(folder);
    let path = folder.join(NAME);
    page(folder, runs).write(&path)?;
    Ok(path)
}

fn page(folder: &Path, runs: &[FoundRun]) -> Report {
    let failed = runs.iter().filter(|run| outcome(run) == Outcome::Failed).count();
    let count = match runs.len() {
        1 => "1 run".to_owned(),
        count => format!("{count} runs"),
    };
    let sentence = match failed {
        0 => format!("{count}."),
        failed => format!("{count}, of which {failed} did not end well."),
    };
    let name =
        folder.canonicalize().ok().and_then(|path| Some(path.file_name()?.to_string_lossy().into_owned()));
    Report {
        title: format!("Runs in {}", name.unwrap_or_else(|| folder.display().to_string())),
        verdict: Verdict { outcome: Outcome::Good, sentence },
        sections: vec![Section {
            title: "Runs".into(),
            text: "Those that started last come first.".into(),
            blocks: vec![Block::Runs(runs.iter().map(|run| card(folder, run)).collect())],
        }],
        ..Report::default()
    }
}

fn outcome(run: &FoundRun) -> Outcome {
    match run.record.as_ref().map(|record| record.status) {
        Ok(Status::Done) => {
            run.record.as_ref().map_or(Outcome::Failed, |record| of_findings(&record.findings))
        }
        Ok(Status::Running | Status::Interrupted) => Outcome::Short,
        Ok(Status::Failed) | Err(_) => Outcome::Failed,
    }
}

fn card(root: &Path, run: &FoundRun) -> RunCard {
    // Addresses contain slashes on every system, so the path is joined by slashes.
    let parts: Vec<_> = run.folder.iter().map(|part| part.to_string_lossy()).collect();
    let folder = parts.join("/");
    let page = if run.has_page { format!("{folder}/report.html") } else { String::new() };
    let (sentence, facts, picture) = match &run.record {
        Ok(record) => (said(record), facts(record), picture(&root.join(&run.folder), record)),
        Err(fault) => (format!("Its run.json cannot be read: {fault}"), Vec::new(), None),
    };
    RunCard {
        page,
        picture: picture.map(|name| format!("{folder}/{name}")).unwrap_or_default(),
        verdict: Verdict { outcome: outcome(run), sentence },
        facts,
        folder,
    }
}

fn said(record: &RunManifest) -> String {
    let status = match record.status {
        Status::Running => return "Running, or killed.".to_owned(),
        Status::Done => "Done",
        Status::Interrupted => "Interrupted",
        Status::Failed => "Failed",
    };
    match record.message.trim_end_matches('.') {
        "" => format!("{status}."),
        message => format!("{status}: {message}."),
    }
}

fn facts(record: &RunManifest) -> Vec<(String, String)> {
    let seconds: f64 = record.timings.iter().map(|timing| timing.seconds).sum();
    let mut facts = vec![("Verb", record.verb().to_owned())];
    facts.extend(record.scene.as_ref().map(|scene| ("Source", scene.path.to_string())));
    facts.extend(record.resolution.map(|size| ("Pixels", size.to_string())));
    facts.push(("Photos", record.photos.to_string()));
    facts.push(("Time", format!("{seconds:.1} s")));
    facts.push(("Started", record.started.clone()));
    facts.into_iter().map(|(name, value)| (name.to_owned(), value)).collect()
}

/// The existing picture that represents the run best.
fn picture(folder: &Path, record: &RunManifest) -> Option<String> {
    const BEST: [&str; 8] =
        ["labels-", "observed", "relit-", "direct.", "probed", "eigenvector-02", "eigenvector-01", "white"];
    let pictures: Vec<&String> = record
        .outputs
        .iter()
        .filter(|name| name.ends_with(".png") && *name != "labels-true.png" && folder.join(name).is_file())
        .collect();
    let best = BEST.iter().find_map(|start| pictures.iter().find(|name| name.starts_with(start)));
    best.or(pictures.first()).map(|name| (*name).clone())
}

/// Whether this module wrote the page. Other pages are not replaced.
pub fn is_own(page: &[u8]) -> bool {
    let mark = b"<p class=\"mark\">krylux</p>";
    page.windows(mark.len()).any(|bytes| bytes == mark)
}
