// What a ray finds where it hits: position, normal and BSDF.
#import parameters
#import bvh
#import bsdf
#import texture

// Laid out as `render::materials::GpuMaterial`; a test compares the two.
struct Material {
    base_color: vec3f,
    metallic: f32,
    f0: vec3f,
    f90: f32,
    emission: vec3f,
    alpha: f32,
    // Index of the base colour texture, or NONE.
    texture: u32,
    double_sided: u32,
    padding: vec2u,
}

@group(0) @binding(3) var<storage, read> materials: array<Material>;
// Three corners' (u, v) a triangle, in leaf order.
@group(0) @binding(4) var<storage, read> texcoords: array<vec2f>;

struct Surface {
    position: vec3f,
    // Geometric, on the side that the ray came from.
    normal: vec3f,
    emission: vec3f,
    // The back of a one-sided surface: no light comes from it.
    black: bool,
    // The ray met the front.
    front: bool,
    // Of the medium behind the front, per metre; and its refractive index, 1 where there is none.
    absorption: vec3f,
    ior: f32,
    bsdf: Bsdf,
}

fn surface_at(hit: Hit, direction: vec3f) -> Surface {
    let texel0 = bvh_triangle_texel(3u * hit.triangle);
    let edge1 = bitcast<vec3f>(bvh_triangle_texel(3u * hit.triangle + 1u).xyz);
    let edge2 = bitcast<vec3f>(bvh_triangle_texel(3u * hit.triangle + 2u).xyz);
    let outward = normalize(cross(edge1, edge2));
    let back = dot(outward, direction) > 0.0;
    let material = materials[texel0.w];

    var surface: Surface;
    // From the barycentric coordinates: nearer to the plane than origin + t · direction.
    surface.position = bitcast<vec3f>(texel0.xyz) + hit.barycentric.x * edge1 + hit.barycentric.y * edge2;
    surface.normal = select(outward, -outward, back);
    surface.front = !back;
    surface.ior = 1.0;
    surface.black = back && material.double_sided == 0u;
    surface.emission = select(material.emission, vec3f(0.0), surface.black);
    surface.bsdf = Bsdf(
        material.base_color, material.metallic, material.f0, material.f90, material.alpha,
        0.0, 0.0, 1.0, vec3f(0.0), 1.0, 1.0, vec3f(0.0, 0.0, 1.0),
    );
    if (material.texture != NONE) {
        let uv = (1.0 - hit.barycentric.x - hit.barycentric.y) * texcoords[3u * hit.triangle]
            + hit.barycentric.x * texcoords[3u * hit.triangle + 1u]
            + hit.barycentric.y * texcoords[3u * hit.triangle + 2u];
        surface.bsdf.base_color *= texture_color(material.texture, uv);
    }
    return surface;
}

// A point just off the surface, on the side of its normal, from which a ray meets the surface no more: Wächter and
// Binder, "A Fast and Robust Method for Avoiding Self-Intersection", Ray Tracing Gems, 2019.
fn surface_leave(position: vec3f, normal: vec3f) -> vec3f {
    let steps = vec3i(256.0 * normal);
    let stepped = bitcast<vec3f>(bitcast<vec3i>(position) + select(steps, -steps, position < vec3f(0.0)));
    return select(stepped, position + normal * 0x1p-16f, abs(position) < vec3f(0x1p-5f));
}
