// The connections of a path from one surface point to the other endpoint: straight, or gathered through
// specular chains. `path.wgsl` describes the weights, and the record to which the connections are written.
#import features
#import parameters
#import sampler
#import endpoint
#import surface
#import reverse
#import photons
#import visibility

// Random numbers for connections have vertex numbers from here on; those for scattering have the ones below.
const CONNECTIONS = 0x1000u;

// Connects the surface point x to the other endpoint, and writes the connection to its slot. The estimate is
// F / p_f = throughput · f(wo, wi) · D(x): the image-plane density D of x, as the other endpoint sees it,
// carries the cosine at x.
fn path_connect(path: ptr<function, Path>, vertex: Vertex) {
    var connection = vec4u(NONE, 0u, 0u, 0u);
    if (vertex.scatters && !(vertex.is_direct && path.chain == 0u)) {
        let draw = connection_sample(path.start.pixel, path.start.sample, path.vertex);
        let end_lens = endpoint_lens_point(parameters.end, draw.xy);
        let end = endpoint_origin(parameters.end, end_lens);
        let offset = vertex.surface.position - end;
        let lit = endpoint_pixel(parameters.end, endpoint_to_local(parameters.end, offset), end_lens);
        let density = endpoint_density(parameters.end, offset, vertex.surface.normal);
        let wi = to_local(vertex.frame, normalize(-offset));
        let value = path.throughput * bsdf_eval(vertex.surface.bsdf, vertex.wo, wi) * (density * parameters.scale);
        if (lit != NONE && any(value > vec3f(0.0))) {
            var rays = 0u;
            let light = connection_transmission(vertex.pair, select(vertex.before, vertex.behind, wi.z < 0.0), end, &rays);
            path.rays += rays;
            // p_r / p_f: the reverse path would start by this connection, and its density on the image plane
            // is D(x).
            var ratio = density * light.probability * parameters.end_to_start;
            if (path.is_specular) {
                ratio *= bsdf_interaction(vertex.surface.bsdf, wi) / (vertex.interaction * vertex.first_density);
            } else {
                ratio *= bsdf_reverse_density(vertex.surface.bsdf, vertex.wo, wi) * path.pdf_ratio / vertex.interaction;
            }
            // The reverse of a path that begins with a specular chain cannot be sampled: its last connection
            // would have to hit the chain.
            ratio = select(ratio, 0.0, path.chain > 0u);
            if (any(light.value > vec3f(0.0))) {
                connection = vec4u(lit, bitcast<vec3u>(value * light.value / (1.0 + ratio)));
            }
        }
    }
    // The connection from surface k has slot k, or k − 1 where the first one is the direct light.
    let slot = select(0u, ~0u, COAXIAL_PINHOLE) + path.surfaces;
    if (slot > 0u) {
        records[slot * parameters.paths + path.index] = connection;
    }
}

// Connects the surface point to the other endpoint through specular chains on both sides, by gathering
// photons of the other endpoint's chains, and writes the connection to its slot.
fn path_gather(path: ptr<function, Path>, vertex: Vertex) {
    var gathered = Gathered(NONE, vec3f(0.0), vec3f(0.0, 0.0, 1.0), 0.0);
    if (vertex.scatters && path.chain > 0u) {
        let most = parameters.max_bounces - path.surfaces;
        let draw = connection_sample(path.start.pixel, path.start.sample, path.vertex).z;
        let own = OwnChain(vertex.is_direct, path.footprint, path.start.image);
        gathered = photons_gather(vertex.surface, vertex.frame, vertex.wo, most, own, draw);
    }
    // p_r / p_f, with the density of the photon that represents all photons found.
    var ratio = gathered.density * parameters.end_to_start;
    if (path.is_specular) {
        ratio /= vertex.first_density;
    } else {
        ratio *= bsdf_reverse_density(vertex.surface.bsdf, vertex.wo, gathered.wi) * path.pdf_ratio / vertex.interaction;
    }
    let value = path.throughput * gathered.value * (parameters.scale / (1.0 + ratio));
    // Behind the connections of all surfaces; the first one belongs to surface 2.
    let first_slot = select(0u, ~0u, COAXIAL_PINHOLE) + parameters.max_bounces + 1u;
    let slot = first_slot + path.surfaces - 2u;
    records[slot * parameters.paths + path.index] = vec4u(gathered.origin, bitcast<vec3u>(value));
}

// Four random numbers in [0, 1) for a connection: a point of the lens (x, y), which photon (z), whether the
// path goes on (w).
fn connection_sample(pixel: u32, sample: u32, vertex: u32) -> vec4f {
    if (!LENSES && !CHAINS && !ROULETTE) {
        return vec4f(0.0);
    }
    return sample4(pixel, sample, CONNECTIONS + vertex);
}
