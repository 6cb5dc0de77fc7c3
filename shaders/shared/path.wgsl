// A light path: from a pixel of one end of the rig through the scene, and from each surface point on it to the other end. Each such
// connection is one contribution to the matrix; the weight makes the sum of what both ends' paths contribute unbiased (see
// `render`'s documentation). Nothing is added up here: a path writes to its own slots.
#import features
#import parameters
#import sampler
#import start
#import warp
#import eye
#import surface
#import side
#import medium
#import photons
#import visibility

// `stride` slots a path, and the same slot of all paths side by side: neighbours write to one cache line, and what few paths
// reach is touched by few. Slot 0: mark (16 bits), rays traced (8), surfaces met (8), and direct light that came back the way
// it went. Then the connections from each surface, the first one left out where it is the direct light. Where there are
// photons, the connections through specular chains from the second surface on. Last: ambient radiance.
// A connection is pixel (or NONE; the upper four bits count the chain's surfaces) and weight.
@group(1) @binding(0) var<storage, read_write> records: array<vec4u>;

// The numbers for connections come after those for vertices.
const CONNECTIONS = 0x1000u;

struct Path {
    // Within the dispatch.
    index: u32,
    start: Start,
    // The ray on which it goes on.
    origin: vec3f,
    direction: vec3f,
    throughput: vec3f,
    direct: vec3f,
    ambient: vec3f,
    medium: Medium,
    surfaces: u32,
    rays: u32,
    vertex: u32,
    passes: u32,
    // Until the path has been scattered for the first time: surfaces of its specular chain and its footprint, what the chain
    // lets through, and the probability with which the path followed it.
    straight: bool,
    chain: u32,
    footprint: Footprint,
    retraced: vec3f,
    probability: f32,
    // Afterwards: density of the reverse path over that of this one, but for what happens at the connection.
    odds: f32,
}

fn path_begin(index: u32, start: Start) -> Path {
    var path: Path;
    path.index = index;
    // By lists, where there are any; other first rays are counted when they are traced.
    path.rays = select(0u, 1u, SIGHT_SIDE > 0u);
    path.start = start;
    path.origin = start.origin;
    path.direction = start.direction;
    path.throughput = vec3f(1.0);
    path.medium = AIR;
    path.straight = true;
    if (CHAINS) {
        path.footprint = footprint_at_eye(parameters.start, start.towards);
    }
    path.retraced = vec3f(1.0);
    path.probability = 1.0;
    return path;
}

fn path_end(path: Path) {
    let head = parameters.mark | (min(path.rays, 255u) << 8u) | path.surfaces;
    records[path.index] = vec4u(head, bitcast<vec3u>(path.direct));
    if (AMBIENT) {
        records[(parameters.stride - 1u) * parameters.paths + path.index] = vec4u(parameters.mark, bitcast<vec3u>(path.ambient));
    }
}

