//! An open journal. Records are read from it, and new records are appended to it.

use std::collections::HashMap;
use std::fs::File;
use std::io::{self, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use super::format::{Damage, Entry, Kind, MAX_METADATA_BYTES, Scan, Torn, encode, read_at, record_name};
use super::{Identity, Key};
use crate::error::{Error, Result};

/// The minimum time between two syncs by [`Journal::append_buffered`].
const SYNC_INTERVAL: Duration = Duration::from_millis(250);

/// A journal that is open for reading. It is also open for appending, unless [`Journal::read_only`] opened it.
#[derive(Debug)]
pub struct Journal {
    pub(super) path: PathBuf,
    pub(super) file: File,
    pub(super) lock: Option<File>,
    pub(super) identity: Identity,
    pub(super) identity_hash: [u8; 32],
    /// The records of the file, and the damaged parts.
    pub(super) content: Scan,
    pub(super) index: HashMap<Key, usize>,
    /// The offset of the next record.
    pub(super) end: u64,
    /// Whether an error left the end of the file in an unknown state. If so, nothing is written any more.
    pub(super) broken: bool,
    pub(super) synced: Synced,
}

/// The records that are known to be on disk. Later records may only be in the operating system's buffers.
#[derive(Debug)]
pub(super) struct Synced {
    entries: usize,
    at: Instant,
}

impl Synced {
    pub(super) fn now(entries: usize) -> Self {
        Self { entries, at: Instant::now() }
    }
}

/// The content of a record.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Stored {
    /// The metadata that the writer gave.
    pub metadata: Vec<u8>,
    /// The photo, pattern or note.
    pub payload: Vec<u8>,
}

impl Journal {
    /// The path of the journal file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The identity of the source of the photos.
    pub fn identity(&self) -> &Identity {
        &self.identity
    }

    /// The key of a photo that depends on these parts and on the identity of the journal.
    pub fn key(&self, parts: &[&[u8]]) -> Key {
        let mut all: Vec<&[u8]> = vec![&self.identity_hash];
        all.extend(parts);
        Key::of(&all)
    }

    /// All records with a valid head, in the order in which they were written. A record with a damaged payload is included, and
    /// [`Journal::holds`] is false for it.
    pub fn entries(&self) -> &[Entry] {
        &self.content.entries
    }

    /// The number of photos.
    pub fn photos(&self) -> usize {
        self.index.values().filter(|&&index| self.content.entries[index].kind == Kind::Photo).count()
    }

    /// Whether the journal has a record with this key that is not known to be damaged.
    pub fn holds(&self, key: Key) -> bool {
        self.index.contains_key(&key)
    }

    /// The damage found so far. Opening a journal finds damaged heads, and reading a record finds a damaged payload.
    pub fn damages(&self) -> &[Damage] {
        &self.content.damages
    }

    /// The incomplete record at the end of the file, if there was one when the journal was opened. It was removed; if the journal is open
    /// only for reading, it was ignored.
    pub fn torn(&self) -> Option<&Torn> {
        self.content.torn.as_ref()
    }

    /// Whether the journal is open for appending.
    pub fn is_writable(&self) -> bool {
        self.lock.is_some()
    }

    /// Reads the record with this key. Returns `None` if it does not exist or is damaged. Damage is added to [`Journal::damages`]. If the
    /// file cannot be read at all, the call fails with [`Error::Read`].
    pub fn get(&mut self, key: Key) -> Result<Option<Stored>> {
        let Some(&index) = self.index.get(&key) else { return Ok(None) };
        let entry = &self.content.entries[index];
        let length = usize::try_from(entry.length).map_err(|_| {
            Error::journal(
                &self.path,
                format!("a record of {} bytes does not fit into the address space", entry.length),
            )
            .help("open it on a 64-bit machine")
        })?;
        let mut payload = vec![0; length];
        read_at(&self.file, entry.payload_at(), &mut payload).map_err(Error::reading(&self.path))?;
        if *blake3::hash(&payload).as_bytes() == entry.checksum {
            return Ok(Some(Stored { metadata: entry.metadata.clone(), payload }));
        }
        let entry = entry.clone();
        self.content.damages.push(Damage {
            offset: entry.offset,
            bytes: entry.end() - entry.offset,
            record: record_name(&self.content.entries[..index], entry.kind),
            fault: "its content does not match its checksum",
            entry: Some(entry),
        });
        self.index.remove(&key);
        Ok(None)
    }

