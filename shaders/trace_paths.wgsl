// Light paths, from one end of the rig to the other (`path.wgsl`).
//
// One invocation traces `paths_each` of them: when one ends, it goes on with its next, so that on software Vulkan, where eight lanes take
// every step together, none has to wait for the others' longest path. A GPU has other invocations to turn to: one path each there
// (`render::dispatch`).
#import features
#import parameters
#import start
#import path
#import bvh
#import sight

const FAR = 3.0e38;

// Paths of one invocation at most, as `render::dispatch` has it.
const MOST_PATHS = 64u;

// Invocations that take consecutive paths, and again the next ones: those that software Vulkan takes side by side.
const SIDE_BY_SIDE = 8u;

// Of several paths, where rays from the pinhole go by lists: what each one's first ray meets; its pixel and direction. Found out
// beforehand, because a step that might do it for a new path would cost all lanes as if each did.
var<private> first_hits: array<vec4u, MOST_PATHS>;
var<private> first_rays: array<vec4u, MOST_PATHS>;

@compute @workgroup_size(64)
fn trace_paths(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let each = parameters.paths_each;
    var next = group.x * 64u * each + lane / SIDE_BY_SIDE * SIDE_BY_SIDE * each + lane % SIDE_BY_SIDE;
    let end = min(next + SIDE_BY_SIDE * each, parameters.paths);
    if (SEVERAL_PATHS && SIGHT_SIDE > 0u) {
        var which = 0u;
        for (var index = next; index < end; index += SIDE_BY_SIDE) {
            let start = path_start(index);
            let hit = sight_trace(start.image, start.origin, start.direction, FAR, NONE, false);
            first_hits[which] = vec4u(hit.triangle, bitcast<u32>(hit.distance), bitcast<vec2u>(hit.barycentric));
            first_rays[which] = vec4u(start.pixel, bitcast<vec3u>(start.direction));
            which += 1u;
        }
    }

    if (next >= end) {
        return;
    }
    var which = 0u;
    var path = path_begin(next, start_taken(next, which));
    var hit = first_hit_taken(path.start, which);
    // The path's first ray is yet to be traced.
    var begins = SIGHT_SIDE == 0u;
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
            which += 1u;
            path = path_begin(next, start_taken(next, which));
            hit = first_hit_taken(path.start, which);
            begins = SIGHT_SIDE == 0u;
        }
    }
}

// As `path_start`, for the invocation's path `which`.
fn start_taken(index: u32, which: u32) -> Start {
    if (!SEVERAL_PATHS || SIGHT_SIDE == 0u || CHAINS) {
        return path_start(index);
    }
    // Without a division for the pixel, which is slow. Only chains ask for the image point.
    let found = first_rays[which];
    let sample = parameters.first_sample + index - (found.x - parameters.first_pixel) * parameters.samples;
    return Start(found.x, sample, vec2f(0.0), vec3f(0.0), parameters.start.position, bitcast<vec3f>(found.yzw));
}

// What its first ray meets, where it goes by lists.
fn first_hit_taken(start: Start, which: u32) -> Hit {
    if (SIGHT_SIDE == 0u) {
        return Hit(NONE, FAR, vec2f(0.0));
    }
    if (!SEVERAL_PATHS) {
        return sight_trace(start.image, start.origin, start.direction, FAR, NONE, false);
    }
    let found = first_hits[which];
    return Hit(found.x, bitcast<f32>(found.y), bitcast<vec2f>(found.zw));
}
