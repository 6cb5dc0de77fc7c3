//! The files of shards. A shard is a part of a matrix that is traced separately, perhaps on another machine.
//!
//! A file consists of a line that names the format, a line of JSON that describes the shard, the shard's arrays, and a BLAKE3 digest of all
//! preceding bytes. It is written and read in one pass.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufRead, BufReader, Read, Write};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::Key;
use crate::error::{Error, Result};
use crate::file;
use crate::io::atomic;
use crate::transport::{Shard, ShardRecord};

/// The first line, up to the number of the format.
const NAME: &str = "krylux shard ";
const FORMAT: &str = "1";
const LONGEST_LINE: u64 = 1 << 16;
const DIGEST: u64 = blake3::OUT_LEN as u64;

#[derive(Serialize, Deserialize)]
struct Head {
    key: String,
    label: String,
    facts: BTreeMap<String, String>,
    #[serde(flatten)]
    record: ShardRecord,
}

/// The matrix to which a shard belongs. Two shards belong to the same matrix if their keys and all facts are equal.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ShardOrigin {
    /// The key of the whole matrix.
    pub key: Key,
    /// The facts on which the matrix depends, by name. Messages say which of them differ.
    pub facts: BTreeMap<String, String>,
}

impl ShardOrigin {
    /// The differences between `other` and this origin, as sentences about `other`. The list is empty if both describe the same matrix.
    pub fn differences(&self, other: &Self) -> Vec<String> {
        let names =
            self.facts.keys().chain(other.facts.keys().filter(|name| !self.facts.contains_key(*name)));
        let of_name = |name: &String| {
            let [ours, theirs] = [self, other].map(|of| of.facts.get(name));
            let shown =
                |value: Option<&String>| shortened(value.map_or("not known", |value| value)).to_owned();
            (ours != theirs).then(|| format!("its {name} is {}, not {}", shown(theirs), shown(ours)))
        };
        let mut found: Vec<String> = names.filter_map(of_name).collect();
        if found.is_empty() && self.key.hex() != other.key.hex() {
            found.push("its camera, its materials, or the program's shaders are others".into());
        }
        found
    }
}

/// Shortens a digest to its first digits. Any other value is unchanged.
fn shortened(value: &str) -> &str {
    let is_digest = value.len() == 64 && value.bytes().all(|byte| byte.is_ascii_hexdigit());
    if is_digest { &value[..12] } else { value }
}

/// Writes a shard, and returns the size of the file in bytes. A failed write gives [`Error::Write`].
pub fn write_shard(path: &Path, origin: &ShardOrigin, shard: &Shard) -> Result<u64> {
    let head = Head {
        key: origin.key.hex().into(),
        label: origin.key.label().into(),
        facts: origin.facts.clone(),
        record: shard.record().clone(),
    };
    let mut bytes = 0;
    atomic::write_with(path, |file| {
        let mut file = Digested { inner: file, hasher: blake3::Hasher::new() };
        writeln!(file, "{NAME}{FORMAT}")?;
        serde_json::to_writer(&mut file, &head)?;
        file.write_all(b"\n")?;
        shard.write(&mut file)?;
        bytes = file.hasher.count() + DIGEST;
        file.inner.write_all(file.hasher.finalize().as_bytes())
    })?;
    Ok(bytes)
}

/// The file of a shard whose head has been read, but not its contributions.
#[derive(Debug)]
pub struct ShardFile {
    path: PathBuf,
    origin: ShardOrigin,
    record: ShardRecord,
    rest: Digested<BufReader<File>>,
    bytes: u64,
}

impl ShardFile {
    /// Whether a file begins like the file of a shard. This is also true of an empty file. A file that cannot be read gives
    /// [`Error::Read`].
    pub fn is_begun(path: &Path) -> Result<bool> {
        let mut begin = Vec::new();
        let file = file::open(path)?;
        file.take(NAME.len() as u64).read_to_end(&mut begin).map_err(Error::reading(path))?;
        Ok(NAME.as_bytes().starts_with(&begin))
    }

    /// Opens a file and reads its head. It fails with [`Error::Read`], or with [`Error::Data`] if this is not the complete file of a shard.
    pub fn open(path: &Path) -> Result<Self> {
        let file = file::open(path)?;
        let length = file.metadata().map_err(Error::reading(path))?.len();
        let mut rest = Digested { inner: BufReader::new(file), hasher: blake3::Hasher::new() };
        let mut line = || rest.line().map_err(Error::reading(path));
        let name = line()?;
        require_format(path, &name)?;
        let head = line()?;
        let damaged = |why: &str| damaged(path, why, None);
        let Head { key, label, facts, record } =
            serde_json::from_slice(&head).map_err(|error| damaged(&error.to_string()))?;
        let key = Key::stored(key, label, record.channels, record.rig)
            .ok_or_else(|| damaged("it names its matrix by no key"))?;
        record.check().map_err(|why| damaged(&why))?;
        let bytes = length.checked_sub(rest.hasher.count() + DIGEST);
        let bytes = bytes.ok_or_else(|| damaged("it ends early"))?;
        Ok(Self { path: path.into(), origin: ShardOrigin { key, facts }, record, rest, bytes })
    }

    /// The path of the file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The matrix to which the shard belongs.
    pub fn origin(&self) -> &ShardOrigin {
        &self.origin
    }

