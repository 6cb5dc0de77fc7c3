//! What every loader needs: errors about a file, the files next to it, warnings, and the hash of it all.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use crate::error::{Error, Result};

/// An error about the file at `path`.
pub(super) fn fault(path: &Path, fault: impl Into<String>, help: impl Into<String>) -> Error {
    Error::Scene { path: path.to_path_buf(), fault: fault.into(), help: help.into() }
}

/// Reads the file that `scene` refers to as `path`, which is already resolved. `what` names its user (`buffer 0`).
pub(super) fn read(scene: &Path, what: &str, path: &Path) -> Result<Vec<u8>> {
    // A scene from elsewhere may name a device or a pipe, and reading that would never end.
    let metadata = std::fs::metadata(path).map_err(Error::reading(path))?;
    if !metadata.is_file() {
        return Err(fault(
            path,
            format!("not a file, but {what} of {} refers to it", scene.display()),
            "correct the reference in the scene",
        ));
    }
    std::fs::read(path).map_err(Error::reading(path))
}

/// The path of a file that `scene` refers to by a relative path. `Err` says what is wrong with it.
pub(super) fn next_to(scene: &Path, relative: &str) -> std::result::Result<PathBuf, &'static str> {
    // The part before a colon is a scheme or a drive.
    if relative.split(['/', '\\']).next().unwrap_or_default().contains(':') {
        return Err("not a relative path");
    }
    if relative.starts_with(['/', '\\']) {
        return Err("an absolute path");
    }
    Ok(scene.parent().map(|folder| folder.join(relative)).unwrap_or_else(|| relative.into()))
}

/// What was ignored, once each, in the order met.
#[derive(Default)]
pub(super) struct Warnings {
    pub list: Vec<String>,
    seen: HashSet<String>,
}

impl Warnings {
    /// Adds `warning` unless there was one about `subject`.
    pub(super) fn add_once(&mut self, subject: &str, warning: impl Into<String>) {
        if self.seen.insert(subject.into()) {
            self.list.push(warning.into());
        }
    }

    pub(super) fn add(&mut self, warning: impl Into<String>) {
        let warning = warning.into();
        if self.seen.insert(warning.clone()) {
            self.list.push(warning);
        }
    }
}

/// BLAKE3 over a sequence of byte strings; each is preceded by its length, so that no two sequences collide by
/// moving a boundary.
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
