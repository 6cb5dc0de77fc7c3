//! Checks of the content of a cached file. A correct checksum is not enough, because anyone who writes a file can calculate its checksum.

use super::file::{Arrays, Record, Rows};
use crate::transport::{Bounces, Channels, RigShape};

/// Checks that the arrays of a file form a matrix of `rig` with these channels. The error text says what is wrong.
pub(super) fn require_matrix(
    record: &Record,
    arrays: &Arrays,
    rig: RigShape,
    channels: Channels,
) -> Result<(), String> {
    let found = record.rig;
    if (found.camera, found.projector) != (rig.camera, rig.projector) || record.channels != channels {
        return Err("it holds a matrix of another size".into());
    }
    if found.symmetric && found.camera != found.projector {
        return Err("its matrix is said to be symmetric, but is not square".into());
    }
    let global = match record.layers.as_slice() {
        [Bounces::One, global @ ..] => global,
        global => global,
    };
    if !matches!(global, [Bounces::Global] | [Bounces::Two, Bounces::Rest]) {
        return Err(format!("its layers are {:?}", record.layers));
    }
    let (rows, columns) = (found.camera.pixels(), found.projector.pixels());
    for layer in &arrays.layers {
        require_rows(layer, rows, columns)?;
        if found.symmetric {
            require_upper(layer)?;
        }
    }
    let lengths = [
        ("direct", &arrays.direct, if found.symmetric { rows } else { 0 }),
        ("ambient", &arrays.ambient, rows),
        ("white_error", &arrays.white_error, if record.has_noise { rows } else { 0 }),
    ];
    match lengths.iter().find(|(_, array, length)| array.len() != *length) {
        Some((name, array, length)) => Err(format!("{name}: {} values, but {length} expected", array.len())),
        None => Ok(()),
    }
}

/// Checks that row starts, columns and weights form a sparse matrix of `rows × cols`.
fn require_rows((starts, columns, weights): &Rows, rows: usize, cols: usize) -> Result<(), String> {
    let entries = columns.len();
    if starts.len() != rows + 1
        || starts.first() != Some(&0)
        || starts.last() != Some(&(entries as u64))
        || !starts.is_sorted()
        || weights.len() != entries
    {
        return Err("the arrays of a layer do not fit together".into());
    }
    let is_row =
        |row: &[u32]| row.is_sorted_by(|a, b| a < b) && row.last().is_none_or(|&last| (last as usize) < cols);
    // The starts are sorted and end at the number of entries, so every row has a valid range.
    match starts.windows(2).position(|of| !is_row(&columns[of[0] as usize..of[1] as usize])) {
        Some(row) => Err(format!("row {row} of a layer has columns out of order or beyond {cols}")),
        None => Ok(()),
    }
}

