// One light path per invocation: from a pixel of one end of the rig through the scene, and from each surface point on it to
// the other end. Each such connection is one contribution to the matrix; the weight makes the sum of what both ends'
// paths contribute unbiased (see `render`'s documentation). Nothing is added up here: a path writes to its own slots.
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
#import sight

// `stride` slots a path, and the same slot of all paths side by side: neighbours write to one cache line, and what few paths
// reach is touched by few. Slot 0: mark (16 bits), rays traced (8), surfaces met (8), and direct light that came back the way
// it went. Then the connections from each surface, the first one left out where it is the direct light. Where there are
// photons, the connections through specular chains from the second surface on. Last: ambient radiance.
// A connection is pixel (or NONE; the upper four bits count the chain's surfaces) and weight.
@group(1) @binding(0) var<storage, read_write> records: array<vec4u>;

// The numbers for connections come after those for vertices.
const CONNECTIONS = 0x1000u;

const FAR = 3.0e38;

@compute @workgroup_size(64)
fn trace_paths(@builtin(global_invocation_id) id: vec3u) {
    if (id.x >= parameters.paths) {
        return;
    }
    let start = path_start(id.x);
    let pixel = start.pixel;
    let sample = start.sample;
    // The slot of the connection from surface k is this plus k; that of the gathered one, plus k − 2.
    let connection_slot = select(0u, ~0u, COAXIAL_PINHOLE);
    let gather_slot = connection_slot + parameters.max_bounces + 1u;
    let gathers = CHAINS && parameters.bucket_mask != 0u;

    var origin = start.origin;
    var direction = start.direction;
    var throughput = vec3f(1.0);
    var direct = vec3f(0.0);
    var ambient = vec3f(0.0);
    var medium = AIR;
    var surfaces = 0u;
    var rays = 0u;
    var vertex = 0u;
    var passes = 0u;
    // Until the path has been scattered for the first time: surfaces of its specular chain and its footprint, what the chain
    // lets through, and the probability with which the path followed it.
    var straight = true;
    var chain = 0u;
    var footprint = footprint_at_eye(parameters.start, start.towards);
    var retraced = vec3f(1.0);
    var probability = 1.0;
    // Afterwards: density of the reverse path over that of this one, but for what happens at the connection.
    var odds = 0.0;

    var hit: Hit;
    if (SIGHT_SIDE > 0u) {
        hit = sight_trace(start.image, origin, direction, FAR, NONE, false);
    } else {
        hit = bvh_trace(origin, direction, FAR, false);
    }
    loop {
        rays += 1u;
        if (hit.triangle == NONE) {
            break;
        }
        var surface = surface_at(hit, direction);
        medium_meets(medium, &surface);
        let frame = frame_around(surface.normal);
        let wo = to_local(frame, -direction);
        let before = surface_leave(surface.position, surface.normal);
        let behind = surface_leave(surface.position, -surface.normal);
        if (MEDIA) {
            let clear = medium_transmittance(medium, hit.distance);
            throughput *= clear;
            retraced *= clear;
        }
        if (CHAINS && straight) {
            footprint = footprint_travel(footprint, hit.distance, direction, surface.normal);
        }
        vertex += 1u;
        let next = bsdf_sample(surface.bsdf, wo, sample4(pixel, sample, vertex));
        if (PASSABLE && next.kind == PASSED && next.pdf > 0.0 && !surface.black) {
            passes += 1u;
            if (passes == MAX_PASSES) {
                break;
            }
            if (straight) {
                retraced *= next.weight * next.pdf;
                probability *= next.pdf;
            }
            throughput *= next.weight;
            origin = behind;
            continue;
        }
        passes = 0u;
        surfaces += 1u;
        let meeting = bsdf_meeting(surface.bsdf, wo);
        throughput /= meeting;
        if (AMBIENT) {
            ambient += throughput * surface.bsdf.opacity * surface.emission;
        }

        // The density with which paths come here by this chain: what this path and one that ends here have in common.
        var first_density = eye_density(parameters.start, surface.position - start.origin, surface.normal);
        if (CHAINS && chain > 0u) {
            first_density = footprint_density(footprint);
        }
        let scatters = bsdf_regular(surface.bsdf) && !surface.black;
        let is_direct = COAXIAL_PINHOLE && straight;
        if (is_direct && scatters && surfaces + chain <= parameters.max_bounces) {
            direct += throughput * retraced * bsdf_eval(surface.bsdf, wo, wo) * first_density;
        }
        first_density *= probability;

        let slot = connection_slot + surfaces;
        var connection = vec4u(NONE, 0u, 0u, 0u);
        if (scatters && !(is_direct && chain == 0u)) {
            let draw = connection_sample(pixel, sample, vertex);
            let end_lens = eye_lens_point(parameters.end, draw.xy);
            let end = eye_origin(parameters.end, end_lens);
            let offset = surface.position - end;
            let lit = eye_pixel(parameters.end, eye_to_local(parameters.end, offset), end_lens);
            let density = eye_density(parameters.end, offset, surface.normal);
            let wi = to_local(frame, normalize(-offset));
            let value = throughput * bsdf_eval(surface.bsdf, wo, wi) * (density * parameters.scale);
            if (lit != NONE && any(value > vec3f(0.0))) {
                let light = connection_light(hit.triangle, select(before, behind, wi.z < 0.0), end, &rays);
                // Density of the reverse path over that of this one.
                var reverse = density * light.probability * parameters.end_to_start;
                if (straight) {
                    reverse *= bsdf_meeting(surface.bsdf, wi) / (meeting * first_density);
                } else {
                    reverse *= bsdf_reverse_density(surface.bsdf, wo, wi) * odds / meeting;
                }
                // A chain at the path's beginning cannot be met by its reverse. Else the balance heuristic: Veach and Guibas 1995.
                reverse = select(reverse, 0.0, chain > 0u);
                if (any(light.value > vec3f(0.0))) {
                    connection = vec4u(lit, bitcast<vec3u>(value * light.value / (1.0 + reverse)));
                }
            }
        }
        if (slot > 0u) {
            records[slot * parameters.paths + id.x] = connection;
        }
        // Specular at both ends: by way of the photons.
        if (gathers && surfaces > 1u) {
            var gathered = Gathered(NONE, vec3f(0.0), vec3f(0.0, 0.0, 1.0), 0.0);
            if (scatters && chain > 0u) {
                let most = parameters.max_bounces - surfaces;
                let draw = connection_sample(pixel, sample, vertex).z;
                gathered = photons_gather(surface, frame, wo, most, is_direct, footprint, start.image, draw);
            }
            var reverse = gathered.density * parameters.end_to_start;
            if (straight) {
                reverse /= first_density;
            } else {
                reverse *= bsdf_reverse_density(surface.bsdf, wo, gathered.wi) * odds / meeting;
            }
            let value = throughput * gathered.value * (parameters.scale / (1.0 + reverse));
            records[(gather_slot + surfaces - 2u) * parameters.paths + id.x] = vec4u(gathered.origin, bitcast<vec3u>(value));
        }

        if (surfaces == parameters.max_bounces || surface.black || !(next.pdf > 0.0) || all(next.weight == vec3f(0.0))) {
            break;
        }
        if (ROULETTE && surfaces > 2u) {
            let left = throughput * next.weight;
            // Stays out of the weights: both ends' paths end by chance alike.
            let survival = clamp(max(max(left.x, left.y), left.z), 0.05, 1.0);
            if (connection_sample(pixel, sample, vertex).w >= survival) {
                break;
            }
            throughput /= survival;
        }
        let leaving = to_world(frame, next.direction);
        if (next.kind == REGULAR) {
            let index = bsdf_index_along(surface.bsdf, next.direction);
            let forward = next.pdf / (index * index * abs(next.direction.z));
            if (straight) {
                odds = bsdf_meeting(surface.bsdf, next.direction) / (first_density * forward);
                straight = false;
            } else {
                odds *= bsdf_reverse_density(surface.bsdf, wo, next.direction) / forward;
            }
        } else if (CHAINS && straight) {
            retraced *= next.weight * next.pdf;
            probability *= next.pdf;
            footprint = footprint_turn(footprint, surface, direction, leaving, next.kind);
            chain += 1u;
        }
        throughput *= next.weight * meeting;
        medium = medium_behind(medium, surface, next.direction);
        origin = select(before, behind, next.direction.z < 0.0);
        direction = leaving;

        continuing {
            hit = bvh_trace(origin, direction, FAR, false);
        }
    }

    records[id.x] = vec4u(parameters.mark | (min(rays, 255u) << 8u) | surfaces, bitcast<vec3u>(direct));
    if (AMBIENT) {
        records[(parameters.stride - 1u) * parameters.paths + id.x] = vec4u(parameters.mark, bitcast<vec3u>(ambient));
    }
}

// The numbers that a connection needs: a point of the lens, which photon, whether to go on.
fn connection_sample(pixel: u32, sample: u32, vertex: u32) -> vec4f {
    if (!LENSES && !CHAINS && !ROULETTE) {
        return vec4f(0.0);
    }
    return sample4(pixel, sample, CONNECTIONS + vertex);
}
