//! An open journal: what is in it, and how more comes in.

use std::collections::HashMap;
use std::fs::File;
use std::io::{self, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use super::record::{Entry, Kind, LONGEST_METADATA, encode};
use super::scan::{Damage, Torn, name, read_at};
use super::{Identity, Key};
use crate::error::{Error, Result};

/// How long a record of what can be computed again waits at most for its way to the disk, as long as more come.
const SOON: Duration = Duration::from_millis(250);

/// A journal, open to read and, unless it is [`Journal::read_only`], to append.
#[derive(Debug)]
pub struct Journal {
    pub(super) path: PathBuf,
    pub(super) file: File,
    /// Held as long as the journal is open to append.
    pub(super) lock: Option<File>,
    pub(super) identity: Identity,
    pub(super) seal: [u8; 32],
    pub(super) entries: Vec<Entry>,
    pub(super) index: HashMap<Key, usize>,
    pub(super) damages: Vec<Damage>,
    pub(super) torn: Option<Torn>,
    /// Where the next record begins.
    pub(super) end: u64,
    /// Bytes that could not be written could not be taken back either.
    pub(super) stuck: bool,
    pub(super) settled: Settled,
}

/// What is on disk for certain, not only with the system.
#[derive(Debug)]
pub(super) struct Settled {
    /// The first so many entries.
    entries: usize,
    at: Instant,
}

impl Settled {
    /// So many entries, now.
    pub(super) fn now(entries: usize) -> Self {
        Self { entries, at: Instant::now() }
    }
}

/// What a record holds.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Stored {
    /// What its writer noted.
    pub metadata: Vec<u8>,
    /// The photo, pattern or note itself.
    pub payload: Vec<u8>,
}

impl Journal {
    /// The file that holds the records.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// What all photos depend on.
    pub fn identity(&self) -> &Identity {
        &self.identity
    }

    /// The key of a photo that is determined by these parts, on this identity.
    pub fn key(&self, parts: &[&[u8]]) -> Key {
        let mut all: Vec<&[u8]> = vec![&self.seal];
        all.extend(parts);
        Key::of(&all)
    }

    /// All records with a whole head, in the order in which they were written. Those whose payload was found damaged are among
    /// them; [`Journal::holds`] tells.
    pub fn entries(&self) -> &[Entry] {
        &self.entries
    }

    /// How many photos there are.
    pub fn photos(&self) -> usize {
        self.index.values().filter(|&&index| self.entries[index].kind == Kind::Photo).count()
    }

    /// Whether there is a record of this key, damaged ones not counted.
    pub fn holds(&self, key: Key) -> bool {
        self.index.contains_key(&key)
    }

    /// What is damaged, as far as is known by now: heads from the start, payloads once they were asked for.
    pub fn damages(&self) -> &[Damage] {
        &self.damages
    }

    /// What was cut off at the end when the journal was opened (or, if it is open to read only, is passed over).
    pub fn torn(&self) -> Option<&Torn> {
        self.torn.as_ref()
    }

    /// Whether more may be appended.
    pub fn is_writable(&self) -> bool {
        self.lock.is_some()
    }

    /// The record of this key; none if there is none, or if it is damaged (then [`Journal::damages`] has one more).
    ///
    /// # Errors
    /// [`Error::Read`] when the file cannot be read at all.
    pub fn get(&mut self, key: Key) -> Result<Option<Stored>> {
        let Some(&index) = self.index.get(&key) else { return Ok(None) };
        let entry = &self.entries[index];
        let length = usize::try_from(entry.length).map_err(|_| Error::Journal {
            path: self.path.clone(),
            fault: format!("a record of {} bytes does not fit this machine's memory", entry.length),
            help: "open it on a 64-bit machine".into(),
        })?;
        let mut payload = vec![0; length];
        read_at(&self.file, entry.payload_at(), &mut payload).map_err(Error::reading(&self.path))?;
        if *blake3::hash(&payload).as_bytes() == entry.checksum {
            return Ok(Some(Stored { metadata: entry.metadata.clone(), payload }));
        }
        let entry = entry.clone();
        self.damages.push(Damage {
            offset: entry.offset,
            bytes: entry.end() - entry.offset,
            record: name(&self.entries[..index], entry.kind),
            fault: "its content is not what its checksum says",
            entry: Some(entry),
        });
        self.index.remove(&key);
        Ok(None)
    }

    /// Reads every payload once, one at a time, so that [`Journal::damages`] is complete.
    ///
    /// # Errors
    /// As [`Journal::get`].
    pub fn verify(&mut self) -> Result<()> {
        let keys: Vec<Key> = self.index.keys().copied().collect();
        for key in keys {
            self.get(key)?;
        }
        self.damages.sort_by_key(|damage| damage.offset);
        Ok(())
    }

