//! The runs below a folder: their size on disk, and which of their photos can be computed again.

use std::path::{Path, PathBuf};

use super::folder::lock;
use super::layout::{RECORD, journal_folder};
use super::notes::{self, Kind, SourceNote};
use crate::error::{Error, Result};
use crate::io::manifest::Status;
use crate::journal::Journal;
use crate::measure::RunManifest;
use crate::scene::{self, LoadOptions};

/// The depth to which folders are searched. Links are not followed.
const DEPTH: usize = 8;

/// A run on the disk.
#[derive(Clone, Debug)]
pub struct KeptRun {
    /// Its folder.
    pub path: PathBuf,
    /// How it ended.
    pub status: Status,
    /// The bytes of all of its files.
    pub bytes: u64,
    /// The bytes of its journal, which holds its photos.
    pub journal_bytes: u64,
    /// Whether its photos can be computed again.
    pub photos: KeptPhotos,
}

/// Whether the photos of a run can be computed again.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum KeptPhotos {
    /// The run has no photos.
    Absent,
    /// The scene still exists unchanged, so tracing it reproduces the photos.
    Recomputable,
    /// The photos cannot be reproduced, for this reason.
    Unique(&'static str),
}

impl KeptRun {
    /// The runs in a folder and in its subfolders, ordered by path. Unreadable folders are left out.
    ///
    /// # Errors
    /// [`Error::Read`] if `folder` itself cannot be read.
    pub fn below(folder: &Path) -> Result<Vec<Self>> {
        std::fs::read_dir(folder).map_err(Error::reading(folder))?;
        let mut found = Vec::new();
        search(folder, DEPTH, &mut found);
        found.sort_by(|a, b| a.path.cmp(&b.path));
        Ok(found)
    }

    fn at(path: &Path) -> Option<Self> {
        let record = RunManifest::read(&path.join(RECORD)).ok()?;
        let journal = journal_folder(path);
        let (bytes, journal_bytes) = (size(path), if journal.is_symlink() { 0 } else { size(&journal) });
        let photos = worth(path, &record);
        Some(Self { path: path.to_path_buf(), status: record.status, bytes, journal_bytes, photos })
    }

    /// Deletes the journal of a run if its photos can be computed again. Returns the number of bytes freed. All other files stay.
    ///
    /// # Errors
    /// [`Error::Option`] if the photos cannot be computed again or a run is in progress in the folder; [`Error::Write`].
    pub fn delete_photos(&self) -> Result<u64> {
        let _lock = lock(&self.path)?;
        // The status is read again, because the run or its scene may have changed since the search.
        if Self::at(&self.path).is_none_or(|now| now.photos != KeptPhotos::Recomputable) {
            let fault = format!("the photos in {} cannot be computed again", self.path.display());
            let help = "delete the folder yourself if you do not need them";
            return Err(Error::option("FOLDER", fault).help(help));
        }
        let journal = journal_folder(&self.path);
        std::fs::remove_dir_all(&journal).map_err(Error::writing(&journal))?;
        Ok(self.journal_bytes)
    }
}

fn search(folder: &Path, depth: usize, found: &mut Vec<KeptRun>) {
    if let Some(run) = KeptRun::at(folder) {
        found.push(run);
    }
    let Ok(entries) = std::fs::read_dir(folder) else { return };
    let folders = entries.flatten().filter(|entry| entry.file_type().is_ok_and(|kind| kind.is_dir()));
    for entry in folders {
        if depth > 0 {
            search(&entry.path(), depth - 1, found);
        }
    }
}

fn size(folder: &Path) -> u64 {
    let Ok(entries) = std::fs::read_dir(folder) else { return 0 };
    let sizes = entries.flatten().map(|entry| match entry.file_type() {
        Ok(kind) if kind.is_dir() => size(&entry.path()),
        Ok(kind) if kind.is_file() => entry.metadata().map_or(0, |of| of.len()),
        _ => 0,
    });
    sizes.sum()
}

fn worth(run: &Path, record: &RunManifest) -> KeptPhotos {
    let folder = journal_folder(run);
    if !Journal::is_in(&folder) {
        return KeptPhotos::Absent;
    }
    let note = Journal::read_only(&folder).and_then(|mut journal| journal.read_note(notes::SOURCE));
    let note = note.ok().flatten().and_then(|note| serde_json::from_slice::<SourceNote>(&note).ok());
    let Some(note) = note else { return KeptPhotos::Unique("its journal cannot be read") };
    if note.kind == Kind::Rig {
        return KeptPhotos::Unique("they are of a rig");
    }
    if record.status != Status::Done {
        return KeptPhotos::Unique("it has not ended, and --resume needs them");
    }
    let options = LoadOptions { auto_camera: true, ..LoadOptions::default() };
    match scene::load_with(&note.path, &options) {
        Err(_) => KeptPhotos::Unique("its scene is not where it was"),
        Ok(scene) if blake3::Hash::from_bytes(scene.hash).to_string() != note.hash => {
            KeptPhotos::Unique("its scene has changed")
        }
        Ok(_) => KeptPhotos::Recomputable,
    }
}
