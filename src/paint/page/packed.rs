//! Matrices as bytes in a page.
//!
//! The columns of a layer are packed as numbers of seven bits a byte: of each column first how many entries it has, all columns in a row; then
//! the distance of each entry from the one before. The values stand apart, as half or single floats relative to the largest. Of a symmetric
//! matrix only the entries on and below the diagonal are packed.

use half::f16;

use crate::sparse::Csr;

/// How values are stored.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Precision {
    /// 16 bits: eleven of precision.
    #[default]
    Half,
    /// 32 bits.
    Single,
}

/// A packed layer: positions, and the values of each channel.
pub(super) struct PackedLayer {
    pub(super) positions: Vec<u8>,
    pub(super) values: Vec<Vec<u8>>,
    /// What the values are multiplied by, one for each channel.
    pub(super) scales: Vec<f32>,
    pub(super) is_symmetric: bool,
}

impl Precision {
    /// A value, relative to the largest, as it is read back.
    pub(super) fn rounded(self, value: f64) -> f64 {
        match self {
            Self::Half => f16::from_f64(value).to_f64(),
            Self::Single => f64::from(value as f32),
        }
    }

    fn put(self, value: f64, bytes: &mut Vec<u8>) {
        match self {
            Self::Half => bytes.extend(f16::from_f64(value).to_le_bytes()),
            Self::Single => bytes.extend((value as f32).to_le_bytes()),
        }
    }
}

/// The largest size of a channel's entries, by which the stored values are relative.
pub(super) fn scale_of(columns: &Csr) -> f64 {
    let largest = columns.weights().iter().fold(0.0, |most: f64, value| most.max(value.abs()));
    if largest > 0.0 { f64::from(largest as f32) } else { 1.0 }
}

/// Packs the columns of all channels of a layer, which have the same positions.
pub(super) fn pack(columns: &[Csr], precision: Precision) -> PackedLayer {
    let is_symmetric = columns.iter().all(Csr::is_symmetric);
    let first = &columns[0];
    let kept = |column: usize| {
        let (places, _) = first.row(column);
        let from = if is_symmetric { places.partition_point(|&place| (place as usize) < column) } else { 0 };
        from..places.len()
    };
    let mut positions = Vec::new();
    (0..first.rows()).for_each(|column| put_number(kept(column).len() as u32, &mut positions));
    for column in 0..first.rows() {
        let mut last = 0;
        for &place in &first.row(column).0[kept(column)] {
            put_number(place - last, &mut positions);
            last = place;
        }
    }
    let scales: Vec<f64> = columns.iter().map(scale_of).collect();
    let values = columns.iter().zip(&scales).map(|(columns, scale)| {
        let mut bytes = Vec::new();
        for column in 0..columns.rows() {
            let values = &columns.row(column).1[kept(column)];
            values.iter().for_each(|value| precision.put(value / scale, &mut bytes));
        }
        bytes
    });
    let values = values.collect();
    PackedLayer {
        positions,
        values,
        scales: scales.iter().map(|&scale| scale as f32).collect(),
        is_symmetric,
    }
}

fn put_number(mut value: u32, bytes: &mut Vec<u8>) {
    while value > 127 {
        bytes.push((value & 127) as u8 | 128);
        value >>= 7;
    }
    bytes.push(value as u8);
}
