//! An open journal. Records are read from it, and new records are appended to it.

use std::collections::HashMap;
use std::fs::File;
use std::io::{self, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use super::format::{Damage, Entry, Kind, MAX_METADATA_BYTES, Scan, Torn, encode, read_at, record_name};
use super::{Identity, Key, checksum};
use crate::error::{Error, Result};

/// The minimum time between the end of a sync and the next one that [`Journal::append_buffered`] begins.
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
    /// When the last record was appended by [`Journal::append_buffered`].
    pub(super) appended: Instant,
}

/// The records that are known to be on disk. Later records may only be in the operating system's buffers.
#[derive(Debug)]
pub(super) struct Synced {
    entries: usize,
    /// When the sync ended.
    at: Instant,
    running: Option<Syncing>,
}

/// A sync by another thread.
#[derive(Debug)]
struct Syncing {
    /// The number of records when it began.
    entries: usize,
    outcome: JoinHandle<(io::Result<()>, Instant)>,
}

impl Synced {
    pub(super) fn now(entries: usize) -> Self {
        Self { entries, at: Instant::now(), running: None }
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
        if checksum(&payload) == entry.checksum {
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
        let key = Self::pattern_key(payload);
        self.keep_pattern(key, payload).map(|()| key)
    }

    pub(crate) fn pattern_key(payload: &[u8]) -> Key {
        Key::of(&[b"pattern", payload])
    }

    /// Works like [`Journal::pattern`], for a known [`Journal::pattern_key`].
    pub(crate) fn keep_pattern(&mut self, key: Key, payload: &[u8]) -> Result<()> {
        if self.holds(key) { Ok(()) } else { self.write(Kind::Pattern, key, b"", payload) }
    }

    /// Appends a record. It returns when this record and all earlier ones are on disk.
    ///
    /// # Errors
    /// [`Error::Journal`], which names the file, if it cannot be written, if it is open only for reading, or if it already has a record
    /// with this key. No earlier record is lost: a partly written record is removed.
    pub fn append(&mut self, kind: Kind, key: Key, metadata: &[u8], payload: &[u8]) -> Result<()> {
        self.write_unless_held(kind, key, metadata, payload)?;
        self.flush()
    }

    /// Appends a record that could be computed again. The call returns when the operating system has the record, so the record survives if
    /// this process ends in any way. Syncing each record would take longer than a product with the matrix. An append therefore syncs only
    /// if the last sync ended at least a quarter of a second ago, and another thread syncs if the last record is not as old. A system crash
    /// can lose the records since the last sync. The journal also syncs when it is closed.
    ///
    /// # Errors
    /// The errors of [`Journal::append`]. If a sync fails, all records since the last successful sync are removed. If another thread has
    /// synced, a later append or [`Journal::flush`] fails.
    pub fn append_buffered(&mut self, kind: Kind, key: Key, metadata: &[u8], payload: &[u8]) -> Result<()> {
        self.write_unless_held(kind, key, metadata, payload)?;
        let pause = std::mem::replace(&mut self.appended, Instant::now()).elapsed();
        if pause >= SYNC_INTERVAL {
            // A slow product is not slowed down by a sync.
            return self.flush();
        }
        if self.synced.running.as_ref().is_some_and(|running| running.outcome.is_finished()) {
            self.end_sync()?;
        }
        let is_due = self.synced.running.is_none() && self.synced.at.elapsed() >= SYNC_INTERVAL;
        if is_due { self.begin_sync() } else { Ok(()) }
    }

    /// Returns when all records are on disk. Fails as [`Journal::append`].
    pub fn flush(&mut self) -> Result<()> {
        self.end_sync()?;
        if self.synced.entries < self.content.entries.len() { self.sync() } else { Ok(()) }
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
        let outcome = self.file.sync_data();
        self.synced_to(self.content.entries.len(), (outcome, Instant::now()))
    }

    /// Begins a sync by another thread. If there can be no other thread, this one syncs.
    fn begin_sync(&mut self) -> Result<()> {
        let entries = self.content.entries.len();
        let thread = self.file.try_clone().and_then(|file| {
            std::thread::Builder::new()
                .name("journal".into())
                .spawn(move || (file.sync_data(), Instant::now()))
        });
        match thread {
            Ok(outcome) => {
                self.synced.running = Some(Syncing { entries, outcome });
                Ok(())
            }
            Err(_) => self.sync(),
        }
    }

    /// Waits for the sync that is running.
    fn end_sync(&mut self) -> Result<()> {
        let Some(Syncing { entries, outcome }) = self.synced.running.take() else { return Ok(()) };
        let early = || (Err(io::Error::other("the thread that syncs ended early")), Instant::now());
        self.synced_to(entries, outcome.join().unwrap_or_else(|_| early()))
    }

    /// Records the outcome of a sync of the first `entries` records.
    fn synced_to(&mut self, entries: usize, (outcome, at): (io::Result<()>, Instant)) -> Result<()> {
        let Err(source) = outcome else {
            self.synced = Synced { entries, at, running: None };
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
        // There is no caller to report an error to. A record that did not reach the disk fails its checksum later, and its photo is taken
        // again.
        let _ = self.flush();
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
        // A time in the future counts as recent, even on a slow machine.
        let recent = || Instant::now() + 100 * SYNC_INTERVAL;
        let long_ago = || Instant::now().checked_sub(SYNC_INTERVAL).expect("the machine has run for longer");
        (journal.synced.at, journal.appended) = (recent(), recent());
        append(&mut journal, b"second").expect("nothing is synced");
        (journal.synced.at, journal.appended) = (long_ago(), recent());
        append(&mut journal, b"third").expect("another thread syncs");
        wait(&journal);
        journal.appended = recent();
        append(&mut journal, b"fourth").expect_err("the sync has failed");
        assert_eq!(journal.photos(), 1, "all records since the last sync may be lost");
        append(&mut journal, b"fifth").expect_err("nothing is written any more");

        let folder = tempfile::tempdir().expect("a temporary folder");
        let mut journal = unsyncable(folder.path());
        journal.appended = long_ago();
        append(&mut journal, b"slow").expect_err("the record of a slow product is synced at once");

        let folder = tempfile::tempdir().expect("a temporary folder");
        let mut journal = unsyncable(folder.path());
        (journal.synced.at, journal.appended) = (long_ago(), recent());
        append(&mut journal, b"last").expect("another thread syncs");
        journal.flush().expect_err("the sync has failed, though nothing is appended any more");
    }

    /// Waits until the sync by another thread has ended.
    fn wait(journal: &Journal) {
        while journal.synced.running.as_ref().is_some_and(|running| !running.outcome.is_finished()) {
            std::thread::yield_now();
        }
    }

    #[test]
    fn records_are_synced_by_another_thread_and_survive() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let mut journal =
            Journal::create(folder.path(), &Identity::new()).expect("the folder can be written");
        let payload = vec![7; 2 * super::super::PARALLEL + 1];
        let long_ago = Instant::now().checked_sub(SYNC_INTERVAL).expect("the machine has run for longer");
        for record in 0..20_u8 {
            wait(&journal);
            (journal.synced.at, journal.appended) = (long_ago, Instant::now() + 100 * SYNC_INTERVAL);
            let key = journal.key(&[&[record]]);
            journal.append_buffered(Kind::Photo, key, b"", &payload).expect("a disk can be synced");
            assert_eq!(journal.synced.entries, usize::from(record), "all records that a sync has reached");
            assert!(record > 0 || journal.synced.running.is_some(), "the first append begins a sync");
            if journal.synced.running.is_none() {
                journal.begin_sync().expect("there can be another thread");
            }
        }
        journal.flush().expect("a disk can be synced");
        assert_eq!(journal.synced.entries, 20);
        drop(journal);
        let mut journal = Journal::read_only(folder.path()).expect("the journal is there");
        let key = journal.key(&[&[19]]);
        assert_eq!(journal.get(key).expect("readable").map(|stored| stored.payload), Some(payload.clone()));
        let one_thread = *blake3::hash(&payload).as_bytes();
        assert_eq!(checksum(&payload), one_thread, "any number of threads gives the same hash");
    }
}
