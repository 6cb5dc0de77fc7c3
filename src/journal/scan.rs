//! From a file's bytes to its records: whole ones, damaged ones, and a torn end.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};

use super::record::{Entry, HEAD, Head, Kind, MARKER};

/// Bytes that are no record, or a record that is not to be trusted.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Damage {
    /// Where it begins in the file.
    pub offset: u64,
    /// How many bytes it is.
    pub bytes: u64,
    /// Which record: `photo 17`, or `the record after photo 16` where that cannot be told.
    pub record: String,
    /// What is wrong with it.
    pub fault: &'static str,
    /// The record, where its head is whole.
    pub entry: Option<Entry>,
}

impl std::fmt::Display for Damage {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} (byte {}): {}", self.record, self.offset, self.fault)
    }
}

/// The end of a file that was being written when its writer was killed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Torn {
    /// Where it begins in the file.
    pub offset: u64,
    /// How many bytes it is.
    pub bytes: u64,
}

/// What a file holds.
#[derive(Debug, Default)]
pub(super) struct Scan {
    pub(super) entries: Vec<Entry>,
    pub(super) damages: Vec<Damage>,
    pub(super) torn: Option<Torn>,
}

/// What stands at a place where a record should begin.
enum At {
    Record(Entry),
    /// No record; what there is may be the beginning of one that goes beyond the file's end.
    Beginning,
    Garbage,
}

/// Reads all heads from `start` to the end of the file.
pub(super) fn scan(file: &File, seal: &[u8; 32], start: u64, length: u64) -> io::Result<Scan> {
    let mut found = Scan::default();
    let mut at = start;
    while at < length {
        let fate = match look(file, seal, at, length)? {
            At::Record(entry) if entry.end() <= length => {
                at = entry.end();
                found.entries.push(entry);
                continue;
            }
            other => other,
        };
        // Should bytes have been lost inside the record before, then the next one begins in what is taken for its payload.
        let before = found.entries.last().filter(|entry| entry.end() == at);
        let from = before.map_or(at + 1, Entry::payload_at);
        match find(file, seal, from, at, length)? {
            Some(next) => {
                if next < at
                    && let Some(entry) = found.entries.pop()
                {
                    let record = name(&found.entries, entry.kind);
                    let fault = "other records begin inside it: bytes are missing";
                    at = entry.offset;
                    found.damages.push(Damage {
                        offset: at,
                        bytes: next - at,
                        record,
                        fault,
                        entry: Some(entry),
                    });
                } else {
                    found.damages.push(unknown(&found.entries, at, next));
                }
                at = next;
            }
            None => {
                match fate {
                    At::Garbage => found.damages.push(unknown(&found.entries, at, length)),
                    _ => found.torn = Some(Torn { offset: at, bytes: length - at }),
                }
                at = length;
            }
        }
    }
    Ok(found)
}

fn unknown(before: &[Entry], from: u64, to: u64) -> Damage {
    let record = match before.iter().rfind(|entry| entry.kind == Kind::Photo) {
        Some(_) => format!("the record after photo {}", count(before, Kind::Photo)),
        None => "a record before the first photo".into(),
    };
    let fault = "its head is not what its checksum says";
    Damage { offset: from, bytes: to - from, record, fault, entry: None }
}

/// `photo 17`, for the one that follows `before`.
pub(super) fn name(before: &[Entry], kind: Kind) -> String {
    format!("{} {}", kind.name(), count(before, kind) + 1)
}

fn count(entries: &[Entry], kind: Kind) -> usize {
    entries.iter().filter(|entry| entry.kind == kind).count()
}

fn look(file: &File, seal: &[u8; 32], at: u64, length: u64) -> io::Result<At> {
    let left = length - at;
    if left < HEAD as u64 {
        return Ok(At::Beginning);
    }
    let mut bytes = [0; HEAD];
    read_at(file, at, &mut bytes)?;
    let Some(head) = Head::parse(&bytes) else { return Ok(At::Garbage) };
    if u64::from(head.metadata) > left - HEAD as u64 {
        return Ok(At::Beginning);
    }
    let mut metadata = vec![0; head.metadata as usize];
    read_at(file, at + HEAD as u64, &mut metadata)?;
    Ok(head.entry(&bytes, metadata, seal, at).map_or(At::Garbage, At::Record))
}

/// The first place from `from` on, other than `except`, where a record with a whole head begins.
fn find(file: &File, seal: &[u8; 32], from: u64, except: u64, length: u64) -> io::Result<Option<u64>> {
    const CHUNK: usize = 1 << 16;
    let mut chunk = vec![0; CHUNK];
    let mut at = from;
    while at + HEAD as u64 <= length {
        let size = CHUNK.min((length - at) as usize);
        read_at(file, at, &mut chunk[..size])?;
        for (index, _) in
            chunk[..size].windows(MARKER.len()).enumerate().filter(|(_, bytes)| *bytes == MARKER)
        {
            let place = at + index as u64;
            if place != except && matches!(look(file, seal, place, length)?, At::Record(_)) {
                return Ok(Some(place));
            }
        }
        // A marker may lie across two chunks.
        at += (size + 1).saturating_sub(MARKER.len()).max(1) as u64;
    }
    Ok(None)
}

/// Reads from a place in the file.
pub(super) fn read_at(mut file: &File, at: u64, bytes: &mut [u8]) -> io::Result<()> {
    file.seek(SeekFrom::Start(at))?;
    file.read_exact(bytes)
}
