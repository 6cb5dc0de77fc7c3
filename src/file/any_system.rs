//! Windows and other systems: every part of a path is checked before it is used. Another program could put a link there after the check; on Windows a
//! file is then opened as the link itself, and refused.

use std::fs::{self, File, OpenOptions};
use std::io;
use std::path::{Path, PathBuf};

use super::spot::{Access, Kind};

/// A folder by its path.
#[cfg_attr(unix, allow(dead_code, reason = "on Unix only the tests use it"))]
pub(super) struct Folder(PathBuf);

#[cfg_attr(unix, allow(dead_code, reason = "on Unix only the tests use it"))]
impl Folder {
    pub(super) fn current() -> Self {
        Self(PathBuf::new())
    }

    pub(super) fn open(path: &Path) -> io::Result<Self> {
        fs::metadata(path).map(|_| Self(path.to_path_buf()))
    }

    /// The folder of this name in this one.
    pub(super) fn enter(&self, name: &Path) -> io::Result<Self> {
        match self.kind(name, false)? {
            Kind::Folder => Ok(Self(self.0.join(name))),
            kind => Err(super::no_folder(name, kind)),
        }
    }

    pub(super) fn make(&self, name: &Path) -> io::Result<()> {
        fs::create_dir(self.0.join(name))
    }

    pub(super) fn kind(&self, name: &Path, follow: bool) -> io::Result<Kind> {
        let path = self.0.join(name);
        let about = if follow { fs::metadata(path) } else { fs::symlink_metadata(path) };
        Ok(Kind::of(about?.file_type()))
    }

    pub(super) fn open_file(&self, name: &Path, access: Access, follow: bool) -> io::Result<File> {
        let mut options = OpenOptions::new();
        options.read(true).write(access != Access::Read).create(access == Access::Make);
        options.create_new(access == Access::New);
        if !follow {
            open_links_themselves(&mut options);
        }
        options.open(self.0.join(name))
    }

    pub(super) fn rename(&self, from: &Path, to: &Path) -> io::Result<()> {
        fs::rename(self.0.join(from), self.0.join(to))
    }

    pub(super) fn remove_file(&self, name: &Path) -> io::Result<()> {
        fs::remove_file(self.0.join(name))
    }
}

#[cfg(windows)]
fn open_links_themselves(options: &mut OpenOptions) {
    const FILE_FLAG_OPEN_REPARSE_POINT: u32 = 0x0020_0000;
    std::os::windows::fs::OpenOptionsExt::custom_flags(options, FILE_FLAG_OPEN_REPARSE_POINT);
}

#[cfg(not(windows))]
fn open_links_themselves(_: &mut OpenOptions) {}
