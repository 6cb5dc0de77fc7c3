// One light path per invocation: from a pixel of one end of the rig through the scene, and from each surface point on it to
// the other end. Each such connection is one contribution to the matrix; the weight makes the sum of what both ends'
// paths contribute unbiased (see `render`'s documentation). Nothing is added up here: a path writes to its own slots.
#import parameters
#import sampler
#import warp
#import eye
#import surface
#import side
#import medium
#import photons

// `stride` slots a path. Slot 0: mark (16 bits), rays traced (8), surfaces met (8), and direct light that came back the way
// it went. Then the connections from each surface, the first one left out where it is the direct light. Where there are
// photons, the connections through specular chains from the second surface on. Last: ambient radiance.
// A connection is pixel (or NONE; the upper four bits count the chain's surfaces) and weight.
@group(1) @binding(0) var<storage, read_write> records: array<vec4u>;

// The numbers for connections come after those for vertices.
const CONNECTIONS = 0x1000u;

// A connection on its way: it stands if the ray to the other end meets nothing.
struct Pending {
    pixel: u32,
    slot: u32,
    target_point: vec3f,
    value: vec3f,
    // Density of the reverse path over that of this one; 0 where the reverse cannot be sampled.
    odds: f32,
}

@compute @workgroup_size(64)
fn trace_paths(@builtin(global_invocation_id) id: vec3u) {
    if (id.x >= parameters.paths) {
        return;
    }
    let path = parameters.first_sample + id.x;
    let pixel = parameters.first_pixel + path / parameters.samples;
    let sample = path % parameters.samples;
    let coaxial = (parameters.flags & COAXIAL_PINHOLE) != 0u;
    let passable = (parameters.flags & PASSABLE) != 0u;
    let first_slot = id.x * parameters.stride;
    // The slot of the connection from surface k is this plus k; that of the gathered one, plus k − 2.
    let connection_slot = first_slot + select(0u, ~0u, coaxial);
    let gather_slot = connection_slot + parameters.max_bounces + 1u;

    let corner = vec2u(pixel % parameters.start.resolution.x, pixel / parameters.start.resolution.x);
    let u = sample4(pixel, sample, 0u);
    let lens = eye_lens_point(parameters.start, u.zw);
    let image = eye_image_point(parameters.start, vec2f(corner) + u.xy);
    let towards = eye_direction(parameters.start, image, lens);
    let start = eye_origin(parameters.start, lens);
    var footprint = footprint_at_eye(parameters.start, towards);

    var origin = start;
    var direction = normalize(eye_to_world(parameters.start, towards));
    var throughput = vec3f(1.0);
    var direct = vec3f(0.0);
    var ambient = vec3f(0.0);
    var medium = AIR;
    var surfaces = 0u;
    var rays = 0u;
    var vertex = 0u;
    var passes = 0u;
    // Until the path has been scattered for the first time: surfaces of its specular chain, what the chain lets through,
    // and the probability with which the path followed it.
    var straight = true;
    var chain = 0u;
    var retraced = vec3f(1.0);
    var probability = 1.0;
    // Afterwards: density of the reverse path over that of this one, but for what happens at the connection.
    var odds = 0.0;
    var shadow = false;
    var pending: Pending;
    // Where the path goes on after a connection.
    var alive = true;
    var next_origin = vec3f(0.0);
    var next_direction = vec3f(0.0);

    loop {
        let limit = select(3.0e38, distance(origin, pending.target_point), shadow);
        let hit = bvh_trace(origin, direction, limit, shadow && !passable);
        rays += 1u;
        if (hit.triangle == NONE) {
            if (!shadow) {
                break;
            }
            // Balance heuristic: Veach and Guibas 1995.
            records[pending.slot] = vec4u(pending.pixel, bitcast<vec3u>(pending.value / (1.0 + pending.odds)));
        } else if (!shadow || passable) {
            var surface = surface_at(hit, direction);
            let frame = frame_around(surface.normal);
            let wo = to_local(frame, -direction);
            let behind = surface_leave(surface.position, -surface.normal);
            if (shadow) {
                let through = bsdf_pass(surface.bsdf, wo);
                passes += 1u;
                if (!surface.black && any(through.value > vec3f(0.0)) && passes < MAX_PASSES) {
                    pending.value *= through.value;
                    pending.odds *= through.probability;
                    origin = behind;
                    continue;
                }
            } else {
                medium_meets(medium, &surface);
                let let_through = medium_transmittance(medium, hit.distance);
                throughput *= let_through;
                if (straight) {
                    retraced *= let_through;
                    footprint = footprint_travel(footprint, hit.distance, direction, surface.normal);
                }
                vertex += 1u;
                let next = bsdf_sample(surface.bsdf, wo, sample4(pixel, sample, vertex));
                if (next.kind == PASSED && next.pdf > 0.0 && !surface.black) {
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
                ambient += throughput * surface.bsdf.opacity * surface.emission;
                alive = surfaces < parameters.max_bounces && !surface.black && next.pdf > 0.0
                    && any(next.weight > vec3f(0.0));

                // What the path's own density, and that of its reverse if it began here, have in common.
                var first_density = 0.0;
                if (straight) {
                    if (chain == 0u) {
                        first_density = eye_density(parameters.start, surface.position - start, surface.normal);
                    } else {
                        first_density = footprint_density(footprint);
                    }
                }
                let scatters = bsdf_regular(surface.bsdf) && !surface.black;
                let slot = connection_slot + surfaces;
                let is_direct = coaxial && straight;
                if (is_direct && scatters && surfaces + chain <= parameters.max_bounces) {
                    direct += throughput * retraced * bsdf_eval(surface.bsdf, wo, wo) * first_density;
                }
                first_density *= probability;
                pending.pixel = NONE;
                if (slot > first_slot) {
                    records[slot] = vec4u(NONE);
                }
                if (parameters.bucket_mask != 0u && surfaces > 1u) {
                    records[gather_slot + surfaces - 2u] = vec4u(NONE);
                }
                if (scatters && !(is_direct && chain == 0u)) {
                    let draw = sample4(pixel, sample, CONNECTIONS + vertex);
                    let end_lens = eye_lens_point(parameters.end, draw.xy);
                    let end = eye_origin(parameters.end, end_lens);
                    let offset = surface.position - end;
                    pending.pixel = eye_pixel(parameters.end, eye_to_local(parameters.end, offset), end_lens);
                    let density = eye_density(parameters.end, offset, surface.normal);
                    let wi = to_local(frame, normalize(-offset));
                    pending.value = throughput * bsdf_eval(surface.bsdf, wo, wi) * (density * parameters.scale);
                    if (pending.pixel != NONE && any(pending.value > vec3f(0.0))) {
                        pending.slot = slot;
                        pending.target_point = end;
                        pending.odds = density * parameters.end_to_start;
                        if (straight) {
                            pending.odds *= bsdf_meeting(surface.bsdf, wi) / (meeting * first_density);
                        } else {
                            pending.odds *= bsdf_reverse_density(surface.bsdf, wo, wi) * odds / meeting;
                        }
                        // A chain at the path's beginning cannot be met by its reverse.
                        pending.odds = select(pending.odds, 0.0, chain > 0u);
                        origin = select(surface_leave(surface.position, surface.normal), behind, wi.z < 0.0);
                    } else {
                        pending.pixel = NONE;
                    }
                    // Specular at both ends: by way of the photons.
                    if (chain > 0u && parameters.bucket_mask != 0u && surfaces > 1u) {
                        let gathered = photons_gather(
                            surface, frame, wo, parameters.max_bounces - surfaces, is_direct, footprint, image, draw.z,
                        );
                        var reverse = gathered.density * parameters.end_to_start;
                        if (straight) {
                            reverse /= first_density;
                        } else {
                            reverse *= bsdf_reverse_density(surface.bsdf, wo, gathered.wi) * odds / meeting;
                        }
                        let value = throughput * gathered.value * (parameters.scale / (1.0 + reverse));
                        records[gather_slot + surfaces - 2u] = vec4u(gathered.origin, bitcast<vec3u>(value));
                    }
                }

                if (alive && (parameters.flags & ROULETTE) != 0u && surfaces > 2u) {
                    let left = throughput * next.weight;
                    // Stays out of the weights: both ends' paths end by chance alike.
                    let survival = clamp(max(max(left.x, left.y), left.z), 0.05, 1.0);
                    alive = sample4(pixel, sample, CONNECTIONS + vertex).w < survival;
                    throughput /= survival;
                }
                if (alive) {
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
                    } else if (straight) {
                        retraced *= next.weight * next.pdf;
                        probability *= next.pdf;
                        footprint = footprint_turn(footprint, surface, direction, leaving, next.kind);
                        chain += 1u;
                    }
                    throughput *= next.weight * meeting;
                    medium = medium_behind(medium, surface, next.direction);
                    next_origin = select(surface_leave(surface.position, surface.normal), behind, next.direction.z < 0.0);
                    next_direction = leaving;
                }
                if (pending.pixel != NONE) {
                    shadow = true;
                    direction = normalize(pending.target_point - origin);
                    continue;
                }
            }
        }
        // The connection's fate is known, or there was none: on with the path.
        shadow = false;
        passes = 0u;
        if (!alive) {
            break;
        }
        origin = next_origin;
        direction = next_direction;
    }

    records[first_slot] = vec4u(parameters.mark | (min(rays, 255u) << 8u) | surfaces, bitcast<vec3u>(direct));
    if ((parameters.flags & AMBIENT) != 0u) {
        records[first_slot + parameters.stride - 1u] = vec4u(parameters.mark, bitcast<vec3u>(ambient));
    }
}
