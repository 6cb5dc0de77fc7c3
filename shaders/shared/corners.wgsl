// What a triangle's corners carry beside their positions: texture coordinates, normals, colours.
#import parameters

// Two texels a corner: both sets of texture coordinates; normal (octahedral, 2 × 16 bits) and linear colour (4 × 16 bits).
@group(0) @binding(4) var corner_texels: texture_storage_2d<rgba32uint, read>;

// What no normal is packed into.
const NO_NORMAL = 0x80008000u;

fn corner_texel(index: u32) -> vec4u {
    return textureLoad(corner_texels, vec2u(index & 4095u, index >> 12u));
}

struct Texcoords {
    // At the first corner, and from there to the others. x and y: set 0, z and w: set 1.
    origin: vec4f,
    edge1: vec4f,
    edge2: vec4f,
}

fn corner_texcoords(first: u32) -> Texcoords {
    let origin = bitcast<vec4f>(corner_texel(first));
    let edge1 = bitcast<vec4f>(corner_texel(first + 2u)) - origin;
    let edge2 = bitcast<vec4f>(corner_texel(first + 4u)) - origin;
    return Texcoords(origin, edge1, edge2);
}

fn corner_normal(packed: u32) -> vec3f {
    if (packed == NO_NORMAL) {
        return vec3f(0.0);
    }
    let xy = unpack2x16snorm(packed);
    let z = 1.0 - abs(xy.x) - abs(xy.y);
    let fold = max(-z, 0.0);
    return normalize(vec3f(xy - select(vec2f(-fold), vec2f(fold), xy >= vec2f(0.0)), z));
}

struct Blend {
    // Not normalized; zero without normals.
    normal: vec3f,
    color: vec4f,
}

// Normal and colour at a point with these weights of the three corners.
fn corner_blend(first: u32, weights: vec3f) -> Blend {
    var blend = Blend(vec3f(0.0), vec4f(0.0));
    for (var corner = 0u; corner < 3u; corner += 1u) {
        let texel = corner_texel(first + 2u * corner + 1u);
        blend.normal += weights[corner] * corner_normal(texel.x);
        blend.color += weights[corner] * vec4f(unpack2x16unorm(texel.y), unpack2x16unorm(texel.z));
    }
    return blend;
}
