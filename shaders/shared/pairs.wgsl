// Triangles in pairs that share an edge (`render::pairs`): where they lie, and where a ray meets them.
//
// They, and the search tree's nodes, lie in read-only storage textures: on software Vulkan their loads are far cheaper than those of
// storage buffers.
#import features
#import parameters

// Four texels a pair of triangles, in leaf order: a corner, and from there the edges to the other three; then material, region and
// where its corners' attributes are.
@group(0) @binding(2) var pair_texels: texture_storage_2d<rgba32uint, read>;

struct Hit {
    // The index of its pair in leaf order, doubled, and 1 more for the second one of the pair; or NONE.
    triangle: u32,
    distance: f32,
    // Weights of its second and third corner.
    barycentric: vec2f,
}

// Texels of a small tree are in one row, and nodes begin at multiples of 8: software Vulkan multiplies slowly, and a row more.
fn tree_place(texel: u32) -> vec2u {
    if (SMALL_TREE) {
        return vec2u(texel, 0u);
    }
    return vec2u(texel & 4095u, texel >> 12u);
}

fn pair_texel(pair: u32, texel: u32) -> vec4u {
    return textureLoad(pair_texels, tree_place(4u * pair + texel));
}

struct Pair {
    corner: vec3f,
    edge1: vec3f,
    edge2: vec3f,
    edge3: vec3f,
}

fn pair_at(pair: u32) -> Pair {
    let a = bitcast<vec4f>(pair_texel(pair, 0u));
    let b = bitcast<vec4f>(pair_texel(pair, 1u));
    let c = bitcast<vec4f>(pair_texel(pair, 2u));
    return Pair(a.xyz, vec3f(a.w, b.xy), vec3f(b.zw, c.x), c.yzw);
}

// Möller and Trumbore 1997, both sides, for the triangles with edges 1 and 2 and with edges 2 and 3. Shrinks `hit` if one of them is
// nearer; of two at the same distance the one of lower index counts, whichever is met first.
fn pair_intersect(index: u32, origin: vec3f, direction: vec3f, hit: ptr<function, Hit>) {
    let pair = pair_at(index);
    let s = origin - pair.corner;
    let across = cross(direction, pair.edge2);
    let first = cross(s, pair.edge1);
    let second = cross(s, pair.edge3);
    // By which side of the common edge the ray passes, for both alike: it cannot slip through between them.
    let side = dot(s, across);
    let inverse = 1.0 / vec2f(dot(pair.edge1, across), dot(pair.edge3, across));
    // Of either triangle: the weight of the corner that is its own, that of the common edge's end, and the distance.
    let own = side * inverse;
    let end = vec2f(dot(direction, first), dot(direction, second)) * inverse;
    let t = vec2f(dot(pair.edge2, first), dot(pair.edge2, second)) * inverse;
    // A ray in a triangle's plane gives NaN or infinity here, and no hit; so does a pair's second triangle that is none.
    let met = own >= vec2f(0.0) & end >= vec2f(0.0) & own + end <= vec2f(1.0) & t > vec2f(0.0);
    let is_second = met.y && !(met.x && t.x <= t.y);
    let triangle = 2u * index + u32(is_second);
    let distance = select(t.x, t.y, is_second);
    let nearer = distance < (*hit).distance
        || (distance == (*hit).distance && (*hit).triangle != NONE && triangle < (*hit).triangle);
    if ((met.x || met.y) && nearer) {
        *hit = Hit(triangle, distance, select(vec2f(own.x, end.x), vec2f(end.y, own.y), is_second));
    }
}
