//! What a journal's file begins with: its format and its identity, twice, so that no single damage takes both.

use super::Identity;

/// Of this format.
const MAGIC: [u8; 8] = *b"\x89klxjrn\n";
const VERSION: u32 = 1;
/// Bytes before the identity.
const FIXED: usize = 48;
/// The identity is no longer, so that the second copy is found without trusting the first one's length.
const LONGEST: usize = 1 << 16;

/// What a file's first bytes say.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Read {
    /// The identity, where the records begin, and whether both copies are whole.
    Known { identity: Identity, records_at: u64, whole: bool },
    /// Written by a later version of this program.
    Later(u32),
    /// Neither copy is whole.
    Unknown,
}

/// As many bytes as [`read`] needs at most.
pub(super) const ENOUGH: usize = 2 * (FIXED + LONGEST);

/// Both copies.
pub(super) fn encode(identity: &Identity) -> Vec<u8> {
    let copy = encode_once(VERSION, &identity.encode());
    [copy.clone(), copy].concat()
}

/// Whether this identity can be written.
pub(super) fn fits(identity: &Identity) -> bool {
    identity.encode().len() <= LONGEST
}

fn encode_once(version: u32, identity: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(FIXED + identity.len());
    bytes.extend(MAGIC);
    bytes.extend(version.to_le_bytes());
    bytes.extend((identity.len() as u32).to_le_bytes());
    let mut hasher = blake3::Hasher::new();
    hasher.update(&bytes).update(identity);
    bytes.extend(hasher.finalize().as_bytes());
    bytes.extend(identity);
    bytes
}

/// The header at the start of `bytes`, from whichever copy is whole.
pub(super) fn read(bytes: &[u8]) -> Read {
    for at in 0..bytes.len().min(FIXED + LONGEST + 1) {
        match copy_at(&bytes[at..]) {
            Some((VERSION, encoded)) => {
                let length = FIXED + encoded.len();
                // The second copy stands where the first one ends.
                if at != 0 && at != length {
                    continue;
                }
                let Ok(identity) = serde_json::from_slice(encoded) else { continue };
                let other = bytes.get(length - at..).and_then(copy_at);
                let whole = other == Some((VERSION, encoded));
                return Read::Known { identity, records_at: 2 * length as u64, whole };
            }
            Some((version, _)) => return Read::Later(version),
            None => {}
        }
    }
    Read::Unknown
}

/// A whole copy at the start of `bytes`: its version, and its identity's encoding.
fn copy_at(bytes: &[u8]) -> Option<(u32, &[u8])> {
    let fixed = bytes.get(..FIXED).filter(|fixed| fixed[..8] == MAGIC)?;
    let four = |at: usize| fixed[at..at + 4].try_into().map(u32::from_le_bytes).ok();
    let (version, length) = (four(8)?, four(12)? as usize);
    let identity = bytes.get(FIXED..FIXED.checked_add(length)?)?;
    let whole = encode_once(version, identity);
    (whole[..FIXED] == *fixed).then_some((version, identity))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_whole_copy_is_enough_wherever_the_other_is_damaged() {
        let identity = Identity::new().with("rig file", "a");
        let bytes = encode(&identity);
        let records_at = bytes.len() as u64;
        assert_eq!(read(&bytes), Read::Known { identity: identity.clone(), records_at, whole: true });
        for at in 0..bytes.len() {
            let mut damaged = bytes.clone();
            damaged[at] ^= 0x10;
            assert_eq!(
                read(&damaged),
                Read::Known { identity: identity.clone(), records_at, whole: false },
                "{at}"
            );
        }
        let mut both = bytes.clone();
        both[20] ^= 1;
        both[bytes.len() / 2 + 20] ^= 1;
        assert_eq!(read(&both), Read::Unknown);
    }

    #[test]
    fn a_later_version_is_told_from_damage() {
        let later = encode_once(VERSION + 1, b"whatever it holds then");
        assert_eq!(read(&later), Read::Later(VERSION + 1));
    }
}
