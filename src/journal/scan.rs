//! Scans a journal file for its records, for damaged parts, and for an incomplete record at its end.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};

use super::record::{Entry, HEAD_BYTES, Head, Kind, MARKER};

/// A damaged part of a journal file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Damage {
    /// The offset in the file.
    pub offset: u64,
    /// The length in bytes.
    pub bytes: u64,
    /// The name of the record: `photo 17`, or `the record after photo 16` if the record's kind is unknown.
    pub record: String,
    /// A description of the damage.
    pub fault: &'static str,
    /// The record, if its head is valid.
    pub entry: Option<Entry>,
}

impl std::fmt::Display for Damage {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} (byte {}): {}", self.record, self.offset, self.fault)
    }
}

/// An incomplete record at the end of a file. Its writer was killed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Torn {
    /// The offset in the file.
    pub offset: u64,
    /// The length in bytes.
    pub bytes: u64,
}

#[derive(Debug, Default)]
pub(super) struct Scan {
    pub(super) entries: Vec<Entry>,
    pub(super) damages: Vec<Damage>,
    pub(super) torn: Option<Torn>,
}

/// The content of the file at an offset where a record should begin.
enum Candidate {
    /// A record with a valid head.
    Record(Entry),
    /// Bytes that may begin a record that extends beyond the end of the file.
    Incomplete,
    Garbage,
}

/// Reads all heads from `start` to the end of the file at `length`.
pub(super) fn scan(file: &File, identity_hash: &[u8; 32], start: u64, length: u64) -> io::Result<Scan> {
    let mut found = Scan::default();
    let mut at = start;
    while at < length {
        let other = match read_head(file, identity_hash, at, length)? {
            Candidate::Record(entry) if entry.end() <= length => {
                at = entry.end();
                found.entries.push(entry);
                continue;
            }
            other => other,
        };
        // If bytes were lost inside the record before this offset, the next record begins inside what seems to be
        // that record's payload. The search therefore starts at that payload.
        let before = found.entries.last().filter(|entry| entry.end() == at);
        let from = before.map_or(at + 1, Entry::payload_at);
        match find_record(file, identity_hash, from, at, length)? {
            Some(next) => {
                if next < at
                    && let Some(entry) = found.entries.pop()
                {
                    let record = record_name(&found.entries, entry.kind);
                    let fault = "bytes of it are missing: another record begins inside it";
                    at = entry.offset;
                    found.damages.push(Damage {
                        offset: at,
                        bytes: next - at,
                        record,
                        fault,
                        entry: Some(entry),
                    });
                } else {
                    found.damages.push(unreadable(&found.entries, at, next));
                }
                at = next;
            }
            None => {
                match other {
                    Candidate::Garbage => found.damages.push(unreadable(&found.entries, at, length)),
                    _ => found.torn = Some(Torn { offset: at, bytes: length - at }),
                }
                at = length;
            }
        }
    }
    Ok(found)
}

/// The damage of the bytes `from..to`, which contain no record.
fn unreadable(before: &[Entry], from: u64, to: u64) -> Damage {
    let record = match before.iter().rfind(|entry| entry.kind == Kind::Photo) {
        Some(_) => format!("the record after photo {}", count(before, Kind::Photo)),
        None => "a record before the first photo".into(),
    };
    let fault = "its head does not match its checksum";
    Damage { offset: from, bytes: to - from, record, fault, entry: None }
}

/// The name of a record that follows the records `before`, such as `photo 17`.
pub(super) fn record_name(before: &[Entry], kind: Kind) -> String {
    format!("{} {}", kind.name(), count(before, kind) + 1)
}

fn count(entries: &[Entry], kind: Kind) -> usize {
    entries.iter().filter(|entry| entry.kind == kind).count()
}

fn read_head(file: &File, identity_hash: &[u8; 32], at: u64, length: u64) -> io::Result<Candidate> {
    let left = length - at;
    if left < HEAD_BYTES as u64 {
        return Ok(Candidate::Incomplete);
    }
    let mut bytes = [0; HEAD_BYTES];
    read_at(file, at, &mut bytes)?;
    let Some(head) = Head::parse(&bytes) else { return Ok(Candidate::Garbage) };
    if u64::from(head.metadata) > left - HEAD_BYTES as u64 {
        return Ok(Candidate::Incomplete);
    }
    let mut metadata = vec![0; head.metadata as usize];
    read_at(file, at + HEAD_BYTES as u64, &mut metadata)?;
    Ok(head.entry(&bytes, metadata, identity_hash, at).map_or(Candidate::Garbage, Candidate::Record))
}

