//! Scenes that lie far from the origin of their file.

use crate::scene_support::{document, set, write, write_files};
use glam::{DVec3, dvec3};
use krylux::scene::{self, LoadOptions, Scene};
use serde_json::json;

/// The document's triangle and camera, `at` far from the origin, with a node's translation for all of it or in the buffer itself.
fn far(at: [f64; 3]) -> Scene {
    let mut document = document();
    for node in 0..2 {
        set(&mut document, &format!("/nodes/{node}/translation"), json!(at));
    }
    scene::load(&write(&document).path, None).expect("the scene loads")
}

#[test]
fn nodes_far_away_are_placed_in_double_precision() {
    // The step of single precision is 0.5 m there.
    let at = [4_500_000.123, 12.25, -6_000_000.375];
    let (scene, near) = (far(at), far([0.0; 3]));
    assert!((scene.origin - DVec3::from_array(at)).length() < 1e-9, "{}", scene.origin);
    for (found, known) in scene.triangles[0].positions.iter().zip(near.triangles[0].positions) {
        let found = *found - scene.camera.position;
        assert!(found.distance(known - near.camera.position) < 1e-6, "{found}");
    }
    assert_eq!(near.origin, DVec3::ZERO);
    assert!(scene.warnings.is_empty(), "the mesh itself is near its node: {:?}", scene.warnings);
}

/// An `.obj` file of a house of 8 m whose corners are written with these digits after the point.
fn house(at: DVec3, round: impl Fn(f64) -> f64) -> Scene {
    let mut obj = String::new();
    for index in 0..200 {
        let turn = f64::from(index) * 0.7;
        let corner = at + dvec3(4.0 * turn.sin(), 0.013 * f64::from(index), 3.1 * turn.cos());
        obj += &format!("v {} {} {}\n", round(corner.x), round(corner.y), round(corner.z));
    }
    (1..199).for_each(|first| obj += &format!("f {} {} {}\n", first, first + 1, first + 2));
    let written = write_files(&[("scene.obj", obj.as_bytes())]);
    scene::load_with(&written.path, &LoadOptions { auto_camera: true, ..LoadOptions::default() })
        .expect("it loads")
}

#[test]
fn a_file_whose_numbers_are_too_coarse_gets_a_warning_with_their_step() {
    let single = |value: f64| f64::from(value as f32);
    let far = dvec3(300_000.0, 100.0, -400_000.0);
    let says = |scene: &Scene| scene.warnings.iter().any(|warning| warning.contains("in steps of 0.03 m"));
    let coarse = house(far, single);
    assert!(says(&coarse), "{:?}", coarse.warnings);
    let quiet = [
        ("the digits are there", house(far, |value| (value * 1e4).round() / 1e4)),
        ("single precision is fine near the origin", house(DVec3::ZERO, single)),
        ("and ten sizes away", house(dvec3(80.0, 0.0, 0.0), single)),
        ("whole numbers are meant", house(far, f64::round)),
    ];
    for (what, scene) in &quiet {
        assert!(
            scene.warnings.iter().all(|warning| !warning.contains("steps")),
            "{what}: {:?}",
            scene.warnings
        );
    }
    // The camera that was placed is written in the file's coordinates, and sees the same when it is read.
    let placed = &quiet[0].1;
    let camera = placed.origin + placed.camera.position.as_dvec3();
    let text = placed.camera.to_toml(placed.origin);
    assert!((camera - far).length() < 30.0 && text.contains(&camera.to_string()), "{text}");
}

#[test]
fn scenes_too_small_to_be_traced_are_refused() {
    let tiny = [("scene.obj", b"v 0 0 0\nv 1e-14 0 0\nv 0 1e-14 0\nf 1 2 3\n".as_slice())];
    let error = scene::load_with(
        &write_files(&tiny).path,
        &LoadOptions { auto_camera: true, ..LoadOptions::default() },
    );
    let error = error.expect_err("radiance would overflow");
    assert!(error.to_string().contains("m from the camera"), "{error}");
}
