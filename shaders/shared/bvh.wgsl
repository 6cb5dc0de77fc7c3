// Ray traversal of a compressed wide BVH: Ylitie, Karras and Laine, "Efficient Incoherent Ray Traversal on GPUs Through
// Compressed Wide BVHs", HPG 2017, in the node layout of the crate obvhs (80 bytes, five texels).
//
// Nodes and triangles lie in read-only storage textures: on software Vulkan their loads are far cheaper than those of
// storage buffers.
#import features
#import parameters

@group(0) @binding(1) var bvh_nodes: texture_storage_2d<rgba32uint, read>;
// Four texels a pair of triangles, in leaf order: a corner, and from there the edges to the other three; then material, region and
// where its corners' attributes are.
@group(0) @binding(2) var bvh_pairs: texture_storage_2d<rgba32uint, read>;

struct Hit {
    // That of its pair in leaf order, doubled, and 1 more for the second one; or NONE.
    triangle: u32,
    distance: f32,
    // Weights of its second and third corner.
    barycentric: vec2f,
}

// Those of a small tree are in one row, and nodes begin at multiples of 8: software Vulkan multiplies slowly, and a row more.
fn bvh_place(texel: u32) -> vec2u {
    if (SMALL_TREE) {
        return vec2u(texel, 0u);
    }
    return vec2u(texel & 4095u, texel >> 12u);
}

fn bvh_node_texel(node: u32, texel: u32) -> vec4u {
    return textureLoad(bvh_nodes, bvh_place(node * select(5u, 8u, SMALL_TREE) + texel));
}

fn bvh_pair_texel(pair: u32, texel: u32) -> vec4u {
    return textureLoad(bvh_pairs, bvh_place(4u * pair + texel));
}

struct Pair {
    corner: vec3f,
    edge1: vec3f,
    edge2: vec3f,
    edge3: vec3f,
}

fn bvh_pair(pair: u32) -> Pair {
    let a = bitcast<vec4f>(bvh_pair_texel(pair, 0u));
    let b = bitcast<vec4f>(bvh_pair_texel(pair, 1u));
    let c = bitcast<vec4f>(bvh_pair_texel(pair, 2u));
    return Pair(a.xyz, vec3f(a.w, b.xy), vec3f(b.zw, c.x), c.yzw);
}

// Deeper than any tree that the builder makes (the host refuses others). Private: a function's own array would be
// zeroed at each call.
var<private> bvh_stack: array<vec2u, 32>;
// The same for a small tree, a word each: on software Vulkan every word is put down and taken up lane by lane.
var<private> bvh_small_stack: array<u32, 32>;

fn bvh_put(depth: u32, group: vec2u) {
    if (SMALL_TREE) {
        bvh_small_stack[depth] = (group.x << 16u) | (group.y >> 16u & 0xff00u) | (group.y & 0xffu);
    } else {
        bvh_stack[depth] = group;
    }
}

fn bvh_take(depth: u32) -> vec2u {
    if (SMALL_TREE) {
        let word = bvh_small_stack[depth];
        return vec2u(word >> 16u, (word << 16u & 0xff000000u) | (word & 0xffu));
    }
    return bvh_stack[depth];
}

// Which of four children the ray meets, as bits for the traversal: inner children in the top byte by octant order,
// pairs of triangles in the lower 24. `meta4` is the children's meta bytes.
fn bvh_children4(meta4: u32, octant4: u32, near: vec4f, far: vec4f) -> u32 {
    let inner = meta4 & (meta4 << 1u) & 0x10101010u;
    let inner_mask = (inner >> 4u) * 0xffu;
    let bit_index = unpack4xU8((meta4 ^ (octant4 & inner_mask)) & 0x1f1f1f1fu);
    let bits = unpack4xU8((meta4 >> 5u) & 0x07070707u);
    let met = select(vec4u(0u), bits << bit_index, near <= far);
    return met.x | met.y | met.z | met.w;
}

