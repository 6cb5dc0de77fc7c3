//! The layout of a run's folder, short names of files, and the journal of a run with reports about damage.

use std::path::{Path, PathBuf};

use super::{Log, SharedObserver};
use crate::error::Result;
use crate::journal::{Damage, Identity, Journal};
use crate::observer::Level;

pub(super) const RECORD: &str = "run.json";
pub(super) const REPORT: &str = "report.html";

/// The file of a scene that was in memory.
pub(super) const SCENE: &str = "scene.glb";

/// The folder of the journal, inside the run's folder.
pub(super) const JOURNAL: &str = "journal";
/// The folder of a rig's calibration, inside the journal's folder.
pub(super) const CALIBRATION: &str = "calibration";
/// The folder that holds an answer until all of its files are complete.
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

/// Opens the journal of a run, and reports the state of an existing journal. Fails as [`Journal::create`] and [`Journal::resume`].
pub(super) fn open_journal(
    run: &Path,
    identity: &Identity,
    resume: bool,
    observer: &SharedObserver,
) -> Result<Journal> {
    let folder = journal_folder(run);
    let journal =
        if resume { Journal::resume(&folder, identity)? } else { Journal::create(&folder, identity)? };
    if journal.photos() > 0 {
        observer.note(format_args!("journal   {} photos are there already", journal.photos()));
    }
    report_damages(&journal, observer);
    Ok(journal)
}

/// Reports each unusable record of the journal by its name.
pub(super) fn report_damages(journal: &Journal, observer: &SharedObserver) {
    let path = journal.path().display();
    if let Some(torn) = journal.torn() {
        observer.note(format_args!(
            "note: {path}: the last {} bytes are a record that was never finished: they are passed over",
            torn.bytes
        ));
    }
    for damage in journal.damages() {
        observer.log(Level::Warning, &format!("warning: {path}: {damage}; it is never used"));
    }
}

/// Reports each record of the journal that turns out to be damaged when it is read.
pub(super) fn warn_of_damage(
    journal: &Journal,
    observer: &SharedObserver,
) -> impl FnMut(&Damage) + Send + use<> {
    let (path, observer) = (journal.path().to_path_buf(), observer.clone());
    let end = if journal.is_writable() { "it is taken again" } else { "the answer does not use it" };
    move |damage| {
        let message = format!("warning: {}: {damage}; {end}", path.display());
        observer.log(Level::Warning, &message);
    }
}
