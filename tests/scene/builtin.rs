//! Tests that the shipped scenes agree with their READMEs, and that the analytic scenes fulfil the conditions
//! of their formulas.

#![allow(clippy::panic, reason = "a failed test panics")]

use std::path::{Path, PathBuf};

use glam::Vec3;
use krylux::image::Resolution;
use krylux::scene::{self, Scene, Triangle, builtin};

fn shipped_path(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/scenes").join(name).join("scene.glb")
}

#[test]
fn shipped_files_equal_the_files_that_the_code_writes() {
    for model in builtin::shipped() {
        let path = shipped_path(model.name);
        let shipped = std::fs::read(&path).expect("every built-in scene is shipped");
        assert!(
            shipped == model.to_glb(),
            "{} is out of date: cargo run --example regenerate_assets",
            path.display()
        );
        assert!(shipped.len() < 300_000, "{} has {} bytes", path.display(), shipped.len());
        assert!(path.with_file_name("README.md").exists(), "{} has no README", model.name);
    }
}

#[test]
fn a_shipped_file_loads_as_the_model_that_it_was_made_from() {
    for model in builtin::shipped() {
        let made = model.to_scene();
        let loaded = scene::load(&shipped_path(model.name), None).expect("shipped scenes load");
        assert_eq!(loaded.triangles, made.triangles, "{}", model.name);
        assert_eq!(loaded.materials, made.materials, "{}", model.name);
        assert_eq!(loaded.regions, made.regions, "{}", model.name);
        assert_eq!(loaded.regions_are_labels, made.regions_are_labels, "{}", model.name);
        assert_eq!(loaded.warnings, made.warnings, "{}", model.name);
        let [mut a, b] = [loaded.camera, made.camera];
        // The file stores the angle instead of its tangent, which rounds twice.
        assert!((a.tan_half_fov - b.tan_half_fov).abs() < 2e-7, "{}", model.name);
        a.tan_half_fov = b.tan_half_fov;
        assert_eq!(a, b, "{}", model.name);
    }
}

/// Distance along the ray to the triangle, in units of `direction`.
fn hit(triangle: &Triangle, origin: Vec3, direction: Vec3) -> Option<f32> {
    let [a, b, c] = triangle.positions;
    let [ab, ac] = [b - a, c - a];
    let p = direction.cross(ac);
    let determinant = ab.dot(p);
    if determinant.abs() < 1e-12 {
        return None;
    }
    let s = origin - a;
    let u = s.dot(p) / determinant;
    let q = s.cross(ab);
    let v = direction.dot(q) / determinant;
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0).then(|| ac.dot(q) / determinant)
}

/// The triangle that the camera sees at a raster point.
fn seen(scene: &Scene, u: f32, v: f32, resolution: Resolution) -> Option<&Triangle> {
    let direction = scene.camera.ray_direction(u, v, resolution);
    scene
        .triangles
        .iter()
        .filter_map(|triangle| Some((hit(triangle, scene.camera.position, direction)?, triangle)))
        .filter(|(distance, _)| *distance > 0.0)
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, triangle)| triangle)
}

/// The region seen at each pixel's centre.
fn region_map(scene: &Scene, resolution: Resolution) -> Vec<Option<u32>> {
    (0..resolution.pixels())
        .map(|pixel| {
            let [u, v] = [pixel % resolution.width, pixel / resolution.width].map(|at| at as f32 + 0.5);
            seen(scene, u, v, resolution).map(|triangle| triangle.region)
        })
        .collect()
}

#[test]
fn two_region_scenes_fill_the_view_with_their_halves() {
    let resolution = Resolution::new(32, 32);
    for model in [builtin::zigzag(), builtin::corner(), builtin::two_sheets()] {
        for (pixel, region) in region_map(&model.to_scene(), resolution).into_iter().enumerate() {
            assert_eq!(region, Some(u32::from(pixel % 32 >= 16)), "{}: pixel {pixel}", model.name);
        }
    }
}

#[test]
fn every_cup_of_the_carton_fills_its_part_of_the_view() {
    for scene in [builtin::carton().to_scene(), builtin::carton_eggs().to_scene()] {
        for (pixel, region) in region_map(&scene, Resolution::new(24, 24)).into_iter().enumerate() {
            let [column, row] = [pixel % 24 / 8, pixel / 24 / 6];
            assert_eq!(region, Some((row * 3 + column) as u32), "{}: pixel {pixel}", scene.path.display());
        }
    }
}

#[test]
fn every_second_cup_shows_an_egg() {
    let [empty, full] = [builtin::carton().to_scene(), builtin::carton_eggs().to_scene()];
    let resolution = Resolution::new(64, 64);
    for cup in 0..12 {
        let [column, row] = [cup % 3, cup / 3];
        // The point is next to the centre of an egg's top, so that the ray does not hit an edge.
        let top = Vec3::new(0.2 * (column as f32 - 1.0) + 0.003, -0.02, 0.15 * (row as f32 - 1.5) + 0.002);
        let (u, v) = full.camera.project(top, resolution).expect("the carton lies before the camera");
        let height = |scene| seen(scene, u, v, resolution).expect("the carton fills the view").positions[0].y;
        let has_egg = height(&full) > height(&empty) + 0.04;
        assert_eq!(has_egg, (column + row) % 2 == 0, "cup {cup}");
    }
}

