//! The run that a new one replaces waits in a separate folder until the new one is whole.
//!
//! It is moved into `earlier-N.moving`. When the record of the new run names `earlier-N`, the folder gets that name. A program that is killed in between
//! leaves `earlier-N.moving`: the next run in the folder finishes the move if the record names it, and undoes it otherwise.

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

/// Runs that were moved aside, into `earlier-N` of their folder.
pub(super) struct Replaced {
    run: PathBuf,
    /// The run that the new one replaces.
    aside: PathBuf,
    /// Those that it replaced itself, if it did not become whole.
    before: Vec<String>,
}

impl Replaced {
    /// Moves the run aside: its photos, its model, its report, its record, and what the record lists.
    ///
    /// # Errors
    /// [`Error::Write`]; then everything is where it was.
    pub(super) fn move_aside(run: &Path) -> Result<Self> {
        let is_free =
            |name: &String| [name, &format!("{name}{MOVING}")].iter().all(|name| !is_there(&run.join(name)));
        // Numbers do not run out before the disk does.
        let name = (1..=u32::MAX).map(|number| format!("{NAME}{number}")).find(is_free).unwrap_or_default();
        let moving = run.join(format!("{name}{MOVING}"));
        file::make_folder(&moving)?;
        let before = names_in_record(run);
        for part in parts(run) {
            if let Err(error) = fs::rename(run.join(&part), moving.join(&part)) {
                put_back(run, &moving)?;
                return Err(Error::writing(&run.join(part))(error));
            }
        }
        Ok(Self { run: run.to_path_buf(), aside: run.join(name), before })
    }

    /// Ends the move, once the record of the new run names [`Replaced::names`].
    pub(super) fn settle(&self) -> Result<()> {
        fs::rename(self.moving(), &self.aside).map_err(Error::writing(&self.aside))
    }

    /// The runs that the record of an unfinished run names; those that a whole run replaced are deleted. A move that a killed program left is finished,
    /// or undone where no record names it.
    ///
    /// # Errors
    /// [`Error::Read`], [`Error::Write`].
    pub(super) fn recover(run: &Path) -> Result<Option<Self>> {
        let named = names_in_record(run);
        let entries = fs::read_dir(run).map_err(Error::reading(run))?.flatten();
        // A link of this name is not ours.
        for entry in entries.filter(|entry| entry.file_type().is_ok_and(|kind| kind.is_dir())) {
            let moving = entry.file_name().to_string_lossy().into_owned();
            match moving.strip_suffix(MOVING).filter(|name| is_name(name)) {
                Some(name) if named.iter().any(|of| of == name) => {
                    fs::rename(entry.path(), run.join(name)).map_err(Error::writing(run))?;
                }
                Some(_) => put_back(run, &entry.path())?,
                None => {}
            }
        }
        let record = RunManifest::read(&run.join(RECORD));
        let mut named = names_in_record(run);
        named.retain(|name| fs::symlink_metadata(run.join(name)).is_ok_and(|it| it.is_dir()));
        let Some(last) = named.pop() else { return Ok(None) };
        let earlier = Self { run: run.to_path_buf(), aside: run.join(last), before: named };
        match record {
            Ok(record) if record.status == Status::Done => earlier.discard().map(|()| None),
            _ => Ok(Some(earlier)),
        }
    }

    /// The folders, as the record of the new run names them: the last one is the run that it replaces.
    pub(super) fn names(&self) -> Vec<String> {
        let last = self.aside.file_name().map(|name| name.to_string_lossy().into_owned());
        self.before.iter().cloned().chain(last).collect()
    }

    /// Photos of the run that was moved aside.
    pub(super) fn photos(&self) -> usize {
        photos_in(&self.aside)
    }

    /// Where the run is now.
    pub(super) fn path(&self) -> &Path {
        &self.aside
    }

    /// Deletes them: the new run is whole.
    pub(super) fn discard(&self) -> Result<()> {
        self.names().iter().map(|name| self.run.join(name)).try_for_each(|aside| {
            if is_there(&aside) { fs::remove_dir_all(&aside).map_err(Error::writing(&aside)) } else { Ok(()) }
        })
    }

    /// Puts the run back in place of one that has no photos. Without the record of that one, the next program does what this one does not get to.
    pub(super) fn restore(&self) -> Result<()> {
        let (moving, record) = (self.moving(), self.run.join(RECORD));
        if is_there(&self.aside) {
            fs::rename(&self.aside, &moving).map_err(Error::writing(&moving))?;
        }
        if is_there(&record) {
            fs::remove_file(&record).map_err(Error::writing(&record))?;
        }
        put_back(&self.run, &moving)
    }

    fn moving(&self) -> PathBuf {
        let mut name = self.aside.clone().into_os_string();
        name.push(MOVING);
        name.into()
    }
}

/// Moves everything in `aside` back, in place of what there is. The record comes last.
fn put_back(run: &Path, aside: &Path) -> Result<()> {
    let mut names: Vec<_> = fs::read_dir(aside)
        .map_err(Error::reading(aside))?
        .flatten()
        .map(|entry| entry.file_name())
        .collect();
    names.sort_by_key(|name| name == RECORD);
    for name in names {
        let place = run.join(&name);
        let freed = match fs::symlink_metadata(&place) {
            Ok(there) if there.is_dir() => fs::remove_dir_all(&place),
            Ok(_) => fs::remove_file(&place),
            Err(_) => Ok(()),
        };
        freed.and_then(|()| fs::rename(aside.join(&name), &place)).map_err(Error::writing(&place))?;
    }
    fs::remove_dir(aside).map_err(Error::writing(aside))
}

/// What there is of a run in its folder, the record last.
fn parts(run: &Path) -> Vec<PathBuf> {
    let listed = RunManifest::read(&run.join(RECORD)).map_or(Vec::new(), |record| record.outputs);
    // What lies in folders is in those of the model, which goes as a whole.
    let is_part = |name: &String| !is_name(name) && is_file_name(name);
    let listed = listed.into_iter().filter(is_part).map(PathBuf::from);
    let fixed = [JOURNAL, model::FOLDER, REPORT, PAINT].map(PathBuf::from);
    let mut parts: BTreeSet<PathBuf> = listed.chain(fixed).collect();
    parts.remove(Path::new(RECORD));
    parts.into_iter().chain([PathBuf::from(RECORD)]).filter(|part| is_there(&run.join(part))).collect()
}

/// The runs aside that the record of a run that is not whole names.
fn names_in_record(run: &Path) -> Vec<String> {
    let record = RunManifest::read(&run.join(RECORD));
    record.map_or(Vec::new(), |record| record.replaces.into_iter().filter(|name| is_name(name)).collect())
}

/// Whether a record's path is a name in the run's own folder. A stranger's record may list any path.
pub(super) fn is_file_name(path: &str) -> bool {
    Path::new(path).file_name().is_some_and(|name| name == path)
}

/// Whether this is the name of a run aside. A stranger's record may name any path.
pub(super) fn is_name(name: &str) -> bool {
    name.strip_prefix(NAME)
        .is_some_and(|number| !number.is_empty() && number.bytes().all(|byte| byte.is_ascii_digit()))
}

fn is_there(path: &Path) -> bool {
    fs::symlink_metadata(path).is_ok()
}
