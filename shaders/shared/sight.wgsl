// What can be seen from the pinhole that camera and projector share, as lists of pairs of triangles: a raster over the image plane (one texel
// wider than the field on each side), and for each of its texels those of all triangles that a ray through it could meet before one that
// covers it whole. After Haines and Greenberg, "The Light Buffer: A Shadow-Testing Accelerator", IEEE CG&A 1986. The host makes
// the lists (`render::sight`); rays that begin or end in the pinhole need no search tree then, and find exactly the same.
#import features
#import parameters
#import pairs

// Words, four to a texel of the texture. First one for each of the raster's texels: the only pair, or, told apart by `SIGHT_GOES_ON`, at
// which word its list begins; no word where nothing is in sight. A list is pairs, all but the last with that mark.
@group(1) @binding(3) var sight_lists: texture_storage_2d<rgba32uint, read>;

// As `render::sight` has it.
const SIGHT_GOES_ON = 0x80000000u;

fn sight_word(index: u32) -> u32 {
    let four = textureLoad(sight_lists, vec2u((index >> 2u) & 4095u, index >> 14u));
    let pair = select(four.xy, four.zw, (index & 2u) != 0u);
    return select(pair.x, pair.y, (index & 1u) != 0u);
}

// As `bvh_trace`, for a ray that runs through the point `image` of the image plane (at distance 1) and the pinhole. It does not meet
// the pair `own` that it left (the pinhole sees both triangles from the same side, so that neither hides the other), which need not be
// tested where nothing else is in sight.
fn sight_trace(image: vec2f, origin: vec3f, direction: vec3f, limit: f32, own: u32, any: bool) -> Hit {
    let raster = (image / parameters.start.tangent * 0.5 + 0.5) * f32(SIGHT_SIDE - 2u) + 1.0;
    let texel = vec2u(clamp(raster, vec2f(0.0), vec2f(f32(SIGHT_SIDE) - 0.5)));
    var word = texel.y * SIGHT_SIDE + texel.x;
    var is_listed = false;
    var hit = Hit(NONE, limit, vec2f(0.0));
    // One loop, that a word is read at one place: software Vulkan reads at each place that any lane may come to.
    loop {
        let value = sight_word(word);
        let goes_on = (value & SIGHT_GOES_ON) != 0u;
        let rest = value & ~SIGHT_GOES_ON;
        if (goes_on && !is_listed) {
            if (rest == 0u) {
                break;
            }
            word = rest;
            is_listed = true;
        } else {
            if (!is_listed && rest == own) {
                break;
            }
            pair_intersect(rest, origin, direction, &hit);
            if (!goes_on || (any && hit.triangle != NONE)) {
                break;
            }
            word += 1u;
        }
    }
    return hit;
}
