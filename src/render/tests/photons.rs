//! The photon map: shader and host find the same buckets.

use super::kernel::{gpu, run};
use crate::render::photon_grid::hash;

#[test]
fn shader_and_host_agree_on_the_hash_of_a_cell() {
    let cells: Vec<[i32; 3]> =
        (0..500).map(|k| [k * 37 % 211 - 100, k * 53 % 307 - 150, 5 - k * 11 % 401]).collect();
    let input: Vec<[f32; 4]> = cells.iter().map(|&[x, y, z]| [x as f32, y as f32, z as f32, 0.0]).collect();
    // A number of 32 bits as two of 16, which are exact in `f32`.
    let source = "#import photons
        fn work(index: u32) -> vec4f {
            let hash = photon_hash(vec3i(input[index].xyz));
            return vec4f(f32(hash >> 16u), f32(hash & 0xffffu), 0.0, 0.0);
        }";
    for (cell, [high, low, ..]) in cells.iter().zip(run(&gpu(), source, &[], &input, cells.len())) {
        assert_eq!((high as u32) << 16 | low as u32, hash(*cell), "{cell:?}");
    }
}
