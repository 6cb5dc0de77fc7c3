// What a surface is made of, and how its light is divided among lobes. glTF's layers, multiplied out, are a blend of three
// materials with fixed shares: metal, opaque dielectric (a coat over a diffuse base) and glass.
#import features
#import warp
#import fresnel

struct Bsdf {
    base_color: vec3f,
    metallic: f32,
    // Dielectric reflectance at normal incidence, and at grazing incidence (KHR_materials_ior, KHR_materials_specular).
    f0: vec3f,
    f90: f32,
    // Microfacet width, roughness²; below MIN_ALPHA the surface is smooth.
    alpha: f32,
    // KHR_materials_transmission: the share of glass.
    transmission: f32,
    // KHR_materials_diffuse_transmission: the share of the diffuse base that lets light through.
    diffuse_transmission: f32,
    // Share of the light that meets the surface at all; the rest passes straight on.
    opacity: f32,
    diffuse_transmission_color: vec3f,
    // Refractive index on the side of wo, and beyond the surface. Equal: a thin wall, which bends nothing.
    eta_o: f32,
    eta_t: f32,
    // Shading normal in the local frame; (0, 0, 1) where there is none.
    shading: vec3f,
}

fn max_component(v: vec3f) -> f32 {
    return max(max(v.x, v.y), v.z);
}

// Whether light meets nothing but a Lambertian reflector, in air.
fn bsdf_plain(bsdf: Bsdf) -> bool {
    if (MATTE) {
        return true;
    }
    return bsdf.f90 == 0.0 && bsdf.metallic == 0.0 && bsdf.transmission == 0.0 && bsdf.diffuse_transmission == 0.0
        && bsdf.opacity == 1.0 && bsdf.shading.z == 1.0 && bsdf.eta_o == 1.0;
}

// What a facet does with light.
struct Facet {
    // Share mirrored, all three materials together.
    reflected: vec3f,
    // Shares that the glass alone mirrors, in its strongest channel, and lets through, before its colour.
    glazed: f32,
    clear: f32,
}

