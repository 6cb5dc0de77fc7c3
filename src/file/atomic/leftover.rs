//! Temporary files that a killed process left: the next write into their folder removes them.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{LazyLock, Mutex, PoisonError};
use std::time::Duration;

/// What the names of temporary files end with.
pub(super) const SUFFIX: &str = ".tmp";

/// How long after its last change a file of another machine or container is taken to be left over: whether its process lives cannot be told
/// from here.
const FOREIGN_AGE: Duration = Duration::from_secs(24 * 3600);

/// Who writes a temporary file, as a part of its name: `PID-SYSTEM-`. The system is a number for this boot of this machine and its space of
/// process numbers, since the same number means another process elsewhere.
pub(super) fn writer() -> String {
    format!("{}-{}-", std::process::id(), *SYSTEM)
}

static SYSTEM: LazyLock<String> = LazyLock::new(|| {
    let boot = fs::read_to_string("/proc/sys/kernel/random/boot_id").unwrap_or_default();
    let processes = fs::read_link("/proc/self/ns/pid").unwrap_or_default();
    blake3::hash(format!("{boot} {}", processes.display()).as_bytes()).to_hex()[..8].to_owned()
});

/// Removes the temporary files that ended processes left in `folder`. Each process looks through a folder once. What cannot be removed stays:
/// it does no harm.
pub(super) fn remove(folder: &Path) {
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

/// Whether a file is a temporary one whose process has ended.
fn is_left_over(name: &str, path: &Path) -> bool {
    let Some((process, system)) = writer_in(name) else { return false };
    // A link is not ours.
    let Some(about) = fs::symlink_metadata(path).ok().filter(fs::Metadata::is_file) else { return false };
    if system == *SYSTEM && Path::new("/proc/self").exists() {
        return !Path::new(&format!("/proc/{process}")).exists();
    }
    about.modified().is_ok_and(|when| when.elapsed().is_ok_and(|age| age > FOREIGN_AGE))
}

/// The process and the system in the name of a temporary file, `.NAME.PID-SYSTEM-RANDOM.tmp`; `None` for other files.
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
        // No process has the highest number that the system's type holds.
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
        // Names of others stay also where they are old.
        for name in &kept[2..] {
            let old = fs::File::options().append(true).open(folder.path().join(name)).expect("it is there");
            old.set_modified(std::time::SystemTime::now() - 2 * FOREIGN_AGE).expect("files have times");
        }
        remove_in(folder.path());
        kept.iter().for_each(|name| assert!(is_there(name), "{name}"));
        let old = fs::File::options().append(true).open(folder.path().join(&foreign)).expect("it is there");
        old.set_modified(std::time::SystemTime::now() - 2 * FOREIGN_AGE).expect("files have times");
        remove_in(folder.path());
        assert!(!is_there(&foreign), "a day later no process writes it any more");
    }
}
