//! Reading of files that a user or another file names: a device, a pipe or a file of the system's is refused, since reading it might never
//! end.

use std::fs::{self, File};
use std::io::{self, ErrorKind};
use std::path::Path;

use crate::error::{Error, Result};
use crate::machine;

/// Opens a regular file for reading.
///
/// # Errors
/// [`Error::Read`] naming the file, also when it is none.
pub(crate) fn open(path: &Path) -> Result<File> {
    require_regular(path).and_then(|()| File::open(path)).map_err(Error::reading(path))
}

/// Checks that a path names a regular file.
///
/// # Errors
/// As [`open()`].
pub(crate) fn require(path: &Path) -> Result<()> {
    require_regular(path).map_err(Error::reading(path))
}

/// The bytes of a regular file.
///
/// # Errors
/// As [`open()`].
pub(crate) fn read(path: &Path) -> Result<Vec<u8>> {
    require_readable(path).and_then(|()| fs::read(path)).map_err(Error::reading(path))
}

/// The text of a regular file in UTF-8.
///
/// # Errors
/// As [`open()`].
pub(crate) fn read_text(path: &Path) -> Result<String> {
    require_readable(path).and_then(|()| fs::read_to_string(path)).map_err(Error::reading(path))
}

/// As [`require_regular`], for a file that is read as a whole: it must not take more than half of the memory.
fn require_readable(path: &Path) -> io::Result<()> {
    require_regular(path)?;
    let (bytes, most) = (fs::metadata(path)?.len(), machine::memory() / 2);
    if bytes > most {
        let what = format!("its {} MiB are more than half of the memory", bytes >> 20);
        return Err(io::Error::new(ErrorKind::FileTooLarge, what));
    }
    Ok(())
}

/// Whether a path names a regular file; the error says what it is.
fn require_regular(path: &Path) -> io::Result<()> {
    let refusal = |what: &str| Err(io::Error::new(ErrorKind::InvalidInput, what));
    let metadata = fs::metadata(path)?;
    if metadata.is_dir() {
        return refusal("it is a folder; give a file");
    }
    if !metadata.is_file() {
        return refusal("it is a device or a pipe; give a file on disk");
    }
    // The system makes the content of these up while it is read.
    let real = fs::canonicalize(path)?;
    if ["/proc", "/sys"].iter().any(|folder| real.starts_with(folder)) {
        return refusal("it is not on disk, but made up by the system; give a file on disk");
    }
    Ok(())
}
