// Ray traversal of the search tree, a compressed wide BVH: Ylitie, Karras and Laine, "Efficient Incoherent Ray Traversal on GPUs Through
// Compressed Wide BVHs", HPG 2017, in the node layout of the crate obvhs (80 bytes, five texels). Leaves are pairs of triangles.
#import features
#import pairs

@group(0) @binding(1) var bvh_nodes: texture_storage_2d<rgba32uint, read>;

// One of the five texels of a node.
fn bvh_node_texel(node: u32, texel: u32) -> vec4u {
    return textureLoad(bvh_nodes, tree_place(node * select(5u, 8u, SMALL_TREE) + texel));
}

// The traversal stack: a pair of words for each level. The host refuses trees that are deeper. It is a private variable, because a
// function's local array would be zeroed at each call.
var<private> bvh_stack: array<vec2u, 32>;
// The stack for a small tree, with one word for each level: software Vulkan stores and loads every word lane by lane.
var<private> bvh_small_stack: array<u32, 32>;

// Puts a group of children on the stack.
fn bvh_put(depth: u32, group: vec2u) {
    if (SMALL_TREE) {
        bvh_small_stack[depth] = (group.x << 16u) | (group.y >> 16u & 0xff00u) | (group.y & 0xffu);
    } else {
        bvh_stack[depth] = group;
    }
}

// The group of children at this level of the stack.
fn bvh_take(depth: u32) -> vec2u {
    if (SMALL_TREE) {
        let word = bvh_small_stack[depth];
        return vec2u(word >> 16u, (word << 16u & 0xff000000u) | (word & 0xffu));
    }
    return bvh_stack[depth];
}

// Which of four children the ray meets, as bits for the traversal: inner children in the top byte, in the octant's order, and pairs of
// triangles in the lower 24 bits. `meta4` holds the meta bytes of the children. `near` and `far` are the distances at which the ray
// enters and leaves each child's box.
fn bvh_children4(meta4: u32, octant4: u32, near: vec4f, far: vec4f) -> u32 {
    let inner = meta4 & (meta4 << 1u) & 0x10101010u;
    let inner_mask = (inner >> 4u) * 0xffu;
    let bit_index = unpack4xU8((meta4 ^ (octant4 & inner_mask)) & 0x1f1f1f1fu);
    let bits = unpack4xU8((meta4 >> 5u) & 0x07070707u);
    let met = select(vec4u(0u), bits << bit_index, near <= far);
    return met.x | met.y | met.z | met.w;
}

// Which children of a node the ray meets before `limit`, as bits in the layout of `bvh_children4`. `inverse` is 1 over the direction,
// component by component.
fn bvh_intersect_node(
    texel0: vec4u, texel1: vec4u, node: u32, origin: vec3f, inverse: vec3f, octant4: u32, limit: f32,
) -> u32 {
    let scale = bitcast<vec3f>(vec3u(texel0.w & 0xffu, (texel0.w >> 8u) & 0xffu, (texel0.w >> 16u) & 0xffu) << vec3u(23u)) * inverse;
    let offset = (bitcast<vec3f>(texel0.xyz) - origin) * inverse;
    let x = bvh_node_texel(node, 2u);
    let y = bvh_node_texel(node, 3u);
    let z = bvh_node_texel(node, 4u);
    // The planes are stored as (lo₀₋₃, lo₄₋₇, hi₀₋₃, hi₄₋₇). Near and far are exchanged where the direction is negative.
    let xs = select(x, x.zwxy, inverse.x < 0.0);
    let ys = select(y, y.zwxy, inverse.y < 0.0);
    let zs = select(z, z.zwxy, inverse.z < 0.0);
    // Boxes are widened by two units in the last place, so that rounding cannot lose a box without thickness.
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

// The closest hit before `limit`, or any hit if `any` is set. The closest hit does not depend on the order of traversal.
fn bvh_trace(origin: vec3f, direction: vec3f, limit: f32, any: bool) -> Hit {
    var hit = Hit(NONE, limit, vec2f(0.0));
    if (FEW_PAIRS > 0u) {
        for (var pair = 0u; pair < FEW_PAIRS; pair += 1u) {
            pair_intersect(pair, origin, direction, &hit);
        }
        return hit;
    }
    let tiny = abs(direction) < vec3f(1e-20);
    let inverse = 1.0 / select(direction, vec3f(1e-20), tiny);
    let octant4 = select(0x04040404u, 0u, inverse.x < 0.0) | select(0x02020202u, 0u, inverse.y < 0.0)
        | select(0x01010101u, 0u, inverse.z < 0.0);
    // x: index of the first child; y: the children still to be visited (top byte), and which of all children are inner nodes (low byte).
    var group = vec2u(0u, 0x80000000u);
    var depth = 0u;
    var left = true;
    loop {
        // Visit nodes until four have leaves that the ray may meet, or until no node is left, and only then test the leaves: lanes that
        // execute every step together rarely have leaves in the same step (speculative traversal, Aila and Laine 2009). `bases` holds the
        // first pairs of these four nodes, `masks` which of the 24 pairs from there are to be tested.
        var bases = vec4u(0u);
        var masks = vec4u(0u);
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
                bases = vec4u(texel1.y, bases.xyz);
                masks = vec4u(mask & 0x00ffffffu, masks.xyz);
            }
            if ((group.y & 0xff000000u) == 0u) {
                left = depth > 0u;
                if (left) {
                    depth -= 1u;
                    group = bvh_take(depth);
                }
            }
            if (!left || masks.w != 0u) {
                break;
            }
        }
        while (masks.x != 0u) {
            let bit = firstLeadingBit(masks.x);
            let pair = bases.x + bit;
            masks.x &= ~(1u << bit);
            if (masks.x == 0u) {
                bases = vec4u(bases.yzw, 0u);
                masks = vec4u(masks.yzw, 0u);
            }
            pair_intersect(pair, origin, direction, &hit);
        }
        if (!left || (any && hit.triangle != NONE)) {
            break;
        }
    }
    return hit;
}
