//! Tests of random numbers: of the hash, and of the sampler, which must be exactly stratified, with independent pixels, vertices and
//! halves.

use super::statistics::{chi_square_test, threshold};
use super::support::run;
use crate::gpu::Gpu;

/// `stratified4` for the samples `0 .. samples` of `pixels` pixels, at `vertex`. The layout is `[pixel · samples + sample]`.
fn points(gpu: &Gpu, pixels: usize, samples: usize, vertex: u32) -> Vec<[f32; 4]> {
    let source = format!(
        "#import sampler
        fn work(index: u32) -> vec4f {{
            return stratified4(index / {samples}u, index % {samples}u, {samples}u, {vertex}u, 11u);
        }}"
    );
    run(gpu, &source, &[], &[[0.0; 4]], pixels * samples)
}

/// Whether the points are a net: for all `a + b = m`, each of the `2ᵃ × 2ᵇ` elementary intervals holds exactly one of the `2ᵐ` points.
fn is_net(points: &[(f32, f32)]) -> bool {
    let count = points.len();
    assert!(count.is_power_of_two());
    (0..=count.ilog2()).all(|a| {
        let (columns, rows) = ((1 << a) as f32, (count >> a) as f32);
        let mut held = vec![0; count];
        for &(x, y) in points {
            held[(y * rows) as usize * (1 << a) + (x * columns) as usize] += 1;
        }
        held.iter().all(|&held| held == 1)
    })
}

fn pairs(points: &[[f32; 4]]) -> [Vec<(f32, f32)>; 2] {
    [points.iter().map(|p| (p[0], p[1])).collect(), points.iter().map(|p| (p[2], p[3])).collect()]
}

#[test]
fn each_half_of_a_pixels_samples_is_a_net_in_both_pairs() {
    let gpu = Gpu::for_tests();
    for (samples, vertex) in [(2, 0), (64, 0), (64, 3), (2048, 1)] {
        for pixel in points(&gpu, 32, samples, vertex).chunks(samples / 2).flat_map(pairs) {
            assert!(is_net(&pixel), "{samples} samples, vertex {vertex}: {pixel:?}");
        }
    }
}

#[test]
fn blocks_are_nets_where_the_count_is_no_power_of_two() {
    // The halves have 24 = 16 + 8 and 23 = 16 + 4 + 2 + 1 samples.
    for pixel in points(&Gpu::for_tests(), 32, 47, 0).chunks(47) {
        for (half, blocks) in [(&pixel[..24], vec![0..16, 16..24]), (&pixel[24..], vec![0..16, 16..20])] {
            for block in blocks {
                for pair in pairs(&half[block.clone()]) {
                    assert!(is_net(&pair), "{block:?}: {pair:?}");
                }
            }
        }
    }
}

#[test]
fn the_test_for_nets_rejects_other_points() {
    let mut points: Vec<(f32, f32)> = (0..16).map(|i| (i as f32 / 16.0, (i % 4) as f32 / 4.0)).collect();
    assert!(!is_net(&points), "four columns of equal heights");
    points = (0_u8..16).map(|i| (f32::from(i) / 16.0, f32::from(i.reverse_bits() >> 4) / 16.0)).collect();
    assert!(is_net(&points), "Hammersley's points");
}

/// The p-value of these pairs, if all `bins²` squares are equally likely.
fn pair_p_value(bins: usize, pairs: impl Iterator<Item = (f32, f32)>) -> f64 {
    let mut observed = vec![0.0; bins * bins];
    let mut count = 0.0;
    for (a, b) in pairs {
        observed[(a * bins as f32) as usize * bins + (b * bins as f32) as usize] += 1.0;
        count += 1.0;
    }
    chi_square_test(&observed, &vec![count / (bins * bins) as f64; bins * bins])
}

/// The p-values of each two numbers of a sample.
fn within<'a>(base: &'a [[f32; 4]]) -> impl Iterator<Item = (String, f64)> + 'a {
    let both = (0..4).flat_map(|c| (c + 1..4).map(move |d| (c, d)));
    both.map(|(c, d)| (format!("numbers {c} and {d}"), pair_p_value(32, base.iter().map(|u| (u[c], u[d])))))
}

