//! The hash grid in which paths find photons: the photons of a cell lie side by side, and so do those of two neighbouring
//! cells along x.

use rayon::prelude::*;

/// A photon as `trace_photons` records it: four texels, which `shaders/shared/photons.wgsl` describes.
pub(super) type Photon = [[u32; 4]; 4];

/// The most photons in one bucket, so that no invocation loops longer than the driver allows. In fuller
/// buckets an even selection of photons is kept, and their power is increased accordingly.
pub(super) const MAX_BUCKET: usize = 512;

/// Photons in the buckets of a hash grid.
pub(super) struct Grid {
    /// Number of buckets, a power of two, minus 1.
    pub(super) mask: u32,
    /// The first photon of each bucket, and the end of the last one.
    pub(super) start: Vec<u32>,
    pub(super) photons: Vec<Photon>,
}

impl Grid {
    /// Sorts `photons` by the buckets of their cells.
    pub(super) fn new(photons: Vec<Photon>, inverse_cell: f32) -> Self {
        let buckets = photons.len().next_power_of_two().max(2);
        let mask = buckets as u32 - 1;
        let mut keyed: Vec<(u32, Photon)> = photons
            .into_par_iter()
            .map(|photon| (hash(cell(&photon, inverse_cell)) & mask, photon))
            .collect();
        // The sort is stable: photons of one bucket stay in the order of their paths.
        keyed.par_sort_by_key(|&(bucket, _)| bucket);
        let mut start = Vec::with_capacity(buckets + 2);
        let mut photons: Vec<Photon> = Vec::with_capacity(keyed.len());
        let mut runs = keyed.chunk_by(|a, b| a.0 == b.0).peekable();
        for bucket in 0..=mask {
            start.push(photons.len() as u32);
            if let Some(run) = runs.next_if(|run| run[0].0 == bucket) {
                thin(run, &mut photons);
            }
        }
        start.push(photons.len() as u32);
        // The first bucket comes once more behind the last one, so that the photons of two neighbouring cells
        // along x always lie side by side.
        photons.extend_from_within(..start[1] as usize);
        start.push(photons.len() as u32);
        Self { mask, start, photons }
    }
}

/// Appends an even selection of at most [`MAX_BUCKET`] photons of a bucket, with the total power of all.
fn thin(run: &[(u32, Photon)], sorted: &mut Vec<Photon>) {
    let kept = run.len().min(MAX_BUCKET);
    let share = run.len() as f32 / kept as f32;
    sorted.extend((0..kept).map(|index| brightened(run[index * run.len() / kept].1, share)));
}

/// The photon with its power multiplied by `share`.
pub(super) fn brightened(mut photon: Photon, share: f32) -> Photon {
    for power in &mut photon[1][1..] {
        *power = (f32::from_bits(*power) * share).to_bits();
    }
    photon
}

/// The grid cell of a photon's position.
fn cell(photon: &Photon, inverse_cell: f32) -> [i32; 3] {
    [1, 2, 3].map(|axis| (f32::from_bits(photon[0][axis]) * inverse_cell).floor() as i32)
}

/// The hash of a grid cell, as `photon_hash` in `shaders/shared/photons.wgsl`.
pub(super) fn hash(cell: [i32; 3]) -> u32 {
    let [x, y, z] = cell.map(i32::cast_unsigned);
    let mixed = (y.wrapping_mul(19_349_663) ^ z.wrapping_mul(83_492_791)).wrapping_mul(0x9e37_79b1);
    (mixed ^ mixed >> 15).wrapping_add(x)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_photons_of_two_neighbouring_cells_lie_side_by_side() {
        let place = |index: u32| {
            let at = |step: u32| (f32::from((index * step % 97) as u8) / 8.0 - 6.0).to_bits();
            [[index, at(7), at(13), at(31)], [0; 4], [0; 4], [0; 4]]
        };
        let photons: Vec<Photon> = (0..97).map(place).collect();
        let grid = Grid::new(photons.clone(), 1.0);
        for y in -6..7 {
            for z in -6..7 {
                for x in -7..7 {
                    let bucket = (hash([x, y, z]) & grid.mask) as usize;
                    let found = &grid.photons[grid.start[bucket] as usize..grid.start[bucket + 2] as usize];
                    let inside = |photon: &&Photon| {
                        let [at, row @ ..] = cell(photon, 1.0);
                        row == [y, z] && (at == x || at == x + 1)
                    };
                    let indices = |photons: &[Photon]| -> Vec<u32> {
                        let mut indices: Vec<u32> = photons.iter().filter(inside).map(|p| p[0][0]).collect();
                        indices.sort_unstable();
                        indices
                    };
                    assert_eq!(indices(found), indices(&photons), "{x}, {y}, {z}");
                }
            }
        }
    }

    #[test]
    fn a_full_bucket_keeps_its_light() {
        let photon = [[0; 4], [0, 1.0_f32.to_bits(), 2.0_f32.to_bits(), 0], [0; 4], [0; 4]];
        let mut sorted = Vec::new();
        thin(&[(0, photon); 1000], &mut sorted);
        let light: f32 = sorted.iter().map(|photon| f32::from_bits(photon[1][2])).sum();
        // 1000/512 is rounded, and added up 512 times.
        assert!(sorted.len() == MAX_BUCKET && (light - 2000.0).abs() < 0.01);
    }
}