// `cos_o` is the cosine between light and facet, `cos_t` that beyond the facet: 0 where light is totally reflected, any
// number at a thin wall.
fn bsdf_facet(bsdf: Bsdf, cos_o: f32, cos_t: f32) -> Facet {
    let grazing = schlick_weight(cos_o);
    let dielectric = bsdf.f0 + (vec3f(bsdf.f90) - bsdf.f0) * grazing;
    let metal = bsdf.base_color + (vec3f(1.0) - bsdf.base_color) * grazing;
    var glass = dielectric;
    var glazed = max_component(dielectric);
    var clear = 1.0 - glazed;
    if (bsdf.eta_o != bsdf.eta_t) {
        // Solid glass has Fresnel's reflectance, times the specular factor, in the hue of the specular colour.
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

// The colour that glass gives to what it lets through, with its share of the surface.
fn bsdf_glass(bsdf: Bsdf) -> vec3f {
    return bsdf.base_color * (bsdf.transmission * (1.0 - bsdf.metallic));
}

// The diffuse base under the coat: albedo of reflection and of transmission, with their share of the surface.
fn bsdf_base(bsdf: Bsdf, beyond: bool) -> vec3f {
    let share = (1.0 - bsdf.metallic) * (1.0 - bsdf.transmission);
    if (beyond) {
        return bsdf.diffuse_transmission_color * (share * bsdf.diffuse_transmission);
    }
    return bsdf.base_color * (share * (1.0 - bsdf.diffuse_transmission));
}

// What the coat leaves of the light for the base, entering along one direction.
fn bsdf_under_coat(bsdf: Bsdf, cosine: f32) -> f32 {
    return 1.0 - mirrored_bound(max_component(bsdf.f0), bsdf.f90, bsdf.alpha, cosine);
}

// What it leaves on the way in and out: (1 − R(θ_o)) (1 − R(θ_i)) / (1 − R̄) (Kelemen and Szirmay-Kalos 2001). Reciprocal,
// and over all directions out just 1 − R(θ_o).
fn bsdf_coupling(bsdf: Bsdf, cos_o: f32, cos_i: f32) -> f32 {
    let mean = 1.0 - mirrored_bound_mean(max_component(bsdf.f0), bsdf.f90, bsdf.alpha);
    return bsdf_under_coat(bsdf, cos_o) * bsdf_under_coat(bsdf, cos_i) / max(mean, 1e-6);
}

// Albedo of the whole base, for choosing among lobes.
fn bsdf_base_weight(bsdf: Bsdf) -> f32 {
    return max_component(bsdf_base(bsdf, false)) + max_component(bsdf_base(bsdf, true));
}

// Share of the base's samples that go through it.
fn bsdf_through_share(bsdf: Bsdf) -> f32 {
    let below = max_component(bsdf_base(bsdf, true));
    return select(below / bsdf_base_weight(bsdf), 0.0, below <= 0.0);
}

// Shares of the regular samples of a rough surface that go to its facets and to its base. They depend on the material
// alone. Both are quotients: a share that is a difference from 1 would not be 0 to the bit.
fn bsdf_rough_shares(bsdf: Bsdf) -> vec2f {
    let tint = mix(bsdf.f0, bsdf.base_color, bsdf.metallic);
    let mirror = max_component(tint) + 0.05 * mix(bsdf.f90, 1.0, bsdf.metallic);
    let facets = mix(mirror, 1.0, bsdf.transmission * (1.0 - bsdf.metallic));
    let base = bsdf_base_weight(bsdf);
    return select(vec2f(facets, base) / (facets + base), vec2f(0.0, 1.0), facets <= 0.0);
}

// Share of the facets' samples that are mirrored; the rest is let through.
fn bsdf_mirror_share(bsdf: Bsdf, facet: Facet) -> f32 {
    let mirrored = max_component(facet.reflected);
    let through = max_component(bsdf_glass(bsdf)) * facet.clear;
    return select(mirrored / (mirrored + through), 1.0, through <= 0.0);
}

// Share of all samples of a smooth surface that go to its base, as large as its part in what the coat and the base return.
fn bsdf_base_share(bsdf: Bsdf, cos_o: f32) -> f32 {
    let f0 = max_component(bsdf.f0);
    let opaque_share = (1.0 - bsdf.metallic) * (1.0 - bsdf.transmission);
    let coat = (f0 + (bsdf.f90 - f0) * schlick_weight(cos_o)) * opaque_share;
    let base = bsdf_under_coat(bsdf, cos_o) * bsdf_base_weight(bsdf);
    return select(base / (coat + base), 0.0, base <= 0.0) * opaque_share;
}

// The single directions that a smooth surface sends light to, of what meets it: values and probabilities. The
// probabilities are those of the reversed path, too: sums of material constants, each times a function of a cosine that
// the path keeps, or times Fresnel's transmittance, which is the same from both sides.
struct Deltas {
    reflected: vec3f,
    reflect: f32,
    transmitted: vec3f,
    transmit: f32,
}

fn bsdf_deltas(bsdf: Bsdf, cos_o: f32, cos_t: f32) -> Deltas {
    if (bsdf.alpha >= MIN_ALPHA) {
        return Deltas();
    }
    let facet = bsdf_facet(bsdf, cos_o, cos_t);
    let glass = bsdf.transmission * (1.0 - bsdf.metallic);
    // The metal and the coat, and the glass.
    let coat = (1.0 - bsdf.metallic) * (1.0 - bsdf.transmission) - bsdf_base_share(bsdf, cos_o);
    let reflect = bsdf.metallic + coat + glass * facet.glazed;
    return Deltas(facet.reflected, reflect, bsdf_glass(bsdf) * facet.clear, glass * facet.clear);
}
