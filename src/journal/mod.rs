//! Journals, which are append-only files of photos.
//!
//! Photos are expensive, so a run appends each photo to its journal before using it. If a run was killed, it can be resumed from its
//! journal without taking a photo twice. A finished run can be replayed from its journal without the rig, with the same analysis or with
//! another. A journal stores keys and bytes. The writers define the meaning of these bytes: [`crate::measure::JournaledFrames`] for a rig,
//! [`crate::transport::JournaledOperator`] for a scene.
//!
//! # File format
//!
//! A journal is a folder with the file `photos.journal` and a lock file. The writer holds the lock. The journal file consists of two copies
//! of the header, followed by the records:
//!
//! ```text
//! header   magic 8 · version u32 · length u32 · BLAKE3 of these and the identity 32 · identity, JSON
//! record   marker 8 · kind u32 · metadata's length u32 · payload's length u64 · key 32 · BLAKE3 of the payload 32
//!          · BLAKE3 of the identity, of all before, and of the metadata 32 · metadata, JSON · payload
//! ```
//!
//! The numbers are lengths in bytes. Integers are little-endian. The [`Identity`] names everything on which all photos depend. A journal
//! with another identity is refused. The head of a record is the part before its metadata. A checksum in the head shows whether the lengths
//! in the head are valid. If they are not, reading continues at the next marker with a valid head. Opening a journal checks all heads but
//! reads no payload. A payload is checked when it is read.
//!
//! # Faults
//!
//! | fault | result |
//! |---|---|
//! | the writer is killed | the incomplete record at the end is cut off; [`Journal::torn`] reports it |
//! | bits are flipped | [`Journal::damages`] names the record, which then counts as not written |
//! | the disk is full, read-only or unplugged | [`Error::Journal`](crate::Error::Journal); all complete records stay |
//! | there is a second writer | an error that names the process of the first |

mod file;
mod format;
mod open;

use std::fmt;

use serde::{Deserialize, Serialize};

pub use file::{Journal, Stored};
pub use format::{Damage, Entry, Kind, Torn};

/// Several threads hash this many bytes or more. For fewer bytes they would take longer than one.
const PARALLEL: usize = 1 << 17;

fn update(hasher: &mut blake3::Hasher, bytes: &[u8]) {
    if bytes.len() < PARALLEL {
        hasher.update(bytes)
    } else {
        hasher.update_rayon(bytes)
    };
}

/// The BLAKE3 hash of these bytes.
fn checksum(bytes: &[u8]) -> [u8; 32] {
    let mut hasher = blake3::Hasher::new();
    update(&mut hasher, bytes);
    *hasher.finalize().as_bytes()
}

/// The key of a record: the BLAKE3 hash of everything on which the photo, pattern or note depends.
#[derive(Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Key([u8; 32]);

impl Key {
    /// The key of these parts. The lengths of the parts are hashed, too, so different lists with equal concatenations have different keys.
    pub fn of(parts: &[&[u8]]) -> Self {
        let mut hasher = blake3::Hasher::new();
        for part in parts {
            hasher.update(&(part.len() as u64).to_le_bytes());
            update(&mut hasher, part);
        }
        Self(*hasher.finalize().as_bytes())
    }

    /// The key with these bytes.
    pub fn from_bytes(bytes: [u8; 32]) -> Self {
        Self(bytes)
    }

    /// The key's bytes.
    pub fn bytes(&self) -> &[u8; 32] {
        &self.0
    }

    /// Parses 64 hexadecimal digits.
    pub fn from_hex(text: &str) -> Option<Self> {
        blake3::Hash::from_hex(text).ok().map(|hash| Self(*hash.as_bytes()))
    }
}

impl fmt::Display for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", blake3::Hash::from_bytes(self.0))
    }
}

impl fmt::Debug for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{self}")
    }
}

/// An ordered list of named values on which all photos of a journal depend. Examples are the hashes of the rig file and its calibration, or
/// of the scene and the tracer's settings. Two photos have the same source if all values are equal.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Identity(Vec<(String, String)>);

impl Identity {
    /// An identity without parts.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a part. If two values differ, error messages call the part `name`.
    #[must_use]
    pub fn with(mut self, name: &str, value: impl ToString) -> Self {
        self.0.push((name.into(), value.to_string()));
        self
    }

    /// The value of the part called `name`.
    pub fn get(&self, name: &str) -> Option<&str> {
        self.0.iter().find(|(part, _)| part == name).map(|(_, value)| value.as_str())
    }

    /// Descriptions of the parts whose values differ in `other`.
    pub fn differences(&self, other: &Self) -> Vec<String> {
        let mut names: Vec<&str> = self.0.iter().map(|(name, _)| name.as_str()).collect();
        names.extend(other.0.iter().map(|(name, _)| name.as_str()).filter(|name| self.get(name).is_none()));
        names.retain(|name| self.get(name) != other.get(name));
        let value = |identity: &Self, name| identity.get(name).map_or("none".into(), shorten);
        let mut differences: Vec<String> = names
            .into_iter()
            .map(|name| format!("{name} (then {}, now {})", value(self, name), value(other, name)))
            .collect();
        if differences.is_empty() && self != other {
            differences.push("the order of its parts".into());
        }
        differences
    }

    pub(super) fn encode(&self) -> Vec<u8> {
        // A list of pairs of strings can always be encoded.
        serde_json::to_vec(self).unwrap_or_default()
    }

    pub(super) fn hash(&self) -> [u8; 32] {
        *blake3::hash(&self.encode()).as_bytes()
    }
}

/// Shortens a hash to its first 12 digits, and quotes any other value.
fn shorten(value: &str) -> String {
    let is_hash = value.len() == 64 && value.bytes().all(|byte| byte.is_ascii_hexdigit());
    if is_hash { format!("{}…", &value[..12]) } else { format!("`{value}`") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_name_the_parts_and_both_values() {
        let then = Identity::new().with("rig file", "0".repeat(64)).with("size", "8x8");
        let now =
            Identity::new().with("rig file", "f".repeat(64)).with("calibration", "ideal").with("size", "8x8");
        assert_eq!(
            then.differences(&now),
            ["rig file (then 000000000000…, now ffffffffffff…)", "calibration (then none, now `ideal`)"]
        );
        assert!(then.differences(&then).is_empty());
        // Only hashes, which have 64 hexadecimal digits, are shortened. Other words of that length and digits of other lengths are not.
        let [word, short] = ["z".repeat(64), "0".repeat(63)];
        let now = then.clone().with("word", word.clone()).with("short", short.clone());
        assert_eq!(
            then.differences(&now),
            [format!("word (then none, now `{word}`)"), format!("short (then none, now `{short}`)")]
        );
        let swapped = Identity::new().with("size", "8x8").with("rig file", "0".repeat(64));
        assert_eq!(then.differences(&swapped), ["the order of its parts"]);
    }
}
