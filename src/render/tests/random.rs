//! The hash that serves as random number generator.

use super::kernel::{gpu, run};
use super::statistics::{chi_square_test, threshold};
use crate::gpu::Gpu;

const COUNT: usize = 1 << 20;

/// `random4` at 128 × 8 × 8 × 128 keys (pixel, sample, vertex, seed), each shifted by `offset`. Without a
/// shift all coordinates are even, so that a shift by one never gives another of these keys, and all pairs
/// are disjoint. Pixels lie in 16 × 8 blocks of an image of width 128.
fn numbers(gpu: &Gpu, offset: [u32; 4]) -> Vec<[f32; 4]> {
    let source = format!(
        "#import rng
        fn work(index: u32) -> vec4f {{
            let block = vec2u(index % 16u, (index / 16u) % 8u);
            let pixel = 2u * block.x + 256u * block.y;
            let sample = 2u * ((index >> 7u) % 8u);
            let vertex = 2u * ((index >> 10u) % 8u);
            let seed = 2u * (index >> 13u);
            return random4(pixel + {}u, sample + {}u, vertex + {}u, seed + {}u);
        }}",
        offset[0], offset[1], offset[2], offset[3]
    );
    run(gpu, &source, &[], &[[0.0; 4]], COUNT)
}

/// The p-value of `bins²` equally likely squares.
fn pair_p_value(bins: usize, pairs: impl Iterator<Item = (f32, f32)>) -> f64 {
    let mut observed = vec![0.0; bins * bins];
    for (a, b) in pairs {
        observed[(a * bins as f32) as usize * bins + (b * bins as f32) as usize] += 1.0;
    }
    chi_square_test(&observed, &vec![COUNT as f64 / (bins * bins) as f64; bins * bins])
}

#[test]
fn random_numbers_are_uniform_and_neighbours_independent() {
    let gpu = gpu();
    let base = numbers(&gpu, [0; 4]);
    assert!(base.iter().flatten().all(|u| (0.0..1.0).contains(u)));
    let mut p_values = Vec::new();
    for c in 0..4 {
        let mut observed = vec![0.0; 1024];
        base.iter().for_each(|u| observed[(u[c] * 1024.0) as usize] += 1.0);
        p_values
            .push((format!("component {c}"), chi_square_test(&observed, &vec![COUNT as f64 / 1024.0; 1024])));
        for d in c + 1..4 {
            let p = pair_p_value(32, base.iter().map(|u| (u[c], u[d])));
            p_values.push((format!("components {c} and {d}"), p));
        }
    }
    let neighbours = [
        ("right pixel", [1, 0, 0, 0]),
        ("lower pixel", [128, 0, 0, 0]),
        ("next sample", [0, 1, 0, 0]),
        ("next vertex", [0, 0, 1, 0]),
        ("next seed", [0, 0, 0, 1]),
    ];
    for (name, offset) in neighbours {
        let shifted = numbers(&gpu, offset);
        for c in 0..4 {
            for d in 0..4 {
                let p = pair_p_value(32, base.iter().zip(&shifted).map(|(a, b)| (a[c], b[d])));
                p_values.push((format!("{name}, components {c} and {d}"), p));
            }
        }
    }
    let threshold = threshold(p_values.len());
    let least = p_values.iter().min_by(|a, b| a.1.total_cmp(&b.1));
    println!("{} tests, threshold {threshold:.2e}, least p {least:?}", p_values.len());
    let failed: Vec<_> = p_values.iter().filter(|(_, p)| p.is_nan() || *p < threshold).collect();
    assert!(failed.is_empty(), "{failed:?}");
}
