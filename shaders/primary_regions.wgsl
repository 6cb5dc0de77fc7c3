// The region that each pixel's centre sees.
#import parameters
#import eye
#import bvh
#import pairs

@group(1) @binding(0) var<storage, read_write> regions: array<u32>;

@compute @workgroup_size(64)
fn primary_regions(@builtin(global_invocation_id) id: vec3u) {
    if (id.x >= parameters.paths) {
        return;
    }
    let pixel = parameters.first_pixel + id.x;
    let eye = parameters.start;
    let corner = vec2u(pixel % eye.resolution.x, pixel / eye.resolution.x);
    let image = eye_image_point(eye, vec2f(corner) + 0.5);
    let direction = normalize(eye_to_world(eye, eye_direction(eye, image, vec2f(0.0))));
    let hit = bvh_trace(eye.position, direction, 3.0e38, false);
    var region = NONE;
    if (hit.triangle != NONE) {
        region = pair_texel(hit.triangle >> 1u, 3u).y;
    }
    regions[id.x] = region;
}
