// The surface at a hit point: position, normal, emission, medium and BSDF.
#import features
#import parameters
#import pairs
#import bsdf
#import corners
#import texture
#import warp

// Texels of one material, and the index of each among them. `render::materials::GpuMaterial` has the same
// layout; a test compares the two.
const MATERIAL_TEXELS = 7u;
// Base colour; metallic.
const MATERIAL_BASE = 0u;
// ((n − 1)/(n + 1))² · specular colour; specular.
const MATERIAL_F0 = 1u;
// Emission; roughness.
const MATERIAL_EMISSION = 2u;
// Colour of the diffuse transmission; its share.
const MATERIAL_DIFFUSE_TRANSMISSION = 3u;
// Absorption; transmission.
const MATERIAL_ABSORPTION = 4u;
// Opacity cutoff of the mask mode, refractive index, scale of the normal map.
const MATERIAL_NUMBERS = 5u;
// Flags, begin and end of the material's textures in the list of textures, opacity.
const MATERIAL_FLAGS = 6u;

// Bits of the flags.
const MATERIAL_DOUBLE_SIDED = 1u;
const MATERIAL_LETS_LIGHT_THROUGH = 2u;
const MATERIAL_BLEND = 4u;
const MATERIAL_MASK = 8u;

@group(0) @binding(3) var materials: texture_storage_2d<rgba32uint, read>;

// One texel of a material, as words.
fn material_words(material: u32, which: u32) -> vec4u {
    let index = MATERIAL_TEXELS * material + which;
    return textureLoad(materials, vec2u(index & 4095u, index >> 12u));
}

// One texel of a material, as numbers.
fn material_texel(material: u32, which: u32) -> vec4f {
    return bitcast<vec4f>(material_words(material, which));
}

struct Surface {
    position: vec3f,
    // The geometric unit normal, on the side from which the ray came.
    normal: vec3f,
    // Emitted radiance, W/(m² sr).
    emission: vec3f,
    // The ray met the back of a one-sided opaque surface: it reflects, emits and transmits nothing.
    black: bool,
    // The ray met the front.
    front: bool,
    // Absorption per unit of length of the medium behind the front; 0 without a medium.
    absorption: vec3f,
    // Refractive index of that medium; 1 for thin walls and for opaque surfaces.
    ior: f32,
    bsdf: Bsdf,
}

// The factors of the material at one point, with its textures applied.
struct Look {
    // Opacity in w.
    base_color: vec4f,
    metallic: f32,
    roughness: f32,
    f0: vec3f,
    specular: f32,
    emission: vec3f,
    transmission: f32,
    diffuse_transmission: f32,
    diffuse_transmission_color: vec3f,
    // Unit shading normal, on the side of the front.
    shading: vec3f,
}

// The shading normal after a normal map: its texel bends the smooth normal `normal`. The texel's frame has +x
// along u and +y against v, which runs downwards. The frame is computed from the gradients of the mapped
// coordinates in the triangle (TANGENT attributes are not used), so that mirrored pictures are right, too.
fn surface_bump(texture: Texture, at: Texcoords, edge1: vec3f, edge2: vec3f, normal: vec3f, texel: vec3f, scale: f32) -> vec3f {
    let second = (texture.flags & 64u) != 0u;
    let along1 = select(at.edge1.xy, at.edge1.zw, second);
    let along2 = select(at.edge2.xy, at.edge2.zw, second);
    let uv1 = vec2f(dot(texture.u.xy, along1), dot(texture.v.xy, along1));
    let uv2 = vec2f(dot(texture.u.xy, along2), dot(texture.v.xy, along2));
    let turn = select(-1.0, 1.0, uv1.x * uv2.y >= uv1.y * uv2.x);
    let along_u = turn * (uv2.y * edge1 - uv1.y * edge2);
    let along_v = turn * (uv1.x * edge2 - uv2.x * edge1);
    let tangent = along_u - dot(along_u, normal) * normal;
    let across = cross(normal, tangent);
    let bitangent = select(across, -across, dot(across, along_v) > 0.0);
    let length2 = dot(tangent, tangent);
    let bump = (2.0 * texel - 1.0) * vec3f(scale, scale, 1.0);
    let bumped = (bump.x * tangent + bump.y * bitangent) * inverseSqrt(length2) + bump.z * normal;
    let usable = length2 > 0.0 && dot(bumped, bumped) > 0.0;
    return select(normal, normalize(bumped), usable);
}

// Applies the corner attributes and the textures of the material to its factors. The textures are those from
// `list.x` up to `list.y` in the list of textures; `first` is the first texel of the corner attributes, and
// `weights` are the barycentric coordinates.
fn surface_texture(
    look: ptr<function, Look>, material: u32, list: vec2u, first: u32, weights: vec3f, edge1: vec3f, edge2: vec3f,
) {
    let blend = corner_blend(first, weights);
    (*look).base_color *= blend.color;
    let length2 = dot(blend.normal, blend.normal);
    if (length2 > 0.0) {
        (*look).shading = blend.normal * inverseSqrt(length2);
    }
    let end = list.y;
    var index = list.x;
    if (index == end) {
        return;
    }
    let coordinates = corner_texcoords(first);
    let uv = coordinates.origin + weights.y * coordinates.edge1 + weights.z * coordinates.edge2;
    for (; index < end; index += 1u) {
        let texture = textures[index];
        let value = texture_value(texture, select(uv.xy, uv.zw, (texture.flags & 64u) != 0u));
        switch (texture.flags >> 8u) {
            case ROLE_BASE_COLOR: {
                (*look).base_color *= value;
            }
            case ROLE_METALLIC_ROUGHNESS: {
                (*look).roughness *= value.y;
                (*look).metallic *= value.z;
            }
            case ROLE_NORMAL: {
                let scale = material_texel(material, MATERIAL_NUMBERS).z;
                (*look).shading = surface_bump(texture, coordinates, edge1, edge2, (*look).shading, value.xyz, scale);
            }
            case ROLE_SPECULAR: {
                (*look).specular *= value.w;
            }
            case ROLE_SPECULAR_COLOR: {
                (*look).f0 *= value.xyz;
            }
            case ROLE_EMISSION: {
                (*look).emission *= value.xyz;
            }
            case ROLE_TRANSMISSION: {
                (*look).transmission *= value.x;
            }
            case ROLE_DIFFUSE_TRANSMISSION: {
                (*look).diffuse_transmission *= value.w;
            }
            default: {
                (*look).diffuse_transmission_color *= value.xyz;
            }
        }
    }
}

