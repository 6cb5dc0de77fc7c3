// The light buffer: which pairs of triangles the pinhole that camera and projector share can see. It is a
// raster over the image plane, one texel wider than the field of view on each side. Each texel has a list of
// the pairs whose triangles a ray through the texel could meet before a triangle that covers the whole texel.
// Rays that start or end at the pinhole test this list instead of traversing the search tree, and find
// exactly the same hit. The host makes the lists (`render::light_buffer`).
//
// Haines and Greenberg, "The Light Buffer: A Shadow-Testing Accelerator", IEEE Computer Graphics and
// Applications 6(9), 1986.
#import features
#import parameters
#import pairs

// Words, four to a texel of the texture. The first words belong to the raster's texels, one each. Without
// LIST_CONTINUES such a word is the only pair in light_buffer. With LIST_CONTINUES it is the index of the list's
// first word, or 0 where nothing is in light_buffer. The words of a list are pairs; all but the last one carry
// LIST_CONTINUES.
@group(1) @binding(3) var light_buffer: texture_storage_2d<rgba32uint, read>;

// The same constant as in `render::light_buffer`.
const LIST_CONTINUES = 0x80000000u;

// The word at this index.
fn light_buffer_word(index: u32) -> u32 {
    let four = textureLoad(light_buffer, vec2u((index >> 2u) & 4095u, index >> 14u));
    let pair = select(four.xy, four.zw, (index & 2u) != 0u);
    return select(pair.x, pair.y, (index & 1u) != 0u);
}

// The closest hit before `limit`, or any hit if `any` is set, of a ray through the pinhole and the point
// `image` of the image plane at distance 1. `own` is the pair that a ray towards the pinhole left, or NONE:
// such a ray cannot meet it, since the pinhole sees both triangles of a pair from the same side. So it need
// not be tested where nothing else is in light_buffer.
fn light_buffer_trace(image: vec2f, origin: vec3f, direction: vec3f, limit: f32, own: u32, any: bool) -> Hit {
    let raster = (image / parameters.start.tangent * 0.5 + 0.5) * f32(LIGHT_BUFFER_SIDE - 2u) + 1.0;
    let texel = vec2u(clamp(raster, vec2f(0.0), vec2f(f32(LIGHT_BUFFER_SIDE) - 0.5)));
    var word = texel.y * LIGHT_BUFFER_SIDE + texel.x;
    var is_listed = false;
    var hit = Hit(NONE, limit, vec2f(0.0));
    // A single loop, with a single place that reads a word: software Vulkan executes every read that any lane
    // may reach.
    loop {
        let value = light_buffer_word(word);
        let continues = (value & LIST_CONTINUES) != 0u;
        let content = value & ~LIST_CONTINUES;
        if (continues && !is_listed) {
            if (content == 0u) {
                break;
            }
            word = content;
            is_listed = true;
        } else {
            if (!is_listed && content == own) {
                break;
            }
            pair_intersect(content, origin, direction, &hit);
            if (!continues || (any && hit.triangle != NONE)) {
                break;
            }
            word += 1u;
        }
    }
    return hit;
}
