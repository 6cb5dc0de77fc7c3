//! Files that appear as a whole or not at all.

use std::ffi::OsString;
use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

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
        _ => {
            let (temporary, _) = temporary_beside(path)?;
            fs::remove_file(&temporary)
        }
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
    let (temporary, file) = temporary_beside(&target)?;
    let written = fill_and_sync(file, fill).and_then(|()| fs::rename(&temporary, &target));
    if written.is_err() {
        // The first failure is the one to report; one that keeps the leftover from being removed adds nothing.
        let _ = fs::remove_file(&temporary);
    }
    written
}

fn fill_and_sync(file: File, fill: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>) -> io::Result<()> {
    let mut file = BufWriter::new(file);
    fill(&mut file)?;
    file.flush()?;
    file.get_ref().sync_all()
}

/// A new file, `.NAME.PID-COUNT.tmp`, that neither another process nor another thread of this one has. What a process that was
/// killed left behind, whose number may come again, is passed over.
fn temporary_beside(target: &Path) -> io::Result<(PathBuf, File)> {
    static COUNT: AtomicU64 = AtomicU64::new(0);
    let name = target
        .file_name()
        .ok_or_else(|| io::Error::new(io::ErrorKind::InvalidInput, "the path names no file"))?;
    loop {
        let mut hidden = OsString::from(".");
        hidden.push(name);
        hidden.push(format!(".{}-{}.tmp", std::process::id(), COUNT.fetch_add(1, Ordering::Relaxed)));
        let path = target.with_file_name(hidden);
        match OpenOptions::new().write(true).create_new(true).open(&path) {
            Ok(file) => return Ok((path, file)),
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
            Err(error) => return Err(error),
        }
    }
}
