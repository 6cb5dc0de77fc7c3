//! The layout of a run's folder, and short names of files.

use std::path::{Path, PathBuf};

use crate::journal::Journal;

pub(super) const RECORD: &str = "run.json";
pub(super) const REPORT: &str = "report.html";

/// The folder of the journal, inside the run's folder.
pub(super) const JOURNAL: &str = "journal";
/// The folder of a rig's calibration, inside the journal's folder.
pub(super) const CALIBRATION: &str = "calibration";
/// The folder in which an answer is written until it is complete.
pub(super) const ANSWER: &str = ".answer";

pub(super) fn journal_folder(run: &Path) -> PathBuf {
    run.join(JOURNAL)
}

pub(super) fn calibration_folder(run: &Path) -> PathBuf {
    journal_folder(run).join(CALIBRATION)
}

/// The number of photos in the journal of a run's folder; 0 if no journal can be read.
pub(super) fn photos_in(run: &Path) -> usize {
    Journal::read_only(&journal_folder(run)).map_or(0, |journal| journal.photos())
}

/// A short name for a file: its stem, or the name of its folder if the stem is just `scene`.
pub(super) fn short_name(path: &Path) -> String {
    let stem = path.file_stem().map(|stem| stem.to_string_lossy().into_owned());
    let folder =
        path.parent().and_then(|folder| folder.file_name()).map(|f| f.to_string_lossy().into_owned());
    match (stem, folder) {
        (Some(stem), Some(folder)) if stem == "scene" => folder,
        (Some(stem), _) => stem,
        (None, _) => "scene".into(),
    }
}
