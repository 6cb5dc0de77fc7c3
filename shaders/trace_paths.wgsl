// Light paths, from one end of the rig to the other (`path.wgsl`).
//
// One invocation traces `paths_per_invocation` of them: when one ends, it goes on with its next, so that on software Vulkan, where eight lanes take
// every step together, none has to wait for the others' longest path. A GPU has other invocations to turn to: one path each there
// (`render::dispatch`).
#import features
#import parameters
#import start
#import path
#import bvh
#import pairs
#import light_buffer

const FAR = 3.0e38;

// Invocations that take consecutive paths, and again the next ones: those that software Vulkan takes side by side.
const SIDE_BY_SIDE = 8u;

@compute @workgroup_size(64)
fn trace_paths(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let each = parameters.paths_per_invocation;
    var next = group.x * 64u * each + lane / SIDE_BY_SIDE * SIDE_BY_SIDE * each + lane % SIDE_BY_SIDE;
    let end = min(next + SIDE_BY_SIDE * each, parameters.paths);
    if (next >= end) {
        return;
    }
    var place = pixel_sample(next);
    // Of several paths, where rays from the pinhole go by lists, the triangles that their first rays meet are found out beforehand: a step
    // that might do it for a new path would cost all lanes as if each did. They wait where the paths will leave their heads, without a mark.
    if (SEVERAL_PATHS && LIGHT_BUFFER_SIDE > 0u) {
        var ahead = place;
        for (var index = next; index < end; index += SIDE_BY_SIDE) {
            let start = path_start(ahead);
            ahead = pixel_sample_after(ahead, SIDE_BY_SIDE);
            let hit = light_buffer_trace(start.image, start.origin, start.direction, FAR, NONE, false);
            records[index] = vec4u(0u, hit.triangle, 0u, 0u);
        }
    }

    var path = path_begin(next, path_start(place));
    var hit = first_hit(path);
    // The path's first ray is yet to be traced.
    var begins = LIGHT_BUFFER_SIDE == 0u;
    loop {
        var goes_on = begins;
        if (hit.triangle != NONE && !begins) {
            goes_on = path_meets(&path, hit);
        }
        if (goes_on) {
            hit = bvh_trace(path.origin, path.direction, FAR, false);
            path.rays += 1u;
            goes_on = hit.triangle != NONE;
            begins = false;
        }
        if (!goes_on) {
            path_end(path);
            next += SIDE_BY_SIDE;
            if (!SEVERAL_PATHS || next >= end) {
                break;
            }
            place = pixel_sample_after(place, SIDE_BY_SIDE);
            path = path_begin(next, path_start(place));
            hit = first_hit(path);
            begins = LIGHT_BUFFER_SIDE == 0u;
        }
    }
}

// What the path's first ray meets, where that goes by lists.
fn first_hit(path: Path) -> Hit {
    var hit = Hit(NONE, FAR, vec2f(0.0));
    if (LIGHT_BUFFER_SIDE == 0u) {
        return hit;
    }
    if (!SEVERAL_PATHS) {
        return light_buffer_trace(path.start.image, path.origin, path.direction, FAR, NONE, false);
    }
    let triangle = records[path.index].y;
    if (triangle != NONE) {
        pair_intersect(triangle >> 1u, path.origin, path.direction, &hit);
    }
    return hit;
}
