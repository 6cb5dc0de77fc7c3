// The isotropic GGX distribution of microfacet normals with width α (Walter et al. 2007). Directions are local, with the normal along +z.
#import warp

// D(h): density of microfacet normals per solid angle, with ∫ D(h) cosθ_h dω = 1. The sine is computed from the tangential components:
// 1 − h.z² would cancel for small α.
fn ggx_distribution(h: vec3f, alpha: f32) -> f32 {
    let a2 = alpha * alpha;
    let denominator = dot(h.xy, h.xy) + a2 * h.z * h.z;
    return a2 * INV_PI / (denominator * denominator);
}

// Smith's height-correlated shadowing–masking function, divided by 4 cosθ_o cosθ_i (glTF 2.0, appendix B). It is symmetric.
fn ggx_visibility(cos_o: f32, cos_i: f32, alpha: f32) -> f32 {
    let a2 = alpha * alpha;
    let lambda_o = cos_i * sqrt(cos_o * cos_o * (1.0 - a2) + a2);
    let lambda_i = cos_o * sqrt(cos_i * cos_i * (1.0 - a2) + a2);
    return 0.5 / (lambda_o + lambda_i);
}

// Smith's masking function in one direction, divided by the cosine of that direction: G₁/cosθ.
fn ggx_masking(cosine: f32, alpha: f32) -> f32 {
    let a2 = alpha * alpha;
    return 2.0 / (cosine + sqrt(a2 + (1.0 - a2) * cosine * cosine));
}

// Samples a microfacet normal among those visible from wo: Dupuy and Benyoub, "Sampling Visible GGX Normals with Spherical Caps", 2023.
// The density per solid angle is G₁(wo)/cosθ_o · D(h) · wo·h.
fn ggx_sample_visible_normal(wo: vec3f, alpha: f32, u: vec2f) -> vec3f {
    let stretched = normalize(vec3f(wo.xy * alpha, wo.z));
    let angle = 2.0 * PI * u.x;
    let z = (1.0 - u.y) * (1.0 + stretched.z) - stretched.z;
    let radius = sqrt(clamp(1.0 - z * z, 0.0, 1.0));
    let h = vec3f(radius * cos(angle), radius * sin(angle), z) + stretched;
    return normalize(vec3f(h.xy * alpha, max(h.z, 1e-7)));
}
