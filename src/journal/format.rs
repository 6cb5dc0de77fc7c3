//! The format of a journal file: two copies of the header, in case one is damaged, and records that consist of a head, metadata and a
//! payload. Scanning a file finds the records, the damaged parts, and an incomplete record at the end.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};

use super::{Identity, Key, checksum};

/// The first bytes of a record. Like PNG's signature, they reveal a transfer that changed line ends or removed the eighth bit.
const MARKER: [u8; 8] = *b"\x89klxrec\n";

/// The length of a head in bytes, up to the metadata.
const HEAD_BYTES: usize = 120;

/// The maximum length of metadata. A head that states more is damaged.
pub(super) const MAX_METADATA_BYTES: u32 = 1 << 20;

/// The kind of a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Kind {
    /// A projected pattern. The metadata of each photo of the pattern contain the pattern's key.
    Pattern,
    /// A photo.
    Photo,
    /// Other data that a replay needs.
    Note,
}

impl Kind {
    fn code(self) -> u32 {
        match self {
            Self::Pattern => 1,
            Self::Photo => 2,
            Self::Note => 3,
        }
    }

    fn from_code(code: u32) -> Option<Self> {
        [Self::Pattern, Self::Photo, Self::Note].into_iter().find(|kind| kind.code() == code)
    }

    /// The kind's name in messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::Pattern => "pattern",
            Self::Photo => "photo",
            Self::Note => "note",
        }
    }
}

/// A record with a valid head. Its payload remains on disk.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Entry {
    /// The kind of the record.
    pub kind: Kind,
    /// The key of the record.
    pub key: Key,
    /// The metadata that the writer gave.
    pub metadata: Vec<u8>,
    /// The offset of the record in the file.
    pub offset: u64,
    /// The payload's length in bytes.
    pub length: u64,
    pub(super) checksum: [u8; 32],
}

impl Entry {
    pub(super) fn payload_at(&self) -> u64 {
        self.offset + HEAD_BYTES as u64 + self.metadata.len() as u64
    }

    pub(super) fn end(&self) -> u64 {
        self.payload_at() + self.length
    }
}

struct Head {
    code: u32,
    metadata: u32,
    payload: u64,
    key: [u8; 32],
    checksum: [u8; 32],
}

impl Head {
    /// Parses a head. Returns `None` if there is no marker or if the metadata's length is too large.
    fn parse(bytes: &[u8; HEAD_BYTES]) -> Option<Self> {
        let four = |at: usize| bytes[at..at + 4].try_into().map(u32::from_le_bytes).ok();
        let hash = |at: usize| <[u8; 32]>::try_from(&bytes[at..at + 32]).ok();
        let head = Self {
            code: four(8)?,
            metadata: four(12)?,
            payload: u64::from_le_bytes(bytes[16..24].try_into().ok()?),
            key: hash(24)?,
            checksum: hash(56)?,
        };
        (bytes[..8] == MARKER && head.metadata <= MAX_METADATA_BYTES).then_some(head)
    }

    /// The entry of this head, if the checksum in `bytes` is that of the identity, the head and the metadata.
    fn entry(
        &self,
        bytes: &[u8; HEAD_BYTES],
        metadata: Vec<u8>,
        identity_hash: &[u8; 32],
        offset: u64,
    ) -> Option<Entry> {
        let kind = Kind::from_code(self.code)?;
        if head_checksum(identity_hash, &bytes[..HEAD_BYTES - 32], &metadata) != bytes[HEAD_BYTES - 32..] {
            return None;
        }
        // If the end exceeds 2⁶⁴, the head is damaged, even if the checksum matches.
        offset.checked_add(HEAD_BYTES as u64 + u64::from(self.metadata))?.checked_add(self.payload)?;
        let key = Key::from_bytes(self.key);
        Some(Entry { kind, key, metadata, offset, length: self.payload, checksum: self.checksum })
    }
}

