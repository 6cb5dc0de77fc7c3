//! Paths, and the files to which they lead. Below the top folder of a run or of the cache, no link is followed, because an archive from a
//! stranger may contain links to any of the user's files.

use std::collections::BTreeSet;
use std::ffi::OsStr;
use std::fs::{self, File};
use std::io::{self, ErrorKind};
use std::path::{Component, Path, PathBuf, absolute};
use std::sync::{Mutex, PoisonError};

#[cfg(not(unix))]
use super::system::any_system as system;
#[cfg(unix)]
use super::system::unix as system;

/// Absolute paths of the folders below which no link is followed.
static TOPS: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

/// From now on, this process follows no link below `top`, and opens only regular files there. `top` itself may be a link.
pub(crate) fn follow_no_links_below(top: &Path) {
    let top = if top.as_os_str().is_empty() { Path::new(".") } else { top };
    if let Ok(top) = absolute(top) {
        TOPS.lock().unwrap_or_else(PoisonError::into_inner).insert(top);
    }
}

#[derive(Clone, Copy, PartialEq)]
pub(super) enum Access {
    Read,
    Change,
    /// Read and write; the file is created if it does not exist.
    Make,
    /// Read and write; the file must not exist yet.
    New,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum FileKind {
    File,
    Folder,
    Link,
    /// A pipe, a socket or a device.
    Other,
}

impl FileKind {
    pub(super) fn of(kind: fs::FileType) -> Self {
        match kind {
            kind if kind.is_symlink() => Self::Link,
            kind if kind.is_file() => Self::File,
            kind if kind.is_dir() => Self::Folder,
            _ => Self::Other,
        }
    }

    pub(super) fn require_file(self) -> io::Result<()> {
        let what = match self {
            Self::File => return Ok(()),
            Self::Folder => "a folder; give a file",
            Self::Other => "a device or a pipe; give a file on disk",
            Self::Link => LINK,
        };
        Err(io::Error::new(ErrorKind::InvalidInput, format!("it is {what}")))
    }
}

pub(super) const LINK: &str =
    "a link, and no link is followed in the folder of a run or of the cache; remove it";

/// The place of a file: a name in an open folder, or a path that the user gave.
pub(super) struct Spot {
    folder: system::Folder,
    name: PathBuf,
    /// Whether the path lies in the folder of a run or of the cache, where links are not followed.
    pub(super) is_ours: bool,
}

impl Spot {
    /// Follows a path up to its last part. A path outside of all top folders is used unchanged.
    pub(super) fn of(path: &Path) -> io::Result<Self> {
        let Some((top, mut parts)) = below_top(path)? else {
            return Ok(Self { folder: system::Folder::current(), name: path.to_path_buf(), is_ours: false });
        };
        let name = parts.pop().unwrap_or_default();
        let folder = parts.iter().try_fold(system::Folder::open(&top)?, |folder, part| folder.enter(part))?;
        Ok(Self { folder, name, is_ours: true })
    }

    /// The kind of file; `None` if nothing is there. If the user named a link, this is the kind of the file to which the link leads.
    pub(super) fn kind(&self) -> io::Result<Option<FileKind>> {
        match self.folder.kind(&self.name, !self.is_ours) {
            Ok(kind) => Ok(Some(kind)),
            Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
            Err(error) => Err(error),
        }
    }

    /// Opens a regular file. Everything else is refused, because opening a pipe would wait for its other end.
    pub(super) fn open(&self, access: Access) -> io::Result<File> {
        if access != Access::New
            && let Some(kind) = self.kind()?
        {
            kind.require_file()?;
        }
        let file = self.folder.open_file(&self.name, access, !self.is_ours)?;
        // The file may have been replaced since it was checked for the first time.
        FileKind::of(file.metadata()?.file_type()).require_file()?;
        Ok(file)
    }

    pub(super) fn sibling(&self, name: &OsStr) -> PathBuf {
        self.name.with_file_name(name)
    }

    /// Creates a new file of another name in the same folder.
    pub(super) fn create_sibling(&self, name: &Path) -> io::Result<File> {
        self.folder.open_file(name, Access::New, false)
    }

    /// Renames the file `name` in the same folder to this file's name. An existing file of this name is replaced.
    pub(super) fn take_from(&self, name: &Path) -> io::Result<()> {
        self.folder.rename(name, &self.name)
    }

    pub(super) fn remove_sibling(&self, name: &Path) -> io::Result<()> {
        self.folder.remove_file(name)
    }
}

pub(super) fn make_folder(path: &Path) -> io::Result<()> {
    let Some((top, parts)) = below_top(path)? else { return fs::create_dir_all(path) };
    fs::create_dir_all(&top)?;
    let make = |folder: system::Folder, part: &PathBuf| {
        match folder.make(part) {
            Err(error) if error.kind() != ErrorKind::AlreadyExists => return Err(error),
            _ => {}
        }
        folder.enter(part)
    };
    parts.iter().try_fold(system::Folder::open(&top)?, make).map(drop)
}

/// The top folder above a path, and the parts of the path below it. A path with `..` counts as a path outside of all top folders.
fn below_top(path: &Path) -> io::Result<Option<(PathBuf, Vec<PathBuf>)>> {
    let path = absolute(path)?;
    let tops = TOPS.lock().unwrap_or_else(PoisonError::into_inner);
    let Some(top) = path.ancestors().skip(1).filter(|above| tops.contains(*above)).last() else {
        return Ok(None);
    };
    let parts = path.strip_prefix(top).map_or(Vec::new(), |below| below.components().collect());
    let is_plain = parts.iter().all(|part| matches!(part, Component::Normal(_)));
    let parts = parts.into_iter().map(|part| PathBuf::from(part.as_os_str())).collect();
    Ok(is_plain.then(|| (top.to_path_buf(), parts)))
}
