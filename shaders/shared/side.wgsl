// A surface's BSDF as seen from the other side, and what the reverse of a path needs of it.
#import parameters
#import bsdf

// The local frame of the other side is this one mirrored at the surface.
fn mirrored(v: vec3f) -> vec3f {
    return vec3f(v.xy, -v.z);
}

fn bsdf_from_behind(bsdf: Bsdf) -> Bsdf {
    var behind = bsdf;
    behind.eta_o = bsdf.eta_t;
    behind.eta_t = bsdf.eta_o;
    // The normal turns round with the frame.
    behind.shading = vec3f(-bsdf.shading.xy, bsdf.shading.z);
    return behind;
}

// Refractive index of the medium that `wi` runs in.
fn bsdf_index_along(bsdf: Bsdf, wi: vec3f) -> f32 {
    return select(bsdf.eta_t, bsdf.eta_o, wi.z > 0.0);
}

// Density, per étendue n² cosθ dω, with which the reverse of a path that came along `wo` and left along `wi` is sampled.
fn bsdf_reverse_density(bsdf: Bsdf, wo: vec3f, wi: vec3f) -> f32 {
    let measure = 1.0 / (bsdf.eta_o * bsdf.eta_o * wo.z);
    if (wi.z > 0.0) {
        return bsdf_pdf(bsdf, wi, wo) * measure;
    }
    return bsdf_pdf(bsdf_from_behind(bsdf), mirrored(wi), mirrored(wo)) * measure;
}

// Probability with which light that comes along `wi` meets the surface instead of passing straight on.
fn bsdf_meeting(bsdf: Bsdf, wi: vec3f) -> f32 {
    if ((parameters.flags & PASSABLE) == 0u) {
        return 1.0;
    }
    if (wi.z > 0.0) {
        return 1.0 - bsdf_pass(bsdf, wi).probability;
    }
    return 1.0 - bsdf_pass(bsdf_from_behind(bsdf), mirrored(wi)).probability;
}
