//! Traced matrices on disk, so that a second run on a scene need not trace it again.
//!
//! A matrix is found by a key over everything that it depends on ([`Key`]). Its files, one for each channel, are ZIP archives
//! that `scipy.sparse.load_npz` opens, with more members than SciPy asks for (`file`). They appear whole or not at all, so that
//! any number of runs can share a cache. What has been damaged is noticed by its checksum, and traced anew.

mod file;
mod key;
mod record;

use std::collections::BTreeMap;
use std::fs;
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

pub use key::Key;

use crate::error::{Error, Result};
use crate::transport::{Assembled, Channels};

/// What a cache holds at most, unless told otherwise: 4 GiB.
pub const LIMIT: u64 = 4 << 30;

/// A folder of matrices.
#[derive(Clone, Debug)]
pub struct Cache {
    folder: PathBuf,
    limit: u64,
}

/// What a cache knows of a key.
#[derive(Debug)]
pub enum Found {
    /// The matrix, bit for bit as it was traced.
    Whole(Box<Assembled>),
    /// Nothing.
    Missing,
    /// Files that cannot be used, and why.
    Damaged(String),
}

/// One matrix in the cache.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Entry {
    /// Its key, in hexadecimal.
    pub key: String,
    /// What it is of, in words; `None` where the file is damaged.
    pub label: Option<String>,
    /// Bytes on disk.
    pub bytes: u64,
    /// When it was last stored or found.
    pub used: SystemTime,
    files: Vec<PathBuf>,
}

/// `XDG_CACHE_HOME/krylux`, or `~/.cache/krylux`; `None` where neither is set.
pub fn default_folder() -> Option<PathBuf> {
    let absolute = |name| std::env::var_os(name).map(PathBuf::from).filter(|path| path.is_absolute());
    let base = absolute("XDG_CACHE_HOME").or_else(|| Some(absolute("HOME")?.join(".cache")))?;
    Some(base.join("krylux"))
}

impl Cache {
    /// The cache in `folder`, which need not exist yet, of at most `limit` bytes.
    pub fn new(folder: impl Into<PathBuf>, limit: u64) -> Self {
        Self { folder: folder.into(), limit }
    }

    /// Where it is.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Looks a matrix up. What is found counts as used now.
    pub fn load(&self, key: &Key) -> Found {
        let files = self.files(key);
        // Once open, a file stays whole, though another run may give it up.
        let open = |path: &PathBuf| Ok((path.clone(), fs::File::open(path)?));
        let opened = match files.iter().map(open).collect::<io::Result<Vec<_>>>() {
            Ok(opened) => opened,
            Err(error) if error.kind() == ErrorKind::NotFound => return Found::Missing,
            Err(error) => return Found::Damaged(error.to_string()),
        };
        match file::read(key, opened) {
            Ok(found) => {
                // A folder that others may only read serves as well; it just cannot tell what was used last.
                let touch = |path: &PathBuf| {
                    fs::File::options().append(true).open(path)?.set_modified(SystemTime::now())
                };
                files.iter().for_each(|path| drop(touch(path)));
                Found::Whole(Box::new(found))
            }
            Err(why) => Found::Damaged(why),
        }
    }

    /// Keeps a matrix, and gives up those unused for longest until all fit the limit. One that is larger than the limit is not
    /// kept: `false`. That another run gives it up at once is nothing that this one says.
    ///
    /// # Errors
    /// [`Error::Write`].
    pub fn store(&self, key: &Key, traced: &Assembled) -> Result<bool> {
        if traced.matrix.bytes() as u64 > self.limit {
            return Ok(false);
        }
        fs::create_dir_all(&self.folder).map_err(Error::writing(&self.folder))?;
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
            // Sorted last: even alone, with its archive's headers, it is larger than the limit.
            if entry.key == key.hex() {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// All matrices, by key. A folder that does not exist holds none.
    ///
    /// # Errors
    /// [`Error::Read`] when the folder is there and cannot be read.
    pub fn entries(&self) -> Result<Vec<Entry>> {
        let mut entries = BTreeMap::<String, Entry>::new();
        for path in self.listing()? {
            let Some(key) = key_of(&path) else { continue };
            // Another run may have given it up meanwhile.
            let Ok(about) = fs::metadata(&path) else { continue };
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

    /// Empties the cache, and says how many matrices it held and their bytes. Other files in the folder stay, but for what a
    /// killed run left unfinished an hour ago or earlier.
    ///
    /// # Errors
    /// [`Error::Read`], [`Error::Write`].
    pub fn clear(&self) -> Result<(usize, u64)> {
        let entries = self.entries()?;
        entries.iter().try_for_each(|entry| remove(&entry.files))?;
        let unfinished: Vec<PathBuf> =
            self.listing()?.into_iter().filter(|path| is_unfinished(path) && is_old(path)).collect();
        remove(&unfinished)?;
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

/// The key in a file's name, if it is one of ours.
fn key_of(path: &Path) -> Option<String> {
    let name = path.file_name()?.to_str()?;
    let (key, rest) = name.split_once('.')?;
    let ours = key.len() == key::HEX_DIGITS && key.bytes().all(|byte| byte.is_ascii_hexdigit());
    (ours && matches!(rest, "luma.npz" | "r.npz" | "g.npz" | "b.npz")).then(|| key.to_owned())
}

/// Whether a file is a temporary one of atomic writing, `.KEY.luma.npz.RANDOM.tmp`.
fn is_unfinished(path: &Path) -> bool {
    let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
    let parts = name
        .strip_prefix('.')
        .and_then(|name| name.strip_suffix(".tmp"))
        .and_then(|name| name.rsplit_once('.'));
    parts.is_some_and(|(target, _)| key_of(Path::new(target)).is_some())
}

/// Whether nobody can still be writing it.
fn is_old(path: &Path) -> bool {
    let written = fs::metadata(path).and_then(|about| about.modified());
    written.is_ok_and(|when| when.elapsed().is_ok_and(|age| age > Duration::from_secs(3600)))
}

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
    fn only_its_own_files_belong_to_a_cache() {
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