    /// Reads and checks every payload. Afterwards [`Journal::damages`] is complete.
    pub fn verify(&mut self) -> Result<()> {
        let keys: Vec<Key> = self.index.keys().copied().collect();
        for key in keys {
            self.get(key)?;
        }
        self.content.damages.sort_by_key(|damage| damage.offset);
        Ok(())
    }

    /// Stores a pattern, unless the journal has it already, and returns its key. Appending the next photo also syncs the pattern to disk.
    pub fn pattern(&mut self, payload: &[u8]) -> Result<Key> {
        let key = Key::of(&[b"pattern", payload]);
        if !self.holds(key) {
            self.write(Kind::Pattern, key, b"", payload)?;
        }
        Ok(key)
    }

    /// Appends a record. It returns when this record and all earlier ones are on disk.
    ///
    /// # Errors
    /// [`Error::Journal`], which names the file, if it cannot be written, if it is open only for reading, or if it already has a record
    /// with this key. No earlier record is lost: a partly written record is removed.
    pub fn append(&mut self, kind: Kind, key: Key, metadata: &[u8], payload: &[u8]) -> Result<()> {
        self.write_unless_held(kind, key, metadata, payload)?;
        self.sync()
    }

    /// Appends a record that could be computed again. The call returns when the operating system has the record, so the record survives if
    /// this process ends in any way. A system crash can lose the record until the next sync. The journal syncs when it is closed. It also
    /// syncs on an append if the last sync was at least a quarter of a second ago. Syncing each record would take longer than a product
    /// with the matrix.
    ///
    /// # Errors
    /// The errors of [`Journal::append`]. If a sync fails, all records since the last successful sync are removed.
    pub fn append_buffered(&mut self, kind: Kind, key: Key, metadata: &[u8], payload: &[u8]) -> Result<()> {
        self.write_unless_held(kind, key, metadata, payload)?;
        if self.synced.at.elapsed() < SYNC_INTERVAL { Ok(()) } else { self.sync() }
    }

    fn write_unless_held(&mut self, kind: Kind, key: Key, metadata: &[u8], payload: &[u8]) -> Result<()> {
        if self.holds(key) {
            return Err(self.refusal(
                format!("the journal already has a {} with this key", kind.name()),
                "this is a fault of the program: please report it",
            ));
        }
        self.write(kind, key, metadata, payload)
    }

    fn sync(&mut self) -> Result<()> {
        // `sync_data` also writes the length of the file. It may omit the times of the file, which are not needed.
        let Err(source) = self.file.sync_data() else {
            self.synced = Synced::now(self.content.entries.len());
            return Ok(());
        };
        // It is unknown which records since the last sync are on disk. All of them are removed, and this process writes no more.
        self.broken = true;
        for entry in self.content.entries.split_off(self.synced.entries).iter().rev() {
            self.index.remove(&entry.key);
            self.end = entry.offset;
        }
        let _ = self.file.set_len(self.end);
        Err(self.unwritable(&source))
    }

    /// Appends a note with this name. An existing note with this name is not changed.
    pub fn note(&mut self, name: &str, payload: &[u8]) -> Result<()> {
        let key = self.note_key(name);
        // Reading the note reveals whether it is damaged.
        if self.get(key)?.is_some() { Ok(()) } else { self.append(Kind::Note, key, name.as_bytes(), payload) }
    }

    /// Reads the note with this name.
    pub fn read_note(&mut self, name: &str) -> Result<Option<Vec<u8>>> {
        let key = self.note_key(name);
        Ok(self.get(key)?.map(|stored| stored.payload))
    }

