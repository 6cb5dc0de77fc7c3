//! Opens the journal of a run and reports its damage.

use std::path::Path;

use super::layout::journal_folder;
use super::{Log, SharedObserver};
use crate::error::Result;
use crate::journal::{Damage, Identity, Journal};
use crate::observer::Level;

/// Opens the journal of a run, and reports the state of an earlier one. Fails as [`Journal::create`] and [`Journal::resume`].
pub(super) fn open(
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

/// Reports each unusable record by name.
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

/// Reports each record that proves damaged when it is read.
pub(super) fn warning(journal: &Journal, observer: &SharedObserver) -> impl FnMut(&Damage) + Send + use<> {
    let (path, observer) = (journal.path().to_path_buf(), observer.clone());
    move |damage| {
        let message = format!("warning: {}: {damage}; it is taken again", path.display());
        observer.log(Level::Warning, &message);
    }
}
