//! Reciprocity of the BSDF, `K(ωo, ωi) = K(ωi, ωo)`, for reflection and for transmission.

use super::kernel::{gpu, run};
use super::material::{RANDOM_BSDF, READ_BSDF};

/// The surface and a direction as the reverse path meets them. Where that path comes from beyond the surface,
/// both are turned around the x axis. This is written without `bsdf_beyond`, so that the test is independent
/// of it.
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
    // between similar media, which is the square of a difference. Only the values of tilted surfaces are
    // rounded differently.
    let sum = length(bsdf.eta_o * wo + select(bsdf.eta_o, bsdf.eta_t, beyond) * wi);
    let step = select(abs(bsdf.eta_o - bsdf.eta_t) / (bsdf.eta_o + bsdf.eta_t), 1.0, bsdf.eta_o == bsdf.eta_t);
    let stability = min(sum, 1.0) * max(bsdf.alpha, 0.02) * step;
    return vec4f(max(change.x, max(change.y, change.z)) * select(1.0, stability, tilted), pdf_change * stability,
        f32(all(forward > vec3f(0.0))), f32(tilted) + 2.0 * f32(beyond));
}
";

#[test]
fn bsdfs_are_reciprocal() {
    let source = format!("#import rng\n#import bsdf\n{READ_BSDF}{RANDOM_BSDF}{REVERSED}{SYMMETRY}");
    let pairs = run(&gpu(), &source, &[], &[[0.0; 4]], 1 << 20);
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
        assert!(worst(0) <= 16.0 * f32::EPSILON, "{name}: worst relative difference {:.2e}", worst(0));
        // One formula, inlined twice: all differences are roundings, of some thirty operations here.
        assert!(worst(1) <= 64.0 * f32::EPSILON, "{name}: worst difference of density {:.2e}", worst(1));
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
    let source = format!("#import rng\n#import bsdf\n{READ_BSDF}{RANDOM_BSDF}{REVERSED}{DELTA_SYMMETRY}");
    let samples = run(&gpu(), &source, &[], &[[0.0; 4]], 1 << 18);
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
        assert!(worst(0) <= 16.0 * f32::EPSILON, "{name}: values differ by {:.2e}", worst(0));
        assert!(worst(1) <= 16.0 * f32::EPSILON, "{name}: probabilities differ by {:.2e}", worst(1));
    }
}
