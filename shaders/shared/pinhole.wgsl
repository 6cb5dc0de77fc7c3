// The coaxial rig's pinhole. All geometry is in its frame: the pinhole is the origin, it looks along −z, +y is up.
#import parameters

// Direction (not normalized, −z component 1) through the continuous raster point `raster`.
fn pinhole_direction(raster: vec2f) -> vec3f {
    let ndc = raster / vec2f(parameters.resolution) * 2.0 - 1.0;
    return vec3f(ndc.x * parameters.tangent.x, -ndc.y * parameters.tangent.y, -1.0);
}

// The pixel that sees (and lights) `point` where nothing stands between, or NONE outside the field of view.
fn pinhole_pixel(point: vec3f) -> u32 {
    if (point.z >= 0.0) {
        return NONE;
    }
    let ndc = vec2f(point.x, -point.y) / (-point.z * parameters.tangent);
    let raster = floor((ndc * 0.5 + 0.5) * vec2f(parameters.resolution));
    if (any(raster < vec2f(0.0)) || any(raster >= vec2f(parameters.resolution))) {
        return NONE;
    }
    return u32(raster.y) * parameters.resolution.x + u32(raster.x);
}

// D(x) = cosθ_x / (r² cos³θ): area on the image plane (at distance 1) per area of surface at x. It is the irradiance at x
// under a pattern of 1, and the density with which camera rays meet x.
fn pinhole_density(point: vec3f, normal: vec3f) -> f32 {
    return abs(dot(normal, point)) / (-point.z * point.z * point.z);
}
