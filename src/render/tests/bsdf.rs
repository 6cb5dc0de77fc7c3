//! Tests of BSDF samples: they follow their densities, report their own weights, and are reciprocal.

use std::sync::LazyLock;

use glam::vec3;

use super::material::{BSDF_SIZE, Bsdf, RANDOM_BSDF, READ_BSDF};
use super::statistics::{Sphere, chi_square_test, outgoing, threshold};
use super::support::run;
use crate::gpu::Gpu;

const BINS: Sphere = Sphere { rings: 20, sectors: 40 };
/// The number of samples. A density that is wrong by 1 % over a tenth of the hemisphere then fails the test.
const SAMPLES: usize = 1 << 20;
/// The narrowest lobe here (α = 0.05) has a width of 0.03 in `t` and of 0.12 in `s` (see [`Sphere`]) at a cosine of 0.05. Cells of 1/320
/// integrate it with an error of 1e-4, a fraction of the counts' relative noise.
const CELLS: usize = 16;
static POINTS: LazyLock<(Vec<[f32; 4]>, Vec<f64>)> = LazyLock::new(|| BINS.midpoints(CELLS));

/// A sampler and its density in WGSL, as functions of `bsdf`, `wo` and `u` or `wi`. The fourth component of a sample is its kind: a delta
/// lobe, `-1` for no sample, or `REGULAR` for samples with the given density.
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

fn p_value(gpu: &Gpu, sampler: &Sampler, bsdf: &Bsdf, cos_o: f64, seed: usize) -> f64 {
    let Sampler { sample, density, deltas } = sampler;
    let head = format!("#import rng\n#import bsdf\n{READ_BSDF}");
    let mut input = bsdf.encode().to_vec();
    input.push(outgoing(cos_o));
    input.push([seed as f32, 0.0, 0.0, 0.0]);

    // Samples are numbered as in the tracer: 1024 samples of each pixel, at their first surface.
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
    // With the remaining probability, there is no sample.
    let left = SAMPLES as f64 - expected.iter().sum::<f64>();
    assert!(left > -1e-3 * SAMPLES as f64, "the density integrates to more than 1: {left}");
    expected.push(left.max(0.0));
    chi_square_test(&observed, &expected)
}

