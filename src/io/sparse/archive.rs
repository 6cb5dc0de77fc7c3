//! Writes and reads the members of `.npz` archives.
//!
//! This module assembles archives itself, because the crate `npyz` requires another version of the crate `zip`.

use std::fs::File;
use std::io::{self, BufReader, BufWriter, Read, Seek, SeekFrom, Write};
use std::path::Path;

use npyz::{DType, WriterBuilder};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipArchive, ZipWriter};

use super::super::npy;
use super::unusable;
use crate::error::{Error, Result};
use crate::file;

/// Appends a one-dimensional array of `count` values to the archive as `NAME.npy`.
pub(crate) fn add_to_npz<T: npyz::AutoSerialize>(
    archive: &mut ZipWriter<impl Write + Seek>,
    name: &str,
    count: usize,
    values: impl Iterator<Item = T>,
) -> io::Result<()> {
    let bytes = count as u64 * size_of::<T>() as u64;
    archive.start_file(format!("{name}.npy"), npz_options(bytes))?;
    let mut buffer = BufWriter::with_capacity(1 << 16, archive);
    let mut array = npyz::WriteOptions::<T>::new()
        .default_dtype()
        .shape(&[count as u64])
        .writer(&mut buffer)
        .begin_nd()?;
    array.extend(values)?;
    array.finish()?;
    buffer.flush()
}

/// Appends the name of the matrix format, `csr`, as SciPy stores it: a scalar byte string.
pub(crate) fn add_format_to_npz(archive: &mut ZipWriter<impl Write + Seek>) -> io::Result<()> {
    archive.start_file("format.npy", npz_options(0))?;
    let bytes: DType = DType::Plain("|S3".parse().map_err(io::Error::other)?);
    let mut array =
        npyz::WriteOptions::<[u8]>::new().dtype(bytes).shape(&[]).writer(&mut *archive).begin_nd()?;
    array.push(b"csr")?;
    array.finish()
}

pub(crate) fn npz_options(bytes: u64) -> SimpleFileOptions {
    SimpleFileOptions::default()
        .compression_method(CompressionMethod::Stored)
        .last_modified_time(zip::DateTime::DEFAULT)
        .unix_permissions(0o644)
        // A member of 4 GiB or more needs this flag. The comparison includes a margin for the header of the .npy format.
        .large_file(bytes + 4096 > u64::from(u32::MAX))
}

/// The maximum size in bytes of a member that is read at any compression ratio.
const MAX_EXPANDED_BYTES: u64 = 1 << 28;

/// The maximum compression ratio of a larger member. This limit prevents a small malicious file from filling the memory.
const MAX_EXPANSION: u64 = 64;

/// All bytes of `unpacked`, which reads what `packed` holds.
pub(super) fn expand(packed: &[u8], unpacked: impl Read) -> std::result::Result<Vec<u8>, String> {
    let most = MAX_EXPANDED_BYTES.max(MAX_EXPANSION * packed.len() as u64);
    let mut bytes = Vec::new();
    match unpacked.take(most + 1).read_to_end(&mut bytes) {
        Err(error) => Err(format!("cannot be unpacked: {error}")),
        Ok(_) if bytes.len() as u64 > most => {
            Err(format!("of {} bytes expands to more than {most}", packed.len()))
        }
        Ok(_) => Ok(bytes),
    }
}

/// An `.npz` archive whose arrays are read by name.
pub(super) struct Archive<'a> {
    path: &'a Path,
    zip: ZipArchive<BufReader<File>>,
    /// The bytes of the whole file.
    length: u64,
}

impl<'a> Archive<'a> {
    pub(super) fn open(path: &'a Path) -> Result<Self> {
        let file = file::open(path)?;
        let length = file.metadata().map_err(Error::reading(path))?.len();
        let zip = ZipArchive::new(BufReader::new(file))
            .map_err(|error| unusable(path, format!("it is not a ZIP archive: {error}")))?;
        Ok(Self { path, zip, length })
    }

    pub(super) fn fault(&self, what: impl Into<String>) -> Error {
        unusable(self.path, what.into())
    }

    pub(super) fn unfit(&self) -> Error {
        self.fault("its arrays do not fit together")
    }

    /// The names of the arrays, in alphabetical order.
    pub(super) fn names(&self) -> Vec<String> {
        let names =
            self.zip.file_names().filter_map(|name| Some(name.ok()?.strip_suffix(".npy")?.to_owned()));
        let mut names: Vec<String> = names.collect();
        names.sort();
        names
    }

    pub(super) fn has(&self, name: &str) -> bool {
        self.zip.index_for_name(&format!("{name}.npy")).is_some()
    }

    /// Whether the archive has a member of this full name.
    pub(super) fn has_member(&self, name: &str) -> bool {
        self.zip.index_for_name(name).is_some()
    }

