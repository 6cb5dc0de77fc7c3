//! Creates, resumes and opens journals. A lock admits only one writer at a time.

use std::fs::{File, TryLockError};
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use super::Identity;
use super::file::{Journal, Synced};
use super::format::{self, Damage, scan};
use crate::error::{Error, Result};
use crate::file;

const FILE: &str = "photos.journal";
const LOCK: &str = "lock";

impl Journal {
    /// Whether a folder contains a journal.
    pub fn is_in(folder: &Path) -> bool {
        !matches!(file::kind(&folder.join(FILE)), Ok(None))
    }

    /// Creates a journal in this folder. The folder is created if it does not exist.
    ///
    /// # Errors
    /// [`Error::Journal`] if the folder already has a journal, if another process writes it, or if the file cannot be written;
    /// [`Error::Write`] if the folder cannot be created.
    pub fn create(folder: &Path, identity: &Identity) -> Result<Self> {
        let (path, lock) = lock_folder(folder)?;
        if Self::is_in(folder) {
            return Err(Error::journal(path, "the journal already has photos of an earlier run")
                .help("continue that run with --resume, or name another folder"));
        }
        create_file(path, lock, identity)
    }

    /// Opens the journal in this folder for appending, or creates it if there is none. An incomplete record at its end is removed (see
    /// [`Journal::torn`]).
    ///
    /// # Errors
    /// [`Error::Journal`] if the journal has another identity (the message names the parts that differ), if both copies of its header are
    /// damaged, if another process writes it, or if it cannot be written; [`Error::Read`], [`Error::Write`].
    pub fn resume(folder: &Path, identity: &Identity) -> Result<Self> {
        let (path, lock) = lock_folder(folder)?;
        if !Self::is_in(folder) {
            return create_file(path, lock, identity);
        }
        let file = file::open_to_change(&path)?;
        let journal = open(path, file, Some(lock))?;
        let differences = journal.identity.differences(identity);
        if !differences.is_empty() {
            return Err(journal.refusal(
                format!("its photos are of another source; these parts differ: {}", differences.join(", ")),
                "use the source and the settings with which the run was started, or name another folder",
            ));
        }
        journal.truncate_torn_end()
    }

    /// Opens the journal in this folder only for reading. The file is not changed, and no lock is taken. Another process may write the
    /// journal at the same time, but records that it appends later are not seen here.
    ///
    /// # Errors
    /// [`Error::Journal`] if both copies of its header are damaged; [`Error::Read`].
    pub fn read_only(folder: &Path) -> Result<Self> {
        file::follow_no_links_below(folder);
        let path = folder.join(FILE);
        let file = file::open(&path)?;
        open(path, file, None)
    }

    fn truncate_torn_end(self) -> Result<Self> {
        if self.content.torn.is_some() {
            let truncated = self.file.set_len(self.end).and_then(|()| self.file.sync_data());
            truncated.map_err(Error::writing(&self.path))?;
        }
        Ok(self)
    }
}

/// Creates the folder if necessary and takes its lock. Returns the path of the journal file and the lock.
fn lock_folder(folder: &Path) -> Result<(PathBuf, File)> {
    file::make_folder(folder)?;
    file::follow_no_links_below(folder);
    let lock = take_lock(&folder.join(LOCK))?;
    Ok((folder.join(FILE), lock))
}

/// Creates a journal file with a header. The file gets its name only after the header is on disk.
fn create_file(path: PathBuf, lock: File, identity: &Identity) -> Result<Journal> {
    if !format::fits_header(identity) {
        return Err(Error::journal(path, "its identity is longer than 64 KiB")
            .help("store hashes instead of long values"));
    }
    let header = format::encode_header(identity);
    let write = || {
        file::atomic::write_bytes(&path, &header)?;
        let file = file::open_to_change(&path)?;
        // Two folder entries must also survive a crash: that of the file in the folder, and that of the folder in its parent.
        let folder = path.parent().unwrap_or(Path::new("."));
        let parent = folder.parent().filter(|parent| !parent.as_os_str().is_empty());
        let sync = |folder: &Path| File::open(folder).and_then(|folder| folder.sync_all());
        sync(folder).and_then(|()| parent.map_or(Ok(()), sync)).map_err(Error::writing(&path))?;
        Ok(file)
    };
    let file = write().map_err(|source: Error| {
        Error::journal(&path, format!("the journal cannot be created: {source}"))
            .help("free disk space, or name a folder that can be written")
    })?;
    open(path, file, Some(lock))
}

