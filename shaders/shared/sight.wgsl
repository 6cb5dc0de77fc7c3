// What can be seen from the pinhole that camera and projector share, as lists of triangles: a raster over the image plane (one texel
// wider than the field on each side), and for each of its texels all triangles that a ray through it could meet before one that
// covers it whole. After Haines and Greenberg, "The Light Buffer: A Shadow-Testing Accelerator", IEEE CG&A 1986. The host makes
// the lists (`render::sight`); rays that begin or end in the pinhole need no search tree then, and find exactly the same.
#import features
#import parameters
#import bvh

// Words, four to a texel of the texture. First one for each of the raster's texels: the only triangle, or at which word its list
// begins, which is told apart by `SIGHT_LIST`. A list is its length and then the triangles.
@group(1) @binding(3) var sight_lists: texture_storage_2d<rgba32uint, read>;

// As `render::sight` has it.
const SIGHT_LIST = 0x80000000u;

fn sight_word(index: u32) -> u32 {
    let four = textureLoad(sight_lists, vec2u((index >> 2u) & 4095u, index >> 14u));
    let pair = select(four.xy, four.zw, (index & 2u) != 0u);
    return select(pair.x, pair.y, (index & 1u) != 0u);
}

// As `bvh_trace`, for a ray that runs through the point `image` of the image plane (at distance 1) and the pinhole. It does not meet
// the triangle `own` that it left, which need not be tested where nothing else is in sight.
fn sight_trace(image: vec2f, origin: vec3f, direction: vec3f, limit: f32, own: u32, any: bool) -> Hit {
    let raster = (image / parameters.start.tangent * 0.5 + 0.5) * f32(SIGHT_SIDE - 2u) + 1.0;
    let texel = vec2u(clamp(raster, vec2f(0.0), vec2f(f32(SIGHT_SIDE) - 0.5)));
    let head = sight_word(texel.y * SIGHT_SIDE + texel.x);
    var hit = Hit(NONE, limit, vec2f(0.0));
    var triangle = head;
    var word = head & ~SIGHT_LIST;
    var end = word + 1u;
    if ((head & SIGHT_LIST) != 0u) {
        end += sight_word(word);
        word += 1u;
        if (word < end) {
            triangle = sight_word(word);
        }
    } else if (head == own) {
        end = word;
    }
    while (word < end) {
        bvh_intersect_triangle(triangle, origin, direction, &hit);
        if (any && hit.triangle != NONE) {
            break;
        }
        word += 1u;
        if (word < end) {
            triangle = sight_word(word);
        }
    }
    return hit;
}