/// The bytes of a record's head and metadata, and the record's entry at `offset`.
pub(super) fn encode(
    identity_hash: &[u8; 32],
    kind: Kind,
    key: Key,
    metadata: &[u8],
    payload: &[u8],
    offset: u64,
) -> (Vec<u8>, Entry) {
    let checksum = checksum(payload);
    let mut bytes = Vec::with_capacity(HEAD_BYTES + metadata.len());
    bytes.extend(MARKER);
    bytes.extend(kind.code().to_le_bytes());
    bytes.extend((metadata.len() as u32).to_le_bytes());
    bytes.extend((payload.len() as u64).to_le_bytes());
    bytes.extend(key.bytes());
    bytes.extend(checksum);
    let sum = head_checksum(identity_hash, &bytes, metadata);
    bytes.extend(sum);
    bytes.extend(metadata);
    let length = payload.len() as u64;
    (bytes, Entry { kind, key, metadata: metadata.to_vec(), offset, length, checksum })
}

fn head_checksum(identity_hash: &[u8; 32], fields: &[u8], metadata: &[u8]) -> [u8; 32] {
    let mut hasher = blake3::Hasher::new();
    hasher.update(identity_hash).update(fields).update(metadata);
    *hasher.finalize().as_bytes()
}

/// The first bytes of a header.
const MAGIC: [u8; 8] = *b"\x89klxjrn\n";
const VERSION: u32 = 1;
/// The number of bytes before the identity.
const FIXED_BYTES: usize = 48;
/// The maximum length of the identity. If the stated length in the first copy is damaged, this limit bounds the search for the second copy.
const MAX_IDENTITY_BYTES: usize = 1 << 16;

#[derive(Debug, PartialEq, Eq)]
pub(super) enum Header {
    /// The identity, the offset of the first record, and whether both copies are undamaged.
    Known { identity: Identity, records_at: u64, whole: bool },
    /// A later version of this program wrote the file.
    Later(u32),
    /// Both copies are damaged.
    Unknown,
}

/// The largest number of bytes that [`read_header`] needs.
pub(super) const MAX_HEADER_BYTES: usize = 2 * (FIXED_BYTES + MAX_IDENTITY_BYTES);

pub(super) fn encode_header(identity: &Identity) -> Vec<u8> {
    let copy = encode_once(VERSION, &identity.encode());
    [copy.clone(), copy].concat()
}

pub(super) fn fits_header(identity: &Identity) -> bool {
    identity.encode().len() <= MAX_IDENTITY_BYTES
}

fn encode_once(version: u32, identity: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(FIXED_BYTES + identity.len());
    bytes.extend(MAGIC);
    bytes.extend(version.to_le_bytes());
    bytes.extend((identity.len() as u32).to_le_bytes());
    let mut hasher = blake3::Hasher::new();
    hasher.update(&bytes).update(identity);
    bytes.extend(hasher.finalize().as_bytes());
    bytes.extend(identity);
    bytes
}

/// Reads the header from an undamaged copy in `bytes`, which are the first bytes of the file.
pub(super) fn read_header(bytes: &[u8]) -> Header {
    for at in 0..bytes.len().min(FIXED_BYTES + MAX_IDENTITY_BYTES + 1) {
        match copy_at(&bytes[at..]) {
            Some((VERSION, encoded)) => {
                let length = FIXED_BYTES + encoded.len();
                // A copy that is not at the start of the file must be the second copy, which starts where the first copy ends.
                if at != 0 && at != length {
                    continue;
                }
                let Ok(identity) = serde_json::from_slice(encoded) else { continue };
                let other = bytes.get(length - at..).and_then(copy_at);
                let whole = other == Some((VERSION, encoded));
                return Header::Known { identity, records_at: 2 * length as u64, whole };
            }
            Some((version, _)) => return Header::Later(version),
            None => {}
        }
    }
    Header::Unknown
}

/// The version and the encoded identity of the header copy at the start of `bytes`; `None` if this copy is damaged.
fn copy_at(bytes: &[u8]) -> Option<(u32, &[u8])> {
    let fixed = bytes.get(..FIXED_BYTES).filter(|fixed| fixed[..8] == MAGIC)?;
    let four = |at: usize| fixed[at..at + 4].try_into().map(u32::from_le_bytes).ok();
    let (version, length) = (four(8)?, four(12)? as usize);
    let identity = bytes.get(FIXED_BYTES..FIXED_BYTES.checked_add(length)?)?;
    let whole = encode_once(version, identity);
    (whole[..FIXED_BYTES] == *fixed).then_some((version, identity))
}

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

/// An incomplete record at the end of a file. Its writer was killed while writing.
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
    /// Bytes that may start a record that would extend beyond the end of the file.
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
        // Bytes may have been lost inside the preceding record. The next record then starts within the apparent payload of the preceding
        // record, so the search starts at this payload.
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