// The path meets a surface there: its direct light, its connection to the other end, and whether and how it goes on.
fn path_meets(path: ptr<function, Path>, hit: Hit) -> bool {
    // The slot of the connection from surface k is this plus k; that of the gathered one, plus k − 2.
    let connection_slot = select(0u, ~0u, COAXIAL_PINHOLE);
    let gather_slot = connection_slot + parameters.max_bounces + 1u;
    let gathers = CHAINS && parameters.bucket_mask != 0u;
    var surface = surface_at(hit, path.direction);
    medium_meets(path.medium, &surface);
    let frame = frame_around(surface.normal);
    let wo = to_local(frame, -path.direction);
    let before = surface_leave(surface.position, surface.normal);
    let behind = surface_leave(surface.position, -surface.normal);
    if (MEDIA) {
        let clear = medium_transmittance(path.medium, hit.distance);
        path.throughput *= clear;
        path.retraced *= clear;
    }
    if (CHAINS && path.straight) {
        path.footprint = footprint_travel(path.footprint, hit.distance, path.direction, surface.normal);
    }
    path.vertex += 1u;
    let next = bsdf_sample(surface.bsdf, wo, sample4(path.start.pixel, path.start.sample, path.vertex));
    if (PASSABLE && next.kind == PASSED && next.pdf > 0.0 && !surface.black) {
        path.passes += 1u;
        if (path.passes == MAX_PASSES) {
            return false;
        }
        if (path.straight) {
            path.retraced *= next.weight * next.pdf;
            path.probability *= next.pdf;
        }
        path.throughput *= next.weight;
        path.origin = behind;
        return true;
    }
    path.passes = 0u;
    path.surfaces += 1u;
    let meeting = bsdf_meeting(surface.bsdf, wo);
    path.throughput /= meeting;
    if (AMBIENT) {
        path.ambient += path.throughput * surface.bsdf.opacity * surface.emission;
    }

    // The density with which paths come here by this chain: what this path and one that ends here have in common.
    var first_density = eye_density(parameters.start, surface.position - path.start.origin, surface.normal);
    if (CHAINS && path.chain > 0u) {
        first_density = footprint_density(path.footprint);
    }
    let scatters = bsdf_regular(surface.bsdf) && !surface.black;
    let is_direct = COAXIAL_PINHOLE && path.straight;
    if (is_direct && scatters && path.surfaces + path.chain <= parameters.max_bounces) {
        path.direct += path.throughput * path.retraced * bsdf_eval(surface.bsdf, wo, wo) * first_density;
    }
    first_density *= path.probability;

    let slot = connection_slot + path.surfaces;
    var connection = vec4u(NONE, 0u, 0u, 0u);
    if (scatters && !(is_direct && path.chain == 0u)) {
        let draw = connection_sample(path.start.pixel, path.start.sample, path.vertex);
        let end_lens = eye_lens_point(parameters.end, draw.xy);
        let end = eye_origin(parameters.end, end_lens);
        let offset = surface.position - end;
        let lit = eye_pixel(parameters.end, eye_to_local(parameters.end, offset), end_lens);
        let density = eye_density(parameters.end, offset, surface.normal);
        let wi = to_local(frame, normalize(-offset));
        let value = path.throughput * bsdf_eval(surface.bsdf, wo, wi) * (density * parameters.scale);
        if (lit != NONE && any(value > vec3f(0.0))) {
            var rays = 0u;
            let light = connection_light(hit.triangle >> 1u, select(before, behind, wi.z < 0.0), end, &rays);
            path.rays += rays;
            // Density of the reverse path over that of this one.
            var reverse = density * light.probability * parameters.end_to_start;
            if (path.straight) {
                reverse *= bsdf_meeting(surface.bsdf, wi) / (meeting * first_density);
            } else {
                reverse *= bsdf_reverse_density(surface.bsdf, wo, wi) * path.odds / meeting;
            }
            // A chain at the path's beginning cannot be met by its reverse. Else the balance heuristic: Veach and Guibas 1995.
            reverse = select(reverse, 0.0, path.chain > 0u);
            if (any(light.value > vec3f(0.0))) {
                connection = vec4u(lit, bitcast<vec3u>(value * light.value / (1.0 + reverse)));
            }
        }
    }
    if (slot > 0u) {
        records[slot * parameters.paths + path.index] = connection;
    }
    // Specular at both ends: by way of the photons.
    if (gathers && path.surfaces > 1u) {
        var gathered = Gathered(NONE, vec3f(0.0), vec3f(0.0, 0.0, 1.0), 0.0);
        if (scatters && path.chain > 0u) {
            let most = parameters.max_bounces - path.surfaces;
            let draw = connection_sample(path.start.pixel, path.start.sample, path.vertex).z;
            gathered = photons_gather(surface, frame, wo, most, is_direct, path.footprint, path.start.image, draw);
        }
        var reverse = gathered.density * parameters.end_to_start;
        if (path.straight) {
            reverse /= first_density;
        } else {
            reverse *= bsdf_reverse_density(surface.bsdf, wo, gathered.wi) * path.odds / meeting;
        }
        let value = path.throughput * gathered.value * (parameters.scale / (1.0 + reverse));
        records[(gather_slot + path.surfaces - 2u) * parameters.paths + path.index] = vec4u(gathered.origin, bitcast<vec3u>(value));
    }

    if (path.surfaces == parameters.max_bounces || surface.black || !(next.pdf > 0.0) || all(next.weight == vec3f(0.0))) {
        return false;
    }
    if (ROULETTE && path.surfaces > 2u) {
        let left = path.throughput * next.weight;
        // Stays out of the weights: both ends' paths end by chance alike.
        let survival = clamp(max(max(left.x, left.y), left.z), 0.05, 1.0);
        if (connection_sample(path.start.pixel, path.start.sample, path.vertex).w >= survival) {
            return false;
        }
        path.throughput /= survival;
    }
    let leaving = to_world(frame, next.direction);
    if (next.kind == REGULAR) {
        let index = bsdf_index_along(surface.bsdf, next.direction);
        let forward = next.pdf / (index * index * abs(next.direction.z));
        if (path.straight) {
            path.odds = bsdf_meeting(surface.bsdf, next.direction) / (first_density * forward);
            path.straight = false;
        } else {
            path.odds *= bsdf_reverse_density(surface.bsdf, wo, next.direction) / forward;
        }
    } else if (CHAINS && path.straight) {
        path.retraced *= next.weight * next.pdf;
        path.probability *= next.pdf;
        path.footprint = footprint_turn(path.footprint, surface, path.direction, leaving, next.kind);
        path.chain += 1u;
    }
    path.throughput *= next.weight * meeting;
    path.medium = medium_behind(path.medium, surface, next.direction);
    path.origin = select(before, behind, next.direction.z < 0.0);
    path.direction = leaving;
    return true;
}

// The numbers that a connection needs: a point of the lens, which photon, whether to go on.
fn connection_sample(pixel: u32, sample: u32, vertex: u32) -> vec4f {
    if (!LENSES && !CHAINS && !ROULETTE) {
        return vec4f(0.0);
    }
    return sample4(pixel, sample, CONNECTIONS + vertex);
}
