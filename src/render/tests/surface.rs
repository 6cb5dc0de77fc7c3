//! Compares the surface at a hit point, its shading normal and its textures with values that the host computes from the scene.

use glam::{Affine2, DMat2, DVec2, DVec3, Vec2, Vec3, vec2, vec3};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use super::support::run;
use crate::gpu::Gpu;
use crate::render::geometry::GpuScene;
use crate::render::materials::{GpuTexture, TextureRole, pack_texels, srgb_table};
use crate::scene::{AlphaMode, Material, Scene, Texture, TextureRef, Triangle, Volume, Wrap, builtin};

/// The result of `surface_at`, with the names of `shaders/shared/surface.wgsl`.
#[derive(Clone, Copy, Debug)]
struct Found {
    base_color: Vec3,
    opacity: f32,
    metallic: f32,
    alpha: f32,
    f90: f32,
    transmission: f32,
    f0: Vec3,
    diffuse_transmission: f32,
    diffuse_transmission_color: Vec3,
    shading: Vec3,
    normal: Vec3,
    front: bool,
    emission: Vec3,
    black: bool,
    absorption: Vec3,
    ior: f32,
    eta: [f32; 2],
}

const FIELDS: usize = 9;

const SOURCE: &str = "#import surface
fn work(index: u32) -> vec4f {
    let ray = input[2u * (index / 9u)];
    let at = input[2u * (index / 9u) + 1u];
    let s = surface_at(Hit(0u, 1.0, at.xy), ray.xyz);
    switch (index % 9u) {
        case 0u: { return vec4f(s.bsdf.base_color, s.bsdf.opacity); }
        case 1u: { return vec4f(s.bsdf.metallic, s.bsdf.alpha, s.bsdf.f90, s.bsdf.transmission); }
        case 2u: { return vec4f(s.bsdf.f0, s.bsdf.diffuse_transmission); }
        case 3u: { return vec4f(s.bsdf.diffuse_transmission_color, 0.0); }
        case 4u: { return vec4f(to_world(frame_around(s.normal), s.bsdf.shading), 0.0); }
        case 5u: { return vec4f(s.normal, select(0.0, 1.0, s.front)); }
        case 6u: { return vec4f(s.emission, select(0.0, 1.0, s.black)); }
        case 7u: { return vec4f(s.absorption, s.ior); }
        default: { return vec4f(s.bsdf.eta_o, s.bsdf.eta_t, 0.0, 0.0); }
    }
}";

/// The surfaces that rays find on the scene's only triangle. Each ray is given by a direction, and by the weights of the second and third
/// corner at its hit point.
fn look(gpu: &Gpu, scene: &Scene, rays: &[(Vec3, [f32; 2])]) -> Vec<Found> {
    let uploaded = GpuScene::upload(gpu, scene).expect("one triangle fits");
    let view = wgpu::BindingResource::TextureView;
    let shared = [
        (2, view(&uploaded.pairs)),
        (3, view(&uploaded.materials)),
        (4, view(&uploaded.corners)),
        (5, uploaded.textures.as_entire_binding()),
        (6, view(&uploaded.texels)),
        (7, uploaded.srgb_table.as_entire_binding()),
    ];
    let input: Vec<[f32; 4]> = rays
        .iter()
        .flat_map(|(direction, at)| [direction.extend(0.0).to_array(), [at[0], at[1], 0.0, 0.0]])
        .collect();
    let values = run(gpu, SOURCE, &shared, &input, FIELDS * rays.len());
    let xyz = |v: [f32; 4]| vec3(v[0], v[1], v[2]);
    let found = |v: &[[f32; 4]]| Found {
        base_color: xyz(v[0]),
        opacity: v[0][3],
        metallic: v[1][0],
        alpha: v[1][1],
        f90: v[1][2],
        transmission: v[1][3],
        f0: xyz(v[2]),
        diffuse_transmission: v[2][3],
        diffuse_transmission_color: xyz(v[3]),
        shading: xyz(v[4]),
        normal: xyz(v[5]),
        front: v[5][3] != 0.0,
        emission: xyz(v[6]),
        black: v[6][3] != 0.0,
        absorption: xyz(v[7]),
        ior: v[7][3],
        eta: [v[8][0], v[8][1]],
    };
    values.chunks_exact(FIELDS).map(found).collect()
}

