//! Atomic file writes: a file appears completely or not at all.

use std::collections::BTreeSet;
use std::ffi::OsString;
use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{LazyLock, Mutex, PoisonError};
use std::time::Duration;

use super::spot::{FileKind, Spot};
use crate::error::{Error, Result};

/// Writes a file atomically: fills a temporary file in the same folder, flushes it to disk, and renames it.
///
/// A reader of `path` always finds either the complete old content or the complete new content, even after a crash or on a full disk. In a
/// run's folder and in the cache, links and pipes are refused. Elsewhere, links are followed, and pipes and devices are written directly.
///
/// # Errors
/// [`Error::Write`] naming `path` (not the temporary file), also if `fill` fails. The temporary file is then removed.
pub fn write_with(path: &Path, fill: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>) -> Result<()> {
    write_steps(path, fill).map_err(Error::writing(path))
}

/// Writes `bytes` atomically, with the errors of [`write_with`].
pub fn write_bytes(path: &Path, bytes: &[u8]) -> Result<()> {
    write_with(path, |file| file.write_all(bytes))
}

/// Checks that `path` can be written, so that a long run fails early. If not, the call fails with [`Error::Write`] naming `path`.
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

/// The file that a write replaces, or the stream that it writes to.
enum Target {
    /// A regular file, or a file that does not exist yet. Links of the user are resolved in the path.
    File(Spot, PathBuf),
    /// A pipe or a device that the user named.
    Stream,
}

impl Target {
    fn of(path: &Path) -> io::Result<Self> {
        let spot = Spot::of(path)?;
        match spot.kind()? {
            Some(FileKind::Folder) => Err(ErrorKind::IsADirectory.into()),
            Some(FileKind::Other) if !spot.is_ours => Ok(Self::Stream),
            Some(FileKind::File) if !spot.is_ours => {
                // If the file was removed in the meantime, there is no link to follow.
                let real = fs::canonicalize(path).unwrap_or_else(|_| path.to_path_buf());
                Ok(Self::File(Spot::of(&real)?, real))
            }
            Some(kind) => kind.require_file().map(|()| Self::File(spot, path.to_path_buf())),
            None => Ok(Self::File(spot, path.to_path_buf())),
        }
    }
}

/// A file `.NAME.PID-SYSTEM-NUMBER.tmp` beside its target. When dropped, it is removed unless it was renamed.
struct Temporary<'a> {
    target: &'a Spot,
    name: PathBuf,
}

impl<'a> Temporary<'a> {
    /// Creates the file, and removes temporary files that killed processes have left in the folder.
    fn beside(target: &'a Spot, path: &Path) -> io::Result<(Self, File)> {
        static NUMBER: AtomicU64 = AtomicU64::new(0);
        let name = path
            .file_name()
            .ok_or_else(|| io::Error::new(ErrorKind::InvalidInput, "the path names no file"))?;
        let folder = path.parent().unwrap_or(Path::new(""));
        remove_left_over(if folder.as_os_str().is_empty() { Path::new(".") } else { folder });
        loop {
            let number = NUMBER.fetch_add(1, Ordering::Relaxed);
            let mut own = OsString::from(".");
            own.push(name);
            own.push(format!(".{}{number:06}{}", writer(), SUFFIX));
            let name = target.sibling(&own);
            match target.create_sibling(&name) {
                Ok(file) => return Ok((Self { target, name }, file)),
                // An earlier process with the same process number left this file.
                Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
                Err(error) => return Err(error),
            }
        }
    }
}

impl Drop for Temporary<'_> {
    fn drop(&mut self) {
        // If the file was renamed, there is nothing to remove.
        let _ = self.target.remove_sibling(&self.name);
    }
}

const SUFFIX: &str = ".tmp";

/// A temporary file of another machine or container counts as left over if it has not changed for this long, because its process cannot be
/// looked up.
const FOREIGN_AGE: Duration = Duration::from_secs(24 * 3600);

/// The part `PID-SYSTEM-` of a temporary file's name, which identifies the writer. The system number identifies this boot of this machine
/// and its namespace of process numbers, because other systems use the same process numbers for other processes.
fn writer() -> String {
    format!("{}-{}-", std::process::id(), *SYSTEM)
}

static SYSTEM: LazyLock<String> = LazyLock::new(|| {
    let boot = fs::read_to_string("/proc/sys/kernel/random/boot_id").unwrap_or_default();
    let processes = fs::read_link("/proc/self/ns/pid").unwrap_or_default();
    blake3::hash(format!("{boot} {}", processes.display()).as_bytes()).to_hex()[..8].to_owned()
});