/// The p-values of each number of one sample and each number of another.
fn across(name: &str, base: &[[f32; 4]], other: &[[f32; 4]]) -> Vec<(String, f64)> {
    let both = (0..4).flat_map(|c| (0..4).map(move |d| (c, d)));
    let p_value = |(c, d)| {
        let p = pair_p_value(32, base.iter().zip(other).map(|(a, b)| (a[c], b[d])));
        (format!("{name}, numbers {c} and {d}"), p)
    };
    both.map(p_value).collect()
}

fn assert_independent(p_values: &[(String, f64)]) {
    let threshold = threshold(p_values.len());
    let least = p_values.iter().min_by(|a, b| a.1.total_cmp(&b.1));
    println!("{} tests, threshold {threshold:.2e}, least p {least:?}", p_values.len());
    let failed: Vec<_> = p_values.iter().filter(|(_, p)| p.is_nan() || *p < threshold).collect();
    assert!(failed.is_empty(), "{failed:?}");
}

#[test]
fn a_sample_is_uniform_and_independent_of_other_halves_vertices_pixels_and_of_its_other_pair() {
    const PIXELS: usize = 1 << 18;
    const SAMPLES: usize = 6;
    let gpu = Gpu::for_tests();
    let vertices = [points(&gpu, PIXELS, SAMPLES, 1), points(&gpu, PIXELS, SAMPLES, 2)];
    // The pairs contain one sample of each pixel. They are independent of one another, which the χ² test requires.
    let of = |vertex: usize, sample: usize| {
        vertices[vertex].iter().skip(sample).step_by(SAMPLES).copied().collect::<Vec<_>>()
    };
    let base = of(0, 1);
    assert!(base.iter().flatten().all(|u| (0.0..1.0).contains(u)));
    let mut p_values: Vec<_> = within(&base).collect();
    let [even, odd] = [0, 1].map(|first| base.iter().skip(first).step_by(2).copied().collect::<Vec<_>>());
    p_values.extend(across("same place in the other half", &base, &of(0, 4)));
    p_values.extend(across("another place in the other half", &base, &of(0, 3)));
    p_values.extend(across("next vertex", &base, &of(1, 1)));
    p_values.extend(across("next vertex, next sample", &base, &of(1, 2)));
    // Only every second pixel has a partner, so no pixel is in two pairs.
    p_values.extend(across("next pixel", &even, &odd));
    // Within a half, the pairs of one vertex are shuffled independently: x of one sample says nothing about z of another sample.
    let next = of(0, 2);
    for (c, d) in [(0, 2), (0, 3), (1, 2), (1, 3)] {
        let p = pair_p_value(32, base.iter().zip(&next).map(|(a, b)| (a[c], b[d])));
        p_values.push((format!("next sample, numbers {c} and {d}"), p));
    }
    assert_independent(&p_values);
}

const COUNT: usize = 1 << 20;

/// `random4` at 128 × 8 × 8 × 128 keys (pixel, sample, vertex, seed), each shifted by `offset`. Without a shift, all coordinates are even,
/// so a key that is shifted by one is none of these keys. The pixels form 16 × 8 blocks in an image of width 128.
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

#[test]
fn random_numbers_are_uniform_and_neighbours_independent() {
    let gpu = Gpu::for_tests();
    let base = numbers(&gpu, [0; 4]);
    assert!(base.iter().flatten().all(|u| (0.0..1.0).contains(u)));
    let mut p_values: Vec<_> = within(&base).collect();
    for c in 0..4 {
        let mut observed = vec![0.0; 1024];
        base.iter().for_each(|u| observed[(u[c] * 1024.0) as usize] += 1.0);
        p_values
            .push((format!("number {c}"), chi_square_test(&observed, &vec![COUNT as f64 / 1024.0; 1024])));
    }
    let neighbours = [
        ("right pixel", [1, 0, 0, 0]),
        ("lower pixel", [128, 0, 0, 0]),
        ("next sample", [0, 1, 0, 0]),
        ("next vertex", [0, 0, 1, 0]),
        ("next seed", [0, 0, 0, 1]),
    ];
    for (name, offset) in neighbours {
        p_values.extend(across(name, &base, &numbers(&gpu, offset)));
    }
    assert_independent(&p_values);
}
