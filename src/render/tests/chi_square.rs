//! Samplers against their densities (χ²), and what samples claim about themselves.

use super::directions::{Hemisphere, outgoing};
use super::kernel::{gpu, run};
use super::material::{Bsdf, READ_BSDF};
use super::statistics::{chi_square_test, threshold};
use crate::gpu::Gpu;

const BINS: Hemisphere = Hemisphere { rings: 20, sectors: 40 };
/// 2²⁰ samples: a density that is wrong by 1 % over a tenth of the hemisphere fails.
const SAMPLES: usize = 1 << 20;
/// The narrowest lobe here (α = 0.05) is 0.03 wide in `t`, and at a cosine of 0.05 0.12 in `s`; cells of 1/320 integrate it
/// to 1e-4, a fraction of the counts' relative noise.
const CELLS: usize = 16;

/// A sampler and its density in WGSL, as functions of `bsdf`, `wo` and `u` or `wi`. A density of 0 is no sample.
struct Sampler {
    sample: &'static str,
    density: &'static str,
}

const COSINE: Sampler = Sampler {
    sample: "let wi = square_to_cosine_hemisphere(u.xy); return vec4f(wi, 1.0);",
    density: "return wi.z * INV_PI;",
};
const VISIBLE_NORMALS: Sampler = Sampler {
    sample: "let wi = reflect(-wo, ggx_sample_visible_normal(wo, bsdf.alpha, u.xy)); return vec4f(wi, f32(wi.z > 0.0));",
    density: "return 0.25 * ggx_distribution(normalize(wo + wi), bsdf.alpha) * ggx_masking(wo.z, bsdf.alpha);",
};
const BSDF: Sampler = Sampler {
    sample: "let next = bsdf_sample(bsdf, wo, u); return vec4f(next.direction, next.pdf);",
    density: "return bsdf_pdf(bsdf, wo, wi);",
};

fn p_value(gpu: &Gpu, sampler: &Sampler, bsdf: &Bsdf, cos_o: f64, seed: usize) -> f64 {
    let Sampler { sample, density } = sampler;
    let head = format!("#import rng\n#import bsdf\n{READ_BSDF}");
    let mut input = bsdf.encode().to_vec();
    input.push(outgoing(cos_o));

    // Numbered as in the tracer: 1024 samples of each pixel, at their first surface.
    let source = format!(
        "{head}
        fn draw(bsdf: Bsdf, wo: vec3f, u: vec4f) -> vec4f {{ {sample} }}
        fn work(index: u32) -> vec4f {{
            return draw(bsdf_at(0u), input[3].xyz, random4(index / 1024u, index % 1024u, 1u, {seed}u));
        }}"
    );
    let mut observed = vec![0.0; BINS.bins() + 1];
    for [x, y, z, valid] in run(gpu, &source, &[], &input, SAMPLES).iter().map(|s| s.map(f64::from)) {
        observed[if valid > 0.0 { BINS.bin([x, y, z]) } else { BINS.bins() }] += 1.0;
    }

    let source = format!(
        "{head}
        fn density(bsdf: Bsdf, wo: vec3f, wi: vec3f) -> f32 {{ {density} }}
        fn work(index: u32) -> vec4f {{
            return vec4f(density(bsdf_at(0u), input[3].xyz, input[4u + index].xyz), 0.0, 0.0, 0.0);
        }}"
    );
    let (points, solid_angles) = BINS.midpoints(CELLS);
    input.extend(&points);
    let densities = run(gpu, &source, &[], &input, points.len());
    let mut expected: Vec<f64> = densities
        .chunks(CELLS * CELLS)
        .zip(solid_angles.chunks(CELLS * CELLS))
        .map(|(density, angle)| {
            SAMPLES as f64 * density.iter().zip(angle).map(|(d, a)| f64::from(d[0]) * a).sum::<f64>()
        })
        .collect();
    // What the density leaves out is what was not sampled.
    let none = SAMPLES as f64 - expected.iter().sum::<f64>();
    assert!(none > -1e-3 * SAMPLES as f64, "the density integrates to more than 1: {none}");
    expected.push(none.max(0.0));
    chi_square_test(&observed, &expected)
}

#[test]
fn samplers_follow_their_densities() {
    let gpu = gpu();
    let lambertian = Bsdf::lambertian(0.8);
    let colored =
        Bsdf { base_color: glam::vec3(0.9, 0.4, 0.1), metallic: 0.4, ..Bsdf::dielectric(0.8, 0.25) };
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
        ("smooth metal", BSDF, Bsdf::metal(0.9, 0.05), 0.7),
        ("smooth metal, grazing", BSDF, Bsdf::metal(0.9, 0.05), 0.05),
        ("half metal, coloured", BSDF, colored, 0.4),
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

#[test]
fn samples_carry_their_own_density_and_weight() {
    let gpu = gpu();
    let source = format!(
        "#import rng\n#import bsdf\n{READ_BSDF}
        fn work(index: u32) -> vec4f {{
            let bsdf = bsdf_at(0u);
            let wo = normalize(square_to_cosine_hemisphere(random4(index, 0u, 0u, 1u).xy));
            let next = bsdf_sample(bsdf, wo, random4(index, 0u, 1u, 1u));
            let pdf = bsdf_pdf(bsdf, wo, next.direction);
            if (next.pdf == 0.0) {{
                // Nothing was sampled: below the horizon, and without weight.
                return vec4f(f32(next.direction.z > 0.0), f32(any(next.weight != vec3f(0.0))), 0.0, 0.0);
            }}
            let weight = bsdf_eval(bsdf, wo, next.direction) * next.direction.z / pdf;
            let change = abs(next.weight - weight) / weight;
            return vec4f(max(change.x, max(change.y, change.z)), abs(next.pdf - pdf) / pdf, length(next.direction) - 1.0, 1.0);
        }}"
    );
    for bsdf in [
        Bsdf::lambertian(0.8),
        Bsdf::dielectric(0.5, 0.3),
        Bsdf::metal(0.9, 0.05),
        Bsdf { metallic: 0.5, ..Bsdf::dielectric(0.7, 0.6) },
    ] {
        let samples = run(&gpu, &source, &[], &bsdf.encode(), 1 << 16);
        for [weight, pdf, length, valid] in &samples {
            // Three multiplications in another order.
            assert!(
                *weight <= 4.0 * f32::EPSILON && *pdf == 0.0,
                "{bsdf:?}: weight off by {weight}, pdf by {pdf}"
            );
            // sin² + cos² of the device's sine and cosine, good to 2⁻¹¹ each by Vulkan's rules.
            assert!(length.abs() < 1e-3, "{bsdf:?}: direction too long by {length}, valid {valid}");
        }
        let valid = samples.iter().filter(|sample| sample[3] == 1.0).count();
        assert!(valid > samples.len() / 2, "{bsdf:?}: only {valid} samples are above the horizon");
    }
}