fn bvh_intersect_node(
    texel0: vec4u, texel1: vec4u, node: u32, origin: vec3f, inverse: vec3f, octant4: u32, limit: f32,
) -> u32 {
    let scale = bitcast<vec3f>(vec3u(texel0.w & 0xffu, (texel0.w >> 8u) & 0xffu, (texel0.w >> 16u) & 0xffu) << vec3u(23u)) * inverse;
    let offset = (bitcast<vec3f>(texel0.xyz) - origin) * inverse;
    let x = bvh_node_texel(node, 2u);
    let y = bvh_node_texel(node, 3u);
    let z = bvh_node_texel(node, 4u);
    // Planes come as (lo₀₋₃, lo₄₋₇, hi₀₋₃, hi₄₋₇); swap near and far where the ray runs backwards.
    let xs = select(x, x.zwxy, inverse.x < 0.0);
    let ys = select(y, y.zwxy, inverse.y < 0.0);
    let zs = select(z, z.zwxy, inverse.z < 0.0);
    // Widened by two ulps, so that rounding cannot lose a box of no thickness.
    const WIDEN = 1.0000003;
    var mask = 0u;
    {
        let near = max(max(vec4f(unpack4xU8(xs.x)) * scale.x + offset.x, vec4f(unpack4xU8(ys.x)) * scale.y + offset.y),
                       max(vec4f(unpack4xU8(zs.x)) * scale.z + offset.z, vec4f(0.0)));
        let far = min(min(vec4f(unpack4xU8(xs.z)) * scale.x + offset.x, vec4f(unpack4xU8(ys.z)) * scale.y + offset.y),
                      vec4f(unpack4xU8(zs.z)) * scale.z + offset.z) * WIDEN;
        mask |= bvh_children4(texel1.z, octant4, near, min(far, vec4f(limit)));
    }
    {
        let near = max(max(vec4f(unpack4xU8(xs.y)) * scale.x + offset.x, vec4f(unpack4xU8(ys.y)) * scale.y + offset.y),
                       max(vec4f(unpack4xU8(zs.y)) * scale.z + offset.z, vec4f(0.0)));
        let far = min(min(vec4f(unpack4xU8(xs.w)) * scale.x + offset.x, vec4f(unpack4xU8(ys.w)) * scale.y + offset.y),
                      vec4f(unpack4xU8(zs.w)) * scale.z + offset.z) * WIDEN;
        mask |= bvh_children4(texel1.w, octant4, near, min(far, vec4f(limit)));
    }
    return mask;
}

// Möller and Trumbore 1997, both sides, for the triangles with edges 1 and 2 and with edges 2 and 3. Shrinks `hit` if one of them is
// nearer; of two at the same distance the one of lower index counts, whichever is met first.
fn bvh_intersect_pair(index: u32, origin: vec3f, direction: vec3f, hit: ptr<function, Hit>) {
    let pair = bvh_pair(index);
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

// The closest hit before `limit`, or any one if `any` is set. Which triangle is hit does not depend on how it is found.
fn bvh_trace(origin: vec3f, direction: vec3f, limit: f32, any: bool) -> Hit {
    var hit = Hit(NONE, limit, vec2f(0.0));
    if (FEW_PAIRS > 0u) {
        for (var pair = 0u; pair < FEW_PAIRS; pair += 1u) {
            bvh_intersect_pair(pair, origin, direction, &hit);
        }
        return hit;
    }
    let tiny = abs(direction) < vec3f(1e-20);
    let inverse = 1.0 / select(direction, vec3f(1e-20), tiny);
    let octant4 = select(0x04040404u, 0u, inverse.x < 0.0) | select(0x02020202u, 0u, inverse.y < 0.0)
        | select(0x01010101u, 0u, inverse.z < 0.0);
    // x: first child's index; y: children yet to visit (top byte) and which of all are inner (low byte).
    var group = vec2u(0u, 0x80000000u);
    var depth = 0u;
    var left = true;
    loop {
        // Nodes until four have leaves that the ray may meet, or none is left, and only then the leaves: of lanes that take every step
        // together, few have leaves in the same one (speculative traversal: Aila and Laine 2009). First pairs, and which from there.
        var leaves = vec4u(0u);
        var pairs = vec4u(0u);
        loop {
            let bit = firstLeadingBit(group.y);
            let base = group.x;
            let inner = group.y;
            group.y &= ~(1u << bit);
            if ((group.y & 0xff000000u) != 0u) {
                bvh_put(depth, group);
                depth += 1u;
            }
            let slot = (bit - 24u) ^ (octant4 & 0xffu);
            let node = base + countOneBits(inner & ~(0xffffffffu << slot));
            let texel0 = bvh_node_texel(node, 0u);
            let texel1 = bvh_node_texel(node, 1u);
            let mask = bvh_intersect_node(texel0, texel1, node, origin, inverse, octant4, hit.distance);
            group = vec2u(texel1.x, (mask & 0xff000000u) | (texel0.w >> 24u));
            if ((mask & 0x00ffffffu) != 0u) {
                leaves = vec4u(texel1.y, leaves.xyz);
                pairs = vec4u(mask & 0x00ffffffu, pairs.xyz);
            }
            if ((group.y & 0xff000000u) == 0u) {
                left = depth > 0u;
                if (left) {
                    depth -= 1u;
                    group = bvh_take(depth);
                }
            }
            if (!left || pairs.w != 0u) {
                break;
            }
        }
        while (pairs.x != 0u) {
            let bit = firstLeadingBit(pairs.x);
            let pair = leaves.x + bit;
            pairs.x &= ~(1u << bit);
            if (pairs.x == 0u) {
                leaves = vec4u(leaves.yzw, 0u);
                pairs = vec4u(pairs.yzw, 0u);
            }
            bvh_intersect_pair(pair, origin, direction, &hit);
        }
        if (!left || (any && hit.triangle != NONE)) {
            break;
        }
    }
    return hit;
}
