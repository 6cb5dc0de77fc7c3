// The material of a surface, and how light is divided among its lobes. The layers of glTF's material model,
// multiplied out, are a blend of three materials with fixed shares: metal, opaque dielectric (a coat over a
// diffuse base), and glass. See guide/src/right/bsdf.md.
#import features
#import warp
#import fresnel

struct Bsdf {
    base_color: vec3f,
    metallic: f32,
    // Reflectance of the dielectric at normal and at grazing incidence (KHR_materials_ior,
    // KHR_materials_specular).
    f0: vec3f,
    f90: f32,
    // Microfacet width α = roughness². Below MIN_ALPHA the surface is smooth.
    alpha: f32,
    // KHR_materials_transmission: the share of glass.
    transmission: f32,
    // KHR_materials_diffuse_transmission: the share of the diffuse base that transmits.
    diffuse_transmission: f32,
    // Share of the light that meets the surface; the rest passes straight through.
    opacity: f32,
    diffuse_transmission_color: vec3f,
    // Refractive index on the side of wo, and beyond the surface. Where both are equal, the surface is a thin
    // wall and does not refract.
    eta_o: f32,
    eta_t: f32,
    // Shading normal in the local frame; (0, 0, 1) without one.
    shading: vec3f,
}

// The largest of three components.
fn max_component(v: vec3f) -> f32 {
    return max(max(v.x, v.y), v.z);
}

// Whether the surface is just a Lambertian reflector in air.
fn bsdf_plain(bsdf: Bsdf) -> bool {
    if (MATTE) {
        return true;
    }
    return bsdf.f90 == 0.0 && bsdf.metallic == 0.0 && bsdf.transmission == 0.0 && bsdf.diffuse_transmission == 0.0
        && bsdf.opacity == 1.0 && bsdf.shading.z == 1.0 && bsdf.eta_o == 1.0;
}

// Whether a surface that is not plain has microfacets, instead of being smooth.
fn bsdf_rough(bsdf: Bsdf) -> bool {
    return FACETS && bsdf.alpha >= MIN_ALPHA;
}

// Reflectance and transmittance of one microfacet.
struct Facet {
    // Share of the light that the blend of all three materials reflects.
    reflected: vec3f,
    // Shares that the glass alone reflects, in its strongest channel, and transmits, before its colour is
    // applied.
    glazed: f32,
    clear: f32,
}

// A facet's shares. `cos_o` is the cosine between light and facet normal, `cos_t` the cosine beyond the
// facet: 0 at total reflection. At a thin wall `cos_t` does not matter.
fn bsdf_facet(bsdf: Bsdf, cos_o: f32, cos_t: f32) -> Facet {
    let grazing = schlick_weight(cos_o);
    let dielectric = bsdf.f0 + (vec3f(bsdf.f90) - bsdf.f0) * grazing;
    let metal = bsdf.base_color + (vec3f(1.0) - bsdf.base_color) * grazing;
    var glass = dielectric;
    var glazed = max_component(dielectric);
    var clear = 1.0 - glazed;
    if (bsdf.eta_o != bsdf.eta_t) {
        // Solid glass has the reflectance of Fresnel's equations, times the specular factor, in the hue of
        // the specular colour.
        let tint = bsdf.f0 * (bsdf.f90 / max(max_component(bsdf.f0), 1e-20));
        let strength = max_component(tint);
        let shares = fresnel_shares(bsdf.eta_o, cos_o, bsdf.eta_t, cos_t);
        let total = cos_t <= 0.0;
        glass = select(shares.x * tint, vec3f(1.0), total);
        glazed = select(shares.x * strength, 1.0, total);
        clear = select(shares.y + shares.x * (1.0 - strength), 0.0, total);
    }
    return Facet(mix(mix(dielectric, glass, bsdf.transmission), metal, bsdf.metallic), glazed, clear);
}

// The colour of light that the glass transmits, times the glass's share of the surface.
fn bsdf_glass(bsdf: Bsdf) -> vec3f {
    return bsdf.base_color * (bsdf.transmission * (1.0 - bsdf.metallic));
}

// The albedo of the diffuse base under the coat, times its share of the surface: for transmission if
// `beyond`, else for reflection.
fn bsdf_base(bsdf: Bsdf, beyond: bool) -> vec3f {
    let share = (1.0 - bsdf.metallic) * (1.0 - bsdf.transmission);
    if (beyond) {
        return bsdf.diffuse_transmission_color * (share * bsdf.diffuse_transmission);
    }
    return bsdf.base_color * (share * (1.0 - bsdf.diffuse_transmission));
}

