// The BSDF of a surface: sample, eval and pdf. Directions are local to the geometric normal (+z, on the side
// of wo) and point away from the surface; wi.z < 0 is light from beyond the surface. Densities are per solid
// angle.
//
// Values are for basic radiance L* = L/n², which refraction leaves unchanged. bsdf_eval returns the K of L*_o
// = ∫ K L*_i n_i² |cosθ_i| dω_i: it does not include the cosine. K(wo, wi) = K(wi, wo), where the latter is
// seen from the side of wi. See guide/src/right/bsdf.md.
#import warp
#import microfacet
#import lobes

// Kinds of samples: a direction drawn from the density of the regular lobes, or one of the delta lobes:
// reflected, refracted into another medium, or passed straight through.
const REGULAR = 0u;
const REFLECTED = 1u;
const REFRACTED = 2u;
const PASSED = 3u;

struct BsdfSample {
    direction: vec3f,
    // For the regular kind K n_i² |cosθ_i| / pdf, with the cosine; for the others value / probability.
    weight: vec3f,
    // For the regular kind a density per solid angle; for the others the probability, which the reverse path
    // has, too. 0 where nothing was sampled.
    pdf: f32,
    kind: u32,
}

// The light that passes straight through a surface, as a share, and the probability with which a path does
// so.
struct Pass {
    value: vec3f,
    probability: f32,
}

// K and pdf (per solid angle) of the regular lobes.
struct Response {
    value: vec3f,
    pdf: f32,
}

// The cosine beyond a smooth surface, by Snell's law; 0 at total reflection.
fn bsdf_cosine_beyond(bsdf: Bsdf, cosine: f32) -> f32 {
    return refracted_cosine(cosine, bsdf.eta_o / bsdf.eta_t);
}

// The light along wo that passes straight through the surface.
fn bsdf_pass(bsdf: Bsdf, wo: vec3f) -> Pass {
    if (!PASSABLE || (bsdf.opacity == 1.0 && (bsdf.transmission == 0.0 || bsdf.alpha >= MIN_ALPHA))) {
        return Pass(vec3f(0.0), 0.0);
    }
    return bsdf_straight(bsdf, bsdf_deltas(bsdf, wo.z, wo.z));
}

// The same, where the delta lobes are known: light that misses the surface, and light through a thin smooth
// wall.
fn bsdf_straight(bsdf: Bsdf, deltas: Deltas) -> Pass {
    // Solid glass refracts the light that it transmits.
    let met = select(0.0, bsdf.opacity, bsdf.eta_o == bsdf.eta_t);
    let missed = 1.0 - bsdf.opacity;
    return Pass(vec3f(missed) + met * deltas.transmitted, missed + met * deltas.transmit);
}

// Whether the surface has any lobe besides the delta lobes.
fn bsdf_regular(bsdf: Bsdf) -> bool {
    return MATTE || (bsdf.opacity > 0.0 && (bsdf.alpha >= MIN_ALPHA || bsdf_base_weight(bsdf) > 0.0));
}