    /// The record of the shard.
    pub fn record(&self) -> &ShardRecord {
        &self.record
    }

    /// The size of the contributions in bytes.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Reads the shard. A truncated or damaged file gives [`Error::Data`].
    pub fn read(self) -> Result<Shard> {
        let Self { path, record, mut rest, bytes, .. } = self;
        let of = (record.part, record.parts);
        let read = Shard::read(record, &mut rest, bytes).and_then(|shard| {
            let found = rest.hasher.finalize();
            let mut digest = [0; DIGEST as usize];
            rest.inner.read_exact(&mut digest).map_err(|error| error.to_string())?;
            if found == blake3::Hash::from_bytes(digest) {
                Ok(shard)
            } else {
                Err("its content does not match its digest".into())
            }
        });
        read.map_err(|why| damaged(&path, &why, Some(of)))
    }
}

fn require_format(path: &Path, line: &[u8]) -> Result<()> {
    let text = String::from_utf8_lossy(line);
    match text.strip_prefix(NAME) {
        Some(format) if format == format!("{FORMAT}\n") => Ok(()),
        Some(format) if format.ends_with('\n') => Err(Error::data(
            path,
            format!("it is a shard of format {}, and this program reads format {FORMAT}", format.trim()),
        )
        .help("use the version of krylux that wrote it")),
        // A file that ends within this line ends early, even if it is empty.
        _ if format!("{NAME}{FORMAT}\n").as_bytes().starts_with(line) => {
            Err(damaged(path, "it ends early", None))
        }
        _ => Err(Error::data(path, "it is not a shard")
            .help("give files that `krylux matrix SOURCE --shard K/N -o FILE` wrote")),
    }
}

/// The error for an incomplete file. `of` gives the number of the shard's part and the number of parts, if the head could be read.
fn damaged(path: &Path, why: &str, of: Option<(usize, usize)>) -> Error {
    let (part, parts) = of.map_or(("K".into(), "N".into()), |(k, n)| (k.to_string(), n.to_string()));
    Error::data(path, format!("the shard is cut short or damaged ({why})"))
        .help(format!("trace it again: krylux matrix SOURCE … --shard {part}/{parts} -o {}", path.display()))
}

/// A reader or writer that hashes all bytes that pass through it.
#[derive(Debug)]
struct Digested<F> {
    inner: F,
    hasher: blake3::Hasher,
}

impl<F: BufRead> Digested<F> {
    /// The next line with its line end. The line is incomplete if the file ends early, or if the line is too long.
    fn line(&mut self) -> io::Result<Vec<u8>> {
        let mut line = Vec::new();
        self.inner.by_ref().take(LONGEST_LINE).read_until(b'\n', &mut line)?;
        self.hasher.update(&line);
        Ok(line)
    }
}

impl<F: Read> Read for Digested<F> {
    fn read(&mut self, to: &mut [u8]) -> io::Result<usize> {
        let read = self.inner.read(to)?;
        self.hasher.update(&to[..read]);
        Ok(read)
    }
}

impl<F: Write> Write for Digested<F> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.inner.write(bytes)?;
        self.hasher.update(&bytes[..written]);
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.inner.flush()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Resolution;
    use crate::transport::{Channels, RigShape};

    #[test]
    fn the_first_line_tells_what_a_file_is() {
        let said = |line: &str| match require_format(Path::new("a.krylux"), line.as_bytes()) {
            Ok(()) => String::new(),
            Err(error) => error.to_string(),
        };
        assert_eq!(said("krylux shard 1\n"), "");
        assert!(said("krylux shard 2\n").contains("format 2"));
        assert!(said("").contains("cut short") && said("krylux sh").contains("cut short"));
        assert!(said("PK\u{3}\u{4}").contains("not a shard") && said("krylux").contains("cut short"));
    }

    fn origin(seed: &str, digit: &str) -> ShardOrigin {
        let camera = Resolution::new(2, 2);
        let rig = RigShape { camera, projector: camera, symmetric: true };
        let key = Key::stored(digit.repeat(32), "a test".into(), Channels::Luma, rig).expect("it is a key");
        let facts = [("scene", "0".repeat(64)), ("seed", seed.into())];
        ShardOrigin { key, facts: facts.map(|(name, value)| (name.to_owned(), value)).into() }
    }

    #[test]
    fn differences_name_what_differs() {
        let one = origin("0", "a");
        assert!(one.differences(&one).is_empty());
        assert_eq!(one.differences(&origin("1", "b")), ["its seed is 1, not 0"]);
        let unnamed = one.differences(&origin("0", "b"));
        assert!(unnamed.len() == 1 && unnamed[0].contains("shaders"), "{unnamed:?}");
        let mut other = origin("0", "b");
        other.facts.insert("scene".into(), "1".repeat(64));
        other.facts.remove("seed");
        assert_eq!(
            one.differences(&other),
            ["its scene is 111111111111, not 000000000000", "its seed is not known, not 0"]
        );
    }

    #[test]
    fn a_key_is_no_path() {
        let RigShape { camera, .. } = origin("0", "a").key.rig();
        let rig = RigShape { camera, projector: camera, symmetric: true };
        for wrong in ["", "../../etc/passwd", &"A".repeat(32), &"a".repeat(33), &"é".repeat(16)] {
            assert!(Key::stored(wrong.into(), String::new(), Channels::Luma, rig).is_none(), "{wrong}");
        }
    }
}