// The share of light that the coat lets through to the base, in one direction.
fn bsdf_under_coat(bsdf: Bsdf, cosine: f32) -> f32 {
    return 1.0 - mirrored_bound(max_component(bsdf.f0), bsdf.f90, bsdf.alpha, cosine);
}

// The share of light that the coat lets through on the way in and out: (1 − R(θ_o)) (1 − R(θ_i)) / (1 − R̄)
// (Kelemen and Szirmay-Kalos 2001). It is reciprocal, and its mean over all outgoing directions is 1 −
// R(θ_o).
fn bsdf_coupling(bsdf: Bsdf, cos_o: f32, cos_i: f32) -> f32 {
    let mean = 1.0 - mirrored_bound_mean(max_component(bsdf.f0), bsdf.f90, bsdf.alpha);
    return bsdf_under_coat(bsdf, cos_o) * bsdf_under_coat(bsdf, cos_i) / max(mean, 1e-6);
}

// Albedo of the whole base, reflection and transmission together; it decides how often the base is sampled.
fn bsdf_base_weight(bsdf: Bsdf) -> f32 {
    return max_component(bsdf_base(bsdf, false)) + max_component(bsdf_base(bsdf, true));
}

// Share of the base's samples that are transmitted.
fn bsdf_through_share(bsdf: Bsdf) -> f32 {
    let below = max_component(bsdf_base(bsdf, true));
    return select(below / bsdf_base_weight(bsdf), 0.0, below <= 0.0);
}

// Shares of a rough surface's regular samples that go to its facets (x) and to its base (y). They depend on
// the material only. Both are computed as quotients: as a difference from 1, a share that should be 0 might
// not be exactly 0.
fn bsdf_rough_shares(bsdf: Bsdf) -> vec2f {
    let tint = mix(bsdf.f0, bsdf.base_color, bsdf.metallic);
    let mirror = max_component(tint) + 0.05 * mix(bsdf.f90, 1.0, bsdf.metallic);
    let facets = mix(mirror, 1.0, bsdf.transmission * (1.0 - bsdf.metallic));
    let base = bsdf_base_weight(bsdf);
    return select(vec2f(facets, base) / (facets + base), vec2f(0.0, 1.0), facets <= 0.0);
}

// Share of the facets' samples that are reflected; the others are transmitted.
fn bsdf_mirror_share(bsdf: Bsdf, facet: Facet) -> f32 {
    let mirrored = max_component(facet.reflected);
    let through = max_component(bsdf_glass(bsdf)) * facet.clear;
    return select(mirrored / (mirrored + through), 1.0, through <= 0.0);
}

// Share of all samples of a smooth surface that go to its base: the base's part of the light that coat and
// base return together.
fn bsdf_base_share(bsdf: Bsdf, cos_o: f32) -> f32 {
    let f0 = max_component(bsdf.f0);
    let opaque_share = (1.0 - bsdf.metallic) * (1.0 - bsdf.transmission);
    let coat = (f0 + (bsdf.f90 - f0) * schlick_weight(cos_o)) * opaque_share;
    let base = bsdf_under_coat(bsdf, cos_o) * bsdf_base_weight(bsdf);
    return select(base / (coat + base), 0.0, base <= 0.0) * opaque_share;
}

// The delta lobes of a smooth surface, reflection and transmission: shares of the light that meets the
// surface, and probabilities. The reverse path has the same probabilities: they are sums of material
// constants, each times a function of a cosine that does not change along the path, or times Fresnel's
// transmittance, which is the same from both sides.
struct Deltas {
    reflected: vec3f,
    reflect: f32,
    transmitted: vec3f,
    transmit: f32,
}

// The delta lobes at these cosines of the incident light: on this side, and beyond the surface. A rough
// surface has none.
fn bsdf_deltas(bsdf: Bsdf, cos_o: f32, cos_t: f32) -> Deltas {
    if (bsdf_rough(bsdf)) {
        return Deltas();
    }
    let facet = bsdf_facet(bsdf, cos_o, cos_t);
    let glass = bsdf.transmission * (1.0 - bsdf.metallic);
    // The metal and the coat, and the glass.
    let coat = (1.0 - bsdf.metallic) * (1.0 - bsdf.transmission) - bsdf_base_share(bsdf, cos_o);
    let reflect = bsdf.metallic + coat + glass * facet.glazed;
    return Deltas(facet.reflected, reflect, bsdf_glass(bsdf) * facet.clear, glass * facet.clear);
}
