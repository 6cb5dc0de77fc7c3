//! Samplers against their densities, by χ² tests.

use std::sync::LazyLock;

use glam::vec3;

use super::directions::{Sphere, outgoing};
use super::kernel::{gpu, run};
use super::material::{BSDF_SIZE, Bsdf, READ_BSDF};
use super::statistics::{chi_square_test, threshold};
use crate::gpu::Gpu;

const BINS: Sphere = Sphere { rings: 20, sectors: 40 };
/// 2²⁰ samples: a density that is wrong by 1 % over a tenth of the hemisphere fails.
const SAMPLES: usize = 1 << 20;
/// The narrowest lobe here (α = 0.05) is 0.03 wide in `t`, and at a cosine of 0.05 0.12 in `s`; cells of
/// 1/320 integrate it to 1e-4, a fraction of the counts' relative noise.
const CELLS: usize = 16;
static POINTS: LazyLock<(Vec<[f32; 4]>, Vec<f64>)> = LazyLock::new(|| BINS.midpoints(CELLS));

/// A sampler and its density in WGSL, as functions of `bsdf`, `wo` and `u` or `wi`. The fourth component of a
/// sample is its kind: that of a delta lobe, `-1` for no sample, and `REGULAR` for the samples that the
/// density describes.
struct Sampler {
    sample: &'static str,
    density: &'static str,
    /// The probabilities of the kinds `REFLECTED`, `REFRACTED` and `PASSED`.
    deltas: &'static str,
}

const NO_DELTAS: &str = "return vec3f(0.0);";
const COSINE: Sampler = Sampler {
    sample: "return vec4f(square_to_cosine_hemisphere(u.xy), 0.0);",
    density: "return max(0.0, wi.z) * INV_PI;",
    deltas: NO_DELTAS,
};
const VISIBLE_NORMALS: Sampler = Sampler {
    sample: "let wi = reflect(-wo, ggx_sample_visible_normal(wo, bsdf.alpha, u.xy));
        return vec4f(wi, select(-1.0, 0.0, wi.z > 0.0));",
    density: "let density = 0.25 * ggx_distribution(normalize(wo + wi), bsdf.alpha) * ggx_masking(wo.z, bsdf.alpha);
        return select(0.0, density, wi.z > 0.0);",
    deltas: NO_DELTAS,
};
const BSDF: Sampler = Sampler {
    sample: "let next = bsdf_sample(bsdf, wo, u);
        return vec4f(next.direction, select(-1.0, f32(next.kind), next.pdf > 0.0));",
    density: "return bsdf_pdf(bsdf, wo, wi);",
    deltas: "let deltas = bsdf_deltas(bsdf, wo.z, bsdf_cosine_beyond(bsdf, wo.z));
        let solid = bsdf.eta_o != bsdf.eta_t;
        return vec3f(bsdf.opacity * vec2f(deltas.reflect, select(0.0, deltas.transmit, solid)), bsdf_pass(bsdf, wo).probability);",
};

/// The p-value of a sampler's histogram against its density.
fn p_value(gpu: &Gpu, sampler: &Sampler, bsdf: &Bsdf, cos_o: f64, seed: usize) -> f64 {
    let Sampler { sample, density, deltas } = sampler;
    let head = format!("#import rng\n#import bsdf\n{READ_BSDF}");
    let mut input = bsdf.encode().to_vec();
    input.push(outgoing(cos_o));
    input.push([seed as f32, 0.0, 0.0, 0.0]);

    // Numbered as in the tracer: 1024 samples of each pixel, at their first surface.
    let source = format!(
        "{head}
        fn draw(bsdf: Bsdf, wo: vec3f, u: vec4f) -> vec4f {{ {sample} }}
        fn work(index: u32) -> vec4f {{
            return draw(bsdf_at(0u), input[5].xyz, random4(index / 1024u, index % 1024u, 1u, u32(input[6].x)));
        }}"
    );
    let none = BINS.bins() + 3;
    let mut observed = vec![0.0; none + 1];
    for [x, y, z, kind] in run(gpu, &source, &[], &input, SAMPLES).iter().map(|s| s.map(f64::from)) {
        observed[match kind {
            0.0 => BINS.bin([x, y, z]),
            1.0..=3.0 => BINS.bins() + kind as usize - 1,
            _ => none,
        }] += 1.0;
    }

    let source = format!(
        "{head}
        fn density(bsdf: Bsdf, wo: vec3f, wi: vec3f) -> f32 {{ {density} }}
        fn deltas(bsdf: Bsdf, wo: vec3f) -> vec3f {{ {deltas} }}
        fn work(index: u32) -> vec4f {{
            if (index + 7u == arrayLength(&input)) {{
                return vec4f(deltas(bsdf_at(0u), input[5].xyz), 0.0);
            }}
            return vec4f(density(bsdf_at(0u), input[5].xyz, input[7u + index].xyz), 0.0, 0.0, 0.0);
        }}"
    );
    assert_eq!(BSDF_SIZE + 2, 7, "the WGSL above counts on it");
    let (points, solid_angles) = &*POINTS;
    input.extend(points);
    let densities = run(gpu, &source, &[], &input, points.len() + 1);
    let mut expected: Vec<f64> = densities
        .chunks(CELLS * CELLS)
        .zip(solid_angles.chunks(CELLS * CELLS))
        .map(|(density, angle)| {
            SAMPLES as f64 * density.iter().zip(angle).map(|(d, a)| f64::from(d[0]) * a).sum::<f64>()
        })
        .collect();
    let [reflected, refracted, passed, _] = densities[points.len()].map(|p| SAMPLES as f64 * f64::from(p));
    expected.extend([reflected, refracted, passed]);
    // The rest of the probability is that of no sample.
    let left = SAMPLES as f64 - expected.iter().sum::<f64>();
    assert!(left > -1e-3 * SAMPLES as f64, "the density integrates to more than 1: {left}");
    expected.push(left.max(0.0));
    chi_square_test(&observed, &expected)
}

