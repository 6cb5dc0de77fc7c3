// What can be seen from the pinhole that camera and projector share, as lists of triangles: a raster over the image plane (one texel
// wider than the field on each side), and for each of its texels all triangles that a ray through it could meet before one that
// covers it whole. After Haines and Greenberg, "The Light Buffer: A Shadow-Testing Accelerator", IEEE CG&A 1986. The host makes
// the lists (`render::sight`); rays that begin or end in the pinhole need no search tree then, and find exactly the same.
#import features
#import parameters
#import bvh

// First a texel for each of the raster: number of triangles, and these, or at which word they begin. Then the lists that are too
// long for that, four triangles a texel.
@group(1) @binding(3) var sight_lists: texture_storage_2d<rgba32uint, read>;

// Texels in a row of the raster. Laid out as `render::sight` has it.
const SIGHT_SIDE = 512u;
const SIGHT_INLINE = 3u;

fn sight_texel(index: u32) -> vec4u {
    return textureLoad(sight_lists, vec2u(index & 4095u, index >> 12u));
}

// As `bvh_trace`, for a ray that runs through the point `image` of the image plane (at distance 1) and the pinhole.
fn sight_trace(image: vec2f, origin: vec3f, direction: vec3f, limit: f32, any: bool) -> Hit {
    let raster = (image / parameters.start.tangent * 0.5 + 0.5) * f32(SIGHT_SIDE - 2u) + 1.0;
    let texel = vec2u(clamp(raster, vec2f(0.0), vec2f(f32(SIGHT_SIDE) - 0.5)));
    let list = sight_texel(texel.y * SIGHT_SIDE + texel.x);
    var hit = Hit(NONE, limit, vec2f(0.0));
    for (var index = 0u; index < list.x; index += 1u) {
        var triangle: u32;
        if (list.x <= SIGHT_INLINE) {
            triangle = list[index + 1u];
        } else {
            let word = list.y + index;
            triangle = sight_texel(word >> 2u)[word & 3u];
        }
        bvh_intersect_triangle(triangle, origin, direction, &hit);
        if (any && hit.triangle != NONE) {
            break;
        }
    }
    return hit;
}
