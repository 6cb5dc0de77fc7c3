//! The GLB container: a header, a JSON chunk, and optionally a binary chunk.

use std::path::Path;

use super::fault;
use crate::error::Result;

const MAGIC: &[u8; 4] = b"glTF";
const HEADER_BYTES: usize = 12;
const CHUNK_HEADER_BYTES: usize = 8;
const JSON_CHUNK: &[u8; 4] = b"JSON";
const BINARY_CHUNK: &[u8; 4] = b"BIN\0";

/// Splits a file into its JSON text and its binary chunk, if it has one. A file that does not begin with the
/// GLB magic is JSON text as a whole.
pub(super) fn split<'a>(path: &Path, bytes: &'a [u8]) -> Result<(&'a [u8], Option<&'a [u8]>)> {
    let extension_is_glb = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("glb"));
    if !bytes.starts_with(MAGIC) {
        if extension_is_glb {
            return Err(damaged(path, "not a GLB file: it does not begin with `glTF`"));
        }
        return Ok((bytes, None));
    }
    let version = word(bytes, 4).ok_or_else(|| damaged(path, "the GLB header is cut short"))?;
    let length = word(bytes, 8).ok_or_else(|| damaged(path, "the GLB header is cut short"))?;
    if version != 2 {
        return Err(other_version(path, &format!("{version}.0")));
    }
    if length as usize > bytes.len() || (length as usize) < HEADER_BYTES {
        return Err(damaged(
            path,
            format!("the GLB header says {length} bytes, but the file has {}", bytes.len()),
        ));
    }
    let (kind, text, rest) = chunk(path, &bytes[HEADER_BYTES..length as usize])?;
    if kind != JSON_CHUNK {
        return Err(damaged(path, "the first GLB chunk is not JSON"));
    }
    // Chunks of other kinds belong to extensions; the specification says to skip them.
    let mut rest = rest;
    while !rest.is_empty() {
        let (kind, content, after) = chunk(path, rest)?;
        if kind == BINARY_CHUNK {
            return Ok((text, Some(content)));
        }
        rest = after;
    }
    Ok((text, None))
}

/// The kind and the content of the chunk at the start of `bytes`, and the bytes after it.
fn chunk<'a>(path: &Path, bytes: &'a [u8]) -> Result<(&'a [u8], &'a [u8], &'a [u8])> {
    let length = word(bytes, 0).map(|length| length as usize);
    let kind = bytes.get(4..CHUNK_HEADER_BYTES);
    let (Some(length), Some(kind)) = (length, kind) else {
        return Err(damaged(path, "a GLB chunk header is cut short"));
    };
    let content = bytes[CHUNK_HEADER_BYTES..]
        .split_at_checked(length)
        .ok_or_else(|| damaged(path, format!("a GLB chunk says {length} bytes, but the file ends before")))?;
    Ok((kind, content.0, content.1))
}

/// The little-endian integer at byte `at`.
fn word(bytes: &[u8], at: usize) -> Option<u32> {
    let four = bytes.get(at..at + 4)?;
    Some(u32::from_le_bytes([four[0], four[1], four[2], four[3]]))
}

/// The error about a file of another version of glTF than 2.
pub(super) fn other_version(path: &Path, version: &str) -> crate::error::Error {
    let help = if version.starts_with("1.") {
        "convert it: npx gltf-pipeline -i OLD.gltf -o NEW.glb (or export the scene again as glTF 2.0)"
    } else {
        "export the scene as glTF 2.0"
    };
    fault(path, format!("glTF version `{version}` is not supported"), help)
}

fn damaged(path: &Path, what: impl Into<String>) -> crate::error::Error {
    fault(path, what, "the file is damaged or not glTF 2.0: copy or export it again")
}
