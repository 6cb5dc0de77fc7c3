// The photon map of an endpoint's specular chains: which of its pixels see a surface point through mirrors
// and glass. `trace_photons` traces the chains, `render::photons` sorts the photons into a hash grid, and
// paths gather them here.
#import parameters
#import surface
#import footprint

// The end of one specular chain, as `trace_photons` records it: four vectors of four words, which are
// `Photon` in `render::photons`.
struct Photon {
    // Pixel (lower 28 bits) and surfaces of the chain (upper 4 bits); position.
    place: vec4u,
    // Generalized image-plane density D of the point through the chain, times the chain's probability; then
    // (RGB) the throughput of the chain over its probability, times the image-plane area that the photon
    // represents.
    light: vec4f,
    // First coordinate on the image plane; unit direction back to the chain's last surface.
    arrival: vec4f,
    // Second coordinate on the image plane; the surface's normal on the photon's side.
    ground: vec4f,
}

@group(1) @binding(1) var<storage, read> photons: array<Photon>;
// Index of the first photon of each bucket, and finally the number of photons.
@group(1) @binding(2) var<storage, read> photon_buckets: array<u32>;

// The result of gathering at one surface point.
struct Gathered {
    // Pixel and surfaces of the chain, packed as in Photon; NONE where nothing was found.
    origin: u32,
    // Radiance that the surface sends along wo, for a pattern of 1.
    value: vec3f,
    // Local direction and density of the photon that represents all photons found.
    wi: vec3f,
    density: f32,
}

// The bucket of a grid cell, by the hash of Teschner et al. 2003.
fn photon_bucket(cell: vec3i) -> u32 {
    let key = vec3u(cell) * vec3u(73856093u, 19349663u, 83492791u);
    let mixed = (key.x ^ key.y ^ key.z) * 0x9e3779b1u;
    return (mixed ^ (mixed >> 15u)) & parameters.bucket_mask;
}

// The specular chain by which the gathering path itself came to the surface point.
struct OwnChain {
    // Light along this chain is known exactly, and photons that came along it are left out.
    is_skipped: bool,
    footprint: Footprint,
    // The path's start on the image plane at distance 1.
    image: vec2f,
}

// Gathers all photons within the radius r around a surface point: Σ K(wo, wi) T Φ / (π r²), where Φ is the
// image-plane area that a photon represents and T its chain's throughput (guide/src/right/operator.md, "Specular
// chains"). One photon, drawn with probability proportional to its contribution, represents all of them.
// `most_surfaces` bounds the surfaces of their chains; `u` is a uniform number in [0, 1).
fn photons_gather(surface: Surface, frame: Frame, wo: vec3f, most_surfaces: u32, own: OwnChain, u: f32) -> Gathered {
    var found = Gathered(NONE, vec3f(0.0), vec3f(0.0), 0.0);
    var total = 0.0;
    var chosen = 1.0;
    var draw = u;
    let radius = parameters.gather_radius;
    // Cells are two radii wide, so that the sphere touches at most two of them along each axis.
    let first = vec3i(floor((surface.position - radius) * parameters.inverse_cell));
    for (var corner = 0u; corner < 8u; corner += 1u) {
        let cell = first + vec3i(vec3u(corner & 1u, (corner >> 1u) & 1u, corner >> 2u));
        let bucket = photon_bucket(cell);
        let end = photon_buckets[bucket + 1u];
        for (var index = photon_buckets[bucket]; index < end; index += 1u) {
            let photon = photons[index];
            let position = bitcast<vec3f>(photon.place.yzw);
            let offset = position - surface.position;
            let height = dot(offset, surface.normal);
            // Photons of other cells may share the bucket, and photons on other surfaces may lie within the
            // sphere.
            if (dot(offset, offset) >= radius * radius || abs(height) > 0.1 * radius
                || dot(photon.ground.yzw, surface.normal) < 0.9
                || (photon.place.x >> 28u) > most_surfaces
                || any(vec3i(floor(position * parameters.inverse_cell)) != cell)) {
                continue;
            }
            if (own.is_skipped) {
                let moved = vec2f(photon.arrival.x, photon.ground.x) - own.image;
                let predicted = own.footprint.foot_u * moved.x + own.footprint.foot_v * moved.y;
                if (dot(predicted, predicted) < 4.0 * radius * radius) {
                    continue;
                }
            }
            let wi = to_local(frame, photon.arrival.yzw);
            let value = bsdf_eval(surface.bsdf, wo, wi) * photon.light.yzw;
            let weight = value.x + value.y + value.z;
            if (!(weight > 0.0)) {
                continue;
            }
            total += weight;
            let share = weight / total;
            // One random number serves all draws: after each draw it is rescaled, and uniform again.
            if (draw < share) {
                draw = draw / share;
                found = Gathered(photon.place.x, value, wi, photon.light.x);
                chosen = weight;
            } else {
                draw = (draw - share) / (1.0 - share);
            }
        }
    }
    // The density estimate over the disc.
    found.value *= total / chosen * INV_PI / (radius * radius);
    return found;
}
