//! The lock that admits one writer at a time.

use std::fs::{File, TryLockError};
use std::io::{Read, Write};
use std::path::Path;
use std::time::Duration;

use crate::error::{Error, Result};

/// Takes the journal's lock for this process. The lock is released when the returned file is closed, however
/// the process ends.
///
/// # Errors
/// [`Error::Journal`] naming the file and the process that holds the lock.
pub(super) fn take(path: &Path) -> Result<File> {
    let unusable = |source: std::io::Error| Error::Journal {
        path: path.into(),
        fault: format!("a journal cannot be written here: {source}"),
        help: "name a folder that can be written, on a file system with locks".into(),
    };
    let mut file = crate::file::open_or_make(path).map_err(unusable)?;
    match lock_with_retries(&file) {
        Ok(()) => {}
        Err(TryLockError::WouldBlock) => {
            let mut holder = String::new();
            // The process id is needed for the message only, so an error here is ignored.
            let _ = file.read_to_string(&mut holder);
            let holder = holder.trim();
            let who = if holder.is_empty() { "another process".into() } else { format!("process {holder}") };
            return Err(Error::Journal {
                path: path.into(),
                fault: format!("the journal is being written by {who}"),
                help: "wait until that run has ended, or name another folder".into(),
            });
        }
        Err(TryLockError::Error(source)) => return Err(unusable(source)),
    }
    // The process id is for messages only. If the disk is full, writing the journal itself reports that.
    let _ = file.set_len(0).and_then(|()| writeln!(file, "{}", std::process::id()));
    Ok(file)
}

/// Tries for half a second to take the lock. A lock may outlive its holder for a moment: until the system has
/// cleaned up after a killed process, or until a forked child process has started its own program.
fn lock_with_retries(file: &File) -> std::result::Result<(), TryLockError> {
    for _ in 0..50 {
        match file.try_lock() {
            Err(TryLockError::WouldBlock) => std::thread::sleep(Duration::from_millis(10)),
            taken_or_broken => return taken_or_broken,
        }
    }
    file.try_lock()
}