/// Describes the bytes `from..to`, which contain no record, as damage.
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

/// The offset of the first record with a valid head at or after `from`. A record at `except` is ignored.
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
        // A marker may extend across two chunks.
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

    use super::*;

    /// The head of a photo that states a payload of this many bytes. Its checksum matches.
    fn head_of(payload: u64, metadata: &[u8]) -> ([u8; HEAD_BYTES], Vec<u8>) {
        let (bytes, _) = encode(&[7; 32], Kind::Photo, Key::of(&[b"key"]), metadata, b"", 0);
        let mut head: [u8; HEAD_BYTES] = bytes[..HEAD_BYTES].try_into().expect("a head is that long");
        head[16..24].copy_from_slice(&payload.to_le_bytes());
        let sum = head_checksum(&[7; 32], &head[..HEAD_BYTES - 32], metadata);
        head[HEAD_BYTES - 32..].copy_from_slice(&sum);
        (head, metadata.to_vec())
    }

    #[test]
    fn an_end_beyond_all_files_is_damage_even_if_the_checksum_is_right() {
        for metadata in [&b""[..], b"metadata"] {
            let most = u64::MAX - 1000 - (HEAD_BYTES + metadata.len()) as u64;
            for (payload, fits) in [(most, true), (most + 1, false), (u64::MAX, false)] {
                let (head, metadata) = head_of(payload, metadata);
                let parsed = Head::parse(&head).expect("it has the marker");
                let entry = parsed.entry(&head, metadata, &[7; 32], 1000);
                assert_eq!(entry.map(|entry| entry.end()), fits.then_some(u64::MAX), "{payload}");
            }
        }
    }

    #[test]
    fn metadata_up_to_the_limit_are_read_and_longer_ones_are_damage() {
        let (mut head, _) = head_of(0, b"");
        for (length, fits) in [(MAX_METADATA_BYTES, true), (MAX_METADATA_BYTES + 1, false)] {
            head[12..16].copy_from_slice(&length.to_le_bytes());
            assert_eq!(Head::parse(&head).is_some(), fits, "{length}");
        }
    }

    #[test]
    fn one_undamaged_copy_is_enough() {
        let identity = Identity::new().with("rig file", "a");
        let bytes = encode_header(&identity);
        let records_at = bytes.len() as u64;
        assert_eq!(
            read_header(&bytes),
            Header::Known { identity: identity.clone(), records_at, whole: true }
        );
        for at in 0..bytes.len() {
            let mut damaged = bytes.clone();
            damaged[at] ^= 0x10;
            assert_eq!(
                read_header(&damaged),
                Header::Known { identity: identity.clone(), records_at, whole: false },
                "{at}"
            );
        }
        let mut both = bytes.clone();
        both[20] ^= 1;
        both[bytes.len() / 2 + 20] ^= 1;
        assert_eq!(read_header(&both), Header::Unknown);
    }

    #[test]
    fn the_longest_identity_fits_and_is_found_in_its_second_copy() {
        let of = |length: usize| Identity::new().with("rig file", "a".repeat(length));
        let room = MAX_IDENTITY_BYTES - of(0).encode().len();
        assert!(fits_header(&of(room)) && !fits_header(&of(room + 1)));
        let mut bytes = encode_header(&of(room));
        assert_eq!(bytes.len(), MAX_HEADER_BYTES);
        bytes[20] ^= 1;
        let records_at = bytes.len() as u64;
        assert_eq!(read_header(&bytes), Header::Known { identity: of(room), records_at, whole: false });
    }

    #[test]
    fn a_later_version_is_not_mistaken_for_damage() {
        let later = encode_once(VERSION + 1, b"whatever it holds then");
        assert_eq!(read_header(&later), Header::Later(VERSION + 1));
    }

    const IDENTITY: [u8; 32] = [3; 32];

    /// The file is searched in chunks of 64 KiB. A record must be found at any position of its marker relative to the chunks.
    #[test]
    fn a_record_behind_damage_is_found_when_its_marker_lies_across_two_chunks() {
        // The search begins one byte after the start of the damage.
        let starts =
            [0, 1000].into_iter().flat_map(|start| (0..=MARKER.len()).map(move |before| (start, before)));
        for (start, before_boundary) in starts {
            // If a disk lost its writes, the file has zeros there. Here they fill the file from the start of the search.
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
