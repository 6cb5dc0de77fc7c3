//! Tests of what Blender's glTF exporter writes: how it turns axes, where it puts cameras and lights, and in which units.

use glam::{Quat, Vec3, vec3};
use serde_json::{Value, json};

use crate::scene_support::{CORNERS, load, with};

/// A quarter turn about x to the front, by which the exporter turns Blender's z up into glTF's y up.
const TURN: [f32; 4] = [-std::f32::consts::FRAC_1_SQRT_2, 0.0, 0.0, std::f32::consts::FRAC_1_SQRT_2];

/// The file of a scene of Blender: a mesh, a camera and a lamp, as the exporter names and nests them. `camera` is the camera's
/// pose. Older exporters put the camera itself into a child `NAME_Orientation`, which looks along Blender's axes.
fn exported(mesh: Value, camera: Value, is_nested: bool) -> Value {
    let mut camera = camera;
    camera["name"] = json!("Camera");
    let mut nodes =
        vec![mesh, Value::Null, json!({ "name": "Light", "children": [3], "translation": [4, 5, 1] })];
    nodes.push(json!({
        "name": "Light_Orientation",
        "rotation": TURN,
        "extensions": { "KHR_lights_punctual": { "light": 0 } },
    }));
    if is_nested {
        camera["children"] = json!([4]);
        nodes.push(json!({ "name": "Camera_Orientation", "rotation": TURN, "camera": 0 }));
    } else {
        camera["camera"] = json!(0);
    }
    nodes[1] = camera;
    let lights = json!([{ "name": "Light", "type": "point", "color": [1, 1, 1], "intensity": 54351.4 }]);
    with(&[
        ("/asset", json!({ "generator": "Khronos glTF Blender I/O v4.2.57", "version": "2.0" })),
        ("/extensionsUsed", json!(["KHR_lights_punctual"])),
        ("/extensions", json!({ "KHR_lights_punctual": { "lights": lights } })),
        ("/scenes/0", json!({ "name": "Scene", "nodes": [0, 1, 2] })),
        ("/nodes", json!(nodes)),
        (
            "/cameras/0",
            json!({
                "name": "Camera",
                "type": "perspective",
                "perspective": { "aspectRatio": 1.7777778, "yfov": 0.39959657, "zfar": 100, "znear": 0.1 },
            }),
        ),
    ])
}

fn sheet() -> Value {
    json!({ "name": "Plane", "mesh": 0 })
}

fn close(found: Vec3, expected: Vec3) -> bool {
    // Single precision, at distances of a few metres.
    found.distance(expected) < 1e-5
}

#[test]
fn a_camera_with_a_rotation_looks_where_it_looked_in_blender() {
    // Blender's default camera, as the exporter writes it.
    let rotation = [-0.20997f32, 0.38534, 0.09058, 0.89395];
    let pose = json!({ "translation": [7.358891, 4.958309, 6.925791], "rotation": rotation });
    let scene = load(&exported(sheet(), pose, false));
    let turn = Quat::from_array(rotation).normalize();
    assert_eq!(scene.camera.name, "Camera");
    assert!(close(scene.camera.position, vec3(7.358891, 4.958309, 6.925791)));
    assert!(close(scene.camera.forward, turn * Vec3::NEG_Z), "{}", scene.camera.forward);
    // It looks down at the middle of the scene.
    let to_middle = (-scene.camera.position).normalize();
    assert!(scene.camera.forward.dot(to_middle) > 0.99, "{}", scene.camera.forward);
}

#[test]
fn a_camera_in_a_child_of_its_node_is_found() {
    // A camera in Blender without rotation looks down, along −z; up is y. In glTF down is −y.
    let scene = load(&exported(sheet(), json!({ "translation": [1, 2, 3] }), true));
    assert!(close(scene.camera.position, vec3(1.0, 2.0, 3.0)));
    assert!(close(scene.camera.forward, Vec3::NEG_Y), "{}", scene.camera.forward);
    assert_eq!(scene.camera.name, "Camera_Orientation");
}

#[test]
fn lamps_are_ignored_with_a_warning() {
    let scene = load(&exported(sheet(), json!({}), false));
    assert_eq!(
        scene.warnings,
        ["the file's lights (KHR_lights_punctual) are ignored: the projector is the light"]
    );
}

#[test]
fn a_model_in_millimetres_is_scaled_by_its_node() {
    let mesh = json!({ "name": "Part", "mesh": 0, "scale": [0.001, 0.001, 0.001], "rotation": TURN });
    let scene = load(&exported(mesh, json!({}), false));
    let turn = Quat::from_array(TURN).normalize();
    for (found, corner) in scene.triangles[0].positions.into_iter().zip(CORNERS) {
        assert!(found.distance(turn * Vec3::from_array(corner) * 0.001) < 1e-8, "{found}");
    }
}

#[test]
fn linked_duplicates_share_a_mesh_and_are_regions_of_their_own() {
    // `Alt D` in Blender: two objects with the data of one mesh, here below an empty.
    let mut document = exported(json!({ "name": "Empty", "children": [4, 5] }), json!({}), false);
    let nodes = document["nodes"].as_array_mut().expect("a list");
    nodes.push(json!({ "name": "Plane", "mesh": 0 }));
    nodes.push(json!({ "name": "Plane.001", "mesh": 0, "translation": [0, 0, 1] }));
    let scene = load(&document);
    assert_eq!(scene.regions, ["Plane", "Plane.001"]);
    let [first, second] = [0, 1].map(|at: usize| scene.triangles[at].positions[0]);
    assert!(close(second - first, Vec3::Z));
}

#[test]
fn instances_of_geometry_nodes_are_placed() {
    let mesh = json!({
        "name": "Plane",
        "mesh": 0,
        "extensions": { "EXT_mesh_gpu_instancing": { "attributes": { "TRANSLATION": 0 } } },
    });
    let mut document = exported(mesh, json!({}), false);
    document["extensionsUsed"] = json!(["KHR_lights_punctual", "EXT_mesh_gpu_instancing"]);
    document["extensionsRequired"] = json!(["EXT_mesh_gpu_instancing"]);
    // The positions of the mesh's corners serve as those of its instances, too.
    let scene = load(&document);
    assert_eq!(scene.triangles.len(), CORNERS.len());
    for (triangle, place) in scene.triangles.iter().zip(CORNERS) {
        assert!(close(triangle.positions[0], Vec3::from_array(CORNERS[0]) + Vec3::from_array(place)));
    }
}
