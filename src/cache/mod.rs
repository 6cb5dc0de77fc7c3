//! The cache of traced matrices on disk. With the cache, later runs with the same scene and settings need not trace again.
//!
//! A matrix is found by its [`Key`], a hash of everything on which it depends. The cache has one file for each channel of a matrix. The
//! file is a ZIP archive that `scipy.sparse.load_npz` opens, with additional members (see `file`). Files are written atomically, so several
//! runs can share a cache. A checksum reveals damaged files; the matrix is then traced again.
//!
//! The cache also keeps the kernels that a driver has compiled.
//!
//! Parts of a matrix that are traced separately are files of another kind ([`ShardFile`]). The user names these files.

mod check;
mod file;
mod kernels;
mod shard;

use std::collections::BTreeMap;
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

pub use shard::{ShardFile, ShardOrigin, write_shard};

use crate::error::{Error, Result};
use crate::gpu::{AdapterSummary, shader};
use crate::render::TraceSettings;
use crate::scene::Scene;
use crate::transport::{Assembled, Channels, RigShape};

/// The version of everything that affects a matrix, but is not hashed in the key. It must be increased if equal paths give another matrix,
/// if the file format changes, or if the host prepares a scene differently for the tracer. Even the pairing of triangles affects the last
/// bits of a matrix. Changed shaders need no new version, because the key hashes their sources.
const OPERATOR_VERSION: u32 = 4;

const HEX_DIGITS: usize = 32;

/// The key of a traced matrix: a BLAKE3 hash of everything on which the matrix depends. It covers the scene's files, camera, projector and
/// materials, the resolutions, samples, bounces, seed, sampler, channels and layers, and the sources of the shaders. It also covers the
/// adapter and its driver, because sines and powers differ between devices.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Key {
    hex: String,
    label: String,
    channels: Channels,
    rig: RigShape,
}

impl Key {
    /// The key of the matrix that tracing `scene` on `adapter` gives. `split` is as in [`crate::transport::assemble_layers`].
    /// [`Scene::hash`] covers geometry and textures.
    ///
    /// The key hashes the `Debug` texts of the camera, the materials, the settings and the channels. Renaming a field of these types
    /// therefore changes every key.
    pub fn new(
        scene: &Scene,
        adapter: &AdapterSummary,
        settings: &TraceSettings,
        channels: Channels,
        split: bool,
    ) -> Self {
        let mut hasher = blake3::Hasher::new();
        let mut part = |text: &str| {
            // The length separates the parts, so different lists of parts with equal concatenations have different hashes.
            hasher.update(&(text.len() as u64).to_le_bytes());
            hasher.update(text.as_bytes());
        };
        part(&format!("krylux operator {OPERATOR_VERSION}"));
        // The shaders of products and vectors do not affect the matrix.
        let makes = |name: &str| !["product", "vectors", "vectors_ahead"].contains(&name);
        shader::SOURCES.iter().filter(|(name, _)| makes(name)).for_each(|(name, source)| {
            part(name);
            part(&without_comments(source));
        });
        part(&format!("{:?}", scene.hash));
        part(&format!("{:?} {:?}", scene.camera, scene.projector));
        part(&format!("{:?}", scene.materials));
        part(&format!("{settings:?} {channels:?} {split}"));
        part(&format!("{} {} {}", adapter.name, adapter.driver, adapter.driver_version));
        let hex = hasher.finalize().to_hex()[..HEX_DIGITS].to_owned();
        let label = format!(
            "{}, {}, {} samples, {} bounces, seed {}",
            scene.path.display(),
            settings.resolution,
            settings.samples,
            settings.max_bounces,
            settings.seed
        );
        let (camera, projector) = (settings.resolution, settings.projector.unwrap_or(settings.resolution));
        // Only the tracer knows whether the rig is coaxial. Here, equal resolutions are enough.
        let rig = RigShape { camera, projector, symmetric: camera == projector };
        Self { hex, label, channels, rig }
    }

    /// The key of the same matrix as a device assembles it, whose entries are rounded differently.
    #[must_use]
    pub fn of_device(&self) -> Self {
        let hash = blake3::hash(format!("{} assembled on the device", self.hex).as_bytes());
        Self { hex: hash.to_hex()[..HEX_DIGITS].to_owned(), ..self.clone() }
    }

    /// A key from a file. The result is `None` for a text that is not a key. This check is needed because keys become file names.
    fn stored(hex: String, label: String, channels: Channels, rig: RigShape) -> Option<Self> {
        let is_digit = |byte: u8| byte.is_ascii_digit() || (b'a'..=b'f').contains(&byte);
        (hex.len() == HEX_DIGITS && hex.bytes().all(is_digit)).then_some(Self { hex, label, channels, rig })
    }