/// A scene of one triangle with this material. The triangle faces the pinhole in the plane z = −2.
fn scene(material: Material) -> Scene {
    let corners = [vec3(0.0, 0.0, -2.0), vec3(1.0, 0.0, -2.0), vec3(0.0, 1.0, -2.0)];
    Scene {
        triangles: vec![Triangle::flat(corners, 0, 0)],
        materials: vec![material],
        ..builtin::plane(1.0, 1.0)
    }
}

fn texture(texel: [u8; 4]) -> Texture {
    let name = String::new();
    Texture { name, width: 1, height: 1, texels: vec![texel], wrap: [Wrap::Repeat; 2], linear: true }
}

const FRONT: (Vec3, [f32; 2]) = (Vec3::NEG_Z, [0.25, 0.25]);
const BACK: (Vec3, [f32; 2]) = (Vec3::Z, [0.25, 0.25]);

#[track_caller]
fn assert_close(found: Vec3, expected: Vec3, tolerance: f32) {
    assert!(found.distance(expected) <= tolerance, "{found} is not {expected}");
}

#[test]
fn each_texture_multiplies_its_own_factor() {
    let texture_of = |index| Some(TextureRef::new(index));
    let volume = Volume { attenuation_color: Vec3::splat(0.5), attenuation_distance: 1.0 };
    let mut scene = scene(Material {
        base_color: vec3(0.5, 1.0, 1.0),
        base_color_texture: texture_of(0),
        opacity: 0.5,
        alpha_mode: AlphaMode::Blend,
        metallic: 0.5,
        roughness: 0.5,
        metallic_roughness_texture: texture_of(1),
        specular: 0.5,
        specular_texture: texture_of(2),
        specular_color: vec3(1.0, 2.0, 100.0),
        specular_color_texture: texture_of(3),
        emission: vec3(1.0, 2.0, 3.0),
        emission_texture: texture_of(4),
        transmission: 0.5,
        transmission_texture: texture_of(5),
        diffuse_transmission: 0.5,
        diffuse_transmission_texture: texture_of(6),
        diffuse_transmission_color: vec3(1.0, 0.5, 1.0),
        diffuse_transmission_color_texture: texture_of(7),
        volume: Some(volume),
        ..Material::default()
    });
    scene.textures = vec![
        texture([255, 188, 0, 51]),
        texture([9, 204, 102, 9]),
        texture([9, 9, 9, 102]),
        texture([255, 188, 255, 9]),
        texture([188, 255, 0, 9]),
        texture([102, 9, 9, 9]),
        texture([9, 9, 9, 204]),
        texture([255, 255, 188, 9]),
    ];
    scene.triangles[0].colors = [[65535, 65535, 0, 0], [65535, 65535, 0, 65535], [65535; 4]];
    let found = look(&Gpu::for_tests(), &scene, &[FRONT])[0];
    // The linear value of the sRGB byte 188 (IEC 61966-2-1).
    let half = (((188.0 / 255.0) + 0.055) / 1.055_f32).powf(2.4);
    // The tolerance is a few roundings of numbers up to 3.
    let tolerance = 1e-6;
    assert_close(found.base_color, vec3(0.5, half, 0.0), tolerance);
    // The two opaque corners have weights of 0.25 each. The texture's opacity is 0.2, and the material's factor is 0.5.
    assert!((found.opacity - 0.5 * 0.2 * 0.5).abs() < tolerance, "{found:?}");
    assert!((found.metallic - 0.5 * 0.4).abs() < tolerance, "{found:?}");
    assert!((found.alpha - (0.5_f32 * 0.8).powi(2)).abs() < tolerance, "{found:?}");
    assert!((found.f90 - 0.5 * 0.4).abs() < tolerance, "{found:?}");
    // F₀ = min(0.04 · colour, 1) · specular.
    assert_close(found.f0, 0.2 * vec3(0.04, 0.08 * half, 1.0), tolerance);
    assert_close(found.emission, vec3(half, 2.0, 0.0), tolerance);
    assert!((found.transmission - 0.5 * 0.4).abs() < tolerance, "{found:?}");
    assert!((found.diffuse_transmission - 0.5 * 0.8).abs() < tolerance, "{found:?}");
    assert_close(found.diffuse_transmission_color, vec3(1.0, 0.5, half), tolerance);
    // Half of the light is left after 1 m. The triangle is 2 m to 4 m away, so the unit of length is 2 m (`render::geometry`).
    assert_close(found.absorption, Vec3::splat(2.0 * 2.0_f32.ln()), tolerance);
}

