//! Tests of the poses of camera and projector: camera files, and the extras of glTF's camera nodes.

#![allow(clippy::panic, reason = "a failed test panics")]

use std::path::Path;

use crate::scene_support::{document, fault, load, set, with, write, write_files};
use glam::{Vec3, vec3};
use krylux::error::Error;
use krylux::image::Resolution;
use krylux::scene::{self, Camera, Lens, LoadOptions, Scene};
use serde_json::{Value, json};

const CAMERA: &str = "[camera]\nposition = [1, 2, 3]\nlook_at = [1, 2, -5]\nvertical_fov_degrees = 90\n";

/// Loads the document with a camera file of this content.
fn with_camera_file(content: &str) -> krylux::Result<Scene> {
    let document = document().to_string();
    let written = write_files(&[("scene.gltf", document.as_bytes()), ("my.toml", content.as_bytes())]);
    let file = written.folder.path().join("my.toml");
    scene::load_with(
        &written.path,
        &LoadOptions { camera: None, camera_file: Some(&file), ..LoadOptions::default() },
    )
}

/// Asserts that a camera file of this content is refused with the message `expected`.
#[track_caller]
fn refuses(content: &str, expected: &str) {
    match with_camera_file(content) {
        Err(Error::Scene { path, fault, .. }) => {
            assert!(path.ends_with("my.toml"), "the error names the camera file");
            assert_eq!(fault, expected);
        }
        other => panic!("not an error about the camera file: {other:?}"),
    }
}

#[test]
fn a_camera_file_states_the_camera_and_the_projector() {
    let content = format!(
        "{CAMERA}aperture_radius = 0.01\nfocus_distance = 1.5\n[projector]\nposition = [0, 0, 0]\nforward = [0, -2, 0]\n\
         up = [1, 0, 0.0]\nvertical_fov_degrees = 45.5\nresolution = [64, 48]\n"
    );
    let scene = with_camera_file(&content).expect("the file is valid");
    let camera = &scene.camera;
    assert_eq!((camera.position, camera.forward), (vec3(1.0, 2.0, 3.0), Vec3::NEG_Z));
    assert_eq!((camera.right, camera.up), (Vec3::X, Vec3::Y));
    assert!((camera.tan_half_fov - 1.0).abs() < 1e-6);
    assert_eq!(camera.lens, Lens { radius: 0.01, focus: 1.5 });
    let projector = scene.projector.expect("the rig is not coaxial");
    assert_eq!((projector.forward, projector.up, projector.right), (Vec3::NEG_Y, Vec3::X, Vec3::Z));
    assert_eq!(projector.lens, Lens::PINHOLE);
    assert_eq!(scene.projector_resolution, Some(Resolution::new(64, 48)));
}

#[test]
fn a_projector_with_the_pose_and_lens_of_the_camera_is_coaxial() {
    let coaxial = format!("{CAMERA}{}", CAMERA.replace("camera", "projector"));
    assert_eq!(with_camera_file(&coaxial).expect("the file is valid").projector, None);
    let other_lens =
        coaxial.replace("[projector]\n", "[projector]\naperture_radius = 0.1\nfocus_distance = 1\n");
    assert!(with_camera_file(&other_lens).expect("the file is valid").projector.is_some());
}

#[test]
fn a_camera_file_without_a_camera_leaves_the_scenes_camera() {
    let content = CAMERA.replace("camera", "projector");
    let scene = with_camera_file(&content).expect("the scene has a camera");
    assert_eq!(scene.camera.name, "eye");
    assert_eq!(scene.projector.expect("the rig is not coaxial").position, vec3(1.0, 2.0, 3.0));
}

#[test]
fn a_camera_file_next_to_the_scene_is_used_unless_a_camera_is_named() {
    let document = document().to_string();
    let written = write_files(&[("a.gltf", document.as_bytes()), ("a.rig.toml", CAMERA.as_bytes())]);
    let load = |camera| scene::load(&written.path, camera).expect("both cameras are valid");
    assert_eq!(load(None).camera.position, vec3(1.0, 2.0, 3.0));
    assert_eq!(load(Some("eye")).camera.position, Vec3::ZERO);
    assert_ne!(load(None).hash, load(Some("eye")).hash);

    let file = written.folder.path().join("a.rig.toml");
    let both = LoadOptions { camera: Some("eye"), camera_file: Some(&file), ..LoadOptions::default() };
    match scene::load_with(&written.path, &both) {
        Err(Error::Scene { fault, .. }) => {
            assert_eq!(fault, "the camera file has a [camera], but --camera names a camera of the scene");
        }
        other => panic!("two cameras at once: {other:?}"),
    }
    let missing =
        LoadOptions { camera: None, camera_file: Some(Path::new("gone.toml")), ..LoadOptions::default() };
    assert!(matches!(scene::load_with(&written.path, &missing), Err(Error::Read { .. })));
}

