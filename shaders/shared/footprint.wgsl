// The footprint of an image point on a surface, through mirrors and panes: ray differentials (Igehy, "Tracing
// Ray Differentials", SIGGRAPH 1999) for flat surfaces. The area of the footprint per image-plane area is
// 1/D, with the generalized image-plane density D of a point that is seen through a specular chain.
#import endpoint

struct Footprint {
    // Derivatives of the hit point (foot) and of the unit direction (turn) with respect to the two
    // coordinates of the image plane at distance 1.
    foot_u: vec3f,
    foot_v: vec3f,
    turn_u: vec3f,
    turn_v: vec3f,
}

// The footprint of a ray that starts at a lens point. `direction` is in the endpoint's frame, with a
// component of 1 along −z.
fn footprint_at_endpoint(endpoint: Endpoint, direction: vec3f) -> Footprint {
    let scale = inverseSqrt(dot(direction, direction));
    let d = direction * scale;
    let turn_u = scale * (vec3f(1.0, 0.0, 0.0) - d.x * d);
    let turn_v = scale * (vec3f(0.0, 1.0, 0.0) - d.y * d);
    return Footprint(vec3f(0.0), vec3f(0.0), endpoint_to_world(endpoint, turn_u), endpoint_to_world(endpoint, turn_v));
}

// The footprint after `distance` along `direction`, on a plane with this normal.
fn footprint_travel(before: Footprint, distance: f32, direction: vec3f, normal: vec3f) -> Footprint {
    var after = before;
    let along = 1.0 / dot(direction, normal);
    after.foot_u += distance * before.turn_u;
    after.foot_v += distance * before.turn_v;
    after.foot_u -= direction * (dot(after.foot_u, normal) * along);
    after.foot_v -= direction * (dot(after.foot_v, normal) * along);
    return after;
}

// The footprint after reflection at a plane with this normal.
fn footprint_reflect(before: Footprint, normal: vec3f) -> Footprint {
    var after = before;
    after.turn_u -= 2.0 * dot(before.turn_u, normal) * normal;
    after.turn_v -= 2.0 * dot(before.turn_v, normal) * normal;
    return after;
}

// The footprint after refraction at a plane, by Snell's law: `eta` is the index before over the index behind
// the surface; `normal` is on the side of arrival.
fn footprint_refract(before: Footprint, eta: f32, direction: vec3f, refracted: vec3f, normal: vec3f) -> Footprint {
    var after = before;
    let bend = eta - eta * eta * dot(direction, normal) / dot(refracted, normal);
    after.turn_u = eta * before.turn_u - bend * dot(before.turn_u, normal) * normal;
    after.turn_v = eta * before.turn_v - bend * dot(before.turn_v, normal) * normal;
    return after;
}

// The image-plane density D: area on the image plane per area of the surface at the hit point.
fn footprint_density(footprint: Footprint) -> f32 {
    return 1.0 / max(length(cross(footprint.foot_u, footprint.foot_v)), 1e-30);
}