    /// Keeps a pattern, once, and returns its key. It is on disk when the photo that is appended next is.
    ///
    /// # Errors
    /// As [`Journal::append`].
    pub fn pattern(&mut self, payload: &[u8]) -> Result<Key> {
        let key = Key::of(&[b"pattern", payload]);
        if !self.holds(key) {
            self.write(Kind::Pattern, key, b"", payload)?;
        }
        Ok(key)
    }

    /// Appends a record, and returns when it is on disk, and all before it.
    ///
    /// # Errors
    /// [`Error::Journal`] naming the file when it cannot be written, is open to read only, or holds such a record already. Nothing that
    /// was there before is lost: a record written in part is cut off again.
    pub fn append(&mut self, kind: Kind, key: Key, metadata: &[u8], payload: &[u8]) -> Result<()> {
        self.write_new(kind, key, metadata, payload)?;
        self.settle()
    }

    /// Appends a record of what can be computed again, and returns when the system has it: it outlives the end of this process,
    /// whatever that may be, and a quarter of a second later, when more is appended or the journal is closed, that of the system.
    /// The way to the disk takes longer than a product.
    ///
    /// # Errors
    /// As [`Journal::append`]; where the disk refuses, it is the records since it last took any that are taken back.
    pub fn append_soon(&mut self, kind: Kind, key: Key, metadata: &[u8], payload: &[u8]) -> Result<()> {
        self.write_new(kind, key, metadata, payload)?;
        if self.settled.at.elapsed() < SOON { Ok(()) } else { self.settle() }
    }

    fn write_new(&mut self, kind: Kind, key: Key, metadata: &[u8], payload: &[u8]) -> Result<()> {
        if self.holds(key) {
            return Err(self.refusal(
                format!("a {} of this key is there already", kind.name()),
                "this is a fault of the program: please report it",
            ));
        }
        self.write(kind, key, metadata, payload)
    }

    /// Returns when all that was written is on disk.
    fn settle(&mut self) -> Result<()> {
        // Lengths are among what `sync_data` brings to the disk; times are not, and nobody asks for them.
        let Err(source) = self.file.sync_data() else {
            self.settled = Settled::now(self.entries.len());
            return Ok(());
        };
        // What of it is on disk now, nobody knows: all of it is taken back, and this process writes no more.
        self.stuck = true;
        for entry in self.entries.split_off(self.settled.entries).iter().rev() {
            self.index.remove(&entry.key);
            self.end = entry.offset;
        }
        let _ = self.file.set_len(self.end);
        Err(self.unwritable(&source))
    }

    /// The note of this name, appended if there is none; what is there already is not changed.
    ///
    /// # Errors
    /// As [`Journal::append`].
    pub fn note(&mut self, name: &str, payload: &[u8]) -> Result<()> {
        let key = self.note_key(name);
        // Reading it first finds out whether it is whole.
        if self.get(key)?.is_some() { Ok(()) } else { self.append(Kind::Note, key, name.as_bytes(), payload) }
    }

    /// The note of this name.
    ///
    /// # Errors
    /// As [`Journal::get`].
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
                "it is open to read only, and more is to be written".into(),
                "go on with --resume, or start another run with the rig attached",
            ));
        }
        if self.stuck {
            return Err(self.unwritable(&io::Error::other("an earlier record is there in part")));
        }
        if metadata.len() > LONGEST_METADATA as usize {
            return Err(self.refusal(
                format!("{} bytes of metadata are more than fit", metadata.len()),
                "this is a fault of the program: please report it",
            ));
        }
        let (head, entry) = encode(&self.seal, kind, key, metadata, payload, self.end);
        let written = (&self.file)
            .seek(SeekFrom::Start(self.end))
            .and_then(|_| (&self.file).write_all(&head))
            .and_then(|()| (&self.file).write_all(payload));
        if let Err(source) = written {
            // Back to the last whole record; where even that fails, opening the journal again does it.
            self.stuck = self.file.set_len(self.end).is_err();
            return Err(self.unwritable(&source));
        }
        self.end = entry.end();
        self.index.insert(key, self.entries.len());
        self.entries.push(entry);
        Ok(())
    }

    pub(super) fn refusal(&self, fault: String, help: &str) -> Error {
        Error::Journal { path: self.path.clone(), fault, help: help.into() }
    }

    fn unwritable(&self, source: &io::Error) -> Error {
        let kept = self.photos();
        self.refusal(
            format!("cannot write: {source}; all {kept} photos so far are safe"),
            "make room (or repair what is wrong), and go on with the same command and --resume",
        )
    }
}

impl Drop for Journal {
    fn drop(&mut self) {
        if self.settled.entries < self.entries.len() {
            // Nobody is left to hear of it; what did not get there is found by its checksum, and taken again.
            let _ = self.settle();
        }
    }
}