#[test]
fn samplers_follow_their_densities() {
    let gpu = Gpu::for_tests();
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

const SOURCE: &str = "
fn relative(found: vec3f, expected: vec3f) -> f32 {
    let change = abs(found - expected) / max(expected, vec3f(1e-30));
    return max(change.x, max(change.y, change.z));
}
fn work(index: u32) -> vec4f {
    // Every second material is smooth.
    let bsdf = random_bsdf(index, false, index % 2u == 1u, index % 4u > 1u);
    let wo = normalize(square_to_cosine_hemisphere(random4(index, 0u, 0u, 1u).xy));
    let next = bsdf_sample(bsdf, wo, random4(index, 0u, 9u, 1u));
    let wi = next.direction;
    if (next.pdf == 0.0) {
        return vec4f(f32(any(next.weight != vec3f(0.0))), 0.0, 0.0, -1.0);
    }
    var weight = 0.0;
    var pdf = 0.0;
    if (next.kind == REGULAR) {
        let n_i = select(bsdf.eta_o, bsdf.eta_t, wi.z < 0.0);
        pdf = bsdf_pdf(bsdf, wo, wi);
        weight = relative(next.weight, bsdf_eval(bsdf, wo, wi) * n_i * n_i * abs(wi.z) / pdf);
    } else {
        // The expected value is that of the delta lobe, the expected direction that of reflection or
        // refraction.
        let deltas = bsdf_deltas(bsdf, wo.z, bsdf_cosine_beyond(bsdf, wo.z));
        var value = bsdf.opacity * deltas.reflected;
        var expected = vec3f(-wo.x, -wo.y, wo.z);
        pdf = bsdf.opacity * deltas.reflect;
        if (next.kind == REFRACTED) {
            value = bsdf.opacity * deltas.transmitted;
            pdf = bsdf.opacity * deltas.transmit;
            expected = vec3f(-wo.xy * bsdf.eta_o / bsdf.eta_t, wi.z);
        } else if (next.kind == PASSED) {
            value = bsdf_pass(bsdf, wo).value;
            pdf = bsdf_pass(bsdf, wo).probability;
            expected = -wo;
        }
        weight = max(relative(next.weight * next.pdf, value), length(wi - expected));
    }
    return vec4f(weight, abs(next.pdf - pdf) / pdf, length(wi) - 1.0, f32(next.kind));
}
";

#[test]
fn samples_carry_their_own_density_and_weight() {
    let source = format!("#import rng\n#import bsdf\n{READ_BSDF}{RANDOM_BSDF}{SOURCE}");
    let samples = run(&Gpu::for_tests(), &source, &[], &[[0.0; 4]], 1 << 18);
    let mut kinds = [0; 5];
    for [weight, pdf, length, kind] in &samples {
        kinds[(kind + 1.0) as usize] += 1;
        // The two weights differ only by the order of a few multiplications.
        assert!(*weight <= 8.0 * f32::EPSILON, "a sample of kind {kind} has its weight wrong by {weight}");
        assert!(*pdf <= 2.0 * f32::EPSILON, "a sample of kind {kind} has its density wrong by {pdf}");
        // The value is sin² + cos² of the device's sine and cosine, each of which Vulkan allows an error of 2⁻¹¹.
        assert!(length.abs() < 1e-3, "a sample of kind {kind} is too long by {length}");
    }
    println!("nothing, regular, reflected, refracted, passed: {kinds:?}");
    // All kinds of samples occur, and few samples are lost.
    assert!(kinds[1..].iter().all(|&count| count > samples.len() / 40), "{kinds:?}");
    assert!(kinds[0] < samples.len() / 10, "{kinds:?}");
}

/// A surface has a regular lobe if and only if it has regular samples.
#[test]
fn surfaces_know_whether_they_have_regular_lobes() {
    let source = format!(
        "#import rng\n#import bsdf\n{READ_BSDF}{RANDOM_BSDF}
        fn work(index: u32) -> vec4f {{
            let bsdf = random_bsdf(index, false, index % 2u == 1u, false);
            let wo = normalize(vec3f(0.3, 0.2, 0.7));
            var value = 0.0;
            for (var k = 0u; k < 64u; k += 1u) {{
                let next = bsdf_sample(bsdf, wo, random4(index, k, 9u, 1u));
                value += select(0.0, next.weight.y, next.kind == REGULAR && next.pdf > 0.0);
            }}
            return vec4f(f32(bsdf_regular(bsdf)), value, 0.0, 0.0);
        }}"
    );
    let found = run(&Gpu::for_tests(), &source, &[], &[[0.0; 4]], 1 << 12);
    let none = found.iter().filter(|[regular, ..]| *regular == 0.0);
    assert!(none.clone().count() > 500 && none.clone().all(|[_, value, ..]| *value == 0.0));
    // Even 64 samples may miss a weak lobe.
    let missed = found.iter().filter(|[regular, value, ..]| *regular == 1.0 && *value == 0.0).count();
    assert!(missed < found.len() / 20, "{missed} of {} have a regular lobe and no sample", found.len());
}

/// The surface and a direction as the reverse path sees them. If the reverse path comes from beyond the surface, both are turned around the
/// x axis. This code does not use `bsdf_beyond`, so the test is independent of it.
const REVERSED: &str = "
fn turned(v: vec3f, beyond: bool) -> vec3f {
    return select(v, vec3f(v.x, -v.y, -v.z), beyond);
}
fn reversed(bsdf: Bsdf, beyond: bool) -> Bsdf {
    var other = bsdf;
    if (beyond) {
        other.eta_o = bsdf.eta_t;
        other.eta_t = bsdf.eta_o;
        // The normal points to the side of the light's arrival, there as here.
        other.shading = turned(-bsdf.shading, true);
    }
    return other;
}
";

const SYMMETRY: &str = "
fn work(index: u32) -> vec4f {
    let directions = random4(index, 0u, 0u, 3u);
    var wo = uniform_direction(directions.xy);
    wo.z = abs(wo.z);
    let wi = uniform_direction(directions.zw);
    let tilted = index % 2u == 1u;
    let bsdf = random_bsdf(index, false, index % 4u > 2u, tilted);
    let beyond = wi.z < 0.0;
    let other = reversed(bsdf, beyond);
    let forward = bsdf_eval(bsdf, wo, wi);
    let backward = bsdf_eval(other, turned(wi, beyond), turned(wo, beyond));
    let change = abs(forward - backward) / max(max(forward, backward), vec3f(1e-20));
    let pdf = bsdf_pdf(other, turned(wi, beyond), turned(wo, beyond));
    let pdf_change = abs(pdf - bsdf_reverse_pdf(bsdf, wo, wi)) / max(pdf, 1e-20);
    // How much a rounding error may grow: in the half vector, in a narrow lobe, and in the reflectance
    // between similar media, which is the square of a difference. With correct rounding, only the values of
    // tilted surfaces are rounded differently.
    let sum = length(bsdf.eta_o * wo + select(bsdf.eta_o, bsdf.eta_t, beyond) * wi);
    let step = select(abs(bsdf.eta_o - bsdf.eta_t) / (bsdf.eta_o + bsdf.eta_t), 1.0, bsdf.eta_o == bsdf.eta_t);
    let stability = min(sum, 1.0) * max(bsdf.alpha, 0.02) * step;
    return vec4f(max(change.x, max(change.y, change.z)) * select(1.0, stability, tilted || input[0].x == 1.0), pdf_change * stability,
        f32(all(forward > vec3f(0.0))), f32(tilted) + 2.0 * f32(beyond));
}
";

const QUOTIENTS: &str = "
fn work(index: u32) -> vec4f {
    let value = random4(index, 0u, 0u, 1u).xy + 0.001;
    return vec4f(value, value.x / value.y, sqrt(value.x));
}
";

/// The factor by which two ways to the same number may differ more than with correct rounding. Vulkan promises only 2.5 units in the last
/// place for a quotient and 3 for a root, instead of a half, and lets a device contract products and sums.
fn slack(gpu: &Gpu) -> f32 {
    let found = run(gpu, &format!("#import rng\n{QUOTIENTS}"), &[], &[[0.0; 4]], 1 << 12);
    let is_exact = |&[x, y, quotient, root]: &[f32; 4]| quotient == x / y && root == x.sqrt();
    if found.iter().all(is_exact) { 1.0 } else { 16.0 }
}

#[test]
fn bsdfs_are_reciprocal() {
    let slack = slack(&Gpu::for_tests());
    let source = format!("#import rng\n#import bsdf\n{READ_BSDF}{RANDOM_BSDF}{REVERSED}{SYMMETRY}");
    let rounds_differently = f32::from(u8::from(slack > 1.0));
    let pairs = run(&Gpu::for_tests(), &source, &[], &[[rounds_differently; 4]], 1 << 20);
    for (class, name) in
        ["reflected", "reflected, tilted", "transmitted", "transmitted, tilted"].iter().enumerate()
    {
        let class: Vec<_> = pairs.iter().filter(|pair| pair[3] as usize == class).collect();
        let worst =
            |c: usize| class.iter().map(|pair| pair[c]).max_by(f32::total_cmp).expect("there are pairs");
        let lit = class.iter().filter(|pair| pair[2] == 1.0).count();
        println!(
            "{name}: worst differences {:.2e} and {:.2e} of the density, {lit} of {} lit",
            worst(0),
            worst(1),
            class.len()
        );
        assert!(lit > class.len() / 5, "{name}: only {lit} of {} pairs carry light", class.len());
        assert!(
            worst(0) <= slack * 16.0 * f32::EPSILON,
            "{name}: worst relative difference {:.2e}",
            worst(0)
        );
        // One formula is inlined in two places. All differences are rounding errors of some thirty operations.
        assert!(
            worst(1) <= slack * 64.0 * f32::EPSILON,
            "{name}: worst difference of density {:.2e}",
            worst(1)
        );
    }
}

const DELTA_SYMMETRY: &str = "
fn work(index: u32) -> vec4f {
    let bsdf = random_bsdf(index, false, true, index % 2u == 1u);
    let wo = normalize(square_to_cosine_hemisphere(random4(index, 0u, 0u, 3u).xy));
    let next = bsdf_sample(bsdf, wo, random4(index, 0u, 9u, 3u));
    if (next.kind == REGULAR) {
        return vec4f(0.0, 0.0, 0.0, 0.0);
    }
    // The path reversed, from where it went.
    let beyond = next.direction.z < 0.0;
    let other = reversed(bsdf, beyond);
    let back = turned(next.direction, beyond);
    let deltas = bsdf_deltas(other, back.z, bsdf_cosine_beyond(other, back.z));
    var value = other.opacity * deltas.reflected;
    var pdf = other.opacity * deltas.reflect;
    if (next.kind == REFRACTED) {
        value = other.opacity * deltas.transmitted;
        pdf = other.opacity * deltas.transmit;
    } else if (next.kind == PASSED) {
        value = bsdf_pass(other, back).value;
        pdf = bsdf_pass(other, back).probability;
    }
    let change = abs(value - next.weight * next.pdf) / max(value, vec3f(1e-20));
    // A cosine that is refracted back has the rounding error of 1 minus its square.
    let cosine = min(wo.z, back.z);
    let stability = select(1.0, cosine * cosine, next.kind == REFRACTED);
    return vec4f(max(change.x, max(change.y, change.z)) * stability, abs(pdf - next.pdf) / pdf * stability, 0.0, f32(next.kind));
}
";

#[test]
fn deltas_are_reciprocal_and_as_probable_on_the_way_back() {
    let slack = slack(&Gpu::for_tests());
    let source = format!("#import rng\n#import bsdf\n{READ_BSDF}{RANDOM_BSDF}{REVERSED}{DELTA_SYMMETRY}");
    let samples = run(&Gpu::for_tests(), &source, &[], &[[0.0; 4]], 1 << 18);
    for (kind, name) in [(1.0, "reflected"), (2.0, "refracted"), (3.0, "passed")] {
        let samples: Vec<_> = samples.iter().filter(|sample| sample[3] == kind).collect();
        let worst =
            |c: usize| samples.iter().map(|s| s[c]).max_by(f32::total_cmp).expect("there are samples");
        println!(
            "{name}: {} samples, worst differences {:.2e} and {:.2e}",
            samples.len(),
            worst(0),
            worst(1)
        );
        assert!(samples.len() > 10_000, "{name}: only {} samples", samples.len());
        assert!(worst(0) <= slack * 16.0 * f32::EPSILON, "{name}: values differ by {:.2e}", worst(0));
        assert!(worst(1) <= slack * 16.0 * f32::EPSILON, "{name}: probabilities differ by {:.2e}", worst(1));
    }
}