/// Checks that rows have no entries below the diagonal. The rows must have passed [`require_rows`].
fn require_upper((starts, columns, _): &Rows) -> Result<(), String> {
    let is_below = |(row, of): (usize, &[u64])| {
        columns[of[0] as usize..of[1] as usize].first().is_some_and(|&first| (first as usize) < row)
    };
    match starts.windows(2).enumerate().position(is_below) {
        Some(row) => {
            Err(format!("row {row} of a layer has columns below the diagonal of a symmetric matrix"))
        }
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use std::fs::File;
    use std::path::Path;

    use super::*;
    use crate::cache::Key;
    use crate::cache::file::{InPieces, read, write_channel};
    use crate::gpu::AdapterSummary;
    use crate::image::Resolution;
    use crate::render::TraceSettings;

    fn in_pieces((starts, columns, weights): Rows) -> InPieces<'static> {
        let counts = [columns.len(), weights.len()];
        let (columns, weights) = (std::iter::once(columns), std::iter::once(weights));
        InPieces { starts, counts, columns: Box::new(columns), weights: Box::new(weights) }
    }

    fn key() -> Key {
        let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/scenes/corner/scene.glb");
        let scene = crate::scene::load(&scene, None).expect("shipped scenes load");
        let settings = TraceSettings::new(Resolution::new(2, 2), 4);
        Key::new(&scene, &AdapterSummary::default(), &settings, Channels::Luma, false)
    }

    /// A valid symmetric matrix of 2×2 pixels with two entries. The file contains only the entry above the diagonal.
    fn sound(key: &Key) -> (Record, Arrays) {
        let record = Record {
            key: key.hex().into(),
            label: "a test".into(),
            channel: 0,
            channels: Channels::Luma,
            rig: RigShape { symmetric: true, ..key.rig() },
            layers: vec![Bounces::Global],
            has_noise: true,
            paths: 16,
            rays: 16,
            dispatches: 1,
            longest_ns: 1,
            tracing_ns: 1,
            checksum: String::new(),
        };
        let arrays = Arrays {
            layers: vec![(vec![0, 0, 1, 1, 1], vec![2], vec![0.5])],
            direct: vec![1.0; 4],
            ambient: vec![0.0; 4],
            white_error: vec![0.1; 4],
            noise: vec![0.1; 3],
        };
        (record, arrays)
    }

    /// Reads a file that was written with this content and a correct checksum.
    fn read_back(key: &Key, record: Record, arrays: Arrays) -> Result<(), String> {
        let Arrays { layers, direct, ambient, white_error, noise } = arrays;
        let layers = layers.into_iter().map(in_pieces).collect();
        let arrays = Arrays { layers, direct, ambient, white_error, noise };
        let folder = tempfile::tempdir().expect("a temporary folder can be made");
        let path = folder.path().join("matrix.npz");
        let mut file = File::create(&path).expect("the folder is writable");
        write_channel(&mut file, record, arrays).expect("the folder is writable");
        let file = File::open(&path).expect("it was written");
        read(key, vec![(path, file)]).map(|found| assert_eq!(found.matrix.nonzeros(), 2))
    }

    #[test]
    fn a_right_checksum_does_not_make_a_matrix() {
        type Change = fn(&mut Record, &mut Arrays);
        let changes: [Change; 19] = [
            |record, _| record.rig.camera = Resolution::new(2, 3),
            |record, _| record.rig.projector = Resolution::new(1 << 31, 2),
            |record, _| record.rig.camera = Resolution::new(1 << 31, 1 << 31),
            |record, _| record.layers = vec![Bounces::Two],
            |record, arrays| {
                record.layers.clear();
                arrays.layers.clear();
            },
            |record, _| record.has_noise = false,
            |_, arrays| arrays.layers[0].0[1] = 7,
            |_, arrays| arrays.layers[0].0[0] = 1,
            |_, arrays| arrays.layers[0].0[4] = 3,
            |_, arrays| arrays.layers[0].0.truncate(2),
            |_, arrays| arrays.layers[0].0.clear(),
            |_, arrays| arrays.layers[0].1[0] = 4,
            // The only entry is in row 2, column 1, below the diagonal.
            |_, arrays| arrays.layers[0] = (vec![0, 0, 0, 1, 1], vec![1], vec![0.5]),
            |_, arrays| arrays.layers[0] = (vec![0, 2, 2, 2, 2], vec![2, 1], vec![0.5, 0.5]),
            |_, arrays| arrays.layers[0].2.clear(),
            |_, arrays| arrays.direct.truncate(2),
            |_, arrays| arrays.ambient.clear(),
            |_, arrays| arrays.white_error.push(0.0),
            |_, arrays| arrays.noise.truncate(2),
        ];
        let key = key();
        let (record, arrays) = sound(&key);
        assert_eq!(read_back(&key, record, arrays), Ok(()));
        for (index, change) in changes.iter().enumerate() {
            let (mut record, mut arrays) = sound(&key);
            change(&mut record, &mut arrays);
            assert!(read_back(&key, record, arrays).is_err(), "change {index} is taken for a matrix");
        }
    }
}
