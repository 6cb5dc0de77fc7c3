//! Reads files that the user or another file names, and writes krylux's files.
//!
//! Devices, pipes and files whose content the system generates are refused, because reading them might never end. Below the top folder of a
//! run or of the cache, no link is followed ([`follow_no_links_below`]).

pub mod atomic;
mod spot;
mod system;
#[cfg(all(test, unix))]
mod tests;

use std::fs::{self, File};
use std::io::{self, ErrorKind, Read};
use std::path::Path;

use spot::{Access, Spot};

use crate::error::{Error, Result};
use crate::machine;

pub(crate) use spot::{FileKind, follow_no_links_below};

pub(crate) fn open(path: &Path) -> Result<File> {
    opened(path).map_err(Error::reading(path))
}

pub(crate) fn open_to_change(path: &Path) -> Result<File> {
    Spot::of(path).and_then(|spot| spot.open(Access::Change)).map_err(Error::writing(path))
}

/// Works like [`open_to_change`], but creates the file if it does not exist.
pub(crate) fn open_or_make(path: &Path) -> io::Result<File> {
    Spot::of(path)?.open(Access::Make)
}

/// The kind of file at a path; `None` if nothing is there. Links below a top folder are not followed.
pub(crate) fn kind(path: &Path) -> Result<Option<FileKind>> {
    let found = match Spot::of(path) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
        spot => spot.and_then(|spot| spot.kind()),
    };
    found.map_err(Error::reading(path))
}

pub(crate) fn make_folder(path: &Path) -> Result<()> {
    spot::make_folder(path).map_err(Error::writing(path))
}

/// Removes a file, a link, or a folder with its content, if it exists.
pub(crate) fn remove(path: &Path) -> Result<()> {
    let removed = match fs::symlink_metadata(path) {
        Ok(there) if there.is_dir() => fs::remove_dir_all(path),
        Ok(_) => fs::remove_file(path),
        Err(_) => Ok(()),
    };
    removed.map_err(Error::writing(path))
}

pub(crate) fn read(path: &Path) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let read = opened_to_hold(path).and_then(|mut file| file.read_to_end(&mut bytes));
    read.map_err(Error::reading(path)).map(|_| bytes)
}

pub(crate) fn read_text(path: &Path) -> Result<String> {
    let mut text = String::new();
    let read = opened_to_hold(path).and_then(|mut file| file.read_to_string(&mut text));
    read.map_err(Error::reading(path)).map(|_| text)
}

/// Opens a file that will be read completely. The file must fit into half of the memory.
fn opened_to_hold(path: &Path) -> io::Result<File> {
    let file = opened(path)?;
    let (bytes, most) = (file.metadata()?.len(), machine::memory() / 2);
    if bytes > most {
        let what = format!("its {} MiB are more than half of the memory", bytes >> 20);
        return Err(io::Error::new(ErrorKind::FileTooLarge, what));
    }
    Ok(file)
}

/// Opens a regular file. For everything else, the error says what it is.
fn opened(path: &Path) -> io::Result<File> {
    let file = Spot::of(path)?.open(Access::Read)?;
    // The system generates the content of these folders while it is read.
    let real = fs::canonicalize(path)?;
    if ["/proc", "/sys"].iter().any(|folder| real.starts_with(folder)) {
        let what = "it is not on disk, but made up by the system; give a file on disk";
        return Err(io::Error::new(ErrorKind::InvalidInput, what));
    }
    Ok(file)
}

fn no_folder(name: &Path, kind: FileKind) -> io::Error {
    let what = match kind {
        FileKind::Link => spot::LINK,
        _ => "not a folder",
    };
    io::Error::new(ErrorKind::InvalidInput, format!("{} is {what}", name.display()))
}

/// The reason why users other than root and this process's user may change a file or folder, such as `can be written by everybody`; `None`
/// if they may not.
pub(crate) fn stranger(about: &fs::Metadata) -> Option<String> {
    #[cfg(unix)]
    {
        use std::os::unix::fs::MetadataExt;
        stranger_of(rustix::process::geteuid().as_raw(), (about.uid(), about.mode()))
    }
    // On other systems, only the user may write to the user's folders.
    #[cfg(not(unix))]
    {
        let _ = about;
        None
    }
}

/// Works like [`stranger`], for a user, an owner and a mode. A folder's sticky bit is ignored, since it does not prevent others from adding
/// files.
#[cfg(unix)]
fn stranger_of(user: u32, (owner, mode): (u32, u32)) -> Option<String> {
    if owner != user && owner != 0 {
        return Some(format!("belongs to user {owner}, and krylux runs as user {user}"));
    }
    let others = if mode & 0o002 != 0 { "everybody" } else { "its group" };
    (mode & 0o022 != 0).then(|| format!("can be written by {others} (`chmod go-w` ends that)"))
}