/// Whether light can pass from the front of one triangle to the front of another. Segments between four
/// points of each are tested.
fn exchange_light(scene: &Scene, a: &Triangle, b: &Triangle) -> bool {
    let normal = |triangle: &Triangle| {
        let [p, q, r] = triangle.positions;
        (q - p).cross(r - p).normalize()
    };
    let points = |triangle: &Triangle| {
        let [p, q, r] = triangle.positions;
        [(0.34, 0.33), (0.9, 0.05), (0.05, 0.9), (0.05, 0.05)].map(|(s, t)| p + s * (q - p) + t * (r - p))
    };
    points(a).into_iter().any(|from| {
        points(b).into_iter().any(|to| {
            let direction = to - from;
            // For surfaces in one plane, rounding gives cosines below 1e-4.
            let cosines = [normal(a).dot(direction), -normal(b).dot(direction)];
            cosines.iter().all(|cosine| *cosine > 1e-4 * direction.length())
                && !scene
                    .triangles
                    .iter()
                    .filter_map(|triangle| hit(triangle, from, direction))
                    .any(|distance| (1e-4..1.0 - 1e-4).contains(&distance))
        })
    })
}

#[test]
fn separate_regions_exchange_no_light() {
    for (model, stride) in [
        (builtin::zigzag(), 1),
        (builtin::two_sheets(), 1),
        (builtin::carton(), 23),
        (builtin::carton_eggs(), 31),
    ] {
        let scene = model.to_scene();
        let sample: Vec<&Triangle> = scene.triangles.iter().step_by(stride).collect();
        let mut within = 0;
        for (index, a) in sample.iter().enumerate() {
            for b in &sample[index + 1..] {
                if a.region == b.region {
                    within += usize::from(within < 10 && exchange_light(&scene, a, b));
                } else {
                    assert!(!exchange_light(&scene, a, b), "{}: {a:?} and {b:?}", model.name);
                }
            }
        }
        assert!(within > 0, "{}: light bounces within a region", model.name);
    }
}

#[test]
fn the_tessellated_box_has_the_requested_number_of_triangles_and_fills_the_view() {
    for (asked, expected) in [(1, 10), (100, 90), (1000, 1000), (100_000, 100_000), (1_000_000, 998_560)] {
        assert_eq!(builtin::tessellated_box(asked).triangles.len(), expected);
    }
    let scene = builtin::tessellated_box(1000);
    let resolution = Resolution::new(16, 16);
    assert!(region_map(&scene, resolution).iter().all(Option::is_some), "every ray hits the box");
    let inwards = scene.triangles.iter().all(|triangle| {
        let [a, b, c] = triangle.positions;
        (b - a).cross(c - a).dot(Vec3::new(0.0, 0.0, -0.5) - a) > 0.0
    });
    assert!(inwards, "fronts face the inside");
}

#[test]
fn the_plane_is_fronto_parallel_and_fills_the_view() {
    let scene = builtin::plane(2.0, 0.5);
    assert!(
        scene.triangles.iter().flat_map(|triangle| triangle.positions).all(|position| position.z == -2.0)
    );
    assert_eq!(scene.materials[0].base_color, Vec3::splat(0.5));
    assert!(region_map(&scene, Resolution::new(16, 4)).iter().all(Option::is_some));
}

#[test]
fn the_camera_sees_the_inner_faces_of_both_parallel_plates() {
    let scene = builtin::parallel_plates(1.0, 0.5, 0.8);
    let [left, right] = [&scene.triangles[0], &scene.triangles[2]];
    assert!(left.positions.iter().all(|position| position.x == -0.25));
    assert!(right.positions.iter().all(|position| position.x == 0.25));
    let map = region_map(&scene, Resolution::new(32, 32));
    for region in [0, 1] {
        // Each plate covers more than a tenth of the picture.
        assert!(map.iter().filter(|seen| **seen == Some(region)).count() > 100);
    }
    let resolution = Resolution::new(32, 32);
    for position in scene.triangles.iter().flat_map(|triangle| triangle.positions) {
        let (u, v) = scene.camera.project(position, resolution).expect("the plates lie before the camera");
        assert!((0.0..32.0).contains(&u) && (0.0..32.0).contains(&v), "{position} is out of view");
    }
}

#[test]
fn the_sphere_is_closed_and_faces_the_camera_in_its_centre() {
    for subdivisions in 0..4 {
        let scene = builtin::inside_sphere(3.0, subdivisions, 0.8);
        assert_eq!(scene.triangles.len(), 20 * 4_usize.pow(subdivisions));
        let mut solid_angle = 0.0;
        for triangle in &scene.triangles {
            let [a, b, c] = triangle.positions.map(|position| position.as_dvec3());
            assert!((a.length() - 3.0).abs() < 1e-6, "vertices lie on the sphere");
            assert!((b - a).cross(c - a).dot(a) < 0.0, "fronts face the centre");
            // The solid angle of a triangle by Van Oosterom and Strackee, 1983.
            let [a, b, c] = [a, b, c].map(|corner| corner.normalize());
            let numerator = a.dot(b.cross(c)).abs();
            solid_angle += 2.0 * numerator.atan2(1.0 + a.dot(b) + b.dot(c) + c.dot(a));
        }
        // The tolerance allows for the rounding of the vertices of up to 1280 triangles to single precision.
        assert!((solid_angle - 4.0 * std::f64::consts::PI).abs() < 1e-4, "{solid_angle}");
    }
}

#[test]
fn different_scenes_in_memory_have_different_hashes() {
    let plane = |distance, albedo| builtin::plane(distance, albedo).hash;
    assert_eq!(plane(1.0, 0.8), plane(1.0, 0.8));
    assert_ne!(plane(1.0, 0.8), plane(2.0, 0.8));
    assert_ne!(plane(1.0, 0.8), plane(1.0, 0.7));
}