/// Opens a journal file, and reads its header and all heads. If this process has the lock, it repairs a damaged header.
fn open(path: PathBuf, mut file: File, lock: Option<File>) -> Result<Journal> {
    let length = file.metadata().map_err(Error::reading(&path))?.len();
    let mut start = Vec::new();
    let read = (&file).take(format::MAX_HEADER_BYTES as u64).read_to_end(&mut start);
    read.map_err(Error::reading(&path))?;
    let refusal = |fault: String, help: &str| Error::journal(&path, fault).help(help);
    let (identity, records_at, whole) = match format::read_header(&start) {
        format::Header::Known { identity, records_at, whole } => (identity, records_at, whole),
        format::Header::Later(version) => {
            let fault = format!("its format is {version}, which this version does not support");
            return Err(refusal(fault, "open it with a later version of krylux"));
        }
        format::Header::Unknown => {
            return Err(refusal(
                "both copies of its header are damaged, or it is not a journal".into(),
                "name another folder, or restore the file from a backup",
            ));
        }
    };
    if !whole && lock.is_some() {
        let repair = file
            .seek(SeekFrom::Start(0))
            .and_then(|_| file.write_all(&format::encode_header(&identity)))
            .and_then(|()| file.sync_data());
        repair.map_err(Error::writing(&path))?;
    }
    let length = length.max(records_at);
    let identity_hash = identity.hash();
    let mut content = scan(&file, &identity_hash, records_at, length).map_err(Error::reading(&path))?;
    if !whole {
        let record = "one copy of the header".into();
        let fault = "it does not match its checksum; the other copy is undamaged";
        content.damages.insert(0, Damage { offset: 0, bytes: records_at, record, fault, entry: None });
    }
    let index = content.entries.iter().enumerate().map(|(index, entry)| (entry.key, index)).collect();
    let end = content.torn.as_ref().map_or(length, |torn| torn.offset);
    let synced = Synced::now(content.entries.len());
    let (broken, appended) = (false, Instant::now());
    Ok(Journal { path, file, lock, identity, identity_hash, content, index, end, broken, synced, appended })
}

/// Takes the journal's lock. However this process ends, the system then closes the file and releases the lock.
fn take_lock(path: &Path) -> Result<File> {
    let unusable = |source: std::io::Error| {
        Error::journal(path, format!("a journal cannot be written here: {source}"))
            .help("name a folder that can be written, on a file system with locks")
    };
    let mut file = file::open_or_make(path).map_err(unusable)?;
    match lock_with_retries(&file) {
        Ok(()) => {}
        Err(TryLockError::WouldBlock) => {
            let mut holder = String::new();
            // An error is ignored, because only the message needs the process id.
            let _ = file.read_to_string(&mut holder);
            let holder = holder.trim();
            let who = if holder.is_empty() { "another process".into() } else { format!("process {holder}") };
            return Err(Error::journal(path, format!("the journal is being written by {who}"))
                .help("wait until that run has ended, or name another folder"));
        }
        Err(TryLockError::Error(source)) => return Err(unusable(source)),
    }
    // An error is ignored, because only messages need the process id. If the disk is full, writing the journal reports it.
    let _ = file.set_len(0).and_then(|()| writeln!(file, "{}", std::process::id()));
    Ok(file)
}

/// Tries for half a second to take the lock. A lock may outlive its holder for a moment: until the system has cleaned up a killed process,
/// or until a forked child process has started its own program.
fn lock_with_retries(file: &File) -> std::result::Result<(), TryLockError> {
    for _ in 0..50 {
        match file.try_lock() {
            Err(TryLockError::WouldBlock) => std::thread::sleep(Duration::from_millis(10)),
            taken_or_broken => return taken_or_broken,
        }
    }
    file.try_lock()
}
