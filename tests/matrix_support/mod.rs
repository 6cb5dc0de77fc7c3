//! Matrix files as other programs write them, made byte by byte.
#![allow(dead_code, reason = "each test uses some of these files")]

use std::io::{Cursor, Write};

use flate2::Compression;
use flate2::write::{GzEncoder, ZlibEncoder};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

/// A matrix of whole numbers. Entries at the same position are added.
#[derive(Clone, Debug)]
pub struct Entries {
    pub rows: usize,
    pub cols: usize,
    /// Row, column and value, in any order.
    pub entries: Vec<(usize, usize, i32)>,
}

/// Which entries a Matrix Market file lists.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Symmetry {
    General,
    Symmetric,
    Skew,
}

pub const SYMMETRIES: [Symmetry; 3] = [Symmetry::General, Symmetry::Symmetric, Symmetry::Skew];

impl Symmetry {
    fn name(self) -> &'static str {
        match self {
            Self::General => "general",
            Self::Symmetric => "symmetric",
            Self::Skew => "skew-symmetric",
        }
    }

    fn lists(self, row: usize, column: usize) -> bool {
        match self {
            Self::General => true,
            Self::Symmetric => row >= column,
            Self::Skew => row > column,
        }
    }
}

impl Entries {
    /// All values, row by row.
    pub fn dense(&self) -> Vec<f64> {
        let mut values = vec![0.0; self.rows * self.cols];
        for &(row, column, value) in &self.entries {
            values[row * self.cols + column] += f64::from(value);
        }
        values
    }

    /// All values, column by column.
    pub fn by_columns(&self) -> Vec<f64> {
        let values = self.dense();
        let column = |column: usize| (0..self.rows).map(move |row| row * self.cols + column);
        (0..self.cols).flat_map(column).map(|at| values[at]).collect()
    }

    /// The same entries with the value 1.
    pub fn with_ones(&self) -> Self {
        let entries = self.entries.iter().map(|&(row, column, _)| (row, column, 1)).collect();
        Self { entries, ..*self }
    }

    /// The entries that a file of this symmetry lists. Without symmetry it is all of them, and otherwise those of a square matrix.
    pub fn listed(&self, symmetry: Symmetry) -> Self {
        let side = self.rows.min(self.cols);
        let [rows, cols] = if symmetry == Symmetry::General { [self.rows, self.cols] } else { [side; 2] };
        let is_listed = |&&(row, column, _): &&(usize, usize, i32)| {
            row < rows && column < cols && symmetry.lists(row, column)
        };
        Self { rows, cols, entries: self.entries.iter().filter(is_listed).copied().collect() }
    }

    /// The matrix that listed entries stand for.
    pub fn mirrored(&self, symmetry: Symmetry) -> Self {
        let factor = match symmetry {
            Symmetry::General => return self.clone(),
            Symmetry::Symmetric => 1,
            Symmetry::Skew => -1,
        };
        let beside = self.entries.iter().filter(|entry| entry.0 != entry.1);
        let mirrored = beside.map(|&(row, column, value)| (column, row, factor * value));
        Self { entries: self.entries.iter().copied().chain(mirrored).collect(), ..*self }
    }

    /// The starts of rows or of columns, the other index of each entry, and its value.
    fn compressed(&self, by_columns: bool) -> (Vec<i32>, Vec<i32>, Vec<f64>) {
        let (mut starts, mut indices, mut values) = (vec![0], Vec::new(), Vec::new());
        for line in 0..if by_columns { self.cols } else { self.rows } {
            for &(row, column, value) in &self.entries {
                let (major, minor) = if by_columns { (column, row) } else { (row, column) };
                if major == line {
                    indices.push(minor as i32);
                    values.push(f64::from(value));
                }
            }
            starts.push(indices.len() as i32);
        }
        (starts, indices, values)
    }
}

