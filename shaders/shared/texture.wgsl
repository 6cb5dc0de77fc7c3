// Textures. The texels of all textures lie in one array, as RGBA of 8 bits each. sRGB is decoded by a table,
// since the result of `pow` differs between devices.
#import parameters

// One use of a texture by a material. `render::textures::GpuTexture` has the same layout; a test compares the
// two.
struct Texture {
    // Rows of the affine map from the surface's texture coordinates to the picture's. `v` = 0 is the
    // picture's top.
    u: vec3f,
    first_texel: u32,
    v: vec3f,
    width: u32,
    height: u32,
    // Bits 0–1: wrapping of u, bits 2–3: wrapping of v (0 repeat, 1 mirrored repeat, 2 clamp); bit 4:
    // bilinear filter; bit 5: RGB is sRGB-encoded; bit 6: set of texture coordinates; from bit 8: the role.
    flags: u32,
    padding: vec2u,
}

// Roles: which factor of the material a texture multiplies.
const ROLE_BASE_COLOR = 0u;
const ROLE_METALLIC_ROUGHNESS = 1u;
const ROLE_NORMAL = 2u;
const ROLE_SPECULAR = 3u;
const ROLE_SPECULAR_COLOR = 4u;
const ROLE_EMISSION = 5u;
const ROLE_TRANSMISSION = 6u;
const ROLE_DIFFUSE_TRANSMISSION = 7u;
const ROLE_DIFFUSE_TRANSMISSION_COLOR = 8u;

@group(0) @binding(5) var<storage, read> textures: array<Texture>;
// Texels, four in each element.
@group(0) @binding(6) var texels: texture_storage_2d<rgba32uint, read>;
// The linear value of each sRGB byte, four in each vector.
@group(0) @binding(7) var<storage, read> srgb_table: array<vec4f, 64>;

// The index of a texel along one axis, wrapped into the picture.
fn texture_wrap(coordinate: i32, size: i32, mode: u32) -> u32 {
    if (mode == 2u) {
        return u32(clamp(coordinate, 0, size - 1));
    }
    let period = select(size, 2 * size, mode == 1u);
    let within = ((coordinate % period) + period) % period;
    return u32(select(within, period - 1 - within, within >= size));
}

// Linear RGBA of the texel at column x and row y, which may lie outside the picture.
fn texture_texel(texture: Texture, x: i32, y: i32) -> vec4f {
    let column = texture_wrap(x, i32(texture.width), texture.flags & 3u);
    let row = texture_wrap(y, i32(texture.height), (texture.flags >> 2u) & 3u);
    let index = texture.first_texel + row * texture.width + column;
    let texel = textureLoad(texels, vec2u((index >> 2u) & 4095u, index >> 14u))[index & 3u];
    let linear = unpack4x8unorm(texel);
    if ((texture.flags & 32u) == 0u) {
        return linear;
    }
    let c = unpack4xU8(texel);
    return vec4f(
        srgb_table[c.x >> 2u][c.x & 3u], srgb_table[c.y >> 2u][c.y & 3u], srgb_table[c.z >> 2u][c.z & 3u], linear.w,
    );
}

// Maps the surface's coordinates `uv` to coordinates of the picture.
fn texture_map(texture: Texture, uv: vec2f) -> vec2f {
    return vec2f(dot(texture.u, vec3f(uv, 1.0)), dot(texture.v, vec3f(uv, 1.0)));
}

// Linear RGBA at the surface's coordinates `uv`, filtered.
fn texture_value(texture: Texture, uv: vec2f) -> vec4f {
    // Large coordinates have no fraction in f32, and must not overflow the integers.
    let mapped = clamp(texture_map(texture, uv), vec2f(-1e4), vec2f(1e4));
    let position = mapped * vec2f(f32(texture.width), f32(texture.height));
    if ((texture.flags & 16u) == 0u) {
        let nearest = vec2i(floor(position));
        return texture_texel(texture, nearest.x, nearest.y);
    }
    let corner = floor(position - 0.5);
    let t = position - 0.5 - corner;
    let i = vec2i(corner);
    return mix(
        mix(texture_texel(texture, i.x, i.y), texture_texel(texture, i.x + 1, i.y), t.x),
        mix(texture_texel(texture, i.x, i.y + 1), texture_texel(texture, i.x + 1, i.y + 1), t.x),
        t.y,
    );
}
