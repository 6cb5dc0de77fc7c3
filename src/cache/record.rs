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

/// The arrays of one file.
#[derive(Debug, Default)]
pub(super) struct Arrays {
    /// The layers in CSR form: row starts, columns and weights.
    pub(super) layers: Vec<(Vec<u64>, Vec<u32>, Vec<f32>)>,
    pub(super) direct: Vec<f32>,
    pub(super) ambient: Vec<f32>,
    pub(super) white_error: Vec<f32>,
    pub(super) noise: Vec<f64>,
}

impl Record {
    /// The checksum of this record with these arrays.
    pub(super) fn checksum(&self, arrays: &Arrays) -> io::Result<String> {
        let record = Self { checksum: String::new(), ..self.clone() };
        let mut hasher = blake3::Hasher::new();
        let mut part = |bytes: &[u8]| {
            hasher.update(&(bytes.len() as u64).to_le_bytes());
            hasher.update(bytes);
        };
        part(&serde_json::to_vec(&record)?);
        for (starts, columns, weights) in &arrays.layers {
            part(bytemuck::cast_slice(starts));
            part(bytemuck::cast_slice(columns));
            part(bytemuck::cast_slice(weights));
        }
        part(bytemuck::cast_slice(&arrays.direct));
        part(bytemuck::cast_slice(&arrays.ambient));
        part(bytemuck::cast_slice(&arrays.white_error));
        part(bytemuck::cast_slice(&arrays.noise));
        Ok(hasher.finalize().to_hex().to_string())
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
