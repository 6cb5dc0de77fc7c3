//! The content of a cached file and its checksum.

use std::io;

use serde::{Deserialize, Serialize};

use crate::transport::{Bounces, Channels, RigShape};

/// The member `krylux.json` of a file: everything but the arrays. Its JSON text is part of the checksum.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Record {
    pub(super) key: String,
    pub(super) label: String,
    pub(super) channel: usize,
    pub(super) channels: Channels,
    pub(super) rig: RigShape,
    pub(super) layers: Vec<Bounces>,
    pub(super) has_noise: bool,
    pub(super) paths: u64,
    pub(super) rays: u64,
    pub(super) dispatches: u32,
    pub(super) longest_ns: u64,
    pub(super) tracing_ns: u64,
    /// BLAKE3 hash of the fields above and of the arrays. It is empty while the hash is computed.
    pub(super) checksum: String,
}

/// One channel of a layer in CSR form: row starts, columns and weights. Of a symmetric matrix it has what is on and above the
/// diagonal.
pub(super) type Rows = (Vec<u64>, Vec<u32>, Vec<f32>);

/// The arrays of one file.
#[derive(Debug)]
pub(super) struct Arrays<L = Rows> {
    pub(super) layers: Vec<L>,
    pub(super) direct: Vec<f32>,
    pub(super) ambient: Vec<f32>,
    pub(super) white_error: Vec<f32>,
    pub(super) noise: Vec<f64>,
}

/// A layer whose arrays are made piece by piece, while they are written.
pub(super) trait InPieces {
    /// The offset of each row, then the number of entries.
    fn starts(&self) -> Vec<u64>;

    /// The numbers of columns and of weights, which are equal in a matrix.
    fn counts(&self) -> [usize; 2];

    /// The columns of all entries.
    fn columns<'a>(&'a self) -> Box<dyn Iterator<Item = Vec<u32>> + 'a>;

    /// The weights of all entries.
    fn weights<'a>(&'a self) -> Box<dyn Iterator<Item = Vec<f32>> + 'a>;
}

impl InPieces for Rows {
    fn starts(&self) -> Vec<u64> {
        self.0.clone()
    }

    fn counts(&self) -> [usize; 2] {
        [self.1.len(), self.2.len()]
    }

    fn columns<'a>(&'a self) -> Box<dyn Iterator<Item = Vec<u32>> + 'a> {
        Box::new(std::iter::once(self.1.clone()))
    }

    fn weights<'a>(&'a self) -> Box<dyn Iterator<Item = Vec<f32>> + 'a> {
        Box::new(std::iter::once(self.2.clone()))
    }
}

/// The checksum of a record and its arrays while they are read or written, in the order of the fields.
pub(super) struct Checksum(blake3::Hasher);

impl Checksum {
    /// That of a record, whose arrays follow.
    pub(super) fn new(record: &Record) -> io::Result<Self> {
        let record = Record { checksum: String::new(), ..record.clone() };
        let mut checksum = Self(blake3::Hasher::new());
        checksum.array(&serde_json::to_vec(&record)?);
        Ok(checksum)
    }

    /// Begins an array of `count` values.
    pub(super) fn begin<T>(&mut self, count: usize) {
        self.0.update(&((count * size_of::<T>()) as u64).to_le_bytes());
    }

    /// Adds some values of the array that has begun.
    pub(super) fn piece<T: bytemuck::NoUninit>(&mut self, values: &[T]) {
        self.0.update(bytemuck::cast_slice(values));
    }

    /// Adds a whole array.
    pub(super) fn array<T: bytemuck::NoUninit>(&mut self, values: &[T]) {
        self.begin::<T>(values.len());
        self.piece(values);
    }

    /// Adds the arrays that follow the layers.
    pub(super) fn planes<L>(&mut self, arrays: &Arrays<L>) {
        self.array(&arrays.direct);
        self.array(&arrays.ambient);
        self.array(&arrays.white_error);
        self.array(&arrays.noise);
    }

    /// The checksum in hexadecimal digits.
    pub(super) fn finish(&self) -> String {
        self.0.finalize().to_hex().to_string()
    }
}

impl Record {
    /// The checksum of this record with these arrays.
    pub(super) fn checksum(&self, arrays: &Arrays) -> io::Result<String> {
        let mut checksum = Checksum::new(self)?;
        for (starts, columns, weights) in &arrays.layers {
            checksum.array(starts);
            checksum.array(columns);
            checksum.array(weights);
        }
        checksum.planes(arrays);
        Ok(checksum.finish())
    }
}

/// The name of a layer's array in the archive. The arrays of the last layer have SciPy's names, those of
/// other layers a prefix.
pub(super) fn member(bounces: Bounces, last: bool, array: &str) -> String {
    let layer = match bounces {
        _ if last => return array.into(),
        Bounces::One => "one",
        Bounces::Two => "two",
        Bounces::Rest | Bounces::Global => "rest",
    };
    format!("{layer}_{array}")
}
