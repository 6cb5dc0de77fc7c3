//! Files that appear as a whole or not at all.

use std::ffi::OsString;
use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter, Write};
use std::path::Path;

use tempfile::NamedTempFile;

use crate::error::{Error, Result};

/// Writes a file by way of a temporary one in the same folder, which is flushed to the disk and then renamed.
///
/// Whoever reads `path` at any moment, also after a crash or a full disk, finds the old content or the new, never a
/// part. A symbolic link is followed; what is no regular file (a pipe, `/dev/stdout`) is written directly.
///
/// # Errors
/// [`Error::Write`] naming `path` (not the temporary file) for anything that goes wrong, in `fill` too; the
/// temporary file is removed.
pub fn write_with(path: &Path, fill: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>) -> Result<()> {
    write_steps(path, fill).map_err(Error::writing(path))
}

/// Writes `bytes` as [`write_with`] does.
///
/// # Errors
/// [`Error::Write`] naming `path`.
pub fn write_bytes(path: &Path, bytes: &[u8]) -> Result<()> {
    write_with(path, |file| file.write_all(bytes))
}

/// Whether `path` could be written now: an early answer, before hours of work.
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
        // It may have been removed since it was looked at: then there is nothing to follow.
        Ok(_) => fs::canonicalize(path).unwrap_or_else(|_| path.to_path_buf()),
        Err(_) => path.to_path_buf(),
    };
    // Dropping the temporary path removes the file, unless the file has been renamed.
    let (file, temporary) = temporary_beside(&target)?.into_parts();
    let mut file = BufWriter::new(file);
    fill(&mut file)?;
    file.flush()?;
    file.get_ref().sync_all()?;
    temporary.persist(&target).map_err(|failed| failed.error)
}

/// A new file `.NAME.RANDOM.tmp` in the folder of `target`.
///
/// The file is opened here and not by `tempfile`, whose files only their owner can read: it has the permissions of any new file.
fn temporary_beside(target: &Path) -> io::Result<NamedTempFile> {
    let name = target
        .file_name()
        .ok_or_else(|| io::Error::new(io::ErrorKind::InvalidInput, "the path names no file"))?;
    let mut prefix = OsString::from(".");
    prefix.push(name);
    prefix.push(".");
    let folder = target.parent().unwrap_or(Path::new(""));
    tempfile::Builder::new()
        .prefix(&prefix)
        .suffix(".tmp")
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