#[test]
fn an_obj_file_needs_a_camera_file_with_a_camera() {
    let obj = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    let expected = "an .obj file has no camera, and no camera file gives one";
    let projector = CAMERA.replace("camera", "projector");
    for content in [None, Some(projector.as_str())] {
        let mut files: Vec<(&str, &[u8])> = vec![("a.obj", obj)];
        files.extend(content.map(|content| ("a.rig.toml", content.as_bytes())));
        let written = write_files(&files);
        match scene::load(&written.path, None) {
            Err(Error::Scene { fault, help, .. }) => {
                assert_eq!(fault, expected);
                assert!(help.contains("a.rig.toml") && help.contains("--camera-file"), "{help}");
            }
            other => panic!("not an error about the scene: {other:?}"),
        }
    }
    let written = write_files(&[("a.obj", obj)]);
    match scene::load(&written.path, Some("eye")) {
        Err(Error::Scene { fault, .. }) => {
            assert_eq!(fault, "an .obj file has no cameras, and none called `eye`");
        }
        other => panic!("not an error about the scene: {other:?}"),
    }
}

#[test]
fn invalid_camera_files_are_refused() {
    let camera = |lines: &str| format!("[camera]\nposition = [0, 0, 0]\n{lines}\n");
    let view = "forward = [0, 0, -1]\nvertical_fov_degrees = 40";
    refuses(&camera("vertical_fov_degrees = 40"), "[camera] needs either look_at or forward");
    refuses(&camera(&format!("look_at = [1, 0, 0]\n{view}")), "[camera] needs either look_at or forward");
    let no_direction = "[camera] has no direction of view, or one that is parallel to up";
    refuses(&camera("look_at = [0, 0, 0]\nvertical_fov_degrees = 40"), no_direction);
    refuses(&camera("look_at = [0, 3, 0]\nvertical_fov_degrees = 40"), no_direction);
    refuses(&camera(&format!("{view}\nup = [0, 0, 0]")), no_direction);
    refuses(&camera("forward = [0, 0, nan]\nvertical_fov_degrees = 40"), no_direction);
    refuses(
        &format!("[camera]\nposition = [1e60, 0, 0]\n{view}\n"),
        "[camera] stands more than 1e9 m from the origin",
    );
    for field in ["0", "180", "-1", "nan", "0.0000001"] {
        let shown = if field == "nan" { "NaN" } else { field };
        refuses(
            &camera(&format!("forward = [0, 0, -1]\nvertical_fov_degrees = {field}")),
            &format!("[camera] has a vertical_fov_degrees of {shown}"),
        );
    }
    refuses(&camera(&format!("{view}\naperture_radius = -1")), "[camera] has an aperture_radius of -1");
    refuses(
        &camera(&format!("{view}\naperture_radius = 0.1")),
        "[camera] has an aperture_radius, but no focus_distance",
    );
    refuses(
        &camera(&format!("{view}\naperture_radius = 0.1\nfocus_distance = 0")),
        "[camera] has a focus_distance of 0",
    );
    refuses(&camera(&format!("{view}\nresolution = [8, 8]")), "[camera] has a resolution");
    let projector = camera(&format!("{view}\nresolution = [8, 0]")).replace("camera", "projector");
    refuses(&projector, "[projector] has a resolution of 8x0");
    for broken in ["[camera", "[camera]\nfov = 3\n", "[lamp]\n"] {
        match with_camera_file(broken) {
            Err(Error::Scene { fault, .. }) => {
                assert!(fault.starts_with("not a valid camera file: TOML parse error at line "), "{fault}");
            }
            other => panic!("not an error about the camera file: {other:?}"),
        }
    }
}

/// The document with a second camera node that has these extras.
fn two_cameras(extras: Value) -> Value {
    let node = json!({ "camera": 0, "name": "lamp", "translation": [1, 0, 0], "extras": extras });
    with(&[("/scenes/0/nodes", json!([0, 1, 2])), ("/nodes/2", node)])
}

#[test]
fn a_camera_node_may_be_the_projector() {
    let mut document = two_cameras(json!({ "krylux": "projector", "resolution": [32, 16] }));
    let scene = load(&document);
    assert_eq!(scene.camera.name, "eye", "the projector is no candidate for the camera");
    let projector = scene.projector.expect("the rig is not coaxial");
    assert_eq!((projector.name.as_str(), projector.position), ("lamp", Vec3::X));
    assert_eq!(scene.projector_resolution, Some(Resolution::new(32, 16)));
    set(&mut document, "/nodes/2/translation", json!([0, 0, 0]));
    assert_eq!(load(&document).projector, None, "at the camera's position the rig is coaxial");
}

