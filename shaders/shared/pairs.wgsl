// Pairs of triangles that share an edge (`render::pairs`): their data, and their intersection with a ray.
//
// Pairs and the nodes of the search tree are stored in read-only storage textures: software Vulkan loads from these far faster than from
// storage buffers.
#import features
#import parameters

// Four texels for each pair, in the order of the tree's leaves. Three hold a corner and the edges from there to the three other corners;
// the fourth holds material, region, and the index of the first corner attribute.
@group(0) @binding(2) var pair_texels: texture_storage_2d<rgba32uint, read>;

struct Hit {
    // Twice the index of the pair in leaf order, plus 1 for the second triangle of the pair; or NONE.
    triangle: u32,
    distance: f32,
    // Weights of the triangle's second and third corner.
    barycentric: vec2f,
}

// Coordinates of a texel of the tree's textures. The texels of a small tree lie in one row, and its nodes begin at multiples of 8: software
// Vulkan multiplies slowly, and a second coordinate costs more.
fn tree_place(texel: u32) -> vec2u {
    if (SMALL_TREE) {
        return vec2u(texel, 0u);
    }
    return vec2u(texel & 4095u, texel >> 12u);
}

// One of the four texels of a pair.
fn pair_texel(pair: u32, texel: u32) -> vec4u {
    return textureLoad(pair_texels, tree_place(4u * pair + texel));
}

// The first triangle has edges 1 and 2, the second one edges 2 and 3, all from one corner.
struct Pair {
    corner: vec3f,
    edge1: vec3f,
    edge2: vec3f,
    edge3: vec3f,
}

// The geometry of a pair.
fn pair_at(pair: u32) -> Pair {
    let a = bitcast<vec4f>(pair_texel(pair, 0u));
    let b = bitcast<vec4f>(pair_texel(pair, 1u));
    let c = bitcast<vec4f>(pair_texel(pair, 2u));
    return Pair(a.xyz, vec3f(a.w, b.xy), vec3f(b.zw, c.x), c.yzw);
}

// Intersects a ray with both triangles of a pair, from either side (Möller and Trumbore 1997), and updates `hit` if one of them is nearer.
// Of two triangles at the same distance the one with the lower index counts, whichever is tested first.
fn pair_intersect(index: u32, origin: vec3f, direction: vec3f, hit: ptr<function, Hit>) {
    let pair = pair_at(index);
    let s = origin - pair.corner;
    let across = cross(direction, pair.edge2);
    let first = cross(s, pair.edge1);
    let second = cross(s, pair.edge3);
    // The side of the common edge on which the ray passes. Both triangles use the same value, so that no ray slips through between them.
    let side = dot(s, across);
    let inverse = 1.0 / vec2f(dot(pair.edge1, across), dot(pair.edge3, across));
    // For each triangle: the weight of the corner that only it has, the weight of the end of the common edge, and the distance.
    let own = side * inverse;
    let end = vec2f(dot(direction, first), dot(direction, second)) * inverse;
    let t = vec2f(dot(pair.edge2, first), dot(pair.edge2, second)) * inverse;
    // A ray in the plane of a triangle gives NaN or infinity, and no hit. So does the missing second triangle of a single one.
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