#[test]
fn the_alpha_mode_decides_the_effect_of_the_opacity() {
    let gpu = Gpu::for_tests();
    let opacity = |alpha_mode, opacity| {
        look(&gpu, &scene(Material { alpha_mode, opacity, ..Material::default() }), &[FRONT])[0].opacity
    };
    assert_eq!(opacity(AlphaMode::Opaque, 0.25), 1.0);
    assert_eq!(opacity(AlphaMode::Blend, 0.25), 0.25);
    let mask = AlphaMode::Mask { cutoff: 0.5 };
    assert_eq!([opacity(mask, 0.25), opacity(mask, 0.5)], [0.0, 1.0]);
}

#[test]
fn the_back_of_a_one_sided_opaque_surface_is_black() {
    let gpu = Gpu::for_tests();
    let one_sided = Material { double_sided: false, emission: Vec3::ONE, ..Material::default() };
    let sides = |material: Material| {
        let found = look(&gpu, &scene(material), &[FRONT, BACK]);
        assert_eq!((found[0].front, found[1].front), (true, false));
        assert_eq!((found[0].normal, found[1].normal), (Vec3::Z, Vec3::NEG_Z));
        assert_eq!((found[0].black, found[0].emission), (false, Vec3::ONE));
        (found[1].black, found[1].emission)
    };
    assert_eq!(sides(one_sided.clone()), (true, Vec3::ZERO));
    assert_eq!(sides(Material { double_sided: true, ..one_sided.clone() }), (false, Vec3::ONE));
    for through in [
        Material { transmission: 0.5, ..one_sided.clone() },
        Material { diffuse_transmission: 0.5, ..one_sided.clone() },
        Material { alpha_mode: AlphaMode::Blend, ..one_sided.clone() },
        // The back is invisible where the mask has a hole.
        Material { alpha_mode: AlphaMode::Mask { cutoff: 2.0 }, ..one_sided },
    ] {
        assert_eq!(sides(through), (false, Vec3::ZERO));
    }
}

#[test]
fn media_lie_behind_the_front() {
    let gpu = Gpu::for_tests();
    let volume = Volume { attenuation_color: vec3(0.5, 1.0, 1.0), attenuation_distance: 2.0 };
    let solid = Material { transmission: 1.0, volume: Some(volume), ior: 1.25, ..Material::default() };
    let found = look(&gpu, &scene(solid.clone()), &[FRONT, BACK]);
    assert_eq!((found[0].eta, found[1].eta), ([1.0, 1.25], [1.25, 1.0]));
    for side in found {
        // The triangle is 2 m to 4 m away, so the unit of length is 2 m (`render::geometry`).
        assert_eq!((side.ior, side.absorption), (1.25, 2.0 * volume.absorption()));
    }
    for thin in [Material { volume: None, ..solid.clone() }, Material { transmission: 0.0, ..solid }] {
        let found = look(&gpu, &scene(thin), &[FRONT, BACK]);
        assert!(found.iter().all(|side| side.eta == [1.0; 2] && side.ior == 1.0), "{found:?}");
        assert!(found.iter().all(|side| side.absorption == Vec3::ZERO), "{found:?}");
    }
}

#[test]
fn vertex_normals_are_blended_on_the_rays_side_and_above_the_horizon() {
    let gpu = Gpu::for_tests();
    let mut scene = scene(Material::default());
    let normals = [vec3(0.6, 0.0, 0.8), vec3(0.0, -0.8, 0.6), vec3(-0.28, 0.96, 0.0)];
    scene.triangles[0].normals = normals;
    let [b, c] = [0.5, 0.125];
    let found = look(&gpu, &scene, &[(Vec3::NEG_Z, [b, c]), (Vec3::Z, [b, c]), (Vec3::NEG_Z, [0.0, 1.0])]);
    let blended = ((1.0 - b - c) * normals[0] + b * normals[1] + c * normals[2]).normalize();
    // The tolerance covers coordinates of 16 bits.
    assert_close(found[0].shading, blended, 1e-4);
    assert_close(found[1].shading, -blended, 1e-4);
    // The third normal is tangential to the surface, and is lifted a little.
    assert_close(found[2].shading, vec3(-0.28, 0.96, 0.01).normalize(), 1e-4);

    scene.triangles[0].normals = [Vec3::ZERO; 3];
    assert_eq!(look(&gpu, &scene, &[FRONT])[0].shading, Vec3::Z);
}

