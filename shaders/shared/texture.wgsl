// Base colour textures: all in one buffer of RGBA8 texels, sRGB-encoded, decoded through a table (a `pow` would differ from
// device to device).
#import parameters

// Laid out as `render::materials::GpuTexture`; a test compares the two.
struct TextureInfo {
    // Index of the first texel.
    offset: u32,
    width: u32,
    height: u32,
    // Bits 0–1: wrap of u, bits 2–3: wrap of v (0 repeat, 1 mirrored, 2 clamp); bit 4: bilinear.
    flags: u32,
}

@group(0) @binding(5) var<storage, read> texture_infos: array<TextureInfo>;
@group(0) @binding(6) var<storage, read> texels: array<u32>;
// Linear value of each sRGB byte, four to a vector.
@group(0) @binding(7) var<storage, read> srgb_table: array<vec4f, 64>;

fn texture_wrap(coordinate: i32, size: i32, mode: u32) -> u32 {
    if (mode == 2u) {
        return u32(clamp(coordinate, 0, size - 1));
    }
    let period = select(size, 2 * size, mode == 1u);
    let within = ((coordinate % period) + period) % period;
    return u32(select(within, period - 1 - within, within >= size));
}

fn texture_texel(info: TextureInfo, x: i32, y: i32) -> vec3f {
    let column = texture_wrap(x, i32(info.width), info.flags & 3u);
    let row = texture_wrap(y, i32(info.height), (info.flags >> 2u) & 3u);
    let c = unpack4xU8(texels[info.offset + row * info.width + column]);
    return vec3f(srgb_table[c.x >> 2u][c.x & 3u], srgb_table[c.y >> 2u][c.y & 3u], srgb_table[c.z >> 2u][c.z & 3u]);
}

// Linear colour at (u, v), v = 0 at the top row.
fn texture_color(index: u32, uv: vec2f) -> vec3f {
    let info = texture_infos[index];
    // Far coordinates carry no fraction any more, and must not overflow the integers.
    let position = clamp(uv, vec2f(-1e4), vec2f(1e4)) * vec2f(f32(info.width), f32(info.height));
    if ((info.flags & 16u) == 0u) {
        let nearest = vec2i(floor(position));
        return texture_texel(info, nearest.x, nearest.y);
    }
    let corner = floor(position - 0.5);
    let t = position - 0.5 - corner;
    let i = vec2i(corner);
    return mix(
        mix(texture_texel(info, i.x, i.y), texture_texel(info, i.x + 1, i.y), t.x),
        mix(texture_texel(info, i.x, i.y + 1), texture_texel(info, i.x + 1, i.y + 1), t.x),
        t.y,
    );
}
