//! Opens folders, and files in them, on each operating system.

/// The code for Linux and macOS. Files are opened relative to the descriptor of their folder. No link is followed on the way to the folder.
#[cfg(unix)]
pub(super) mod unix {
    use std::fs::File;
    use std::io;
    use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
    use std::path::Path;

    use rustix::fs::{AtFlags, CWD, FileType, Mode, OFlags, mkdirat, openat, renameat, statat, unlinkat};

    use super::super::spot::{Access, FileKind};

    /// An open folder; `None` is the current folder.
    pub struct Folder(Option<OwnedFd>);

    const FOLDER: OFlags = OFlags::DIRECTORY.union(OFlags::CLOEXEC);

    impl Folder {
        pub fn current() -> Self {
            Self(None)
        }

        pub fn open(path: &Path) -> io::Result<Self> {
            Ok(Self(Some(openat(CWD, path, FOLDER, Mode::empty())?)))
        }

        pub fn enter(&self, name: &Path) -> io::Result<Self> {
            match openat(self.at(), name, FOLDER | OFlags::NOFOLLOW, Mode::empty()) {
                Ok(folder) => Ok(Self(Some(folder))),
                Err(error) => {
                    let kind = self.kind(name, false)?;
                    Err(if kind == FileKind::Folder {
                        error.into()
                    } else {
                        super::super::no_folder(name, kind)
                    })
                }
            }
        }

        pub fn make(&self, name: &Path) -> io::Result<()> {
            Ok(mkdirat(self.at(), name, Mode::from_raw_mode(0o777))?)
        }

        pub fn kind(&self, name: &Path, follow: bool) -> io::Result<FileKind> {
            let flags = if follow { AtFlags::empty() } else { AtFlags::SYMLINK_NOFOLLOW };
            Ok(match FileType::from_raw_mode(statat(self.at(), name, flags)?.st_mode) {
                FileType::RegularFile => FileKind::File,
                FileType::Directory => FileKind::Folder,
                FileType::Symlink => FileKind::Link,
                _ => FileKind::Other,
            })
        }

        /// Opens a file without waiting, even if a pipe has replaced the file.
        pub fn open_file(&self, name: &Path, access: Access, follow: bool) -> io::Result<File> {
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

        pub fn rename(&self, from: &Path, to: &Path) -> io::Result<()> {
            Ok(renameat(self.at(), from, self.at(), to)?)
        }

        pub fn remove_file(&self, name: &Path) -> io::Result<()> {
            Ok(unlinkat(self.at(), name, AtFlags::empty())?)
        }

        fn at(&self) -> BorrowedFd<'_> {
            self.0.as_ref().map_or(CWD, AsFd::as_fd)
        }
    }
}

/// The code for Windows and other systems. Every part of a path is checked before it is used. If another program puts a link there after
/// the check, Windows opens the link itself, which is then refused.
#[cfg(any(not(unix), test))]
pub(super) mod any_system {
    use std::fs::{self, File, OpenOptions};
    use std::io;
    use std::path::{Path, PathBuf};

    use super::super::spot::{Access, FileKind};

    #[cfg_attr(unix, allow(dead_code, reason = "on Unix only the tests use it"))]
    pub struct Folder(PathBuf);

    #[cfg_attr(unix, allow(dead_code, reason = "on Unix only the tests use it"))]
    impl Folder {
        pub fn current() -> Self {
            Self(PathBuf::new())
        }

        pub fn open(path: &Path) -> io::Result<Self> {
            fs::metadata(path).map(|_| Self(path.to_path_buf()))
        }

        pub fn enter(&self, name: &Path) -> io::Result<Self> {
            match self.kind(name, false)? {
                FileKind::Folder => Ok(Self(self.0.join(name))),
                kind => Err(super::super::no_folder(name, kind)),
            }
        }

        pub fn make(&self, name: &Path) -> io::Result<()> {
            fs::create_dir(self.0.join(name))
        }

        pub fn kind(&self, name: &Path, follow: bool) -> io::Result<FileKind> {
            let path = self.0.join(name);
            let about = if follow { fs::metadata(path) } else { fs::symlink_metadata(path) };
            Ok(FileKind::of(about?.file_type()))
        }

        pub fn open_file(&self, name: &Path, access: Access, follow: bool) -> io::Result<File> {
            let mut options = OpenOptions::new();
            options.read(true).write(access != Access::Read).create(access == Access::Make);
            options.create_new(access == Access::New);
            if !follow {
                open_links_themselves(&mut options);
            }
            options.open(self.0.join(name))
        }

        pub fn rename(&self, from: &Path, to: &Path) -> io::Result<()> {
            fs::rename(self.0.join(from), self.0.join(to))
        }

        pub fn remove_file(&self, name: &Path) -> io::Result<()> {
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
}
