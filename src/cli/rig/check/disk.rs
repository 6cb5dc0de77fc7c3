//! Room for a session's photos.

use std::path::{Path, PathBuf};

use super::finding::{Finding, Grade};
use crate::io::atomic;
use crate::rig::CameraInfo;

/// Photos of a long session: a capture with several exposures and takes, its calibration, and a second try.
const SESSION: u64 = 5000;

/// With fewer than so many, not even one capture is kept.
const LEAST: u64 = 200;

/// Whether the folder can be written, and holds a session's photos.
pub(super) fn room(folder: &Path, camera: &CameraInfo) -> Finding {
    let there = existing(folder);
    // A file of this name is never written: it is only tried whether it could be.
    if let Err(why) = atomic::check_writable(&there.join("krylux-check")) {
        return Finding::error("disk", &why);
    }
    // Two bytes a sample, as journals keep them; levels and headers are less.
    let photo = 2 * (camera.resolution.pixels() * camera.channels) as u64;
    let Some(free) = free(&there) else {
        return Finding::ok("disk", format!("{} can be written; its room is not told", there.display()));
    };
    let photos = free / photo.max(1);
    let found = format!(
        "{} has {:.1} GB free, for {} photos of {:.2} MB",
        there.display(),
        free as f64 / 1e9,
        if photos > 1_000_000 { "over a million".to_owned() } else { photos.to_string() },
        photo as f64 / 1e6
    );
    let grade = match photos {
        ..LEAST => Grade::Fails,
        LEAST..SESSION => Grade::Warning,
        _ => Grade::Ok,
    };
    Finding::graded(
        "disk",
        grade,
        found,
        format!("room for {SESSION}"),
        "make room, or give another folder by -o",
    )
}

/// The folder, or the nearest one above it that is there.
fn existing(folder: &Path) -> PathBuf {
    let named = folder.ancestors().find(|path| path.is_dir());
    match named {
        Some(path) if !path.as_os_str().is_empty() => path.to_path_buf(),
        _ => PathBuf::from("."),
    }
}

/// Bytes that a user may still write there.
#[cfg(unix)]
fn free(folder: &Path) -> Option<u64> {
    let found = rustix::fs::statvfs(folder).ok()?;
    Some(found.f_bavail.saturating_mul(found.f_frsize))
}

#[cfg(not(unix))]
fn free(_: &Path) -> Option<u64> {
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Resolution;

    #[test]
    fn a_folder_that_is_not_there_yet_is_looked_for_above() {
        let folder = tempfile::TempDir::new().expect("a temporary folder can be made");
        assert_eq!(existing(&folder.path().join("a/b")), folder.path());
        assert_eq!(existing(Path::new("not-there")), Path::new("."));
        let camera = |side| CameraInfo {
            name: String::new(),
            resolution: Resolution::new(side, 1),
            channels: 1,
            bits: 12,
            exposures: [1e-4, 1.0],
        };
        let finding = room(&folder.path().join("a/b"), &camera(1));
        assert_eq!(finding.grade, Grade::Ok, "{finding:?}");
        // No disk has room for photos of an exabyte.
        let finding = room(folder.path(), &camera(1 << 59));
        assert_eq!(finding.grade, if cfg!(unix) { Grade::Fails } else { Grade::Ok }, "{finding:?}");
    }
}
