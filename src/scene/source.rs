//! Helpers of all scene loaders: errors about a file, files next to the scene, warnings, and the content
//! hash.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use crate::error::{Error, Result};
use crate::file;

/// An error about the file at `path`.
pub(super) fn fault(path: &Path, fault: impl Into<String>, help: impl Into<String>) -> Error {
    Error::Scene { path: path.to_path_buf(), fault: fault.into(), help: help.into() }
}

/// Reads a file that the scene file `scene` refers to. `path` is already resolved; `what` names the object
/// that refers to it (`buffer 0`).
pub(super) fn read(scene: &Path, what: &str, path: &Path) -> Result<Vec<u8>> {
    if std::fs::metadata(path).is_ok_and(|metadata| !metadata.is_file()) {
        return Err(fault(
            path,
            format!("not a file, but {what} of {} refers to it", scene.display()),
            "correct the reference in the scene",
        ));
    }
    file::read(path)
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
