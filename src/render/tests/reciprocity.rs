//! `f(ωo, ωi) = f(ωi, ωo)`.

use super::kernel::{gpu, run};
use super::material::READ_BSDF;

/// Directions uniform over the hemisphere, materials over what glTF allows, but for black ones and `α` down to 0.02.
const SOURCE: &str = "
fn uniform_direction(u: vec2f) -> vec3f {
    let radius = sqrt(max(0.0, 1.0 - u.x * u.x));
    return vec3f(radius * cos(2.0 * PI * u.y), radius * sin(2.0 * PI * u.y), max(u.x, 1e-4));
}
fn work(index: u32) -> vec4f {
    let directions = random4(index, 0u, 0u, 3u);
    let wo = normalize(uniform_direction(directions.xy));
    let wi = normalize(uniform_direction(directions.zw));
    let color = mix(vec4f(0.02), vec4f(1.0), random4(index, 0u, 1u, 3u));
    let reflectance = mix(vec4f(0.2), vec4f(1.0), random4(index, 0u, 2u, 3u));
    let kind = random4(index, 0u, 3u, 3u);
    // A third each: dielectric, metal, and between.
    let metallic = select(select(kind.y, 1.0, kind.x < 0.667), 0.0, kind.x < 0.333);
    let bsdf = Bsdf(color.xyz, metallic, reflectance.xyz * reflectance.w, reflectance.w, mix(0.02, 1.0, kind.z),
        0.0, 0.0, 1.0, vec3f(0.0), 1.0, 1.0, vec3f(0.0, 0.0, 1.0));
    let forward = bsdf_eval(bsdf, wo, wi);
    let backward = bsdf_eval(bsdf, wi, wo);
    // Where Fresnel's F comes near 1 the diffuse part, with its 1 − F, cancels: measured against what it is without F.
    let scale = max(forward, backward) + bsdf.base_color * (1.0 - metallic) * INV_PI;
    let change = abs(forward - backward) / max(scale, vec3f(1e-20));
    let lit = f32(all(forward > vec3f(0.0)));
    return vec4f(max(change.x, max(change.y, change.z)), lit, min(length(wo + wi), 1.0), 0.0);
}
";

#[test]
fn bsdfs_are_reciprocal() {
    let source = format!("#import rng\n#import bsdf\n{READ_BSDF}{SOURCE}");
    let pairs = run(&gpu(), &source, &[], &[[0.0; 4]; 3], 1 << 20);
    // ωo and ωi are unit vectors to a rounding only. Where they are nearly opposite that difference in length is a large part
    // of their sum, by which the half vector is normalized.
    let worst = pairs.iter().map(|pair| pair[0] * pair[2]).max_by(f32::total_cmp).expect("there are pairs");
    let lit = pairs.iter().filter(|pair| pair[1] == 1.0).count();
    println!("reciprocity: worst relative difference {worst:.2e}");
    assert!(lit > pairs.len() * 9 / 10, "only {lit} of {} pairs reflect light", pairs.len());
    // The half vector is the same to the bit; ωo·h and ωi·h differ by a rounding or two, and F's fifth power makes five
    // of each.
    assert!(worst <= 16.0 * f32::EPSILON, "worst relative difference {worst:.2e}");
}