// K and pdf of the regular lobes for light that arrives along wi and leaves along wo. K does not include the
// cosine.
fn bsdf_response(bsdf: Bsdf, wo: vec3f, wi: vec3f) -> Response {
    let beyond = wi.z < 0.0;
    if (bsdf_plain(bsdf)) {
        let lit = wo.z > 0.0 && wi.z > 0.0;
        return Response(select(vec3f(0.0), bsdf.base_color * INV_PI, lit), select(0.0, wi.z * INV_PI, lit));
    }
    // The lobes are evaluated in the frame of the shading normal. All cosines outside the lobes are
    // geometric.
    var o = wo;
    var i = wi;
    if (CORNERS) {
        let frame = frame_around(bsdf.shading);
        o = to_local(frame, wo);
        i = to_local(frame, wi);
    }
    if (!(wo.z > 0.0 && o.z > 0.0 && wi.z * i.z > 0.0)) {
        return Response(vec3f(0.0), 0.0);
    }
    let solid = bsdf.eta_o != bsdf.eta_t;
    let bent = beyond && solid;
    let n_i = select(bsdf.eta_o, bsdf.eta_t, beyond);
    let smooth_surface = !bsdf_rough(bsdf);

    // The diffuse base. Under a smooth coat, the coupling uses the cosines of the delta lobes, which are
    // geometric.
    let coat_o = select(o.z, wo.z, smooth_surface);
    let coat_i = abs(select(i.z, wi.z, smooth_surface));
    let n = max(bsdf.eta_o, n_i);
    var value = bsdf_base(bsdf, beyond) * (bsdf_coupling(bsdf, coat_o, coat_i) * INV_PI / (n * n));
    let through = bsdf_through_share(bsdf);
    var pdf = select(1.0 - through, through, beyond) * abs(wi.z) * INV_PI;

    if (smooth_surface) {
        pdf *= bsdf_base_share(bsdf, wo.z);
    } else {
        let facets = bsdf_facets(bsdf, o, i, bent, beyond);
        let shares = bsdf_rough_shares(bsdf);
        value += facets.value;
        pdf = shares.x * facets.pdf + shares.y * pdf;
    }
    // With this factor, no shading normal makes a surface return more light than it receives: ∫ f |cosθ| ≤ ∫
    // f |cosθ_s|.
    let visible = min(1.0, o.z / wo.z) * min(1.0, i.z / wi.z);
    return Response(value * (visible * bsdf.opacity), pdf * bsdf.opacity);
}

// K and pdf of the microfacets of a rough surface, in the frame of the shading normal. `bent`: the light is
// refracted; `beyond`: it comes from beyond the surface.
fn bsdf_facets(bsdf: Bsdf, o: vec3f, i: vec3f, bent: bool, beyond: bool) -> Response {
    // A thin wall transmits like a mirror image: its transmitted lobe is the reflected one on the other side.
    let out = select(i, vec3f(i.xy, -i.z), beyond && !bent);
    let n_i = select(bsdf.eta_o, bsdf.eta_t, bent);
    // The half vector of reflection, or of refraction, is the facet's normal.
    let sum = bsdf.eta_o * o + n_i * out;
    let squared = dot(sum, sum);
    let h = sum * (select(1.0, -1.0, sum.z < 0.0) / sqrt(squared));
    var cos_o = 0.5 * sqrt(squared) / bsdf.eta_o;
    var cos_t = bsdf_cosine_beyond(bsdf, cos_o);
    if (bent) {
        cos_o = dot(o, h);
        cos_t = -dot(out, h);
        if (!(cos_o > 0.0 && cos_t > 0.0)) {
            return Response(vec3f(0.0), 0.0);
        }
    }
    let facet = bsdf_facet(bsdf, cos_o, cos_t);
    let mirror_share = bsdf_mirror_share(bsdf, facet);
    let color = select(facet.reflected, bsdf_glass(bsdf) * facet.clear, beyond);
    let share = select(mirror_share, 1.0 - mirror_share, beyond);
    let distribution = ggx_distribution(h, bsdf.alpha);
    let masking = ggx_masking(o.z, bsdf.alpha);
    if (bent) {
        // Walter et al. 2007, equation 21, without its η_o².
        let shape = distribution * (cos_o * cos_t) / squared;
        return Response(color * (shape * (masking * ggx_masking(-out.z, bsdf.alpha))), share * shape * masking * n_i * n_i);
    }
    let visibility = ggx_visibility(o.z, out.z, bsdf.alpha) / (bsdf.eta_o * bsdf.eta_o);
    return Response(color * (distribution * visibility), share * 0.25 * distribution * masking);
}

// K of the regular lobes, in 1/sr. The caller multiplies by n_i² |cosθ_i|, or by an image-plane density that
// carries the cosine.
fn bsdf_eval(bsdf: Bsdf, wo: vec3f, wi: vec3f) -> vec3f {
    return bsdf_response(bsdf, wo, wi).value;
}

// Density per solid angle with which bsdf_sample draws the direction wi from the regular lobes.
fn bsdf_pdf(bsdf: Bsdf, wo: vec3f, wi: vec3f) -> f32 {
    return bsdf_response(bsdf, wo, wi).pdf;
}

// The same surface as seen from its other side. Directions have to be turned by `bsdf_mirrored`.
fn bsdf_beyond(bsdf: Bsdf) -> Bsdf {
    var other = bsdf;
    other.eta_o = bsdf.eta_t;
    other.eta_t = bsdf.eta_o;
    other.shading = vec3f(-bsdf.shading.xy, bsdf.shading.z);
    return other;
}

