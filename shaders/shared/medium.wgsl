// What a ray runs in: air, or the inside of a solid. Solids do not overlap.
#import features
#import surface
#import footprint

struct Medium {
    // Refractive index.
    ior: f32,
    // Absorption per metre.
    absorption: vec3f,
}

const AIR = Medium(1.0, vec3f(0.0));

// Surfaces in a row that light passes straight through, at most; what lies behind them stays dark.
const MAX_PASSES = 16u;

// Beer and Lambert.
fn medium_transmittance(medium: Medium, distance: f32) -> vec3f {
    if (!MEDIA || all(medium.absorption == vec3f(0.0))) {
        return vec3f(1.0);
    }
    return exp(-medium.absorption * distance);
}

// A surface that borders on no medium of its own stands in the one that the ray came through, on both sides.
fn medium_meets(medium: Medium, surface: ptr<function, Surface>) {
    if (MEDIA && (*surface).ior == 1.0) {
        (*surface).bsdf.eta_o = medium.ior;
        (*surface).bsdf.eta_t = medium.ior;
    }
}

// Where a ray goes on that leaves the surface along `wi` (local).
fn medium_behind(medium: Medium, surface: Surface, wi: vec3f) -> Medium {
    if (!MEDIA || wi.z > 0.0 || surface.ior == 1.0) {
        return medium;
    }
    if (surface.front) {
        return Medium(surface.ior, surface.absorption);
    }
    return AIR;
}

// The footprint of a ray that is mirrored or refracted.
fn footprint_turn(footprint: Footprint, surface: Surface, before: vec3f, behind: vec3f, kind: u32) -> Footprint {
    if (kind == REFLECTED) {
        return footprint_reflect(footprint, surface.normal);
    }
    return footprint_refract(footprint, surface.bsdf.eta_o / surface.bsdf.eta_t, before, behind, surface.normal);
}
