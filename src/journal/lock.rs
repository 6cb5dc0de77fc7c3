//! One writer at a time.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{Read, Write};
use std::path::Path;

use crate::error::{Error, Result};

/// Takes the journal's lock for this process; it is given back when the file is closed, however the process ends.
///
/// # Errors
/// [`Error::Journal`] naming the file, and the process that has it.
pub(super) fn take(path: &Path) -> Result<File> {
    let unusable = |source: std::io::Error| Error::Journal {
        path: path.into(),
        fault: format!("a journal cannot be written here: {source}"),
        help: "name a folder that can be written, on a file system with locks".into(),
    };
    let opened = OpenOptions::new().read(true).write(true).create(true).truncate(false).open(path);
    let mut file = opened.map_err(unusable)?;
    match file.try_lock() {
        Ok(()) => {}
        Err(TryLockError::WouldBlock) => {
            let mut holder = String::new();
            // Only for the message: without it, the journal is in use all the same.
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
    // The same: a full disk is for the journal itself to report.
    let _ = file.set_len(0).and_then(|()| writeln!(file, "{}", std::process::id()));
    Ok(file)
}