// The shading normal in the frame of the geometric normal, on the same side. At the silhouette of a coarse
// mesh it may lie below the horizon; then it is lifted above.
fn surface_shading(normal: vec3f, shading: vec3f) -> vec3f {
    let local = to_local(frame_around(normal), shading);
    return normalize(vec3f(local.xy, max(local.z, 0.01)));
}

// The surface that a ray in this direction finds at a hit. Its BSDF has air on the side without a medium; see
// `medium_meets`.
fn surface_at(hit: Hit, direction: vec3f) -> Surface {
    let pair = pair_at(hit.triangle >> 1u);
    let texel = pair_texel(hit.triangle >> 1u, 3u);
    let is_second = (hit.triangle & 1u) != 0u;
    let edge1 = select(pair.edge1, pair.edge2, is_second);
    let edge2 = select(pair.edge2, pair.edge3, is_second);
    let outward = normalize(cross(edge1, edge2));
    let back = dot(outward, direction) > 0.0;
    let index = texel.x;
    let head = material_words(index, MATERIAL_FLAGS);
    let flags = head.x;

    var look: Look;
    let base = material_texel(index, MATERIAL_BASE);
    look.base_color = vec4f(base.xyz, bitcast<f32>(head.w));
    if (!MATTE) {
        let f0 = material_texel(index, MATERIAL_F0);
        look.metallic = base.w;
        look.roughness = material_texel(index, MATERIAL_EMISSION).w;
        look.f0 = f0.xyz;
        look.specular = f0.w;
    }
    if (AMBIENT) {
        look.emission = material_texel(index, MATERIAL_EMISSION).xyz;
    }
    look.shading = outward;

    var surface: Surface;
    surface.ior = 1.0;
    if (TRANSMITS && (flags & MATERIAL_LETS_LIGHT_THROUGH) != 0u) {
        let diffuse = material_texel(index, MATERIAL_DIFFUSE_TRANSMISSION);
        let medium = material_texel(index, MATERIAL_ABSORPTION);
        look.transmission = medium.w;
        look.diffuse_transmission = diffuse.w;
        look.diffuse_transmission_color = diffuse.xyz;
        surface.absorption = medium.xyz;
        surface.ior = material_texel(index, MATERIAL_NUMBERS).y;
    }
    // The barycentric coordinates give a point nearer to the plane than origin + t · direction.
    surface.position = pair.corner + hit.barycentric.x * edge1 + hit.barycentric.y * edge2;
    surface.normal = select(outward, -outward, back);
    surface.front = !back;
    surface.bsdf.shading = vec3f(0.0, 0.0, 1.0);
    if (CORNERS && texel.z != NONE) {
        let weights = vec3f(1.0 - hit.barycentric.x - hit.barycentric.y, hit.barycentric);
        surface_texture(&look, index, head.yz, texel.z + select(0u, 6u, is_second), weights, edge1, edge2);
        surface.bsdf.shading = surface_shading(surface.normal, select(look.shading, -look.shading, back));
    }
    var opacity = 1.0;
    if ((flags & MATERIAL_BLEND) != 0u) {
        opacity = look.base_color.w;
    } else if ((flags & MATERIAL_MASK) != 0u) {
        opacity = select(0.0, 1.0, look.base_color.w >= material_texel(index, MATERIAL_NUMBERS).x);
    }

    let one_sided_back = back && (flags & MATERIAL_DOUBLE_SIDED) == 0u;
    surface.black = one_sided_back && (flags & MATERIAL_LETS_LIGHT_THROUGH) == 0u && opacity > 0.0;
    surface.emission = select(look.emission, vec3f(0.0), one_sided_back);

    surface.bsdf.base_color = look.base_color.xyz;
    surface.bsdf.metallic = look.metallic;
    surface.bsdf.f0 = min(look.f0, vec3f(1.0)) * look.specular;
    surface.bsdf.f90 = look.specular;
    surface.bsdf.alpha = look.roughness * look.roughness;
    surface.bsdf.transmission = look.transmission;
    surface.bsdf.diffuse_transmission = look.diffuse_transmission;
    surface.bsdf.opacity = opacity;
    surface.bsdf.diffuse_transmission_color = look.diffuse_transmission_color;
    surface.bsdf.eta_o = select(1.0, surface.ior, back);
    surface.bsdf.eta_t = select(surface.ior, 1.0, back);
    return surface;
}

// The origin of a ray that leaves a surface point on the side of `normal`, offset so far that the ray cannot
// meet the surface again: Wächter and Binder, "A Fast and Robust Method for Avoiding Self-Intersection", Ray
// Tracing Gems, 2019.
fn offset_origin(position: vec3f, normal: vec3f) -> vec3f {
    let steps = vec3i(256.0 * normal);
    let stepped = bitcast<vec3f>(bitcast<vec3i>(position) + select(steps, -steps, position < vec3f(0.0)));
    return select(stepped, position + normal * 0x1p-16f, abs(position) < vec3f(0x1p-5f));
}
