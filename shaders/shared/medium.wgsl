// The medium in which a ray runs: air, or the inside of a solid. Solids do not overlap.
#import features
#import surface
#import footprint

struct Medium {
    // Refractive index.
    ior: f32,
    // Absorption per unit of length.
    absorption: vec3f,
}

const AIR = Medium(1.0, vec3f(0.0));

// The most surfaces in a row that light passes straight through; whatever lies behind them is dark.
const MAX_PASSES = 16u;

// The share of light that remains after `distance`, by Beer and Lambert's law.
fn medium_transmittance(medium: Medium, distance: f32) -> vec3f {
    if (!MEDIA || all(medium.absorption == vec3f(0.0))) {
        return vec3f(1.0);
    }
    return exp(-medium.absorption * distance);
}

// Sets the refractive indices of a surface that borders on no medium: it has the ray's medium on both sides.
fn medium_meets(medium: Medium, surface: ptr<function, Surface>) {
    if (MEDIA && (*surface).ior == 1.0) {
        (*surface).bsdf.eta_o = medium.ior;
        (*surface).bsdf.eta_t = medium.ior;
    }
}

// The medium of a ray that leaves the surface along the local direction `wi`.
fn medium_behind(medium: Medium, surface: Surface, wi: vec3f) -> Medium {
    if (!MEDIA || wi.z > 0.0 || surface.ior == 1.0) {
        return medium;
    }
    if (surface.front) {
        return Medium(surface.ior, surface.absorption);
    }
    return AIR;
}

// The footprint after reflection or refraction at the surface; `before` and `behind` are the ray's
// directions.
fn footprint_turn(footprint: Footprint, surface: Surface, before: vec3f, behind: vec3f, kind: u32) -> Footprint {
    if (kind == REFLECTED) {
        return footprint_reflect(footprint, surface.normal);
    }
    return footprint_refract(footprint, surface.bsdf.eta_o / surface.bsdf.eta_t, before, behind, surface.normal);
}
