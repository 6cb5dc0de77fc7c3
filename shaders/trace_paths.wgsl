// Traces light paths from one endpoint of the rig to the other (`path.wgsl`).
//
// An invocation traces up to `paths_per_invocation` paths. When one ends, the invocation starts its next one.
// On software Vulkan eight lanes execute every step together, and in this way no lane waits for the longest
// path of the others. On a GPU each invocation traces one path, since a GPU hides the wait by switching to
// other invocations (`render::dispatch`).
#import features
#import parameters
#import start
#import path
#import bvh
#import pairs
#import light_buffer

const FAR = 3.0e38;

// Lanes that software Vulkan executes together. They trace consecutive paths, then the next consecutive ones,
// and so on.
const SIDE_BY_SIDE = 8u;

@compute @workgroup_size(64)
fn trace_paths(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let most = parameters.paths_per_invocation;
    var next = group.x * 64u * most + lane / SIDE_BY_SIDE * SIDE_BY_SIDE * most + lane % SIDE_BY_SIDE;
    let end = min(next + SIDE_BY_SIDE * most, parameters.paths);
    if (next >= end) {
        return;
    }
    var current = pixel_sample(next);
    // If an invocation traces several paths by the light buffer, it traces the first rays of all its paths
    // beforehand: a step in the loop below that may do so for one lane would cost as much as if all lanes
    // did. The triangles are stored in the heads of the paths' records, without a mark.
    if (SEVERAL_PATHS && LIGHT_BUFFER_SIDE > 0u) {
        var ahead = current;
        for (var index = next; index < end; index += SIDE_BY_SIDE) {
            let start = path_start(ahead);
            ahead = pixel_sample_after(ahead, SIDE_BY_SIDE);
            let hit = light_buffer_trace(start.image, start.origin, start.direction, FAR, NONE, false);
            records[index] = vec4u(0u, hit.triangle, 0u, 0u);
        }
    }

    var path = path_begin(next, path_start(current));
    var hit = first_hit(path);
    // The first ray of the path has not been traced yet.
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
            current = pixel_sample_after(current, SIDE_BY_SIDE);
            path = path_begin(next, path_start(current));
            hit = first_hit(path);
            begins = LIGHT_BUFFER_SIDE == 0u;
        }
    }
}

// The hit of the path's first ray, where first rays use the light buffer; no hit elsewhere.
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