    /// The key in hexadecimal.
    pub fn hex(&self) -> &str {
        &self.hex
    }

    /// A description of the scene and the settings of the matrix.
    pub fn label(&self) -> &str {
        &self.label
    }

    /// The pixels of camera and projector. `symmetric` is false for a matrix that is not square. For a square matrix it is true, although
    /// only the tracer knows whether the rig is coaxial.
    fn rig(&self) -> RigShape {
        self.rig
    }

    /// The channels of the matrix.
    pub fn channels(&self) -> Channels {
        self.channels
    }
}

/// The source of a shader without comments and empty lines. These do not affect the matrix.
fn without_comments(source: &str) -> String {
    let code = source.lines().map(|line| line.split("//").next().unwrap_or_default().trim_end());
    code.filter(|line| !line.is_empty()).collect::<Vec<_>>().join("\n")
}

/// The default size limit of a cache: 4 GiB, in bytes.
pub const LIMIT: u64 = 4 << 30;

/// A folder of traced matrices.
#[derive(Clone, Debug)]
pub struct Cache {
    folder: PathBuf,
    limit: u64,
}

/// The result of looking up a key.
#[derive(Debug)]
pub enum Found {
    /// The matrix, bit for bit as it was traced.
    Whole(Box<Assembled>),
    /// The cache has no matrix with this key.
    Missing,
    /// The cache has files with this key, but they cannot be used, for this reason.
    Damaged(String),
}

/// One matrix in the cache.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Entry {
    /// The key in hexadecimal.
    pub key: String,
    /// A description of the scene and the settings; `None` if the file is damaged.
    pub label: Option<String>,
    /// The size on disk in bytes.
    pub bytes: u64,
    /// The time at which the matrix was last stored or loaded.
    pub used: SystemTime,
    files: Vec<PathBuf>,
}

/// The default folder, `$XDG_CACHE_HOME/krylux` or `~/.cache/krylux`. `None` if neither `XDG_CACHE_HOME` nor `HOME` is set.
pub fn default_folder() -> Option<PathBuf> {
    let absolute = |name| std::env::var_os(name).map(PathBuf::from).filter(|path| path.is_absolute());
    let base = absolute("XDG_CACHE_HOME").or_else(|| Some(absolute("HOME")?.join(".cache")))?;
    Some(base.join("krylux"))
}

impl Cache {
    /// A cache in `folder` of at most `limit` bytes. Storing the first matrix creates the folder. Links in the folder are not followed.
    pub fn new(folder: impl Into<PathBuf>, limit: u64) -> Self {
        let folder = folder.into();
        crate::file::follow_no_links_below(&folder);
        Self { folder, limit }
    }

    /// The folder of the cache.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Looks up a matrix, and marks it as used now.
    pub fn load(&self, key: &Key) -> Found {
        let files = self.files(key);
        // An open file stays readable even if another run removes it from the cache.
        let open = |path: &PathBuf| Ok((path.clone(), crate::file::open(path)?));
        let opened = match files.iter().map(open).collect::<Result<Vec<_>>>() {
            Ok(opened) => opened,
            Err(Error::Read { reason, .. }) if reason.kind() == ErrorKind::NotFound => return Found::Missing,
            Err(error) => return Found::Damaged(error.to_string()),
        };
        match file::read(key, opened) {
            Ok(found) => {
                // Errors are ignored, because even a read-only cache is useful. It does not record times of use.
                let touch = |path: &PathBuf| {
                    crate::file::open_to_change(path).map(|file| file.set_modified(SystemTime::now()))
                };
                files.iter().for_each(|path| drop(touch(path)));
                Found::Whole(Box::new(found))
            }
            Err(why) => Found::Damaged(why),
        }
    }

