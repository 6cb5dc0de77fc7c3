// What the reverse of a path needs to know of a surface.
#import features
#import bsdf

// Refractive index of the medium that `wi` runs in.
fn bsdf_index_along(bsdf: Bsdf, wi: vec3f) -> f32 {
    return select(bsdf.eta_t, bsdf.eta_o, wi.z > 0.0);
}

// Density, per étendue n² cosθ dω, with which the reverse of a path that came along `wo` and left along `wi` is sampled.
fn bsdf_reverse_density(bsdf: Bsdf, wo: vec3f, wi: vec3f) -> f32 {
    return bsdf_reverse_pdf(bsdf, wo, wi) / (bsdf.eta_o * bsdf.eta_o * wo.z);
}

// Probability with which light that comes along `wi` meets the surface instead of passing straight on.
fn bsdf_interaction(bsdf: Bsdf, wi: vec3f) -> f32 {
    if (!PASSABLE) {
        return 1.0;
    }
    if (wi.z > 0.0) {
        return 1.0 - bsdf_pass(bsdf, wi).probability;
    }
    return 1.0 - bsdf_pass(bsdf_beyond(bsdf), bsdf_mirrored(wi)).probability;
}