/// The shading normal of a normal map by glTF's definition: +X of the map points along u, and +Y against v (which runs downwards), in the
/// plane perpendicular to the smooth normal.
fn bumped(triangle: &Triangle, map: Affine2, normal: DVec3, bump: DVec3) -> DVec3 {
    let [a, b, c] = triangle.positions.map(Vec3::as_dvec3);
    let uv = triangle.texcoords.map(|[_, second]| map.transform_point2(second).as_dvec2());
    // The edges are a linear function of the differences of texture coordinates. The columns of its matrix are the gradients.
    let coordinates = DMat2::from_cols(uv[1] - uv[0], uv[2] - uv[0]).inverse();
    let along = |w: DVec2| {
        let weights = coordinates * w;
        weights.x * (b - a) + weights.y * (c - a)
    };
    let tangent = along(DVec2::X).reject_from(normal).normalize();
    let upwards = -along(DVec2::Y);
    let across = normal.cross(tangent);
    let bitangent = if across.dot(upwards) < 0.0 { -across } else { across };
    (bump.x * tangent + bump.y * bitangent + bump.z * normal).normalize()
}

#[test]
fn normal_maps_bend_the_smooth_normal_in_the_frame_of_their_coordinates() {
    let gpu = Gpu::for_tests();
    let mut random = Pcg64::seed_from_u64(7);
    let mut number = |low: f32, high: f32| random.random_range(low..high);
    for case in 0..12 {
        let map = Affine2::from_scale_angle_translation(
            vec2(number(0.5, 2.0), number(0.5, 2.0)),
            number(-3.0, 3.0),
            vec2(number(-1.0, 1.0), 0.0),
        );
        let reference = TextureRef { texture: 0, set: 1, transform: map };
        let mut scene =
            scene(Material { normal_texture: Some(reference), normal_scale: 0.5, ..Material::default() });
        let texel = [number(0.0, 255.0) as u8, number(0.0, 255.0) as u8, 230, 255];
        scene.textures = vec![texture(texel)];
        let triangle = &mut scene.triangles[0];
        triangle.positions =
            triangle.positions.map(|p| p + Vec3::splat(number(-0.2, 0.2)) * vec3(1.0, 1.0, -2.0));
        // Every second texture is mirrored.
        let mirror = if case % 2 == 0 { 1.0 } else { -1.0 };
        triangle.texcoords = [vec2(0.0, 0.0), vec2(mirror, 0.2), vec2(0.3 * mirror, -1.0)]
            .map(|uv| [Vec2::ZERO, uv + vec2(0.1 * number(-1.0, 1.0), 0.0)]);
        let [a, b, c] = triangle.positions;
        let flat = (b - a).cross(c - a).normalize();
        let tilted = if case < 6 { flat } else { (flat + vec3(0.3, -0.2, 0.0)).normalize() };
        triangle.normals = [tilted; 3];
        let triangle = *triangle;

        let [x, y, z, _] = texel.map(|byte| 2.0 * f64::from(byte) / 255.0 - 1.0);
        let bump = DVec3::new(0.5 * x, 0.5 * y, z);
        let expected = bumped(&triangle, map, tilted.as_dvec3(), bump).as_vec3();
        let found = look(&gpu, &scene, &[(-flat, [0.3, 0.3]), (flat, [0.3, 0.3])]);
        // The smooth normal has coordinates of 16 bits.
        assert_close(found[0].shading, expected, 2e-4);
        assert_close(found[1].shading, -expected, 2e-4);
    }
}

/// The texel index for a coordinate that may lie outside `0..size`, by table 8.20 of OpenGL 4.6.
fn wrapped(coordinate: i64, size: i64, wrap: Wrap) -> i64 {
    let mirror = |a: i64| if a >= 0 { a } else { -(1 + a) };
    match wrap {
        Wrap::Repeat => coordinate.rem_euclid(size),
        Wrap::MirroredRepeat => (size - 1) - mirror(coordinate.rem_euclid(2 * size) - size),
        Wrap::ClampToEdge => coordinate.clamp(0, size - 1),
    }
}