    pub(super) fn bytes(&mut self, name: &str) -> Result<Vec<u8>> {
        let (path, length) = (self.path, self.length);
        let fault = |what: String| unusable(path, what);
        let entry = self.zip.by_name(&format!("{name}.npy"));
        let entry = entry.map_err(|error| fault(format!("it has no array `{name}`: {error}")))?;
        let size = entry.size();
        // Both sizes are stated by the archive, so they may be wrong. A member cannot take more bytes than the whole archive.
        let packed = entry.compressed_size().min(length);
        if size > MAX_EXPANDED_BYTES.max(MAX_EXPANSION * packed) {
            let what = format!("array `{name}` takes {packed} bytes, but claims to be one of {size}");
            return Err(fault(what));
        }
        let mut bytes = Vec::new();
        let failed = |error: io::Error| fault(format!("array `{name}`: {error}"));
        bytes.try_reserve_exact(size as usize).map_err(|error| failed(io::Error::other(error)))?;
        if entry.take(size + 1).read_to_end(&mut bytes).map_err(failed)? as u64 != size {
            return Err(fault(format!("array `{name}` is not as long as the archive states")));
        }
        Ok(bytes)
    }

    pub(super) fn array(&mut self, name: &str) -> Result<npy::Array> {
        let bytes = self.bytes(name)?;
        npy::parse(&bytes).map_err(|what| self.fault(format!("array `{name}`: {what}")))
    }

    /// An array of integers. Their conversion to `f64` and back is exact, because they are limited to 9·10¹⁵.
    pub(super) fn integers(&mut self, name: &str) -> Result<Vec<i64>> {
        let values = self.array(name)?.values;
        if !values.iter().all(|value| value.abs() < 9e15 && value.fract() == 0.0) {
            return Err(self.fault(format!("array `{name}` holds numbers that are no indices")));
        }
        Ok(values.into_iter().map(|value| value as i64).collect())
    }

    /// An array of indices, which are integers from 0 on.
    pub(super) fn indices(&mut self, name: &str) -> Result<Vec<usize>> {
        let index = |value: i64| usize::try_from(value).ok();
        let indices: Option<Vec<usize>> = self.integers(name)?.into_iter().map(index).collect();
        indices.ok_or_else(|| self.fault(format!("array `{name}` holds a negative index")))
    }
}

/// A writer that passes everything to `inner` until an operation fails. Afterwards, all operations succeed and do nothing. Without this,
/// the crate `zip`, which finishes an archive when it is dropped, would print a second error on stderr.
pub(crate) struct FirstError<W> {
    inner: W,
    has_failed: bool,
}

impl<W> FirstError<W> {
    pub(crate) fn new(inner: W) -> Self {
        Self { inner, has_failed: false }
    }

    fn unless_failed<T>(&mut self, rest: T, work: impl FnOnce(&mut W) -> io::Result<T>) -> io::Result<T> {
        if self.has_failed {
            return Ok(rest);
        }
        let done = work(&mut self.inner);
        self.has_failed = done.as_ref().is_err_and(|error| error.kind() != io::ErrorKind::Interrupted);
        done
    }
}

impl<W: Write> Write for FirstError<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.unless_failed(bytes.len(), |inner| inner.write(bytes))
    }

    fn flush(&mut self) -> io::Result<()> {
        self.unless_failed((), Write::flush)
    }
}

impl<W: Seek> Seek for FirstError<W> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.unless_failed(0, |inner| inner.seek(to))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn after_an_error_nothing_is_written_and_nothing_fails() {
        let mut writer = FirstError::new(io::Cursor::new(Vec::new()));
        assert!(writer.write_all(b"abc").is_ok() && writer.seek(SeekFrom::Start(1)).is_ok());
        assert_eq!(writer.inner.get_ref(), b"abc");
        let mut writer = FirstError::new(Refusing);
        assert!(
            FirstError::new(Refusing).flush().is_err()
                && FirstError::new(Refusing).seek(SeekFrom::End(0)).is_err()
        );
        assert!(writer.write(b"a").is_err());
        assert!(writer.write_all(b"b").is_ok() && writer.flush().is_ok());
        assert_eq!(writer.seek(SeekFrom::Start(7)).ok(), Some(0));
    }

    struct Refusing;

    impl Write for Refusing {
        fn write(&mut self, _: &[u8]) -> io::Result<usize> {
            Err(io::ErrorKind::StorageFull.into())
        }

        fn flush(&mut self) -> io::Result<()> {
            Err(io::ErrorKind::StorageFull.into())
        }
    }

    impl Seek for Refusing {
        fn seek(&mut self, _: SeekFrom) -> io::Result<u64> {
            Err(io::ErrorKind::StorageFull.into())
        }
    }
}
