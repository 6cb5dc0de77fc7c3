// An end of the rig as a thin lens: where its rays start, and what it sees a point as. A pinhole is a lens of radius 0.
// All rays through one image point meet in the plane of focus; the image plane is taken at distance 1.
#import features
#import parameters
#import warp

// A point of the aperture, uniform over its area, in the endpoint's frame.
fn endpoint_lens_point(endpoint: Endpoint, u: vec2f) -> vec2f {
    if (!LENSES) {
        return vec2f(0.0);
    }
    let radius = endpoint.radius * sqrt(u.x);
    let angle = 2.0 * PI * u.y;
    return radius * vec2f(cos(angle), sin(angle));
}

fn endpoint_to_local(endpoint: Endpoint, v: vec3f) -> vec3f {
    return vec3f(dot(v, endpoint.right), dot(v, endpoint.up), dot(v, endpoint.back));
}

fn endpoint_to_world(endpoint: Endpoint, v: vec3f) -> vec3f {
    return v.x * endpoint.right + v.y * endpoint.up + v.z * endpoint.back;
}

fn endpoint_origin(endpoint: Endpoint, lens: vec2f) -> vec3f {
    return endpoint.position + endpoint_to_world(endpoint, vec3f(lens, 0.0));
}

// The point of the image plane (at distance 1) at the continuous raster point `raster`.
fn endpoint_image_point(endpoint: Endpoint, raster: vec2f) -> vec2f {
    let ndc = raster / vec2f(endpoint.resolution) * 2.0 - 1.0;
    return vec2f(ndc.x, -ndc.y) * endpoint.tangent;
}

// Direction in the endpoint's frame (not normalized, −z component 1) from a point of the lens through an image point.
fn endpoint_direction(endpoint: Endpoint, image: vec2f, lens: vec2f) -> vec3f {
    return vec3f(image - lens / endpoint.focus, -1.0);
}

// The pixel through which a point of the lens sees (and lights) what lies at `offset` from it, or NONE outside the field of
// view. `offset` is in the endpoint's frame.
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

// D(x) = cosθ_x / (r² cos³θ): area on the image plane per area of surface at `offset` from a point of the lens. It is the
// irradiance there under a pattern of 1, and the density with which rays from that point of the lens meet the surface.
fn endpoint_density(endpoint: Endpoint, offset: vec3f, normal: vec3f) -> f32 {
    let depth = -dot(offset, endpoint.back);
    return abs(dot(normal, offset)) / (depth * depth * depth);
}