    /// Stores a matrix. Then the least recently used matrices are removed until the cache fits its limit. Returns `false`, and stores
    /// nothing, if the matrix alone exceeds the limit. Another run may remove the matrix at any time. It fails with [`Error::Write`].
    pub fn store(&self, key: &Key, traced: &Assembled) -> Result<bool> {
        if traced.matrix.bytes() as u64 > self.limit {
            return Ok(false);
        }
        crate::file::make_folder(&self.folder)?;
        file::write(key, &self.files(key), traced)?;
        let mut entries = self.entries()?;
        entries.sort_by_key(|entry| (entry.key == key.hex(), entry.used));
        let mut held: u64 = entries.iter().map(|entry| entry.bytes).sum();
        for entry in &entries {
            if held <= self.limit {
                break;
            }
            remove(&entry.files)?;
            held -= entry.bytes;
            // The new matrix is sorted last. If even this matrix is removed, it alone exceeds the limit, because of the headers of its
            // archive.
            if entry.key == key.hex() {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// All matrices, ordered by key. If the folder does not exist, the list is empty. An unreadable folder gives [`Error::Read`].
    pub fn entries(&self) -> Result<Vec<Entry>> {
        let mut entries = BTreeMap::<String, Entry>::new();
        for path in self.listing()? {
            let Some(key) = key_of(&path) else { continue };
            // Another run may have removed the file in the meantime.
            let Ok(about) = fs::symlink_metadata(&path) else { continue };
            let used = about.modified().unwrap_or(SystemTime::UNIX_EPOCH);
            let entry = entries.entry(key.clone()).or_insert(Entry {
                key,
                label: file::label(&path),
                bytes: 0,
                used,
                files: Vec::new(),
            });
            entry.bytes += about.len();
            entry.used = entry.used.max(used);
            entry.files.push(path);
        }
        Ok(entries.into_values().collect())
    }

    /// Removes all matrices, and returns their number and their total size in bytes. It also removes compiled kernels, and temporary files
    /// that a killed run left more than an hour ago. Other files in the folder are kept. It fails with [`Error::Read`] or [`Error::Write`].
    pub fn clear(&self) -> Result<(usize, u64)> {
        let entries = self.entries()?;
        entries.iter().try_for_each(|entry| remove(&entry.files))?;
        let is_other = |path: &PathBuf| kernels::has_kernels(path) || is_unfinished(path) && is_old(path);
        let others: Vec<PathBuf> = self.listing()?.into_iter().filter(is_other).collect();
        remove(&others)?;
        Ok((entries.len(), entries.iter().map(|entry| entry.bytes).sum()))
    }

    fn files(&self, key: &Key) -> Vec<PathBuf> {
        let names: &[&str] = match key.channels() {
            Channels::Luma => &["luma"],
            Channels::Rgb => &["r", "g", "b"],
        };
        names.iter().map(|name| self.folder.join(format!("{}.{name}.npz", key.hex()))).collect()
    }

    fn listing(&self) -> Result<Vec<PathBuf>> {
        let reading = Error::reading(&self.folder);
        match fs::read_dir(&self.folder) {
            Ok(listing) => Ok(listing.filter_map(|item| Some(item.ok()?.path())).collect()),
            Err(error) if error.kind() == ErrorKind::NotFound => Ok(Vec::new()),
            Err(error) => Err(reading(error)),
        }
    }
}

/// The key in the name of a cache file; `None` for any other file.
fn key_of(path: &Path) -> Option<String> {
    let name = path.file_name()?.to_str()?;
    let (key, rest) = name.split_once('.')?;
    let is_key = key.len() == HEX_DIGITS && key.bytes().all(|byte| byte.is_ascii_hexdigit());
    (is_key && matches!(rest, "luma.npz" | "r.npz" | "g.npz" | "b.npz")).then(|| key.to_owned())
}

/// Whether a file is a temporary file of an atomic write, `.KEY.luma.npz.RANDOM.tmp`.
fn is_unfinished(path: &Path) -> bool {
    let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
    let parts = name
        .strip_prefix('.')
        .and_then(|name| name.strip_suffix(".tmp"))
        .and_then(|name| name.rsplit_once('.'));
    parts.is_some_and(|(target, _)| key_of(Path::new(target)).is_some())
}

/// Whether a file was last written more than an hour ago. No run can still be writing such a file.
fn is_old(path: &Path) -> bool {
    let written = fs::symlink_metadata(path).and_then(|about| about.modified());
    written.is_ok_and(|when| when.elapsed().is_ok_and(|age| age > Duration::from_secs(3600)))
}

/// Removes files. A file that does not exist is not an error.
fn remove(files: &[PathBuf]) -> Result<()> {
    for path in files {
        match fs::remove_file(path) {
            Err(error) if error.kind() != ErrorKind::NotFound => return Err(Error::writing(path)(error)),
            _ => {}
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cache_recognizes_its_own_files_only() {
        let key = "0123456789abcdef0123456789abcdef";
        let path = |name: &str| PathBuf::from("/cache").join(name);
        assert_eq!(key_of(&path(&format!("{key}.luma.npz"))).as_deref(), Some(key));
        for other in ["matrix.npz", "0123.luma.npz", &format!("{key}.txt"), &format!("{key}x.r.npz"), key] {
            assert_eq!(key_of(&path(other)), None, "{other}");
        }
        assert!(is_unfinished(&path(&format!(".{key}.g.npz.a7Xk2Q.tmp"))));
        for other in [".thesis.tmp", &format!("{key}.g.npz"), &format!(".{key}.g.npz"), ".a.b.tmp"] {
            assert!(!is_unfinished(&path(other)), "{other}");
        }
    }
}
