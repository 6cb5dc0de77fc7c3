//! Storage of a run that a new run replaces. The old run is kept until the new run is complete.
//!
//! The old run is moved into `earlier-N.moving`, which is renamed to `earlier-N` when the record of the new run names it. If the program is
//! killed in between, the next run in the folder completes the move if the record names `earlier-N`, and otherwise undoes the move.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use super::layout::{JOURNAL, RECORD, REPORT, photos_in};
use crate::error::{Error, Result};
use crate::file;
use crate::io::manifest::Status;
use crate::io::model;
use crate::measure::RunManifest;
use crate::report::run::PAINT;

const NAME: &str = "earlier-";
pub(super) const MOVING: &str = ".moving";

/// Runs that were moved into `earlier-N` inside their own folder.
pub(super) struct Replaced {
    run: PathBuf,
    aside: PathBuf,
    /// Folders of earlier runs that the replaced run had moved aside. It was never completed, so these folders still exist.
    before: Vec<String>,
}

impl Replaced {
    /// Moves the run aside: its photos, model, report, record, and the listed files. On [`Error::Write`], everything is moved back.
    pub(super) fn move_aside(run: &Path) -> Result<Self> {
        let is_free =
            |name: &String| [name, &format!("{name}{MOVING}")].iter().all(|name| !is_there(&run.join(name)));
        // An unused name is always found, since the disk is full long before the numbers are used up.
        let name = (1..=u32::MAX).map(|number| format!("{NAME}{number}")).find(is_free).unwrap_or_default();
        let moving = run.join(format!("{name}{MOVING}"));
        file::make_folder(&moving)?;
        let before = RunManifest::read(&run.join(RECORD)).map_or(Vec::new(), |record| names_in(&record));
        for part in parts(run) {
            if let Err(error) = fs::rename(run.join(&part), moving.join(&part)) {
                move_all(&moving, run)?;
                return Err(Error::writing(&run.join(part))(error));
            }
        }
        Ok(Self { run: run.to_path_buf(), aside: run.join(name), before })
    }

    /// Completes the move. The record of the new run must already name [`Replaced::names`].
    pub(super) fn settle(&self) -> Result<()> {
        fs::rename(self.moving(), &self.aside).map_err(Error::writing(&self.aside))
    }

    /// The replaced runs that the record of an unfinished run names. If the run is complete, the runs that it replaced are deleted. If a
    /// killed program left a move unfinished, the move is completed if a record names its folder, and otherwise undone. Errors:
    /// [`Error::Read`], [`Error::Write`].
    pub(super) fn recover(run: &Path) -> Result<Option<Self>> {
        let named = RunManifest::read(&run.join(RECORD)).map_or(Vec::new(), |record| names_in(&record));
        let entries = fs::read_dir(run).map_err(Error::reading(run))?.flatten();
        // The filter skips links, since this program makes only real folders.
        for entry in entries.filter(|entry| entry.file_type().is_ok_and(|kind| kind.is_dir())) {
            let moving = entry.file_name().to_string_lossy().into_owned();
            match moving.strip_suffix(MOVING).filter(|name| is_name(name)) {
                Some(name) if named.iter().any(|of| of == name) => {
                    fs::rename(entry.path(), run.join(name)).map_err(Error::writing(run))?;
                }
                Some(_) => move_all(&entry.path(), run)?,
                None => {}
            }
        }
        // The record is read again, because an undone move restores the record of the old run.
        let Ok(record) = RunManifest::read(&run.join(RECORD)) else { return Ok(None) };
        let mut named = names_in(&record);
        named.retain(|name| fs::symlink_metadata(run.join(name)).is_ok_and(|it| it.is_dir()));
        let Some(last) = named.pop() else { return Ok(None) };
        let earlier = Self { run: run.to_path_buf(), aside: run.join(last), before: named };
        match record.status {
            Status::Done => earlier.discard().map(|()| None),
            _ => Ok(Some(earlier)),
        }
    }

    /// The names of the folders in the order of the new run's record. The last folder holds the run that the new run replaces.
    pub(super) fn names(&self) -> Vec<String> {
        let last = self.aside.file_name().map(|name| name.to_string_lossy().into_owned());
        self.before.iter().cloned().chain(last).collect()
    }

    pub(super) fn photos(&self) -> usize {
        photos_in(&self.aside)
    }

    pub(super) fn path(&self) -> &Path {
        &self.aside
    }

    pub(super) fn discard(&self) -> Result<()> {
        self.names().iter().try_for_each(|name| file::remove(&self.run.join(name)))
    }

    /// Puts the replaced run back in place of a new run without photos. The record of the new run is removed first. Therefore, if this
    /// program is killed in between, the next one can complete the work.
    pub(super) fn restore(&self) -> Result<()> {
        let moving = self.moving();
        if is_there(&self.aside) {
            fs::rename(&self.aside, &moving).map_err(Error::writing(&moving))?;
        }
        file::remove(&self.run.join(RECORD))?;
        move_all(&moving, &self.run)
    }

    fn moving(&self) -> PathBuf {
        let mut name = self.aside.clone().into_os_string();
        name.push(MOVING);
        name.into()
    }
}

/// Moves all entries of the folder `from` into `to`, the record last, and removes `from`. Existing entries of the same names are replaced.
pub(super) fn move_all(from: &Path, to: &Path) -> Result<()> {
    let entries = fs::read_dir(from).map_err(Error::reading(from))?.flatten();
    let mut names: Vec<_> = entries.map(|entry| entry.file_name()).collect();
    names.sort_by_key(|name| name == RECORD);
    let is_folder = |path: &Path| fs::symlink_metadata(path).is_ok_and(|it| it.is_dir());
    for (source, place) in names.iter().map(|name| (from.join(name), to.join(name))) {
        // A renamed file replaces an existing file atomically, so only folders must be removed first.
        if is_folder(&source) || is_folder(&place) {
            file::remove(&place)?;
        }
        fs::rename(&source, &place).map_err(Error::writing(&place))?;
    }
    fs::remove_dir(from).map_err(Error::writing(from))
}

/// The names of a run's files and folders, with the record last.
fn parts(run: &Path) -> Vec<PathBuf> {
    let listed = RunManifest::read(&run.join(RECORD)).map_or(Vec::new(), |record| record.outputs);
    // A listed file inside a subfolder belongs to the model, whose folder moves as a whole.
    let is_part = |name: &String| !is_name(name) && is_file_name(name);
    let listed = listed.into_iter().filter(is_part).map(PathBuf::from);
    let fixed = [JOURNAL, model::FOLDER, REPORT, PAINT].map(PathBuf::from);
    let mut parts: BTreeSet<PathBuf> = listed.chain(fixed).collect();
    parts.remove(Path::new(RECORD));
    parts.into_iter().chain([PathBuf::from(RECORD)]).filter(|part| is_there(&run.join(part))).collect()
}

fn names_in(record: &RunManifest) -> Vec<String> {
    record.replaces.iter().filter(|name| is_name(name)).cloned().collect()
}

/// Whether a path in a record is a plain name in the run's own folder. The record may be from elsewhere and list any path.
pub(super) fn is_file_name(path: &str) -> bool {
    Path::new(path).file_name().is_some_and(|name| name == path)
}

/// Whether this is the name of a replaced run. The record may be from elsewhere and list any name.
pub(super) fn is_name(name: &str) -> bool {
    name.strip_prefix(NAME)
        .is_some_and(|number| !number.is_empty() && number.bytes().all(|byte| byte.is_ascii_digit()))
}

fn is_there(path: &Path) -> bool {
    fs::symlink_metadata(path).is_ok()
}
