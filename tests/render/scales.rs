//! Scenes of any size at any place: light is that of the same scene near the origin, of ordinary size.

use crate::common::{rms, settings, tracer};
use glam::{DVec3, Vec3};
use krylux::image::Resolution;
use krylux::render::TraceSettings;
use krylux::scene::{self, Lens, Material, Scene, Volume, builtin};
use krylux::transport::{Channels, Part, assemble};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

/// The photo of white with all light, which is the sums of the matrix's rows.
fn photo(scene: &Scene, settings: &TraceSettings) -> Vec<f64> {
    let traced = assemble(&mut tracer(scene), settings, Channels::Luma).expect("the scene can be traced");
    let mut photo = vec![0.0; settings.resolution.pixels()];
    let pattern = vec![1.0; settings.projector.unwrap_or(settings.resolution).pixels()];
    traced.matrix.apply(Part::Full, 0, &pattern, &mut photo);
    photo
}

/// The scene with all lengths multiplied by a power of two, which is exact.
fn enlarged(scene: &Scene, factor: f32) -> Scene {
    let mut scene = scene.clone();
    for triangle in &mut scene.triangles {
        triangle.positions = triangle.positions.map(|corner| factor * corner);
    }
    for end in std::iter::once(&mut scene.camera).chain(&mut scene.projector) {
        end.position *= factor;
        end.lens = Lens { radius: factor * end.lens.radius, focus: factor * end.lens.focus };
    }
    for volume in scene.materials.iter_mut().filter_map(|material| material.volume.as_mut()) {
        volume.attenuation_distance *= factor;
    }
    scene
}

/// A corner whose left half is behind glass that absorbs.
fn behind_glass() -> Scene {
    let mut scene = builtin::corner().to_scene();
    let volume = Volume { attenuation_color: Vec3::new(0.5, 0.8, 0.9), attenuation_distance: 0.25 };
    let glass = Material {
        roughness: 0.0,
        specular: 1.0,
        transmission: 1.0,
        volume: Some(volume),
        ..Material::default()
    };
    let index = scene.materials.len() as u32;
    scene.materials.push(glass);
    let near = builtin::plane(0.5, 1.0).triangles[0];
    scene.triangles.push(scene::Triangle { material: index, ..near });
    scene
}

#[test]
fn a_scene_times_a_power_of_two_gives_the_same_bits() {
    let apart = |mut scene: Scene| {
        let mut projector = scene.camera.clone();
        projector.position += 0.2 * projector.right;
        projector.lens = Lens { radius: 0.01, focus: 1.25 };
        scene.projector = Some(projector);
        scene
    };
    let scenes = [
        ("corner", builtin::corner().to_scene()),
        ("ball in a mirror", builtin::mirror_ball().to_scene()),
        ("behind glass", behind_glass()),
        ("a projector with a lens, apart", apart(builtin::zigzag().to_scene())),
    ];
    let mut random = Pcg64::seed_from_u64(38);
    for (what, scene) in scenes {
        let settings = settings(12, 16, 5, 1);
        let known = photo(&scene, &settings);
        assert!(rms(&known) > 0.0, "{what}");
        for _ in 0..3 {
            let power: i32 = random.random_range(-30..=26);
            let found = photo(&enlarged(&scene, 2_f32.powi(power)), &settings);
            let found: Vec<f64> = found.iter().map(|value| value * 2_f64.powi(2 * power)).collect();
            assert_eq!(found, known, "{what}, times 2^{power}");
        }
    }
}

/// A corner of three walls as an `.obj` file with its camera file, enlarged and then moved; written in decimals, as exporters do.
fn written(folder: &std::path::Path, scale: f64, place: DVec3) -> Scene {
    let corners = [
        [-0.348, 0.137, 0.137],
        [0.622, 0.137, 0.137],
        [0.622, 0.137, 1.107],
        [-0.348, 0.137, 1.107],
        [-0.348, 0.913, 0.137],
        [0.622, 0.913, 0.137],
        [-0.348, 0.913, 1.107],
    ];
    let at = |corner: [f64; 3]| scale * DVec3::from_array(corner) + place;
    let mut obj = String::new();
    for corner in corners.map(at) {
        obj += &format!("v {} {} {}\n", corner.x, corner.y, corner.z);
    }
    obj += "f 1 4 3 2\nf 1 2 6 5\nf 1 5 7 4\n";
    let [position, look_at] = [[1.301, 1.301, 1.883], [0.04, 0.428, 0.428]].map(at);
    let rig = format!("[camera]\nposition = {position}\nlook_at = {look_at}\nvertical_fov_degrees = 40.0\n");
    let path = folder.join("scene.obj");
    std::fs::write(&path, obj).expect("the folder is ours");
    std::fs::write(folder.join("scene.rig.toml"), rig).expect("the folder is ours");
    let scene = scene::load(&path, None).expect("the scene loads");
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    let camera = scene.origin + scene.camera.position.as_dvec3();
    let error = camera.distance(position);
    assert!(error <= 1e-6 * (scale + scene.camera.position.as_dvec3().length()), "{error} m");
    scene
}

#[test]
fn a_scene_of_any_size_at_any_place_loses_no_light() {
    let folder = tempfile::tempdir().expect("a folder");
    let of = |scale: f64, place: DVec3, seed: u32| -> Vec<f64> {
        let settings = TraceSettings { seed, ..TraceSettings::new(Resolution::new(24, 24), 128) };
        let found = photo(&written(folder.path(), scale, place), &settings);
        found.iter().map(|value| value * scale * scale).collect()
    };
    let known = of(1.0, DVec3::ZERO, 0);
    let apart = |found: &[f64]| rms(&found.iter().zip(&known).map(|(a, b)| a - b).collect::<Vec<_>>());
    let noise = apart(&of(1.0, DVec3::ZERO, 1));
    let total: f64 = known.iter().sum();
    let mut random = Pcg64::seed_from_u64(5);
    for case in 0..10 {
        // Sizes from a micrometre to 100 km, up to 5 million sizes away.
        let scale = 10_f64.powf(random.random_range(-6.0..5.0));
        let mut away = || scale * 10_f64.powf(random.random_range(0.0..6.7)).min(9e8 / scale);
        let place = if case % 2 == 0 { DVec3::ZERO } else { DVec3::new(away(), -away(), away()) };
        let found = of(scale, place, 0);
        let lost = found.iter().sum::<f64>() / total - 1.0;
        // The same paths are traced, but for those whose next surface rounding decides: far fewer than the noise of all.
        assert!(
            lost.abs() < 1e-4 && apart(&found) < 0.2 * noise,
            "{scale} m at {place}: {lost}, {} of {noise}",
            apart(&found)
        );
    }
}
