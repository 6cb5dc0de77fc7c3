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

/// Who besides this process' user and root may change a file or folder, as a predicate of it; `None` for nobody.
pub(crate) fn stranger(about: &fs::Metadata) -> Option<String> {
    #[cfg(unix)]
    {
        use std::os::unix::fs::MetadataExt;
        stranger_of(rustix::process::geteuid().as_raw(), (about.uid(), about.mode()))
    }
    // Elsewhere a user's own folders are written by nobody else.
    #[cfg(not(unix))]
    {
        let _ = about;
        None
    }
}

/// As [`stranger`], for a user, and an owner with a mode. The sticky bit of a folder is no help, since it lets others add files.
#[cfg(unix)]
fn stranger_of(user: u32, (owner, mode): (u32, u32)) -> Option<String> {
    if owner != user && owner != 0 {
        return Some(format!("belongs to user {owner}, and krylux runs as user {user}"));
    }
    let others = if mode & 0o002 != 0 { "everybody" } else { "its group" };
    (mode & 0o022 != 0).then(|| format!("can be written by {others} (`chmod go-w` ends that)"))
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    #[test]
    fn only_the_user_and_root_are_no_strangers() {
        use rand::{RngExt, SeedableRng};
        let mut random = rand_pcg::Pcg64::seed_from_u64(1);
        let mut counts = [0; 2];
        for _ in 0..20_000 {
            let users = [0, 1000, 1001, 65534];
            let [user, owner] = [0; 2].map(|_| users[random.random_range(0..users.len())]);
            let mode = random.random_range(0..0o10000);
            // Who can change it: its owner (who can change its mode), and its group and all others, by their bits.
            let may_write = |who: u32| who == owner || mode & 0o020 != 0 || mode & 0o002 != 0;
            let is_safe = users.into_iter().filter(|who| ![0, user].contains(who)).all(|who| !may_write(who));
            assert_eq!(stranger_of(user, (owner, mode)).is_none(), is_safe, "{user} {owner} {mode:o}");
            counts[usize::from(is_safe)] += 1;
        }
        assert!(counts[0] > 1000 && counts[1] > 1000, "{counts:?}");
        let sudo = stranger_of(0, (1000, 0o644)).expect("under sudo the file is not root's");
        assert!(sudo.contains("user 1000") && sudo.contains("runs as user 0"), "{sudo}");
    }
}
