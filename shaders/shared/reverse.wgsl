// What the balance heuristic needs to know about the reverse of a path at one surface: densities and probabilities.
#import features
#import bsdf

// Refractive index of the medium in which the direction `wi` runs.
fn bsdf_index_along(bsdf: Bsdf, wi: vec3f) -> f32 {
    return select(bsdf.eta_t, bsdf.eta_o, wi.z > 0.0);
}

// Density, per étendue n² cosθ dω of wo, with which the reverse path samples wo when it arrives along wi. The path itself arrived along
// wo and left along wi.
fn bsdf_reverse_density(bsdf: Bsdf, wo: vec3f, wi: vec3f) -> f32 {
    return bsdf_reverse_pdf(bsdf, wo, wi) / (bsdf.eta_o * bsdf.eta_o * wo.z);
}

// Probability with which the surface interacts with light along `wi`, instead of letting it pass straight through.
fn bsdf_interaction(bsdf: Bsdf, wi: vec3f) -> f32 {
    if (!PASSABLE) {
        return 1.0;
    }
    if (wi.z > 0.0) {
        return 1.0 - bsdf_pass(bsdf, wi).probability;
    }
    return 1.0 - bsdf_pass(bsdf_beyond(bsdf), bsdf_mirrored(wi)).probability;
}
