//! One record: what stands before its payload, and whether that can be trusted.

use super::Key;

/// What a record begins with. Like PNG's, it does not survive a transfer that meddles with line ends or the eighth bit.
pub(super) const MARKER: [u8; 8] = *b"\x89klxrec\n";

/// Bytes before the metadata.
pub(super) const HEAD: usize = 120;

/// No metadata are longer: a length beyond it is damage.
pub(super) const LONGEST_METADATA: u32 = 1 << 20;

/// What a record is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Kind {
    /// What was shown; photos name it by its key.
    Pattern,
    /// What was seen.
    Photo,
    /// What else a replay has to know.
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

    /// In words.
    pub fn name(self) -> &'static str {
        match self {
            Self::Pattern => "pattern",
            Self::Photo => "photo",
            Self::Note => "note",
        }
    }
}

/// A record whose head is whole. Its payload stays on disk.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Entry {
    /// What it is.
    pub kind: Kind,
    /// What it is found by.
    pub key: Key,
    /// What its writer noted beside the payload.
    pub metadata: Vec<u8>,
    /// Where its record begins in the file.
    pub offset: u64,
    /// The payload's length in bytes.
    pub length: u64,
    pub(super) checksum: [u8; 32],
}

impl Entry {
    /// Where its payload begins.
    pub(super) fn payload_at(&self) -> u64 {
        self.offset + HEAD as u64 + self.metadata.len() as u64
    }

    /// Where the next record begins.
    pub(super) fn end(&self) -> u64 {
        self.payload_at() + self.length
    }
}

/// The head's fields before its checksum.
pub(super) struct Head {
    code: u32,
    pub(super) metadata: u32,
    pub(super) payload: u64,
    key: [u8; 32],
    checksum: [u8; 32],
}

impl Head {
    /// The fields; `None` without the marker, or with metadata longer than any.
    pub(super) fn parse(bytes: &[u8; HEAD]) -> Option<Self> {
        let four = |at: usize| bytes[at..at + 4].try_into().map(u32::from_le_bytes).ok();
        let hash = |at: usize| <[u8; 32]>::try_from(&bytes[at..at + 32]).ok();
        let head = Self {
            code: four(8)?,
            metadata: four(12)?,
            payload: u64::from_le_bytes(bytes[16..24].try_into().ok()?),
            key: hash(24)?,
            checksum: hash(56)?,
        };
        (bytes[..8] == MARKER && head.metadata <= LONGEST_METADATA).then_some(head)
    }

    /// The entry, if the head's checksum is that of `bytes` and `metadata`.
    pub(super) fn entry(
        &self,
        bytes: &[u8; HEAD],
        metadata: Vec<u8>,
        seal: &[u8; 32],
        offset: u64,
    ) -> Option<Entry> {
        let kind = Kind::from_code(self.code)?;
        if seal_head(seal, &bytes[..HEAD - 32], &metadata) != bytes[HEAD - 32..] {
            return None;
        }
        // A length that no file can have is damage too, whatever the checksum says.
        offset.checked_add(HEAD as u64 + u64::from(self.metadata))?.checked_add(self.payload)?;
        let key = Key::from_bytes(self.key);
        Some(Entry { kind, key, metadata, offset, length: self.payload, checksum: self.checksum })
    }
}

/// Head and metadata as they are written, and the entry that they stand for.
pub(super) fn encode(
    seal: &[u8; 32],
    kind: Kind,
    key: Key,
    metadata: &[u8],
    payload: &[u8],
    offset: u64,
) -> (Vec<u8>, Entry) {
    let checksum = *blake3::hash(payload).as_bytes();
    let mut bytes = Vec::with_capacity(HEAD + metadata.len());
    bytes.extend(MARKER);
    bytes.extend(kind.code().to_le_bytes());
    bytes.extend((metadata.len() as u32).to_le_bytes());
    bytes.extend((payload.len() as u64).to_le_bytes());
    bytes.extend(key.bytes());
    bytes.extend(checksum);
    let sum = seal_head(seal, &bytes, metadata);
    bytes.extend(sum);
    bytes.extend(metadata);
    let length = payload.len() as u64;
    (bytes, Entry { kind, key, metadata: metadata.to_vec(), offset, length, checksum })
}

fn seal_head(seal: &[u8; 32], fields: &[u8], metadata: &[u8]) -> [u8; 32] {
    let mut hasher = blake3::Hasher::new();
    hasher.update(seal).update(fields).update(metadata);
    *hasher.finalize().as_bytes()
}