fn texel(texture: &Texture, x: i64, y: i64, role: TextureRole) -> [f64; 4] {
    let x = wrapped(x, i64::from(texture.width), texture.wrap[0]);
    let y = wrapped(y, i64::from(texture.height), texture.wrap[1]);
    let [r, g, b, a] =
        texture.texels[(y * i64::from(texture.width) + x) as usize].map(|byte| f64::from(byte) / 255.0);
    let decode = |c: f64| if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) };
    match role {
        TextureRole::BaseColor => [decode(r), decode(g), decode(b), a],
        _ => [r, g, b, a],
    }
}

fn value(texture: &Texture, uv: [f32; 2], role: TextureRole) -> [f64; 4] {
    // The computation uses f32, as on the device, so host and device choose the same texels.
    let [x, y] = [uv[0] * texture.width as f32, uv[1] * texture.height as f32];
    if !texture.linear {
        return texel(texture, x.floor() as i64, y.floor() as i64, role);
    }
    let [left, top] = [(x - 0.5).floor(), (y - 0.5).floor()];
    let [s, t] = [f64::from(x - 0.5 - left), f64::from(y - 0.5 - top)];
    let [i, j] = [left as i64, top as i64];
    let corners = [(i, j), (i + 1, j), (i, j + 1), (i + 1, j + 1)].map(|(x, y)| texel(texture, x, y, role));
    let weights = [(1.0 - s) * (1.0 - t), s * (1.0 - t), (1.0 - s) * t, s * t];
    [0, 1, 2, 3].map(|c| (0..4).map(|k| weights[k] * corners[k][c]).sum())
}

#[test]
fn textures_are_filtered_and_wrapped_as_gltf_defines() {
    let mut random = Pcg64::seed_from_u64(1);
    let wraps = [Wrap::Repeat, Wrap::MirroredRepeat, Wrap::ClampToEdge];
    let mut scene = builtin::plane(1.0, 1.0);
    for (u, v, linear) in
        wraps.iter().flat_map(|u| wraps.iter().flat_map(move |v| [(*u, *v, true), (*u, *v, false)]))
    {
        // Odd sides, even sides, and a side of one texel occur.
        let (width, height) = [(5, 3), (4, 7), (1, 2)][scene.textures.len() % 3];
        let texels = (0..width * height).map(|_| random.random::<[u8; 4]>()).collect();
        scene.textures.push(Texture { name: String::new(), width, height, texels, wrap: [u, v], linear });
    }
    let roles = [TextureRole::BaseColor, TextureRole::MetallicRoughness];
    let uses: Vec<(usize, TextureRole)> =
        (0..scene.textures.len()).flat_map(|texture| roles.map(|role| (texture, role))).collect();
    let look_ups: Vec<[f32; 4]> = (0..1 << 16)
        .map(|index| {
            let [u, v] = [random.random_range(-3.0..4.0_f32), random.random_range(-3.0..4.0_f32)];
            [u, v, (index % uses.len()) as f32, 0.0]
        })
        .collect();

    let gpu = Gpu::for_tests();
    let textures: Vec<GpuTexture> = uses
        .iter()
        .map(|&(texture, role)| GpuTexture::new(&scene, &TextureRef::new(texture as u32), role))
        .collect();
    let textures = gpu.storage("texture descriptions", &textures).expect("small");
    let texels = gpu.texel_array("textures", &pack_texels(&scene)).expect("small");
    let table = gpu.storage("sRGB table", &srgb_table()).expect("small");
    let source = "#import texture
        fn work(index: u32) -> vec4f {
            return texture_value(textures[u32(input[index].z)], input[index].xy);
        }";
    let shared = [
        (5, textures.as_entire_binding()),
        (6, wgpu::BindingResource::TextureView(&texels)),
        (7, table.as_entire_binding()),
    ];
    let found = run(&gpu, source, &shared, &look_ups, look_ups.len());
    for (&[u, v, index, _], found) in look_ups.iter().zip(&found) {
        let (texture, role) = uses[index as usize];
        let texture = &scene.textures[texture];
        let expected = value(texture, [u, v], role);
        for c in 0..4 {
            // The tolerance covers two blends of numbers up to 1, in f32.
            let error = (f64::from(found[c]) - expected[c]).abs();
            assert!(
                error < 8.0 * f64::from(f32::EPSILON),
                "{texture:?} at {u}, {v}: {found:?}, expected {expected:?}"
            );
        }
    }
}
