// Finds the region of the scene that the centre of each pixel sees; NONE where it sees nothing. One invocation for each pixel.
#import parameters
#import endpoint
#import bvh
#import pairs

@group(1) @binding(0) var<storage, read_write> regions: array<u32>;

@compute @workgroup_size(64)
fn primary_regions(@builtin(global_invocation_id) id: vec3u) {
    if (id.x >= parameters.paths) {
        return;
    }
    let pixel = parameters.first_pixel + id.x;
    let endpoint = parameters.start;
    let corner = vec2u(pixel % endpoint.resolution.x, pixel / endpoint.resolution.x);
    let image = endpoint_image_point(endpoint, vec2f(corner) + 0.5);
    let direction = normalize(endpoint_to_world(endpoint, endpoint_direction(endpoint, image, vec2f(0.0))));
    let hit = bvh_trace(endpoint.position, direction, 3.0e38, false);
    var region = NONE;
    if (hit.triangle != NONE) {
        region = pair_texel(hit.triangle >> 1u, 3u).y;
    }
    regions[id.x] = region;
}
