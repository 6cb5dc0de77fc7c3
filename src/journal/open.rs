//! Creating a journal, going on with one, and looking into one.

use std::collections::HashMap;
use std::fs::{self, File, OpenOptions};
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use super::file::{Journal, Settled};
use super::scan::{Damage, scan};
use super::{Identity, header, lock};
use crate::error::{Error, Result};

/// The file of records in a journal's folder.
const FILE: &str = "photos.journal";
const LOCK: &str = "lock";

impl Journal {
    /// Whether a folder holds a journal.
    pub fn is_in(folder: &Path) -> bool {
        folder.join(FILE).exists()
    }

    /// A new journal in this folder, which is made if need be.
    ///
    /// # Errors
    /// [`Error::Journal`] when there is one already, when another process writes it, or when the file cannot be written; [`Error::Write`]
    /// naming the folder.
    pub fn create(folder: &Path, identity: &Identity) -> Result<Self> {
        let (path, lock) = claim(folder)?;
        if path.exists() {
            return Err(Error::Journal {
                path,
                fault: "there are photos of an earlier run already".into(),
                help: "go on with it by --resume, or name another folder".into(),
            });
        }
        begin(path, lock, identity)
    }

    /// Goes on with the journal in this folder; a new one if there is none. A torn end is cut off, see [`Journal::torn`].
    ///
    /// # Errors
    /// [`Error::Journal`] when its identity is another (the parts that differ are named), when its header is damaged beyond repair, when
    /// another process writes it, or when it cannot be written; [`Error::Read`], [`Error::Write`].
    pub fn resume(folder: &Path, identity: &Identity) -> Result<Self> {
        let (path, lock) = claim(folder)?;
        if !path.exists() {
            return begin(path, lock, identity);
        }
        let file = OpenOptions::new().read(true).write(true).open(&path).map_err(Error::writing(&path))?;
        let journal = open(path, file, Some(lock))?;
        let differences = journal.identity.differences(identity);
        if !differences.is_empty() {
            return Err(journal.refusal(
                format!("its photos are of another source; what differs: {}", differences.join(", ")),
                "go on with what it was begun with, or name another folder for another run",
            ));
        }
        journal.cut()
    }

    /// Opens the journal in this folder to read only. Nothing is changed, and no lock is taken: it may be written meanwhile, and what
    /// comes in later is not seen.
    ///
    /// # Errors
    /// [`Error::Journal`] when its header is damaged beyond repair; [`Error::Read`].
    pub fn read_only(folder: &Path) -> Result<Self> {
        let path = folder.join(FILE);
        let file = File::open(&path).map_err(Error::reading(&path))?;
        open(path, file, None)
    }

    /// Throws away the journal in this folder, and says how many photos that were: none where there is no journal, or none that
    /// can be read.
    ///
    /// # Errors
    /// [`Error::Journal`] when another process writes it; [`Error::Write`].
    pub fn discard(folder: &Path) -> Result<usize> {
        if !Self::is_in(folder) {
            return Ok(0);
        }
        let (path, _lock) = claim(folder)?;
        let photos = Self::read_only(folder).map_or(0, |journal| journal.photos());
        fs::remove_file(&path).map_err(Error::writing(&path))?;
        Ok(photos)
    }

    /// Cuts off the torn end.
    fn cut(self) -> Result<Self> {
        if self.torn.is_some() {
            let cut = self.file.set_len(self.end).and_then(|()| self.file.sync_data());
            cut.map_err(Error::writing(&self.path))?;
        }
        Ok(self)
    }
}

fn claim(folder: &Path) -> Result<(PathBuf, File)> {
    fs::create_dir_all(folder).map_err(Error::writing(folder))?;
    let lock = lock::take(&folder.join(LOCK))?;
    Ok((folder.join(FILE), lock))
}

/// Writes a header, whole or not at all.
fn begin(path: PathBuf, lock: File, identity: &Identity) -> Result<Journal> {
    if !header::fits(identity) {
        return Err(Error::Journal {
            path,
            fault: "its identity is longer than 64 KiB".into(),
            help: "give hashes of long parts".into(),
        });
    }
    let header = header::encode(identity);
    let temporary = path.with_extension("new");
    let create = || {
        // Whoever holds the lock may remove what an earlier process left.
        let mut file =
            OpenOptions::new().read(true).write(true).create(true).truncate(true).open(&temporary)?;
        file.write_all(&header)?;
        file.sync_all()?;
        fs::rename(&temporary, &path)?;
        // The folder's entry for the file, and its parent's for the folder, must outlive a crash too.
        let folder = path.parent().unwrap_or(Path::new("."));
        File::open(folder)?.sync_all()?;
        if let Some(parent) = folder.parent().filter(|parent| !parent.as_os_str().is_empty()) {
            File::open(parent)?.sync_all()?;
        }
        Ok(file)
    };
    let file = create().map_err(|source: std::io::Error| Error::Journal {
        path: path.clone(),
        fault: format!("cannot be made: {source}"),
        help: "make room, or name a folder that can be written".into(),
    })?;
    Ok(Journal {
        end: header.len() as u64,
        path,
        file,
        lock: Some(lock),
        seal: identity.seal(),
        identity: identity.clone(),
        entries: Vec::new(),
        index: HashMap::new(),
        damages: Vec::new(),
        torn: None,
        stuck: false,
        settled: Settled::now(0),
    })
}

fn open(path: PathBuf, mut file: File, lock: Option<File>) -> Result<Journal> {
    let length = file.metadata().map_err(Error::reading(&path))?.len();
    let mut start = Vec::new();
    let read = (&file).take(header::ENOUGH as u64).read_to_end(&mut start);
    read.map_err(Error::reading(&path))?;
    let refusal = |fault: String, help: &str| Error::Journal { path: path.clone(), fault, help: help.into() };
    let (identity, records_at, whole) = match header::read(&start) {
        header::Read::Known { identity, records_at, whole } => (identity, records_at, whole),
        header::Read::Later(version) => {
            let fault = format!("it is written in format {version}, which this version does not know");
            return Err(refusal(fault, "open it with a later version of krylux"));
        }
        header::Read::Unknown => {
            return Err(refusal(
                "its header is damaged in both copies, or it is no journal".into(),
                "name another folder, or restore the file from a backup",
            ));
        }
    };
    if !whole && lock.is_some() {
        let repair = file
            .seek(SeekFrom::Start(0))
            .and_then(|_| file.write_all(&header::encode(&identity)))
            .and_then(|()| file.sync_data());
        repair.map_err(Error::writing(&path))?;
    }
    let length = length.max(records_at);
    let seal = identity.seal();
    let mut found = scan(&file, &seal, records_at, length).map_err(Error::reading(&path))?;
    if !whole {
        let record = "one copy of the header".into();
        let fault = "it is not what its checksum says; the other copy is whole";
        found.damages.insert(0, Damage { offset: 0, bytes: records_at, record, fault, entry: None });
    }
    let index = found.entries.iter().enumerate().map(|(index, entry)| (entry.key, index)).collect();
    let end = found.torn.as_ref().map_or(length, |torn| torn.offset);
    let settled = Settled::now(found.entries.len());
    Ok(Journal {
        path,
        file,
        lock,
        identity,
        seal,
        entries: found.entries,
        index,
        damages: found.damages,
        torn: found.torn,
        end,
        stuck: false,
        settled,
    })
}
