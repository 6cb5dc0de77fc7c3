//! Shading normals: those of vertices, bent by normal maps.

use glam::{Affine2, DMat2, DVec2, DVec3, Vec2, Vec3, vec2, vec3};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use super::{FRONT, assert_close, look, scene, texture};
use crate::render::tests::kernel::gpu;
use crate::scene::{Material, TextureRef, Triangle};

#[test]
fn vertex_normals_are_blended_on_the_rays_side_and_above_the_horizon() {
    let gpu = gpu();
    let mut scene = scene(Material::default());
    let normals = [vec3(0.6, 0.0, 0.8), vec3(0.0, -0.8, 0.6), vec3(-0.28, 0.96, 0.0)];
    scene.triangles[0].normals = normals;
    let [b, c] = [0.5, 0.125];
    let found = look(&gpu, &scene, &[(Vec3::NEG_Z, [b, c]), (Vec3::Z, [b, c]), (Vec3::NEG_Z, [0.0, 1.0])]);
    let blended = ((1.0 - b - c) * normals[0] + b * normals[1] + c * normals[2]).normalize();
    // Coordinates of 16 bits.
    assert_close(found[0].shading, blended, 1e-4);
    assert_close(found[1].shading, -blended, 1e-4);
    // The third normal lies in the horizon, and is lifted a little.
    assert_close(found[2].shading, vec3(-0.28, 0.96, 0.01).normalize(), 1e-4);

    scene.triangles[0].normals = [Vec3::ZERO; 3];
    assert_eq!(look(&gpu, &scene, &[FRONT])[0].shading, Vec3::Z);
}

/// The shading normal of a normal map by glTF's definition: +X of the map along u and +Y against v (which
/// runs downwards), in the plane perpendicular to the smooth normal.
fn bumped(triangle: &Triangle, map: Affine2, normal: DVec3, bump: DVec3) -> DVec3 {
    let [a, b, c] = triangle.positions.map(Vec3::as_dvec3);
    let uv = triangle.texcoords.map(|[_, second]| map.transform_point2(second).as_dvec2());
    // Edges are a linear map of their coordinates' differences; its columns are the gradients.
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
    let gpu = gpu();
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
        // Every second picture is mirrored.
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
