//! The weight, density and direction that BSDF samples report.

use super::kernel::{gpu, run};
use super::material::{RANDOM_BSDF, READ_BSDF};

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
    let samples = run(&gpu(), &source, &[], &[[0.0; 4]], 1 << 18);
    let mut kinds = [0; 5];
    for [weight, pdf, length, kind] in &samples {
        kinds[(kind + 1.0) as usize] += 1;
        // A handful of multiplications in another order.
        assert!(*weight <= 8.0 * f32::EPSILON, "a sample of kind {kind} has its weight wrong by {weight}");
        assert!(*pdf <= 2.0 * f32::EPSILON, "a sample of kind {kind} has its density wrong by {pdf}");
        // sin² + cos² of the device's sine and cosine, good to 2⁻¹¹ each by Vulkan's rules.
        assert!(length.abs() < 1e-3, "a sample of kind {kind} is too long by {length}");
    }
    println!("nothing, regular, reflected, refracted, passed: {kinds:?}");
    // All kinds occur; few samples are lost.
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
    let found = run(&gpu(), &source, &[], &[[0.0; 4]], 1 << 12);
    let none = found.iter().filter(|[regular, ..]| *regular == 0.0);
    assert!(none.clone().count() > 500 && none.clone().all(|[_, value, ..]| *value == 0.0));
    // A weak lobe may be missed 64 times.
    let missed = found.iter().filter(|[regular, value, ..]| *regular == 1.0 && *value == 0.0).count();
    assert!(missed < found.len() / 20, "{missed} of {} have a regular lobe and no sample", found.len());
}