#[test]
fn samplers_follow_their_densities() {
    let gpu = gpu();
    let lambertian = Bsdf::lambertian(0.8);
    let colored = Bsdf { base_color: vec3(0.9, 0.4, 0.1), metallic: 0.4, ..Bsdf::dielectric(0.8, 0.25) };
    let paper = Bsdf { diffuse_transmission: 0.4, ..Bsdf::dielectric(0.7, 0.3) };
    let mixed = Bsdf { metallic: 0.2, transmission: 0.5, opacity: 0.7, eta_t: 1.4, ..paper };
    let smooth = Bsdf { alpha: 0.0, ..mixed };
    let cases = [
        ("cosine hemisphere", COSINE, lambertian, 1.0),
        ("visible normals, α 0.05", VISIBLE_NORMALS, Bsdf::metal(0.8, 0.05), 0.8),
        ("visible normals, α 0.05, along the normal", VISIBLE_NORMALS, Bsdf::metal(0.8, 0.05), 1.0),
        ("visible normals, α 0.3", VISIBLE_NORMALS, Bsdf::metal(0.8, 0.3), 0.5),
        ("visible normals, α 0.3, grazing", VISIBLE_NORMALS, Bsdf::metal(0.8, 0.3), 0.05),
        ("visible normals, α 1, grazing", VISIBLE_NORMALS, Bsdf::metal(0.8, 1.0), 0.02),
        ("Lambertian", BSDF, lambertian, 0.6),
        ("rough dielectric", BSDF, Bsdf::dielectric(0.8, 0.5), 0.7),
        ("glossy dielectric, grazing", BSDF, Bsdf::dielectric(0.3, 0.1), 0.1),
        ("rough metal", BSDF, Bsdf::metal(0.9, 0.4), 0.6),
        ("glossy metal", BSDF, Bsdf::metal(0.9, 0.05), 0.7),
        ("glossy metal, grazing", BSDF, Bsdf::metal(0.9, 0.05), 0.05),
        ("half metal, coloured", BSDF, colored, 0.4),
        ("smooth plastic", BSDF, Bsdf::dielectric(0.8, 0.0), 0.3),
        ("rough pane", BSDF, Bsdf::pane(0.2), 0.7),
        ("rough pane, grazing", BSDF, Bsdf::pane(0.4), 0.1),
        ("smooth pane", BSDF, Bsdf::pane(0.0), 0.2),
        ("rough glass from outside", BSDF, Bsdf::glass(0.3), 0.8),
        ("rough glass from outside, grazing", BSDF, Bsdf::glass(0.2), 0.1),
        ("rough glass from inside", BSDF, Bsdf::glass(0.2).beyond(), 0.9),
        ("rough glass near the critical angle", BSDF, Bsdf::glass(0.3).beyond(), 0.7453),
        ("rough glass beyond the critical angle", BSDF, Bsdf::glass(0.3).beyond(), 0.4),
        ("smooth glass from outside", BSDF, Bsdf::glass(0.0), 0.3),
        ("smooth glass from inside", BSDF, Bsdf::glass(0.0).beyond(), 0.8),
        ("paper", BSDF, paper, 0.6),
        ("everything, rough", BSDF, mixed, 0.5),
        ("everything, rough, from beyond", BSDF, mixed.beyond(), 0.5),
        ("everything, smooth", BSDF, smooth, 0.5),
        ("everything, smooth, from beyond, totally reflected", BSDF, smooth.beyond(), 0.5),
        ("rough metal, tilted", BSDF, Bsdf::metal(0.9, 0.4).tilted(25.0), 0.6),
        ("Lambertian, tilted", BSDF, lambertian.tilted(40.0), 0.7),
        ("everything, rough, tilted", BSDF, mixed.tilted(20.0), 0.7),
        ("everything, rough, tilted, from beyond", BSDF, mixed.tilted(20.0).beyond(), 0.3),
        ("everything, smooth, tilted", BSDF, smooth.tilted(30.0), 0.6),
    ];
    let threshold = threshold(cases.len());
    let mut failed = Vec::new();
    for (seed, (name, sampler, bsdf, cos_o)) in cases.iter().enumerate() {
        let p = p_value(&gpu, sampler, bsdf, *cos_o, seed);
        println!("{name}: p = {p:.4}");
        if p.is_nan() || p < threshold {
            failed.push((name, p));
        }
    }
    assert!(failed.is_empty(), "samples do not follow their density (threshold {threshold:.2e}): {failed:?}");
}
