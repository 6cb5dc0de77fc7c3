//! Atomic file writes: a file appears completely or not at all.

mod leftover;

use std::ffi::OsString;
use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

use super::spot::{Kind, Spot};
use crate::error::{Error, Result};

/// Writes a file atomically: a temporary file in the same folder is filled, flushed to disk and renamed.
///
/// A reader of `path` always finds the complete old or the complete new content, even after a crash or on a full disk. In a run's folder and in the
/// cache, links and pipes are refused. Elsewhere, links are followed, and files that are not regular (a pipe, `/dev/stdout`) are written directly.
///
/// # Errors
/// [`Error::Write`] naming `path` (not the temporary file) for any failure, including those of `fill`; the temporary file is
/// removed.
pub fn write_with(path: &Path, fill: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>) -> Result<()> {
    write_steps(path, fill).map_err(Error::writing(path))
}

/// Writes `bytes` atomically; see [`write_with`].
///
/// # Errors
/// [`Error::Write`] naming `path`.
pub fn write_bytes(path: &Path, bytes: &[u8]) -> Result<()> {
    write_with(path, |file| file.write_all(bytes))
}

/// Checks that `path` can be written, so that a long run fails early.
///
/// # Errors
/// [`Error::Write`] naming `path`.
pub fn check_writable(path: &Path) -> Result<()> {
    let probe = || match Target::of(path)? {
        Target::Stream => OpenOptions::new().write(true).open(path).map(drop),
        Target::File(spot, path) => Temporary::beside(&spot, &path).map(drop),
    };
    probe().map_err(Error::writing(path))
}

fn write_steps(path: &Path, fill: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>) -> io::Result<()> {
    match Target::of(path)? {
        Target::Stream => {
            let mut stream = BufWriter::new(OpenOptions::new().write(true).open(path)?);
            fill(&mut stream)?;
            stream.flush()
        }
        Target::File(spot, path) => {
            let (temporary, file) = Temporary::beside(&spot, &path)?;
            let mut file = BufWriter::new(file);
            fill(&mut file)?;
            file.flush()?;
            file.get_ref().sync_all()?;
            spot.take_from(&temporary.name)
        }
    }
}

/// Where a path that is to be written leads.
enum Target {
    /// To a regular file, or to none yet; with the path after links of the user's.
    File(Spot, PathBuf),
    /// To a pipe or a device that the user named.
    Stream,
}

impl Target {
    fn of(path: &Path) -> io::Result<Self> {
        let spot = Spot::of(path)?;
        match spot.kind()? {
            Some(Kind::Folder) => Err(ErrorKind::IsADirectory.into()),
            Some(Kind::Other) if !spot.is_ours => Ok(Self::Stream),
            Some(Kind::File) if !spot.is_ours => {
                // The file may have been removed meanwhile; then there is no link to follow.
                let real = fs::canonicalize(path).unwrap_or_else(|_| path.to_path_buf());
                Ok(Self::File(Spot::of(&real)?, real))
            }
            Some(kind) => kind.require_file().map(|()| Self::File(spot, path.to_path_buf())),
            None => Ok(Self::File(spot, path.to_path_buf())),
        }
    }
}

/// A file `.NAME.PID-SYSTEM-NUMBER.tmp` beside the one that it becomes. It is removed unless it has been renamed.
struct Temporary<'a> {
    target: &'a Spot,
    name: PathBuf,
}

impl<'a> Temporary<'a> {
    /// Creates it. Those that killed processes left in the folder are removed.
    fn beside(target: &'a Spot, path: &Path) -> io::Result<(Self, File)> {
        static NUMBER: AtomicU64 = AtomicU64::new(0);
        let name = path
            .file_name()
            .ok_or_else(|| io::Error::new(ErrorKind::InvalidInput, "the path names no file"))?;
        let folder = path.parent().unwrap_or(Path::new(""));
        leftover::remove(if folder.as_os_str().is_empty() { Path::new(".") } else { folder });
        loop {
            let number = NUMBER.fetch_add(1, Ordering::Relaxed);
            let mut own = OsString::from(".");
            own.push(name);
            own.push(format!(".{}{number:06}{}", leftover::writer(), leftover::SUFFIX));
            let name = target.sibling(&own);
            match target.create_sibling(&name) {
                Ok(file) => return Ok((Self { target, name }, file)),
                // An earlier process of the same number left it.
                Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
                Err(error) => return Err(error),
            }
        }
    }
}

impl Drop for Temporary<'_> {
    fn drop(&mut self) {
        // After renaming there is none.
        let _ = self.target.remove_sibling(&self.name);
    }
}

#[cfg(all(test, unix))]
mod tests {
    use std::os::unix::fs::PermissionsExt;

    use super::*;

    #[test]
    fn a_file_has_the_permissions_of_any_new_file() {
        let folder = tempfile::tempdir().expect("a temporary folder can be made");
        let [plain, atomic] = ["plain", "atomic"].map(|name| folder.path().join(name));
        fs::write(&plain, "").expect("the folder is writable");
        write_bytes(&atomic, b"").expect("the folder is writable");
        let [expected, found] =
            [plain, atomic].map(|path| fs::metadata(path).expect("it is there").permissions().mode());
        assert_eq!(found, expected);
    }

    #[test]
    fn a_failure_leaves_no_temporary_file() {
        let folder = tempfile::tempdir().expect("a temporary folder can be made");
        let path = folder.path().join("result");
        assert!(write_with(&path, |_| Err(ErrorKind::StorageFull.into())).is_err());
        check_writable(&path).expect("the folder is writable");
        assert_eq!(fs::read_dir(folder.path()).expect("it is there").count(), 0);
    }
}
