//! Atomic file writes: a file appears completely or not at all.

mod leftover;

use std::ffi::OsString;
use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter, Write};
use std::path::Path;

use tempfile::NamedTempFile;

use crate::error::{Error, Result};

/// Writes a file atomically: a temporary file in the same folder is filled, flushed to disk and renamed.
///
/// A reader of `path` always finds the complete old or the complete new content, even after a crash or on a full disk. Symbolic
/// links are followed; files that are not regular (a pipe, `/dev/stdout`) are written directly.
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
    let probe = || match fs::metadata(path) {
        Ok(there) if there.is_dir() => Err(io::Error::from(io::ErrorKind::IsADirectory)),
        Ok(there) if !there.is_file() => OpenOptions::new().write(true).open(path).map(drop),
        _ => temporary_beside(path)?.close(),
    };
    probe().map_err(Error::writing(path))
}

fn write_steps(path: &Path, fill: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>) -> io::Result<()> {
    let target = match fs::metadata(path) {
        Ok(there) if there.is_dir() => return Err(io::Error::from(io::ErrorKind::IsADirectory)),
        Ok(there) if !there.is_file() => {
            let mut stream = BufWriter::new(OpenOptions::new().write(true).open(path)?);
            fill(&mut stream)?;
            return stream.flush();
        }
        // The file may have been removed since `metadata`; then there is no link to follow.
        Ok(_) => fs::canonicalize(path).unwrap_or_else(|_| path.to_path_buf()),
        Err(_) => path.to_path_buf(),
    };
    // Dropping the temporary path removes the file unless it has been renamed.
    let (file, temporary) = temporary_beside(&target)?.into_parts();
    let mut file = BufWriter::new(file);
    fill(&mut file)?;
    file.flush()?;
    file.get_ref().sync_all()?;
    temporary.persist(&target).map_err(|failed| failed.error)
}

/// Creates `.NAME.PID-SYSTEM-RANDOM.tmp` in the folder of `target`. Those that killed processes left there are removed.
///
/// The file is opened here because files of `tempfile` are readable by their owner only; this one gets the default permissions.
fn temporary_beside(target: &Path) -> io::Result<NamedTempFile> {
    let name = target
        .file_name()
        .ok_or_else(|| io::Error::new(io::ErrorKind::InvalidInput, "the path names no file"))?;
    let mut prefix = OsString::from(".");
    prefix.push(name);
    prefix.push(".");
    prefix.push(leftover::writer());
    let folder = target.parent().unwrap_or(Path::new(""));
    leftover::remove(if folder.as_os_str().is_empty() { Path::new(".") } else { folder });
    tempfile::Builder::new()
        .prefix(&prefix)
        .suffix(leftover::SUFFIX)
        .make_in(folder, |path| OpenOptions::new().write(true).create_new(true).open(path))
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
        assert!(write_with(&path, |_| Err(io::ErrorKind::StorageFull.into())).is_err());
        check_writable(&path).expect("the folder is writable");
        assert_eq!(fs::read_dir(folder.path()).expect("it is there").count(), 0);
    }
}