    fn note_key(&self, name: &str) -> Key {
        self.key(&[b"note", name.as_bytes()])
    }

    fn write(&mut self, kind: Kind, key: Key, metadata: &[u8], payload: &[u8]) -> Result<()> {
        if !self.is_writable() {
            return Err(self.refusal(
                "the journal is open for reading only, but a record is to be written".into(),
                "continue the run with --resume, or start another run with the rig attached",
            ));
        }
        if self.broken {
            return Err(self.unwritable(&io::Error::other("an earlier record was written only in part")));
        }
        if metadata.len() > MAX_METADATA_BYTES as usize {
            return Err(self.refusal(
                format!("{} bytes of metadata exceed the limit of {MAX_METADATA_BYTES}", metadata.len()),
                "this is a fault of the program: please report it",
            ));
        }
        let (head, entry) = encode(&self.identity_hash, kind, key, metadata, payload, self.end);
        let written = (&self.file)
            .seek(SeekFrom::Start(self.end))
            .and_then(|_| (&self.file).write_all(&head))
            .and_then(|()| (&self.file).write_all(payload));
        if let Err(source) = written {
            // The incomplete record is removed. If this fails, the next opening of the journal removes it.
            self.broken = self.file.set_len(self.end).is_err();
            return Err(self.unwritable(&source));
        }
        self.end = entry.end();
        self.index.insert(key, self.content.entries.len());
        self.content.entries.push(entry);
        Ok(())
    }

    pub(super) fn refusal(&self, fault: String, help: &str) -> Error {
        Error::journal(&self.path, fault).help(help)
    }

    fn unwritable(&self, source: &io::Error) -> Error {
        let stored = self.photos();
        self.refusal(
            format!("cannot write: {source}; all {stored} photos so far are safe"),
            "free disk space (or repair the cause), and run the same command with --resume",
        )
    }
}

impl Drop for Journal {
    fn drop(&mut self) {
        if self.synced.entries < self.content.entries.len() {
            // There is no caller to report an error to. A record that did not reach the disk fails its checksum later, and its photo is
            // taken again.
            let _ = self.sync();
        }
    }
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    /// A journal of one photo whose file is now `/dev/null`, which accepts every byte and cannot be synced.
    fn unsyncable(folder: &Path) -> Journal {
        let mut journal = Journal::create(folder, &Identity::new()).expect("the folder can be written");
        let first = journal.key(&[b"first"]);
        journal.append(Kind::Photo, first, b"", b"1").expect("a disk can be synced");
        journal.file =
            File::options().read(true).write(true).open("/dev/null").expect("it is there, and writable");
        journal
    }

    #[test]
    fn an_append_does_not_return_before_its_record_is_synced() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let mut journal = unsyncable(folder.path());
        let second = journal.key(&[b"second"]);
        let why = journal.append(Kind::Photo, second, b"", b"2").expect_err("the sync fails").to_string();
        assert!(why.contains("cannot write") && why.contains("all 1 photos so far are safe"), "{why}");
        assert!(!journal.holds(second) && journal.photos() == 1, "what is not on disk is no record");
    }

    #[test]
    fn a_buffered_append_syncs_when_the_last_sync_is_long_ago_and_not_before() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let mut journal = unsyncable(folder.path());
        let append = |journal: &mut Journal, name: &[u8]| {
            let key = journal.key(&[name]);
            journal.append_buffered(Kind::Photo, key, b"", b"2")
        };
        // A sync time in the future counts as recent, even on a slow machine.
        journal.synced.at = Instant::now() + 100 * SYNC_INTERVAL;
        append(&mut journal, b"second").expect("nothing is synced");
        journal.synced.at =
            Instant::now().checked_sub(SYNC_INTERVAL).expect("the machine has run for longer");
        append(&mut journal, b"third").expect_err("the sync fails");
        assert_eq!(journal.photos(), 1, "both records since the last sync may be lost");
    }
}
