//! What lies where in the folder of a run, and short names of files.

use std::path::{Path, PathBuf};

use crate::journal::Journal;

/// The file in which a run says what it did.
pub(super) const RECORD: &str = "run.json";
/// The page of a run.
pub(super) const REPORT: &str = "report.html";

/// The folder of a run's journal in its own.
pub(super) const JOURNAL: &str = "journal";
/// The folder of a rig's calibration in that of the journal.
pub(super) const CALIBRATION: &str = "calibration";
/// The folder in which an answer is written, until all of it is there.
pub(super) const ANSWER: &str = ".answer";

/// The folder of a run's journal.
pub(super) fn journal_folder(run: &Path) -> PathBuf {
    run.join(JOURNAL)
}

/// The folder in which a run keeps the calibration of its rig.
pub(super) fn calibration_folder(run: &Path) -> PathBuf {
    journal_folder(run).join(CALIBRATION)
}

/// Photos in the journal of a run's folder; 0 where there is none that can be read.
pub(super) fn photos_in(run: &Path) -> usize {
    Journal::read_only(&journal_folder(run)).map_or(0, |journal| journal.photos())
}

/// A short name for a file: its own, or its folder's where the file is just called `scene`.
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