/// The bytes of an array in `.npy` format, whose numbers have the type `kind` of NumPy.
pub fn npy(kind: &str, shape: &[usize], numbers: &[u8]) -> Vec<u8> {
    let lengths = shape.iter().map(usize::to_string).collect::<Vec<_>>().join(", ");
    let comma = if shape.len() == 1 { "," } else { "" };
    let header = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': ({lengths}{comma}), }}");
    // The values begin at a multiple of 64 bytes. Ten bytes stand before the header, and a line break ends it.
    let length = (11 + header.len()).next_multiple_of(64) - 10;
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((length as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    bytes.resize(9 + length, b' ');
    bytes.push(b'\n');
    bytes.extend(numbers);
    bytes
}

pub fn doubles(shape: &[usize], values: &[f64]) -> Vec<u8> {
    npy("<f8", shape, &values.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<u8>>())
}

fn integers(values: &[i32]) -> Vec<u8> {
    npy("<i4", &[values.len()], &values.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<u8>>())
}

fn long_integers(values: &[i64]) -> Vec<u8> {
    npy("<i8", &[values.len()], &values.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<u8>>())
}

/// An archive of arrays.
pub fn npz(members: &[(&str, Vec<u8>)], is_packed: bool) -> Vec<u8> {
    let method = if is_packed { CompressionMethod::Deflated } else { CompressionMethod::Stored };
    let options = SimpleFileOptions::default().compression_method(method);
    let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
    for (name, bytes) in members {
        archive.start_file(format!("{name}.npy"), options).expect("memory can be written");
        archive.write_all(bytes).expect("memory can be written");
    }
    archive.finish().expect("memory can be written").into_inner()
}

/// An archive of SciPy's `save_npz`.
fn scipy(format: &str, matrix: &Entries, arrays: Vec<(&str, Vec<u8>)>, is_packed: bool) -> Vec<u8> {
    let shape = long_integers(&[matrix.rows as i64, matrix.cols as i64]);
    let format = npy("|S3", &[], format.as_bytes());
    let members: Vec<_> = [("format", format), ("shape", shape)].into_iter().chain(arrays).collect();
    npz(&members, is_packed)
}

/// The matrix in each sparse format of SciPy, with the name of the format.
pub fn scipy_files(matrix: &Entries, is_packed: bool) -> Vec<(&'static str, Vec<u8>)> {
    let compressed = |by_columns| {
        let (starts, indices, values) = matrix.compressed(by_columns);
        vec![
            ("indices", integers(&indices)),
            ("indptr", integers(&starts)),
            ("data", doubles(&[values.len()], &values)),
        ]
    };
    let numbers =
        |number: fn(&(usize, usize, i32)) -> i64| matrix.entries.iter().map(number).collect::<Vec<_>>();
    let values: Vec<f64> = matrix.entries.iter().map(|entry| f64::from(entry.2)).collect();
    let coordinates = vec![
        ("row", long_integers(&numbers(|entry| entry.0 as i64))),
        ("col", long_integers(&numbers(|entry| entry.1 as i64))),
        ("data", doubles(&[values.len()], &values)),
    ];
    let formats = [
        ("csr", compressed(false)),
        ("csc", compressed(true)),
        ("coo", coordinates),
        ("bsr", blocks(matrix)),
        ("dia", diagonals(matrix)),
    ];
    formats.into_iter().map(|(format, arrays)| (format, scipy(format, matrix, arrays, is_packed))).collect()
}

/// The arrays of `bsr`. Entries of odd and of even index are in blocks of their own, so blocks may repeat a position.
fn blocks(matrix: &Entries) -> Vec<(&'static str, Vec<u8>)> {
    let height = if matrix.rows.is_multiple_of(2) { 2 } else { 1 };
    let width = if matrix.cols.is_multiple_of(3) { 3 } else { 1 };
    let (mut starts, mut columns, mut values) = (vec![0], Vec::new(), Vec::new());
    for top in (0..matrix.rows).step_by(height) {
        let lefts = |parity: usize| (0..matrix.cols).step_by(width).map(move |left| (parity, left));
        for (parity, left) in (0..2).flat_map(lefts) {
            let mut block = vec![0.0; height * width];
            for (at, &(row, column, value)) in matrix.entries.iter().enumerate() {
                let is_inside = (top..top + height).contains(&row) && (left..left + width).contains(&column);
                if at % 2 == parity && is_inside {
                    block[(row - top) * width + column - left] += f64::from(value);
                }
            }
            if block.iter().any(|value| *value != 0.0) {
                columns.push((left / width) as i32);
                values.extend(block);
            }
        }
        starts.push(columns.len() as i32);
    }
    let shape = [columns.len(), height, width];
    vec![("indices", integers(&columns)), ("indptr", integers(&starts)), ("data", doubles(&shape, &values))]
}

/// A value that no sum of entries has.
const OUTSIDE: f64 = 1e9;

/// The arrays of `dia`. Places outside of the matrix hold a value that must not be read.
fn diagonals(matrix: &Entries) -> Vec<(&'static str, Vec<u8>)> {
    let dense = matrix.dense();
    let (mut offsets, mut values) = (Vec::new(), Vec::new());
    let [rows, cols] = [matrix.rows as i32, matrix.cols as i32];
    for offset in 1 - rows..cols {
        let value = |column: i32| {
            let row = column - offset;
            let is_inside = (0..rows).contains(&row) && column < cols;
            if is_inside { dense[(row * cols + column) as usize] } else { OUTSIDE }
        };
        // One place more than the matrix has columns.
        let diagonal: Vec<f64> = (0..=cols).map(value).collect();
        if offset == 0 || diagonal.iter().any(|value| *value != 0.0 && *value != OUTSIDE) {
            offsets.push(offset);
            values.extend(diagonal);
        }
    }
    let shape = [offsets.len(), matrix.cols + 1];
    vec![("offsets", integers(&offsets)), ("data", doubles(&shape, &values))]
}

/// A coordinate file of Matrix Market with the entries that are listed.
pub fn mtx_coordinates(listed: &Entries, field: &str, symmetry: Symmetry) -> String {
    let Entries { rows, cols, entries } = listed;
    let mut text = format!(
        "%%MatrixMarket matrix coordinate {field} {}\n% a comment\n\n{rows} {cols} {}\n",
        symmetry.name(),
        entries.len()
    );
    for (row, column, value) in entries {
        text += &match field {
            "pattern" => format!("{} {}\n", row + 1, column + 1),
            "integer" => format!("{} {} {value}\n", row + 1, column + 1),
            _ => format!("  {}\t{}  {value}.0e0\n", row + 1, column + 1),
        };
    }
    text
}

/// An array file of Matrix Market with the entries that are listed.
pub fn mtx_array(listed: &Entries, field: &str, symmetry: Symmetry) -> String {
    let Entries { rows, cols, .. } = *listed;
    let values = listed.dense();
    let mut text = format!("%%MatrixMarket matrix array {field} {}\n{rows} {cols}\n%\n", symmetry.name());
    for (column, row) in (0..cols).flat_map(|column| (0..rows).map(move |row| (column, row))) {
        if symmetry.lists(row, column) {
            text += &format!("{}\n", values[row * cols + column]);
        }
    }
    text
}

/// A text packed by gzip, in two parts one after the other.
pub fn packed_text(text: &str) -> Vec<u8> {
    let halves = text.as_bytes().split_at(text.len() / 2);
    [halves.0, halves.1].map(packed_part).concat()
}

fn packed_part(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::default());
    encoder.write_all(bytes).expect("memory can be written");
    encoder.finish().expect("memory can be written")
}

/// The numbers of the types of MATLAB's data elements.
pub mod matlab {
    pub const INT8: u32 = 1;
    pub const INT16: u32 = 3;
    pub const INT32: u32 = 5;
    pub const UINT32: u32 = 6;
    pub const DOUBLE: u32 = 9;
    pub const MATRIX: u32 = 14;
    pub const COMPRESSED: u32 = 15;
    /// Classes of variables.
    pub const CHAR_CLASS: u32 = 4;
    pub const SPARSE_CLASS: u32 = 5;
    pub const DOUBLE_CLASS: u32 = 6;
}

/// Writes MATLAB files of version 5, in one of both orders of bytes.
#[derive(Clone, Copy, Debug)]
pub struct Mat {
    pub is_little: bool,
    pub is_packed: bool,
}

/// Files of both orders of bytes, packed and not.
pub const MATS: [Mat; 4] = [
    Mat { is_little: true, is_packed: false },
    Mat { is_little: true, is_packed: true },
    Mat { is_little: false, is_packed: false },
    Mat { is_little: false, is_packed: true },
];

impl Mat {
    /// A file of these variables.
    pub fn file(self, variables: &[Vec<u8>]) -> Vec<u8> {
        let mut bytes = b"MATLAB 5.0 MAT-file, written by a test".to_vec();
        bytes.resize(116, b' ');
        bytes.resize(124, 0);
        bytes.extend(if self.is_little { *b"\x00\x01IM" } else { *b"\x01\x00MI" });
        for variable in variables {
            let element = self.element(matlab::MATRIX, variable);
            if !self.is_packed {
                bytes.extend(element);
                continue;
            }
            let mut encoder = ZlibEncoder::new(Vec::new(), Compression::default());
            encoder.write_all(&element).expect("memory can be written");
            let packed = encoder.finish().expect("memory can be written");
            // Packed elements are not padded.
            bytes.extend(self.word(matlab::COMPRESSED));
            bytes.extend(self.word(packed.len() as u32));
            bytes.extend(packed);
        }
        bytes
    }

    fn word(self, word: u32) -> [u8; 4] {
        if self.is_little { word.to_le_bytes() } else { word.to_be_bytes() }
    }

    /// A data element. Up to four bytes stand in its tag.
    pub fn element(self, kind: u32, content: &[u8]) -> Vec<u8> {
        let length = content.len() as u32;
        let mut bytes = match length {
            1..=4 => self.word((length << 16) | kind).to_vec(),
            _ => [self.word(kind), self.word(length)].concat(),
        };
        bytes.extend(content);
        bytes.resize(bytes.len().next_multiple_of(8), 0);
        bytes
    }

    /// Numbers that are stored as `kind`.
    pub fn numbers(self, kind: u32, values: &[f64]) -> Vec<u8> {
        let number = |&value: &f64| {
            let mut bytes = match kind {
                matlab::INT8 => (value as i8).to_be_bytes().to_vec(),
                matlab::INT16 => (value as i16).to_be_bytes().to_vec(),
                matlab::INT32 => (value as i32).to_be_bytes().to_vec(),
                _ => value.to_be_bytes().to_vec(),
            };
            if self.is_little {
                bytes.reverse();
            }
            bytes
        };
        self.element(kind, &values.iter().flat_map(number).collect::<Vec<u8>>())
    }

    /// What every variable begins with: its class, its shape and its name.
    pub fn head(self, class: u32, shape: &[usize], name: &str) -> Vec<u8> {
        let flags = [self.word(class), self.word(0)].concat();
        let shape: Vec<f64> = shape.iter().map(|&length| length as f64).collect();
        let name = self.element(matlab::INT8, name.as_bytes());
        [self.element(matlab::UINT32, &flags), self.numbers(matlab::INT32, &shape), name].concat()
    }

    /// A dense variable with values in the order of MATLAB (the first index runs fastest), stored as `kind`.
    pub fn dense(self, name: &str, shape: &[usize], kind: u32, values: &[f64]) -> Vec<u8> {
        [self.head(matlab::DOUBLE_CLASS, shape, name), self.numbers(kind, values)].concat()
    }

    /// A sparse variable. MATLAB may keep room for more entries, here for one.
    pub fn sparse(self, name: &str, matrix: &Entries) -> Vec<u8> {
        let (starts, mut rows, mut values) = matrix.compressed(true);
        rows.push(0);
        values.push(55.0);
        let indices = |indices: &[i32]| {
            let indices: Vec<f64> = indices.iter().map(|&index| f64::from(index)).collect();
            self.numbers(matlab::INT32, &indices)
        };
        let head = self.head(matlab::SPARSE_CLASS, &[matrix.rows, matrix.cols], name);
        [head, indices(&rows), indices(&starts), self.numbers(matlab::DOUBLE, &values)].concat()
    }
}
