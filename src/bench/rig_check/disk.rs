//! The check of the disk: space for a session's photos.

use std::path::{Path, PathBuf};

use super::thresholds::{MIN_PHOTOS, SESSION_PHOTOS};
use super::{Finding, Grade};
use crate::io::atomic;
use crate::rig::CameraInfo;

/// Whether the folder can be written, and has space for a session's photos.
pub(crate) fn space(folder: &Path, camera: &CameraInfo) -> Finding {
    let there = existing(folder);
    // Nothing is written under this name.
    if let Err(why) = atomic::check_writable(&there.join("krylux-check")) {
        return Finding::error("disk", &why);
    }
    // A journal stores two bytes per sample; levels and headers take less than that.
    let photo_bytes = 2 * (camera.resolution.pixels() * camera.channels) as u64;
    let Some(free) = free(&there) else {
        return Finding::ok("disk", format!("{} can be written; the free space is unknown", there.display()));
    };
    let photos = free / photo_bytes.max(1);
    let found = format!(
        "{} has {:.1} GB free, for {} photos of {:.2} MB",
        there.display(),
        free as f64 / 1e9,
        if photos > 1_000_000 { "over a million".to_owned() } else { photos.to_string() },
        photo_bytes as f64 / 1e6
    );
    let grade = match photos {
        ..MIN_PHOTOS => Grade::Fails,
        MIN_PHOTOS..SESSION_PHOTOS => Grade::Warning,
        _ => Grade::Ok,
    };
    Finding::graded(
        "disk",
        grade,
        found,
        format!("space for {SESSION_PHOTOS} photos"),
        "free some space, or give another folder by -o",
    )
}

/// The folder, or the nearest folder above it that exists.
fn existing(folder: &Path) -> PathBuf {
    let named = folder.ancestors().find(|path| path.is_dir());
    match named {
        Some(path) if !path.as_os_str().is_empty() => path.to_path_buf(),
        _ => PathBuf::from("."),
    }
}

/// Bytes that the user may still write there.
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
    fn the_space_of_a_missing_folder_is_that_of_the_nearest_folder_above() {
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
        let finding = space(&folder.path().join("a/b"), &camera(1));
        assert_eq!(finding.grade, Grade::Ok, "{finding:?}");
        // No disk has space for photos of an exabyte.
        let finding = space(folder.path(), &camera(1 << 59));
        assert_eq!(finding.grade, if cfg!(unix) { Grade::Fails } else { Grade::Ok }, "{finding:?}");
    }
}
