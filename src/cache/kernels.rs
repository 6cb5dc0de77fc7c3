//! Compiled kernels in the cache, one file per adapter and driver version.
//!
//! A driver trusts compiled kernels, so a file is used only if the running user owns it, nobody else may write it, and its checksum is
//! correct.

use std::fs;
use std::path::{Path, PathBuf};

use super::Cache;
use crate::error::Result;
use crate::gpu::AdapterSummary;
use crate::{file, io};

/// The maximum size in bytes of a file that is read. The kernels of a scene take far less than a hundredth of this size.
const MOST: u64 = 64 << 20;

const PREFIX: &str = "kernels-";
const SUFFIX: &str = ".bin";

impl Cache {
    /// The kernels that an earlier run compiled for this adapter; `None` if there are none, or if they cannot be trusted.
    pub fn kernels(&self, adapter: &AdapterSummary) -> Option<Vec<u8>> {
        let path = self.kernel_file(adapter);
        let about = fs::symlink_metadata(&path).ok()?;
        if !about.is_file() || about.len() > MOST || file::stranger(&about).is_some() {
            return None;
        }
        let mut kernels = file::read(&path).ok()?;
        let checksum = kernels.split_off(kernels.len().checked_sub(blake3::OUT_LEN)?);
        (blake3::hash(&kernels).as_bytes()[..] == checksum[..]).then_some(kernels)
    }

    /// Stores the compiled kernels of this adapter, and replaces earlier ones. It fails with [`Error::Write`](crate::Error::Write).
    pub fn store_kernels(&self, adapter: &AdapterSummary, kernels: &[u8]) -> Result<()> {
        file::make_folder(&self.folder)?;
        let checksum = blake3::hash(kernels);
        io::atomic::write_bytes(&self.kernel_file(adapter), &[kernels, checksum.as_bytes()].concat())
    }

    fn kernel_file(&self, adapter: &AdapterSummary) -> PathBuf {
        let AdapterSummary { name, driver, driver_version, .. } = adapter;
        let of = format!("{name}\n{driver}\n{driver_version}\n{}", env!("CARGO_PKG_VERSION"));
        self.folder.join(format!("{PREFIX}{}{SUFFIX}", &blake3::hash(of.as_bytes()).to_hex()[..16]))
    }
}

pub(super) fn has_kernels(path: &Path) -> bool {
    let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
    let hash = name.strip_prefix(PREFIX).and_then(|name| name.strip_suffix(SUFFIX));
    hash.is_some_and(|hash| hash.len() == 16 && hash.bytes().all(|byte| byte.is_ascii_hexdigit()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn adapter(driver_version: &str) -> AdapterSummary {
        AdapterSummary {
            name: "a card".into(),
            driver: "a driver".into(),
            driver_version: driver_version.into(),
            ..AdapterSummary::default()
        }
    }

    fn cache() -> (tempfile::TempDir, Cache) {
        let folder = tempfile::tempdir().expect("a temporary folder can be made");
        let cache = Cache::new(folder.path().join("cache"), 1 << 20);
        (folder, cache)
    }

    #[test]
    fn kernels_come_back_for_the_same_driver_only() {
        let (_folder, cache) = cache();
        assert_eq!(cache.kernels(&adapter("1")), None);
        cache.store_kernels(&adapter("1"), b"compiled").expect("the folder can be written");
        assert_eq!(cache.kernels(&adapter("1")).as_deref(), Some(&b"compiled"[..]));
        assert_eq!(cache.kernels(&adapter("2")), None);
    }

    #[test]
    fn a_changed_or_short_file_is_not_given_to_a_driver() {
        let (_folder, cache) = cache();
        let path = cache.kernel_file(&adapter("1"));
        cache.store_kernels(&adapter("1"), b"compiled").expect("the folder can be written");
        let whole = fs::read(&path).expect("it was written");
        for at in 0..whole.len() {
            let mut changed = whole.clone();
            changed[at] ^= 1;
            fs::write(&path, changed).expect("it can be written");
            assert_eq!(cache.kernels(&adapter("1")), None, "byte {at}");
            fs::write(&path, &whole[..at]).expect("it can be written");
            assert_eq!(cache.kernels(&adapter("1")), None, "cut after {at} bytes");
        }
    }

    #[cfg(unix)]
    #[test]
    fn a_file_that_others_may_write_is_not_given_to_a_driver() {
        use std::os::unix::fs::{PermissionsExt, symlink};
        let (_folder, cache) = cache();
        let path = cache.kernel_file(&adapter("1"));
        cache.store_kernels(&adapter("1"), b"compiled").expect("the folder can be written");
        for (mode, is_used) in [(0o600, true), (0o644, true), (0o660, false), (0o646, false)] {
            fs::set_permissions(&path, fs::Permissions::from_mode(mode)).expect("the file is ours");
            assert_eq!(cache.kernels(&adapter("1")).is_some(), is_used, "{mode:o}");
        }
        fs::set_permissions(&path, fs::Permissions::from_mode(0o600)).expect("the file is ours");
        let elsewhere = path.with_extension("elsewhere");
        fs::rename(&path, &elsewhere).expect("the folder is ours");
        symlink(&elsewhere, &path).expect("the folder is ours");
        assert_eq!(cache.kernels(&adapter("1")), None, "a link");
    }

    #[test]
    fn clearing_the_cache_removes_kernels_and_nothing_else() {
        let (_folder, cache) = cache();
        cache.store_kernels(&adapter("1"), b"compiled").expect("the folder can be written");
        let others =
            ["kernels-thesis.bin", "kernels-0123456789abcdef.txt"].map(|name| cache.folder().join(name));
        others.iter().for_each(|path| fs::write(path, "mine").expect("the folder can be written"));
        assert_eq!(cache.clear().expect("the folder can be written"), (0, 0));
        assert_eq!(cache.kernels(&adapter("1")), None);
        assert!(others.iter().all(|path| path.exists()));
    }
}
