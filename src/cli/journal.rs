//! A run's journal, as the verbs use it.

use std::path::{Path, PathBuf};

use super::console::Console;
use crate::error::Result;
use crate::journal::{Damage, Identity, Journal};

/// Where a run keeps its journal.
pub(super) fn folder(run: &Path) -> PathBuf {
    run.join("journal")
}

/// Opens the journal of a run, and says what became of an earlier session's.
///
/// # Errors
/// As [`Journal::create`] and [`Journal::resume`].
pub(super) fn open(run: &Path, identity: &Identity, resume: bool, console: &Console) -> Result<Journal> {
    let folder = folder(run);
    let journal =
        if resume { Journal::resume(&folder, identity)? } else { Journal::create(&folder, identity)? };
    if journal.photos() > 0 {
        console.note(format_args!("journal   {} photos are there already", journal.photos()));
    }
    say_damages(&journal, console);
    Ok(journal)
}

/// What cannot be used, by name.
pub(super) fn say_damages(journal: &Journal, console: &Console) {
    let path = journal.path().display();
    if let Some(torn) = journal.torn() {
        console.note(format_args!(
            "note: {path}: the last {} bytes are a record that was never finished: they are passed over",
            torn.bytes
        ));
    }
    for damage in journal.damages() {
        console.note(format_args!("warning: {path}: {damage}; it is never used"));
    }
}

/// Says of each record that is found damaged when it is asked for.
pub(super) fn warning(journal: &Journal, console: &Console) -> impl FnMut(&Damage) + Send + 'static {
    let (path, console) = (journal.path().to_path_buf(), console.clone());
    move |damage| console.note(format_args!("warning: {}: {damage}; it is taken again", path.display()))
}
