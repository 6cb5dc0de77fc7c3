// The surface's BSDF: glTF 2.0 metallic–roughness with KHR_materials_specular and KHR_materials_ior, as
// sample / eval / pdf. Directions are local (normal +z, on the side of wo) and point away from the surface; densities are
// per solid angle; nobody but the caller carries a cosine. Reciprocal: eval(wo, wi) = eval(wi, wo).
#import warp
#import microfacet

struct Bsdf {
    base_color: vec3f,
    metallic: f32,
    // Dielectric reflectance at normal incidence, and at grazing incidence.
    f0: vec3f,
    f90: f32,
    // Microfacet width, roughness²; below MIN_ALPHA the surface is smooth.
    alpha: f32,
    // KHR_materials_transmission and KHR_materials_diffuse_transmission.
    transmission: f32,
    diffuse_transmission: f32,
    // Share of the light that meets the surface at all; the rest passes straight on.
    opacity: f32,
    diffuse_transmission_color: vec3f,
    // Refractive index on the side of wo, and beyond the surface; both 1 at a thin wall.
    eta_o: f32,
    eta_t: f32,
    // Shading normal in the local frame; (0, 0, 1) where there is none.
    shading: vec3f,
}

// A surface whose microfacet width is below this is smooth: it mirrors and refracts in single directions.
const MIN_ALPHA = 1e-3;

// What a sample is.
const REGULAR = 0u;
// Delta: mirrored at the surface.
const REFLECTED = 1u;
// Delta: refracted into another medium.
const REFRACTED = 2u;
// Delta: straight on.
const PASSED = 3u;

struct BsdfSample {
    // Below the horizon where transmitted.
    direction: vec3f,
    // Regular: K n_i² |cosθ| / pdf; delta: value / pdf.
    weight: vec3f,
    // Regular: per solid angle; delta: a probability. 0 when nothing was sampled.
    pdf: f32,
    kind: u32,
}

// What goes straight through, and the probability with which it is sampled.
struct Pass {
    value: vec3f,
    probability: f32,
}

fn bsdf_pass(bsdf: Bsdf, wo: vec3f) -> Pass {
    return Pass(vec3f(0.0), 0.0);
}

// Whether there is anything but deltas.
fn bsdf_regular(bsdf: Bsdf) -> bool {
    return true;
}

// Share of the samples that go to the microfacet lobe. It depends on the material alone, so it is the same for a path and
// its reverse.
fn bsdf_specular_share(bsdf: Bsdf) -> f32 {
    let tint = mix(bsdf.f0, bsdf.base_color, bsdf.metallic);
    let specular = max(max(tint.x, tint.y), tint.z) + 0.05 * mix(bsdf.f90, 1.0, bsdf.metallic);
    let diffuse = max(max(bsdf.base_color.x, bsdf.base_color.y), bsdf.base_color.z) * (1.0 - bsdf.metallic);
    return select(specular / (specular + diffuse), 0.0, specular <= 0.0);
}

fn bsdf_eval(bsdf: Bsdf, wo: vec3f, wi: vec3f) -> vec3f {
    if (wo.z <= 0.0 || wi.z <= 0.0) {
        return vec3f(0.0);
    }
    if (bsdf.f90 == 0.0 && bsdf.metallic == 0.0) {
        return bsdf.base_color * INV_PI;
    }
    let h = normalize(wo + wi);
    // Schlick's fifth power, multiplied out: `pow` differs from device to device.
    let away = clamp(1.0 - dot(wo, h), 0.0, 1.0);
    let grazing = away * away * (away * away) * away;
    let dielectric = bsdf.f0 + (vec3f(bsdf.f90) - bsdf.f0) * grazing;
    let metal = bsdf.base_color + (vec3f(1.0) - bsdf.base_color) * grazing;
    let passed = 1.0 - max(max(dielectric.x, dielectric.y), dielectric.z);
    let diffuse = bsdf.base_color * ((1.0 - bsdf.metallic) * passed * INV_PI);
    let facets = ggx_distribution(h, bsdf.alpha) * ggx_visibility(wo.z, wi.z, bsdf.alpha);
    return diffuse + mix(dielectric, metal, bsdf.metallic) * facets;
}

fn bsdf_pdf(bsdf: Bsdf, wo: vec3f, wi: vec3f) -> f32 {
    if (wo.z <= 0.0 || wi.z <= 0.0) {
        return 0.0;
    }
    let share = bsdf_specular_share(bsdf);
    var pdf = (1.0 - share) * wi.z * INV_PI;
    if (share > 0.0) {
        pdf += share * ggx_reflected_pdf(wo.z, normalize(wo + wi), bsdf.alpha);
    }
    return pdf;
}

fn bsdf_sample(bsdf: Bsdf, wo: vec3f, u: vec4f) -> BsdfSample {
    var wi: vec3f;
    if (u.z < bsdf_specular_share(bsdf)) {
        wi = reflect(-wo, ggx_sample_visible_normal(wo, bsdf.alpha, u.xy));
    } else {
        wi = square_to_cosine_hemisphere(u.xy);
    }
    let pdf = bsdf_pdf(bsdf, wo, wi);
    if (!(pdf > 0.0)) {
        return BsdfSample(wi, vec3f(0.0), 0.0, REGULAR);
    }
    return BsdfSample(wi, bsdf_eval(bsdf, wo, wi) * (wi.z / pdf), pdf, REGULAR);
}
