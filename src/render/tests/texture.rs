//! Texture look-ups against a computation on the host.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use super::kernel::{gpu, run};
use crate::render::textures::{GpuTexture, Role, pack_texels, srgb_table};
use crate::scene::{Texture, TextureRef, Wrap, builtin};

/// Texel index of a coordinate that may lie outside `0..size`, by table 8.20 of OpenGL 4.6.
fn wrapped(coordinate: i64, size: i64, wrap: Wrap) -> i64 {
    let mirror = |a: i64| if a >= 0 { a } else { -(1 + a) };
    match wrap {
        Wrap::Repeat => coordinate.rem_euclid(size),
        Wrap::MirroredRepeat => (size - 1) - mirror(coordinate.rem_euclid(2 * size) - size),
        Wrap::ClampToEdge => coordinate.clamp(0, size - 1),
    }
}

fn texel(texture: &Texture, x: i64, y: i64, role: Role) -> [f64; 4] {
    let x = wrapped(x, i64::from(texture.width), texture.wrap[0]);
    let y = wrapped(y, i64::from(texture.height), texture.wrap[1]);
    let [r, g, b, a] =
        texture.texels[(y * i64::from(texture.width) + x) as usize].map(|byte| f64::from(byte) / 255.0);
    let decode = |c: f64| if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) };
    match role {
        Role::BaseColor => [decode(r), decode(g), decode(b), a],
        _ => [r, g, b, a],
    }
}

fn value(texture: &Texture, uv: [f32; 2], role: Role) -> [f64; 4] {
    // In f32 as on the device, so that both choose the same texels.
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
        // Odd and even sides, and one texel.
        let (width, height) = [(5, 3), (4, 7), (1, 2)][scene.textures.len() % 3];
        let texels = (0..width * height).map(|_| random.random::<[u8; 4]>()).collect();
        scene.textures.push(Texture { name: String::new(), width, height, texels, wrap: [u, v], linear });
    }
    let roles = [Role::BaseColor, Role::MetallicRoughness];
    let uses: Vec<(usize, Role)> =
        (0..scene.textures.len()).flat_map(|texture| roles.map(|role| (texture, role))).collect();
    let look_ups: Vec<[f32; 4]> = (0..1 << 16)
        .map(|index| {
            let [u, v] = [random.random_range(-3.0..4.0_f32), random.random_range(-3.0..4.0_f32)];
            [u, v, (index % uses.len()) as f32, 0.0]
        })
        .collect();

    let gpu = gpu();
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
            // Two blends of numbers up to 1, in f32.
            let error = (f64::from(found[c]) - expected[c]).abs();
            assert!(
                error < 8.0 * f64::from(f32::EPSILON),
                "{texture:?} at {u}, {v}: {found:?}, expected {expected:?}"
            );
        }
    }
}
