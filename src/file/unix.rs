//! Linux and macOS: files are opened relative to the descriptor of their folder, which was itself reached without following a link.

use std::fs::File;
use std::io;
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::path::Path;

use rustix::fs::{AtFlags, CWD, FileType, Mode, OFlags, mkdirat, openat, renameat, statat, unlinkat};

use super::spot::{Access, Kind};

/// An open folder; `None` is the current one.
pub(super) struct Folder(Option<OwnedFd>);

const FOLDER: OFlags = OFlags::DIRECTORY.union(OFlags::CLOEXEC);

impl Folder {
    pub(super) fn current() -> Self {
        Self(None)
    }

    pub(super) fn open(path: &Path) -> io::Result<Self> {
        Ok(Self(Some(openat(CWD, path, FOLDER, Mode::empty())?)))
    }

    /// The folder of this name in this one.
    pub(super) fn enter(&self, name: &Path) -> io::Result<Self> {
        match openat(self.at(), name, FOLDER | OFlags::NOFOLLOW, Mode::empty()) {
            Ok(folder) => Ok(Self(Some(folder))),
            Err(error) => {
                let kind = self.kind(name, false)?;
                Err(if kind == Kind::Folder { error.into() } else { super::no_folder(name, kind) })
            }
        }
    }

    pub(super) fn make(&self, name: &Path) -> io::Result<()> {
        Ok(mkdirat(self.at(), name, Mode::from_raw_mode(0o777))?)
    }

    pub(super) fn kind(&self, name: &Path, follow: bool) -> io::Result<Kind> {
        let flags = if follow { AtFlags::empty() } else { AtFlags::SYMLINK_NOFOLLOW };
        Ok(match FileType::from_raw_mode(statat(self.at(), name, flags)?.st_mode) {
            FileType::RegularFile => Kind::File,
            FileType::Directory => Kind::Folder,
            FileType::Symlink => Kind::Link,
            _ => Kind::Other,
        })
    }

    /// Opens a file without waiting, also where it has become a pipe.
    pub(super) fn open_file(&self, name: &Path, access: Access, follow: bool) -> io::Result<File> {
        let how = match access {
            Access::Read => OFlags::RDONLY,
            Access::Change => OFlags::RDWR,
            Access::Make => OFlags::RDWR | OFlags::CREATE,
            Access::New => OFlags::RDWR | OFlags::CREATE | OFlags::EXCL,
        };
        let links = if follow { OFlags::empty() } else { OFlags::NOFOLLOW };
        let flags = how | links | OFlags::NONBLOCK | OFlags::CLOEXEC;
        Ok(openat(self.at(), name, flags, Mode::from_raw_mode(0o666))?.into())
    }

    pub(super) fn rename(&self, from: &Path, to: &Path) -> io::Result<()> {
        Ok(renameat(self.at(), from, self.at(), to)?)
    }

    pub(super) fn remove_file(&self, name: &Path) -> io::Result<()> {
        Ok(unlinkat(self.at(), name, AtFlags::empty())?)
    }

    fn at(&self) -> BorrowedFd<'_> {
        self.0.as_ref().map_or(CWD, AsFd::as_fd)
    }
}
