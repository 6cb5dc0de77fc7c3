// One endpoint of the rig, camera or projector, as a thin lens: its rays, its pixels and its image-plane
// density. A pinhole is a lens of radius 0. All rays through one image point meet in the plane of focus. The
// image plane lies at distance 1.
#import features
#import parameters
#import warp

// A point of the aperture, uniform over its area, in the endpoint's frame. `u` is uniform in
// the unit square.
fn endpoint_lens_point(endpoint: Endpoint, u: vec2f) -> vec2f {
    if (!LENSES) {
        return vec2f(0.0);
    }
    let radius = endpoint.radius * sqrt(u.x);
    let angle = 2.0 * PI * u.y;
    return radius * vec2f(cos(angle), sin(angle));
}

// A vector of the geometry's frame in the endpoint's frame.
fn endpoint_to_local(endpoint: Endpoint, v: vec3f) -> vec3f {
    return vec3f(dot(v, endpoint.right), dot(v, endpoint.up), dot(v, endpoint.back));
}

// A vector of the endpoint's frame in the geometry's frame.
fn endpoint_to_world(endpoint: Endpoint, v: vec3f) -> vec3f {
    return v.x * endpoint.right + v.y * endpoint.up + v.z * endpoint.back;
}

// The position of the lens point `lens` in the geometry's frame.
fn endpoint_origin(endpoint: Endpoint, lens: vec2f) -> vec3f {
    return endpoint.position + endpoint_to_world(endpoint, vec3f(lens, 0.0));
}

// The point of the image plane at the continuous raster point `raster`, in pixels from the top left corner.
fn endpoint_image_point(endpoint: Endpoint, raster: vec2f) -> vec2f {
    let ndc = raster / vec2f(endpoint.resolution) * 2.0 - 1.0;
    return vec2f(ndc.x, -ndc.y) * endpoint.tangent;
}

// The direction from the lens point `lens` through the image point `image`, in the endpoint's frame. It is
// not normalized: its component along −z is 1.
fn endpoint_direction(endpoint: Endpoint, image: vec2f, lens: vec2f) -> vec3f {
    return vec3f(image - lens / endpoint.focus, -1.0);
}

// The pixel through which the lens point `lens` sees, or lights, a point at `offset` from it; NONE outside
// the field of view. `offset` is in the endpoint's frame.
fn endpoint_pixel(endpoint: Endpoint, offset: vec3f, lens: vec2f) -> u32 {
    if (offset.z >= 0.0) {
        return NONE;
    }
    let image = offset.xy / -offset.z + lens / endpoint.focus;
    let raster = floor((vec2f(image.x, -image.y) / endpoint.tangent * 0.5 + 0.5) * vec2f(endpoint.resolution));
    if (any(raster < vec2f(0.0)) || any(raster >= vec2f(endpoint.resolution))) {
        return NONE;
    }
    return u32(raster.y) * endpoint.resolution.x + u32(raster.x);
}

// The image-plane density D(x) = cosθ_x / (r² cos³θ) of a surface point at `offset` from a lens point: area
// on the image plane per area of the surface. θ_x is the angle at the surface, θ the angle to the optical
// axis. D carries the cosine at the surface. It is the irradiance at x under a pattern of 1, and the density
// per surface area with which rays from that lens point meet the surface.
fn endpoint_density(endpoint: Endpoint, offset: vec3f, normal: vec3f) -> f32 {
    let depth = -dot(offset, endpoint.back);
    return abs(dot(normal, offset)) / (depth * depth * depth);
}