// A direction in the frame of the surface's other side.
fn bsdf_mirrored(direction: vec3f) -> vec3f {
    return vec3f(direction.xy, -direction.z);
}

// The density, per solid angle of wo, with which the reverse path samples wo when it arrives along wi.
fn bsdf_reverse_pdf(bsdf: Bsdf, wo: vec3f, wi: vec3f) -> f32 {
    if (wi.z > 0.0) {
        return bsdf_pdf(bsdf, wi, wo);
    }
    return bsdf_pdf(bsdf_beyond(bsdf), bsdf_mirrored(wi), bsdf_mirrored(wo));
}

// Samples the direction in which a path that arrived along wo goes on. u.w chooses between the delta lobes
// and the regular lobes, u.z among the regular lobes, and u.xy choose the direction.
fn bsdf_sample(bsdf: Bsdf, wo: vec3f, u: vec4f) -> BsdfSample {
    var wi = square_to_cosine_hemisphere(u.xy);
    if (!bsdf_plain(bsdf)) {
        let ratio = bsdf.eta_o / bsdf.eta_t;
        let cos_t = bsdf_cosine_beyond(bsdf, wo.z);
        let deltas = bsdf_deltas(bsdf, wo.z, cos_t);
        let straight = bsdf_straight(bsdf, deltas);
        if (u.w < straight.probability) {
            return BsdfSample(-wo, straight.value / straight.probability, straight.probability, PASSED);
        }
        let reflect = bsdf.opacity * deltas.reflect;
        if (u.w < straight.probability + reflect) {
            return BsdfSample(vec3f(-wo.xy, wo.z), deltas.reflected / deltas.reflect, reflect, REFLECTED);
        }
        let refract = bsdf.opacity * deltas.transmit;
        if (bsdf.eta_o != bsdf.eta_t && u.w < straight.probability + reflect + refract) {
            let direction = vec3f(-ratio * wo.xy, -cos_t);
            return BsdfSample(direction, deltas.transmitted / deltas.transmit, refract, REFRACTED);
        }
        wi = bsdf_sample_regular(bsdf, wo, wi, u.xyz);
    }
    let response = bsdf_response(bsdf, wo, wi);
    if (!(response.pdf > 0.0)) {
        return BsdfSample(wi, vec3f(0.0), 0.0, REGULAR);
    }
    let n_i = select(bsdf.eta_o, bsdf.eta_t, wi.z < 0.0);
    return BsdfSample(wi, response.value * (n_i * n_i * (abs(wi.z) / response.pdf)), response.pdf, REGULAR);
}

// Samples a direction of the regular lobes; the zero vector where a facet sends light to the wrong side.
// `diffuse` is a sample of the cosine-weighted hemisphere.
fn bsdf_sample_regular(bsdf: Bsdf, wo: vec3f, diffuse: vec3f, u: vec3f) -> vec3f {
    var shares = vec2f(0.0, 1.0);
    if (bsdf_rough(bsdf)) {
        shares = bsdf_rough_shares(bsdf);
    }
    if (!FACETS || u.z >= shares.x) {
        return select(diffuse, bsdf_mirrored(diffuse), u.z - shares.x < bsdf_through_share(bsdf) * shares.y);
    }
    let frame = frame_around(bsdf.shading);
    let o = to_local(frame, wo);
    let h = ggx_sample_visible_normal(o, bsdf.alpha, u.xy);
    let cos_o = dot(o, h);
    let cos_t = bsdf_cosine_beyond(bsdf, cos_o);
    let mirrored = u.z < shares.x * bsdf_mirror_share(bsdf, bsdf_facet(bsdf, cos_o, cos_t));
    var i = reflect(-o, h);
    if (!mirrored) {
        let ratio = bsdf.eta_o / bsdf.eta_t;
        i = select(vec3f(i.xy, -i.z), (ratio * cos_o - cos_t) * h - ratio * o, bsdf.eta_o != bsdf.eta_t);
    }
    return select(vec3f(0.0), to_world(frame, i), (i.z > 0.0) == mirrored);
}