#[test]
fn lenses_are_stated_by_the_node_or_its_camera() {
    let lens = |changes: &[(&str, Value)]| load(&with(changes)).camera.lens;
    assert_eq!(lens(&[]), Lens::PINHOLE);
    let open = json!({ "aperture_radius": 0.25, "focus_distance": 2 });
    assert_eq!(lens(&[("/nodes/1/extras", open.clone())]), Lens { radius: 0.25, focus: 2.0 });
    assert_eq!(lens(&[("/cameras/0/extras", open.clone())]), Lens { radius: 0.25, focus: 2.0 });
    let nearer = json!({ "focus_distance": 1 });
    assert_eq!(
        lens(&[("/cameras/0/extras", open), ("/nodes/1/extras", nearer)]),
        Lens { radius: 0.25, focus: 1.0 }
    );
}

#[test]
fn invalid_extras_are_refused() {
    let refused = |document: Value, expected: &str| assert_eq!(fault(&document, None).0, expected);
    let projector = json!({ "krylux": "projector" });
    refused(
        two_cameras(json!({ "krylux": "lamp" })),
        "node 2 \"lamp\": its extras.krylux is not \"projector\"",
    );
    refused(
        with(&[("/nodes/0/extras", projector.clone())]),
        "node 0 \"sheet\" is marked as the projector, but is not a camera",
    );
    refused(with(&[("/nodes/1/extras", projector.clone())]), "no camera in the scene");
    let mut both = two_cameras(projector.clone());
    set(&mut both, "/scenes/0/nodes", json!([0, 1, 2, 3]));
    set(&mut both, "/nodes/3", json!({ "camera": 0, "name": "beam", "extras": projector }));
    refused(both, "two projectors, `lamp` and `beam`");
    for (extras, expected) in [
        (json!({ "aperture_radius": "wide" }), "camera `eye` has an aperture_radius that is not a number"),
        (json!({ "aperture_radius": -1 }), "camera `eye` has an aperture_radius of -1"),
        (json!({ "aperture_radius": 1 }), "camera `eye` has an aperture_radius, but no focus_distance"),
        (json!({ "aperture_radius": 1, "focus_distance": -2 }), "camera `eye` has a focus_distance of -2"),
    ] {
        refused(with(&[("/nodes/1/extras", extras)]), expected);
    }
    refused(
        two_cameras(json!({ "krylux": "projector", "resolution": [8] })),
        "camera `lamp` has a resolution that is not [width, height]",
    );
}

#[test]
fn cameras_coincide_up_to_rounding() {
    let camera = load(&document()).camera;
    let moved = |by: f32| Camera { position: camera.position + by * Vec3::X, ..camera.clone() };
    assert!(camera.coincides(&moved(1e-7), 1.0));
    assert!(!camera.coincides(&moved(1e-4), 1.0));
    assert!(!camera.coincides(&Camera { tan_half_fov: 1.01 * camera.tan_half_fov, ..camera.clone() }, 1.0));
    assert_eq!(load(&document()).projector, None);
    // The camera of the same scene in another file is the same.
    assert_eq!(scene::load(&write(&document()).path, None).expect("it loads").camera, camera);
}

#[test]
fn a_scene_without_a_camera_gets_one_where_that_is_asked_for() {
    let mut without = document();
    without["nodes"][1] = json!({});
    let gltf = write(&without);
    let obj = write_files(&[("scene.obj", b"v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\n")]);
    for path in [&gltf.path, &obj.path] {
        let auto =
            |auto_camera| scene::load_with(path, &LoadOptions { auto_camera, ..LoadOptions::default() });
        let refused = auto(false).expect_err("it has no camera").to_string();
        assert!(refused.contains("--auto-camera"), "{refused}");
        let scene = auto(true).expect("a camera is placed");
        assert_eq!(scene.camera.name, Camera::PLACED);
        let resolution = Resolution::new(64, 64);
        for corner in scene.triangles.iter().flat_map(|triangle| triangle.positions) {
            assert!(scene.camera.project(corner, resolution).is_some(), "{corner} is behind the camera");
        }
        // The file that `info --write-camera` writes places the same camera.
        let file = path.with_file_name("written.toml");
        std::fs::write(&file, scene.camera.to_toml(scene.origin)).expect("the folder is ours");
        let again =
            scene::load_with(path, &LoadOptions { camera_file: Some(&file), ..LoadOptions::default() });
        let again = again.expect("it is a camera file").camera;
        assert!(again.coincides(&scene.camera, 1.0), "{again:?} {:?}", scene.camera);
    }
}
