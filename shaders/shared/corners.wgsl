// Attributes of a triangle's corners besides positions: texture coordinates, normals, colours.
#import parameters

// Two texels for each corner. The first holds both sets of texture coordinates; the second the normal (octahedral, 2 × 16 bits) and the
// linear colour (4 × 16 bits).
@group(0) @binding(4) var corner_texels: texture_storage_2d<rgba32uint, read>;

// The packed word that stands for a corner without a normal.
const NO_NORMAL = 0x80008000u;

// The texel at this index.
fn corner_texel(index: u32) -> vec4u {
    return textureLoad(corner_texels, vec2u(index & 4095u, index >> 12u));
}

struct Texcoords {
    // Coordinates of the first corner, and differences from there to the second and the third one. x and y are set 0, z and w set 1.
    origin: vec4f,
    edge1: vec4f,
    edge2: vec4f,
}

// The texture coordinates of the triangle whose attributes begin at texel `first`.
fn corner_texcoords(first: u32) -> Texcoords {
    let origin = bitcast<vec4f>(corner_texel(first));
    let edge1 = bitcast<vec4f>(corner_texel(first + 2u)) - origin;
    let edge2 = bitcast<vec4f>(corner_texel(first + 4u)) - origin;
    return Texcoords(origin, edge1, edge2);
}

// The unit normal that a word packs; zero for none.
fn corner_normal(packed: u32) -> vec3f {
    if (packed == NO_NORMAL) {
        return vec3f(0.0);
    }
    let xy = unpack2x16snorm(packed);
    let z = 1.0 - abs(xy.x) - abs(xy.y);
    let fold = max(-z, 0.0);
    return normalize(vec3f(xy - select(vec2f(-fold), vec2f(fold), xy >= vec2f(0.0)), z));
}

// Corner attributes, interpolated.
struct Blend {
    // It is not normalized, and zero where the corners have no normals.
    normal: vec3f,
    color: vec4f,
}

// Normal and colour at the point with these barycentric weights.
fn corner_blend(first: u32, weights: vec3f) -> Blend {
    var blend = Blend(vec3f(0.0), vec4f(0.0));
    for (var corner = 0u; corner < 3u; corner += 1u) {
        let texel = corner_texel(first + 2u * corner + 1u);
        blend.normal += weights[corner] * corner_normal(texel.x);
        blend.color += weights[corner] * vec4f(unpack2x16unorm(texel.y), unpack2x16unorm(texel.z));
    }
    return blend;
}