/// Removes the temporary files that ended processes have left in `folder`, once in each process. Files that cannot be removed are harmless.
fn remove_left_over(folder: &Path) {
    static SEEN: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());
    let real = fs::canonicalize(folder).unwrap_or_else(|_| folder.to_path_buf());
    if SEEN.lock().unwrap_or_else(PoisonError::into_inner).insert(real.clone()) {
        remove_in(&real);
    }
}

fn remove_in(folder: &Path) {
    let Ok(listing) = fs::read_dir(folder) else { return };
    for path in listing.filter_map(|item| Some(item.ok()?.path())) {
        let name = path.file_name().and_then(|name| name.to_str());
        if name.is_some_and(|name| is_left_over(name, &path)) {
            let _ = fs::remove_file(&path);
        }
    }
}

fn is_left_over(name: &str, path: &Path) -> bool {
    let Some((process, system)) = writer_in(name) else { return false };
    // A link is never a temporary file of krylux.
    let Some(about) = fs::symlink_metadata(path).ok().filter(fs::Metadata::is_file) else { return false };
    if system == *SYSTEM && Path::new("/proc/self").exists() {
        return !Path::new(&format!("/proc/{process}")).exists();
    }
    about.modified().is_ok_and(|when| when.elapsed().is_ok_and(|age| age > FOREIGN_AGE))
}

/// The process and the system in the name of a temporary file, `.NAME.PID-SYSTEM-NUMBER.tmp`; `None` for other files.
fn writer_in(name: &str) -> Option<(u32, &str)> {
    let (_, writer) = name.strip_prefix('.')?.strip_suffix(SUFFIX)?.rsplit_once('.')?;
    let mut parts = writer.split('-');
    let (process, system, random) = (parts.next()?, parts.next()?, parts.next()?);
    let is_ours = parts.next().is_none()
        && system.len() == 8
        && system.bytes().all(|byte| byte.is_ascii_hexdigit())
        && random.bytes().all(|byte| byte.is_ascii_alphanumeric());
    process.parse().ok().filter(|_| is_ours).map(|process| (process, system))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_writer_in_a_name_is_this_process_on_this_system() {
        let name = format!(".photo.npy.{}1rSJqC{SUFFIX}", writer());
        assert_eq!(writer_in(&name), Some((std::process::id(), SYSTEM.as_str())));
    }

    #[test]
    fn only_files_of_ended_processes_are_removed() {
        let folder = tempfile::tempdir().expect("a temporary folder can be made");
        // No process has the largest number that the type can hold.
        let dead = format!(".photo.npy.{}-{}-a7Xk2Q.tmp", u32::MAX, *SYSTEM);
        let foreign = ".photo.npy.7-00000000-a7Xk2Q.tmp".to_owned();
        let kept = [
            format!(".photo.npy.{}-{}-a7Xk2Q.tmp", std::process::id(), *SYSTEM),
            foreign.clone(),
            format!("photo.npy.{}-{}-a7Xk2Q.tmp", u32::MAX, *SYSTEM),
            format!(".photo.npy.{}-{}-a7.Xk2Q.tmp", u32::MAX, *SYSTEM),
            ".photo.npy.a7Xk2Q.tmp".into(),
            format!(".photo.npy.{}-1234567-a7Xk2Q.tmp", u32::MAX),
            format!(".photo.npy.{}-12345678-a7_k2Q.tmp", u32::MAX),
            format!(".photo.npy.{}-1234567g-a7Xk2Q.tmp", u32::MAX),
            format!(".photo.npy.{}-12345678-a7Xk2Q-1.tmp", u32::MAX),
            ".thesis.tmp".into(),
        ];
        for name in kept.iter().chain([&dead]) {
            fs::write(folder.path().join(name), "half a photo").expect("the folder is writable");
        }
        remove_in(folder.path());
        let is_there = |name: &String| folder.path().join(name).exists();
        assert!(!is_there(&dead), "{dead}");
        kept.iter().for_each(|name| assert!(is_there(name), "{name}"));
        // Files of other programs are kept, even old ones.
        for name in &kept[2..] {
            let old = File::options().append(true).open(folder.path().join(name)).expect("it is there");
            old.set_modified(std::time::SystemTime::now() - 2 * FOREIGN_AGE).expect("files have times");
        }
        remove_in(folder.path());
        kept.iter().for_each(|name| assert!(is_there(name), "{name}"));
        let old = File::options().append(true).open(folder.path().join(&foreign)).expect("it is there");
        old.set_modified(std::time::SystemTime::now() - 2 * FOREIGN_AGE).expect("files have times");
        remove_in(folder.path());
        assert!(!is_there(&foreign), "a day later no process writes it any more");
    }

    #[cfg(unix)]
    #[test]
    fn a_file_has_the_permissions_of_any_new_file() {
        use std::os::unix::fs::PermissionsExt;
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
