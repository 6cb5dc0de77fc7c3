// What can be seen from the pinhole that camera and projector share, as lists of pairs of triangles: a raster over the image plane (one texel
// wider than the field on each side), and for each of its texels those of all triangles that a ray through it could meet before one that
// covers it whole. After Haines and Greenberg, "The Light Buffer: A Shadow-Testing Accelerator", IEEE CG&A 1986. The host makes
// the lists (`render::light_buffer`); rays that begin or end in the pinhole need no search tree then, and find exactly the same.
#import features
#import parameters
#import pairs

// Words, four to a texel of the texture. First one for each of the raster's texels: the only pair, or, told apart by `LIST_CONTINUES`, at
// which word its list begins; no word where nothing is in light_buffer. A list is pairs, all but the last with that mark.
@group(1) @binding(3) var light_buffer: texture_storage_2d<rgba32uint, read>;

// As `render::light_buffer` has it.
const LIST_CONTINUES = 0x80000000u;

fn light_buffer_word(index: u32) -> u32 {
    let four = textureLoad(light_buffer, vec2u((index >> 2u) & 4095u, index >> 14u));
    let pair = select(four.xy, four.zw, (index & 2u) != 0u);
    return select(pair.x, pair.y, (index & 1u) != 0u);
}

// As `bvh_trace`, for a ray that runs through the point `image` of the image plane (at distance 1) and the pinhole. It does not meet
// the pair `own` that it left (the pinhole sees both triangles from the same side, so that neither hides the other), which need not be
// tested where nothing else is in light_buffer.
fn light_buffer_trace(image: vec2f, origin: vec3f, direction: vec3f, limit: f32, own: u32, any: bool) -> Hit {
    let raster = (image / parameters.start.tangent * 0.5 + 0.5) * f32(LIGHT_BUFFER_SIDE - 2u) + 1.0;
    let texel = vec2u(clamp(raster, vec2f(0.0), vec2f(f32(LIGHT_BUFFER_SIDE) - 0.5)));
    var word = texel.y * LIGHT_BUFFER_SIDE + texel.x;
    var is_listed = false;
    var hit = Hit(NONE, limit, vec2f(0.0));
    // One loop, that a word is read at one place: software Vulkan reads at each place that any lane may come to.
    loop {
        let value = light_buffer_word(word);
        let goes_on = (value & LIST_CONTINUES) != 0u;
        let rest = value & ~LIST_CONTINUES;
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
