// Traces the specular chains of one endpoint: rays from its pixels through mirrors and glass, to the surfaces
// behind them that scatter. Each invocation traces one path. At each surface that scatters, it writes a
// photon to its own slot.
#import parameters
#import bvh
#import sampler
#import start
#import photons
#import medium

// The record of a path: the mark, then `stride` photons of four slots each. The photon behind a chain of c
// surfaces is number c − 1.
@group(1) @binding(0) var<storage, read_write> records: array<vec4u>;

@compute @workgroup_size(64)
fn trace_photons(@builtin(global_invocation_id) id: vec3u) {
    if (id.x >= parameters.paths) {
        return;
    }
    let start = path_start(pixel_sample(id.x));
    let first_slot = id.x * (4u * parameters.stride + 1u);
    for (var index = 0u; index < parameters.stride; index += 1u) {
        records[first_slot + 4u * index + 1u] = vec4u(NONE);
    }

    var origin = start.origin;
    var direction = start.direction;
    var footprint = footprint_at_endpoint(parameters.start, start.towards);
    // The throughput of the chain over its probability, times the image-plane area per photon; and that
    // probability.
    var power = vec3f(parameters.scale);
    var probability = 1.0;
    var medium = AIR;
    var chain = 0u;
    var passes = 0u;

    while (chain <= parameters.stride && passes < MAX_PASSES) {
        let hit = bvh_trace(origin, direction, 3.0e38, false);
        if (hit.triangle == NONE) {
            break;
        }
        var surface = surface_at(hit, direction);
        if (surface.black) {
            break;
        }
        medium_meets(medium, &surface);
        power *= medium_transmittance(medium, hit.distance);
        let frame = frame_around(surface.normal);
        let wo = to_local(frame, -direction);
        footprint = footprint_travel(footprint, hit.distance, direction, surface.normal);
        if (chain > 0u && bsdf_regular(surface.bsdf)) {
            let slot = first_slot + 4u * chain - 3u;
            let density = footprint_density(footprint) * probability;
            records[slot] = vec4u(start.pixel | (chain << 28u), bitcast<vec3u>(surface.position));
            records[slot + 1u] = vec4u(bitcast<u32>(density), bitcast<vec3u>(power));
            records[slot + 2u] = vec4u(bitcast<u32>(start.image.x), bitcast<vec3u>(-direction));
            records[slot + 3u] = vec4u(bitcast<u32>(start.image.y), bitcast<vec3u>(surface.normal));
        }
        let next = bsdf_sample(surface.bsdf, wo, sample4(start.pixel, start.sample, chain + passes + 1u));
        if (!(next.pdf > 0.0) || next.kind == REGULAR || chain == parameters.stride) {
            break;
        }
        power *= next.weight;
        probability *= next.pdf;
        if (next.kind == PASSED) {
            passes += 1u;
        } else {
            let leaving = to_world(frame, next.direction);
            footprint = footprint_turn(footprint, surface, direction, leaving, next.kind);
            medium = medium_behind(medium, surface, next.direction);
            direction = leaving;
            chain += 1u;
        }
        origin = offset_origin(surface.position, select(surface.normal, -surface.normal, next.direction.z < 0.0));
    }
    records[first_slot] = vec4u(parameters.mark, 0u, 0u, 0u);
}
