//! MATLAB's files of version 5 (`save -v6` and `-v7`), by MathWorks' description of the format, "MAT-File Level 5".

use std::path::Path;

use flate2::read::ZlibDecoder;

use super::archive::expand;
use super::npz::{are_starts, line_of};
use super::{Entry, MatrixFile, dense, from_entries, unusable};
use crate::error::{Error, Result};
use crate::file;
use crate::io::npy::{Array, from_fortran_order};

/// The bytes before the first variable.
const HEADER: usize = 128;

/// The types of data elements, by their numbers in the format.
const COMPRESSED: u32 = 15;
const MATRIX: u32 = 14;

/// The class of sparse arrays. The classes of numbers are 6 (`double`) to 15 (`uint64`).
const SPARSE: u8 = 5;

/// A variable that may be the matrix.
enum Variable {
    Dense(Array),
    Sparse([usize; 2], Vec<Entry>),
}

/// Reads the only numeric variable that has more than one row and more than one column.
pub(super) fn read(path: &Path) -> Result<MatrixFile> {
    let bytes = file::read(path)?;
    if bytes.starts_with(b"MATLAB 7.3") {
        let name = path.display();
        let stem = path.with_extension("npy");
        return Err(Error::data(path, "it is a file of MATLAB 7.3, which is HDF5").help(format!(
            "save it with save('{name}', 'T', '-v7'), or convert it in Python:\n    import h5py, numpy\n    numpy.save('{}', h5py.File('{name}')['T'][()].T)",
            stem.display()
        )));
    }
    let fault = |what: &str| unusable(path, what.into());
    let is_little = match bytes.get(HEADER - 2..HEADER) {
        Some(b"IM") => true,
        Some(b"MI") => false,
        _ => return Err(fault("it is not a file of MATLAB 5 to 7")),
    };
    let mut found: Option<(String, Variable)> = None;
    let mut rest = Reader { bytes: &bytes[HEADER..], is_little };
    while !rest.bytes.is_empty() {
        let cut = || fault("it is cut off, or damaged");
        let (kind, content) = rest.element(true).ok_or_else(cut)?;
        let unpacked;
        let content = match kind {
            COMPRESSED => {
                unpacked = expand(content, ZlibDecoder::new(content))
                    .map_err(|what| fault(&format!("a variable {what}")))?;
                let (kind, inner) = Reader { bytes: &unpacked, is_little }.element(false).ok_or_else(cut)?;
                if kind == MATRIX { inner } else { continue }
            }
            MATRIX => content,
            _ => continue,
        };
        let Some((name, variable)) = variable(Reader { bytes: content, is_little }).ok_or_else(cut)? else {
            continue;
        };
        if let Some((other, _)) = &found {
            let what = format!("variables `{other}` and `{name}`");
            return Err(dense::several(path, &what, &format!("save('FILE.mat', '{name}', '-v7')")));
        }
        found = Some((name, variable));
    }
    match found {
        Some((_, Variable::Dense(array))) => dense::from_array(path, &array),
        Some((_, Variable::Sparse(shape, entries))) => Ok(from_entries(path, shape, entries)?.into()),
        None => Err(fault("it has no variable that is a matrix of real numbers")),
    }
}

/// Reads elements, each with its type and its length in front.
struct Reader<'a> {
    bytes: &'a [u8],
    is_little: bool,
}

impl<'a> Reader<'a> {
    fn word(&self, at: usize) -> Option<u32> {
        let word = self.bytes.get(at..at + 4)?.try_into().ok()?;
        Some(if self.is_little { u32::from_le_bytes(word) } else { u32::from_be_bytes(word) })
    }

    /// The type and the content of the next element. Elements end at multiples of eight bytes, but compressed ones in a file do not.
    fn element(&mut self, is_in_file: bool) -> Option<(u32, &'a [u8])> {
        let tag = self.word(0)?;
        // Up to four bytes may stand in the tag itself. Its upper half is then their number.
        let (kind, start, length, end): (u32, usize, usize, usize) = match (tag & 0xffff, tag >> 16) {
            (kind, length @ 1..=4) => (kind, 4, length as usize, 8),
            (_, 0) => {
                let length = self.word(4)? as usize;
                let is_padded = !(is_in_file && tag == COMPRESSED);
                let end = 8_usize.checked_add(length)?;
                (tag, 8, length, if is_padded { end.checked_next_multiple_of(8)? } else { end })
            }
            _ => return None,
        };
        let content = self.bytes.get(start..start.checked_add(length)?)?;
        self.bytes = &self.bytes[end.min(self.bytes.len())..];
        Some((kind, content))
    }

    /// The numbers of the next element.
    fn numbers(&mut self) -> Option<Vec<f64>> {
        let is_little = self.is_little;
        let (kind, bytes) = self.element(false)?;
        macro_rules! numbers {
            ($type:ty) => {{
                let (exact, rest) = bytes.as_chunks::<{ size_of::<$type>() }>();
                let number = |bytes: &[u8; size_of::<$type>()]| match is_little {
                    true => <$type>::from_le_bytes(*bytes) as f64,
                    false => <$type>::from_be_bytes(*bytes) as f64,
                };
                rest.is_empty().then(|| exact.iter().map(number).collect())
            }};
        }
        match kind {
            1 => numbers!(i8),
            2 => numbers!(u8),
            3 => numbers!(i16),
            4 => numbers!(u16),
            5 => numbers!(i32),
            6 => numbers!(u32),
            7 => numbers!(f32),
            9 => numbers!(f64),
            12 => numbers!(i64),
            13 => numbers!(u64),
            _ => None,
        }
    }

    fn indices(&mut self) -> Option<Vec<usize>> {
        let index = |number: f64| (0.0..9e15).contains(&number).then_some(number as usize);
        self.numbers()?.into_iter().map(index).collect()
    }
}

/// A variable with its name. The outer `None` means that the bytes are damaged, and the inner one that the variable is no matrix of real
/// numbers.
fn variable(mut content: Reader<'_>) -> Option<Option<(String, Variable)>> {
    let (_, flags) = content.element(false)?;
    let flags = Reader { bytes: flags, ..content }.word(0)?;
    let (class, is_complex) = ((flags & 0xff) as u8, flags & 0x800 != 0);
    if is_complex || !(class == SPARSE || (6..=15).contains(&class)) {
        return Some(None);
    }
    let shape = content.indices()?;
    let (_, name) = content.element(false)?;
    let name = String::from_utf8_lossy(name).into_owned();
    // Without lengths of zero, the product of all lengths bounds that of any of them.
    if shape.contains(&0) || shape.iter().filter(|&&length| length > 1).count() < 2 {
        return Some(None);
    }
    if class == SPARSE {
        let &[rows, cols] = shape.as_slice() else { return None };
        let (indices, starts, values) = (content.indices()?, content.indices()?, content.numbers()?);
        // There may be room for more entries.
        if !are_starts(&starts, cols, *starts.last()?) || *starts.last()? > indices.len().min(values.len()) {
            return None;
        }
        let columns = line_of(&starts).zip(indices).zip(values);
        let entries = columns.map(|((column, row), value)| (row, column, value)).collect();
        return Some(Some((name, Variable::Sparse([rows, cols], entries))));
    }
    let values = content.numbers()?;
    let count = shape.iter().try_fold(1_usize, |product, &length| product.checked_mul(length))?;
    if count != values.len() {
        return None;
    }
    let values = from_fortran_order(&shape, &values);
    Some(Some((name, Variable::Dense(Array { shape, values }))))
}
