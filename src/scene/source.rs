//! Helpers of all scene loaders: errors about a file, files next to the scene, warnings, and the content
//! hash.

use std::borrow::Cow;
use std::collections::HashSet;
use std::path::{Path, PathBuf};

use crate::error::{Error, Result};
use crate::file;

/// An error about the file at `path`.
pub(super) fn fault(path: &Path, fault: impl Into<String>, help: impl Into<String>) -> Error {
    Error::Scene { path: path.to_path_buf(), fault: fault.into(), help: help.into() }
}

/// Reads the scene's own file.
///
/// # Errors
/// [`Error::Read`] when it cannot be read, [`Error::Scene`] when it only stands for a file that is elsewhere.
pub(super) fn read_scene(path: &Path) -> Result<Vec<u8>> {
    file::read(path).and_then(|bytes| not_a_pointer(path, bytes))
}

/// Reads a file that the scene file `scene` refers to. `path` is already resolved; `what` names the object
/// that refers to it (`buffer 0`).
pub(super) fn read(scene: &Path, what: &str, path: &Path) -> Result<Vec<u8>> {
    if is_missing(path) {
        return Err(fault(
            path,
            format!("no such file, but {what} of {} refers to it", scene.display()),
            "a scene may be several files: put this one where the scene names it, or get the scene as one .glb",
        ));
    }
    if std::fs::metadata(path).is_ok_and(|metadata| !metadata.is_file()) {
        return Err(fault(
            path,
            format!("not a file, but {what} of {} refers to it", scene.display()),
            "correct the reference in the scene",
        ));
    }
    file::read(path).and_then(|bytes| not_a_pointer(path, bytes))
}

/// Refuses the few lines by which Git LFS stands for a large file that was not fetched.
fn not_a_pointer(path: &Path, bytes: Vec<u8>) -> Result<Vec<u8>> {
    if bytes.starts_with(b"version https://git-lfs.github.com/spec/") {
        return Err(fault(
            path,
            "not the file itself, but a pointer of Git LFS to it",
            "fetch the file: git lfs pull, or download it by itself",
        ));
    }
    Ok(bytes)
}

/// The text of a file, in UTF-8 or, where it begins with a byte order mark, in UTF-16; what is neither is replaced.
pub(super) fn text(bytes: &[u8]) -> Cow<'_, str> {
    let wide = |read: fn([u8; 2]) -> u16| {
        let units = bytes[2..].as_chunks::<2>().0.iter().map(|&unit| read(unit));
        Cow::Owned(
            char::decode_utf16(units).map(|unit| unit.unwrap_or(char::REPLACEMENT_CHARACTER)).collect(),
        )
    };
    match bytes {
        [0xFE, 0xFF, ..] => wide(u16::from_be_bytes),
        [0xFF, 0xFE, ..] => wide(u16::from_le_bytes),
        [0xEF, 0xBB, 0xBF, rest @ ..] => String::from_utf8_lossy(rest),
        _ => String::from_utf8_lossy(bytes),
    }
}

/// The file that a path names that is no relative one, such as that of another computer: the one of the same name next to the scene.
pub(super) fn same_name(scene: &Path, elsewhere: &str) -> Option<PathBuf> {
    let name = elsewhere.rsplit(['/', '\\']).next().filter(|name| !name.is_empty() && !name.contains(':'))?;
    next_to(scene, name).ok()
}

/// Whether there is nothing at a path.
pub(super) fn is_missing(path: &Path) -> bool {
    std::fs::metadata(path).is_err_and(|error| error.kind() == std::io::ErrorKind::NotFound)
}

/// Resolves the relative path by which `scene` refers to a file. `Err` says why the path is not relative.
pub(super) fn next_to(scene: &Path, relative: &str) -> std::result::Result<PathBuf, &'static str> {
    // The part before a colon is a URI scheme or a drive.
    if relative.split(['/', '\\']).next().unwrap_or_default().contains(':') {
        return Err("not a relative path");
    }
    if relative.starts_with(['/', '\\']) {
        return Err("an absolute path");
    }
    Ok(scene.parent().map(|folder| folder.join(relative)).unwrap_or_else(|| relative.into()))
}

/// The warnings of a loader, each at most once, in the order in which they came up.
#[derive(Default)]
pub(super) struct Warnings {
    pub list: Vec<String>,
    seen: HashSet<String>,
}

impl Warnings {
    /// Adds `warning` unless there is one about `subject` already.
    pub(super) fn add_once(&mut self, subject: &str, warning: impl Into<String>) {
        if self.seen.insert(subject.into()) {
            self.list.push(warning.into());
        }
    }

    /// Adds `warning` unless the same text is there already.
    pub(super) fn add(&mut self, warning: impl Into<String>) {
        let warning = warning.into();
        if self.seen.insert(warning.clone()) {
            self.list.push(warning);
        }
    }
}

/// A BLAKE3 hash of a sequence of byte strings. Each string is preceded by its length, so that sequences with
/// the same concatenation but other boundaries have different hashes.
#[derive(Default)]
pub(super) struct ContentHash(blake3::Hasher);

impl ContentHash {
    pub(super) fn add(&mut self, bytes: &[u8]) {
        self.0.update(&(bytes.len() as u64).to_le_bytes());
        self.0.update(bytes);
    }

    pub(super) fn finish(&self) -> [u8; 32] {
        *self.0.finalize().as_bytes()
    }
}
