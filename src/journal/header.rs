//! The header of a journal file: its format version and its identity. It is written twice, so that one damage
//! cannot destroy both copies.

use super::Identity;

/// The bytes that mark a header.
const MAGIC: [u8; 8] = *b"\x89klxjrn\n";
/// The version of the format.
const VERSION: u32 = 1;
/// Number of bytes before the identity.
const FIXED_BYTES: usize = 48;
/// The largest length of the identity. It bounds the search for the second copy when the length in the first
/// one is damaged.
const MAX_IDENTITY_BYTES: usize = 1 << 16;

/// The content of a file's header.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Header {
    /// The identity, the offset of the first record, and whether both copies are undamaged.
    Known { identity: Identity, records_at: u64, whole: bool },
    /// Written by a later version of this program.
    Later(u32),
    /// Both copies are damaged.
    Unknown,
}

/// The number of bytes that [`read`] needs at most.
pub(super) const MAX_BYTES: usize = 2 * (FIXED_BYTES + MAX_IDENTITY_BYTES);

/// The bytes of both copies.
pub(super) fn encode(identity: &Identity) -> Vec<u8> {
    let copy = encode_once(VERSION, &identity.encode());
    [copy.clone(), copy].concat()
}

/// Whether this identity fits into a header.
pub(super) fn fits(identity: &Identity) -> bool {
    identity.encode().len() <= MAX_IDENTITY_BYTES
}

/// The bytes of one copy.
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

/// Reads the header at the start of `bytes` from a copy that is undamaged.
pub(super) fn read(bytes: &[u8]) -> Header {
    for at in 0..bytes.len().min(FIXED_BYTES + MAX_IDENTITY_BYTES + 1) {
        match copy_at(&bytes[at..]) {
            Some((VERSION, encoded)) => {
                let length = FIXED_BYTES + encoded.len();
                // A copy that does not begin the file must be the second one, which begins where the first
                // one ends.
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

/// The version and the encoded identity of the copy at the start of `bytes`; `None` if it is damaged.
fn copy_at(bytes: &[u8]) -> Option<(u32, &[u8])> {
    let fixed = bytes.get(..FIXED_BYTES).filter(|fixed| fixed[..8] == MAGIC)?;
    let four = |at: usize| fixed[at..at + 4].try_into().map(u32::from_le_bytes).ok();
    let (version, length) = (four(8)?, four(12)? as usize);
    let identity = bytes.get(FIXED_BYTES..FIXED_BYTES.checked_add(length)?)?;
    let whole = encode_once(version, identity);
    (whole[..FIXED_BYTES] == *fixed).then_some((version, identity))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_undamaged_copy_is_enough() {
        let identity = Identity::new().with("rig file", "a");
        let bytes = encode(&identity);
        let records_at = bytes.len() as u64;
        assert_eq!(read(&bytes), Header::Known { identity: identity.clone(), records_at, whole: true });
        for at in 0..bytes.len() {
            let mut damaged = bytes.clone();
            damaged[at] ^= 0x10;
            assert_eq!(
                read(&damaged),
                Header::Known { identity: identity.clone(), records_at, whole: false },
                "{at}"
            );
        }
        let mut both = bytes.clone();
        both[20] ^= 1;
        both[bytes.len() / 2 + 20] ^= 1;
        assert_eq!(read(&both), Header::Unknown);
    }

    #[test]
    fn the_longest_identity_fits_and_is_found_in_its_second_copy() {
        let of = |length: usize| Identity::new().with("rig file", "a".repeat(length));
        let room = MAX_IDENTITY_BYTES - of(0).encode().len();
        assert!(fits(&of(room)) && !fits(&of(room + 1)));
        let mut bytes = encode(&of(room));
        assert_eq!(bytes.len(), MAX_BYTES);
        bytes[20] ^= 1;
        let records_at = bytes.len() as u64;
        assert_eq!(read(&bytes), Header::Known { identity: of(room), records_at, whole: false });
    }

    #[test]
    fn a_later_version_is_not_mistaken_for_damage() {
        let later = encode_once(VERSION + 1, b"whatever it holds then");
        assert_eq!(read(&later), Header::Later(VERSION + 1));
    }
}
