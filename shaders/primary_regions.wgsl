// The region that each pixel's centre sees.
#import parameters
#import pinhole
#import bvh

@group(1) @binding(0) var<storage, read_write> regions: array<u32>;

@compute @workgroup_size(64)
fn primary_regions(@builtin(global_invocation_id) id: vec3u) {
    if (id.x >= parameters.paths) {
        return;
    }
    let pixel = parameters.first_pixel + id.x;
    let corner = vec2u(pixel % parameters.resolution.x, pixel / parameters.resolution.x);
    let direction = normalize(pinhole_direction(vec2f(corner) + 0.5));
    let hit = bvh_trace(vec3f(0.0), direction, 3.0e38, false);
    var region = NONE;
    if (hit.triangle != NONE) {
        region = bvh_triangle_texel(3u * hit.triangle + 1u).w;
    }
    regions[id.x] = region;
}