/// The offset of the first record with a valid head at or after `from`, except at `except`.
fn find_record(
    file: &File,
    identity_hash: &[u8; 32],
    from: u64,
    except: u64,
    length: u64,
) -> io::Result<Option<u64>> {
    const CHUNK: usize = 1 << 16;
    let mut chunk = vec![0; CHUNK];
    let mut at = from;
    while at + HEAD_BYTES as u64 <= length {
        let size = CHUNK.min((length - at) as usize);
        read_at(file, at, &mut chunk[..size])?;
        for (index, _) in
            chunk[..size].windows(MARKER.len()).enumerate().filter(|(_, bytes)| *bytes == MARKER)
        {
            let place = at + index as u64;
            if place != except
                && matches!(read_head(file, identity_hash, place, length)?, Candidate::Record(_))
            {
                return Ok(Some(place));
            }
        }
        // A marker may lie across two chunks.
        at += (size + 1).saturating_sub(MARKER.len()).max(1) as u64;
    }
    Ok(None)
}

pub(super) fn read_at(mut file: &File, at: u64, bytes: &mut [u8]) -> io::Result<()> {
    file.seek(SeekFrom::Start(at))?;
    file.read_exact(bytes)
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use super::super::Key;
    use super::super::record::encode;
    use super::*;

    const IDENTITY: [u8; 32] = [3; 32];

    /// The file is searched in chunks of 64 KiB. A record is found wherever its marker lies relative to them.
    #[test]
    fn a_record_behind_damage_is_found_when_its_marker_lies_across_two_chunks() {
        // The search begins one byte after the start of the damage.
        let starts =
            [0, 1000].into_iter().flat_map(|start| (0..=MARKER.len()).map(move |before| (start, before)));
        for (start, before_boundary) in starts {
            // A disk that lost its writes leaves zeros. They fill the file from the start of the search.
            let mut bytes = vec![0; start + 1 + (1 << 16) - before_boundary];
            let place = bytes.len() as u64;
            let (head, entry) = encode(&IDENTITY, Kind::Photo, Key::of(&[b"photo"]), b"m", b"light", place);
            bytes.extend(head);
            bytes.extend(b"light");
            let mut file = tempfile::tempfile().expect("a temporary file can be made");
            file.write_all(&bytes).expect("there is room");
            let found = scan(&file, &IDENTITY, start as u64, bytes.len() as u64).expect("it can be read");
            assert_eq!(found.entries, [entry], "{before_boundary} bytes of the marker before the boundary");
            assert_eq!((found.damages.len(), found.damages[0].bytes), (1, place - start as u64));
        }
    }

    fn four() -> (Vec<u8>, Vec<Entry>) {
        let (mut bytes, mut entries) = (vec![0; 50], Vec::new());
        for index in 0..4_u8 {
            let key = Key::of(&[&[index]]);
            let (head, entry) = encode(&IDENTITY, Kind::Photo, key, b"m", &[index; 40], bytes.len() as u64);
            bytes.extend(head);
            bytes.extend([index; 40]);
            entries.push(entry);
        }
        (bytes, entries)
    }

    fn scanned(bytes: &[u8]) -> Scan {
        let mut file = tempfile::tempfile().expect("a temporary file can be made");
        file.write_all(bytes).expect("there is room");
        scan(&file, &IDENTITY, 50, bytes.len() as u64).expect("it can be read")
    }

    #[test]
    fn a_damaged_head_costs_its_record_from_its_first_byte_to_its_last() {
        let (bytes, entries) = four();
        for (index, said) in [(0, "a record before the first photo"), (2, "the record after photo 2")] {
            let mut damaged = bytes.clone();
            damaged[entries[index].offset as usize + 9] ^= 1;
            let found = scanned(&damaged);
            let kept: Vec<Entry> =
                entries.iter().filter(|entry| **entry != entries[index]).cloned().collect();
            assert_eq!(found.entries, kept);
            let [damage] = &found.damages[..] else { unreachable!("one damage, not {:?}", found.damages) };
            let extent = (damage.offset, damage.bytes, damage.record.as_str());
            assert_eq!(extent, (entries[index].offset, entries[index].end() - entries[index].offset, said));
            assert!(damage.entry.is_none() && found.torn.is_none());
        }
    }

    #[test]
    fn a_record_that_lost_bytes_is_named_and_the_next_ones_are_found_where_they_are_now() {
        let (bytes, entries) = four();
        let lost = 5;
        let mut damaged = bytes;
        damaged.drain(entries[1].end() as usize - 20..entries[1].end() as usize - 20 + lost);
        let found = scanned(&damaged);
        let offsets: Vec<u64> = found.entries.iter().map(|entry| entry.offset).collect();
        let moved = |index: usize| entries[index].offset - lost as u64;
        assert_eq!(offsets, [entries[0].offset, moved(2), moved(3)]);
        let [damage] = &found.damages[..] else { unreachable!("one damage, not {:?}", found.damages) };
        let extent = (damage.offset, damage.bytes, damage.record.as_str());
        assert_eq!(extent, (entries[1].offset, moved(2) - entries[1].offset, "photo 2"));
        assert_eq!(damage.entry.as_ref(), Some(&entries[1]));
    }
}
