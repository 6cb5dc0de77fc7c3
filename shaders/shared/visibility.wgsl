// Visibility along a connection: how much light reaches the other endpoint.
#import bvh
#import surface
#import medium
#import light_buffer

// Transmission from a point just off a triangle of pair `own` to `target_point`. `value` is the share of light that arrives;
// `probability` is the probability with which a sampled path would have passed straight through every surface on the way. `rays` counts
// the rays traced.
fn connection_transmission(own: u32, origin: vec3f, target_point: vec3f, rays: ptr<function, u32>) -> Pass {
    let direction = normalize(target_point - origin);
    var light = Pass(vec3f(1.0), 1.0);
    if (!PASSABLE) {
        *rays += 1u;
        let reach = distance(origin, target_point);
        var met: Hit;
        if (LIGHT_BUFFER_SIDE > 0u) {
            // The target is the pinhole, and the pinhole is the origin of all geometry.
            met = light_buffer_trace(origin.xy / -origin.z, origin, direction, reach, own, true);
        } else {
            met = bvh_trace(origin, direction, reach, true);
        }
        light.value = select(vec3f(1.0), vec3f(0.0), met.triangle != NONE);
        return light;
    }
    var from_point = origin;
    for (var passes = 0u; passes < MAX_PASSES; passes += 1u) {
        *rays += 1u;
        let hit = bvh_trace(from_point, direction, distance(from_point, target_point), false);
        if (hit.triangle == NONE) {
            return light;
        }
        let surface = surface_at(hit, direction);
        let through = bsdf_pass(surface.bsdf, to_local(frame_around(surface.normal), -direction));
        light.value *= select(through.value, vec3f(0.0), surface.black);
        light.probability *= through.probability;
        if (all(light.value == vec3f(0.0))) {
            break;
        }
        from_point = offset_origin(surface.position, -surface.normal);
    }
    return Pass(vec3f(0.0), 1.0);
}
