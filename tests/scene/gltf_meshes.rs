//! Tests that vertex attributes, morph targets, skins and instances of a glTF file are loaded into triangles.

#![allow(clippy::panic, reason = "a failed test panics")]

use crate::scene_support::{CORNERS, data_uri, document, fault, load, set, with};
use glam::{Vec3, vec3};
use krylux::scene::Triangle;
use serde_json::{Value, json};

/// Adds an accessor of this shape and component type for `bytes`, with its own buffer. Returns its index.
fn accessor(document: &mut Value, shape: &str, component: u32, count: usize, bytes: &[u8]) -> usize {
    let length = |key: &str| document[key].as_array().map_or(0, Vec::len);
    let [accessor, view, buffer] = [length("accessors"), length("bufferViews"), length("buffers")];
    let changes = [
        ("buffers", buffer, json!({ "byteLength": bytes.len(), "uri": data_uri("", bytes) })),
        ("bufferViews", view, json!({ "buffer": buffer, "byteLength": bytes.len() })),
        (
            "accessors",
            accessor,
            json!({ "bufferView": view, "componentType": component, "type": shape, "count": count }),
        ),
    ];
    for (list, index, value) in changes {
        set(document, &format!("/{list}/{index}"), value);
    }
    accessor
}

fn floats(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}

/// Adds an accessor for floats. Returns its index.
fn with_floats(document: &mut Value, shape: &str, count: usize, values: &[f32]) -> usize {
    accessor(document, shape, 5126, count, &floats(values))
}

const PRIMITIVE: &str = "/meshes/0/primitives/0";

#[test]
fn sparse_accessors_replace_some_elements() {
    let base = with(&[(
        "/accessors/0/sparse",
        json!({
            "count": 1,
            // Byte 2 of the index list is the index 1.
            "indices": { "bufferView": 1, "byteOffset": 2, "componentType": 5123 },
            // This is the last position of the list.
            "values": { "bufferView": 0, "byteOffset": 24 },
        }),
    )]);
    // Two corners coincide, so the triangle has no area and is dropped.
    assert_eq!(fault(&base, None).0, "no triangles in the scene");

    let mut moved = base.clone();
    let values = with_floats(&mut moved, "VEC3", 1, &[5.0, 0.0, -2.0]);
    set(&mut moved, "/accessors/0/sparse/values", json!({ "bufferView": values }));
    let scene = load(&moved);
    assert_eq!(
        scene.triangles[0].positions,
        [vec3(0.0, 0.0, -2.0), vec3(5.0, 0.0, -2.0), vec3(0.0, 1.0, -2.0)]
    );

    // Without a buffer view all other elements are zero.
    moved["accessors"][0].as_object_mut().expect("an accessor").remove("bufferView");
    let two = with_floats(&mut moved, "VEC3", 2, &[1.0, 0.0, -2.0, 0.0, 1.0, -2.0]);
    set(
        &mut moved,
        "/accessors/0/sparse",
        json!({
            "count": 2,
            "indices": { "bufferView": 1, "byteOffset": 2, "componentType": 5123 },
            "values": { "bufferView": two },
        }),
    );
    let scene = load(&moved);
    assert_eq!(scene.triangles[0].positions, [Vec3::ZERO, vec3(1.0, 0.0, -2.0), vec3(0.0, 1.0, -2.0)]);
}

#[test]
fn indices_may_have_one_two_or_four_bytes() {
    for (component, bytes) in [
        (5121, vec![2_u8, 0, 1]),
        (5123, [2_u16, 0, 1].iter().flat_map(|index| index.to_le_bytes()).collect()),
        (5125, [2_u32, 0, 1].iter().flat_map(|index| index.to_le_bytes()).collect()),
    ] {
        let mut document = document();
        let indices = accessor(&mut document, "SCALAR", component, 3, &bytes);
        set(&mut document, &format!("{PRIMITIVE}/indices"), json!(indices));
        let [a, b, c] = CORNERS.map(Vec3::from_array);
        assert_eq!(load(&document).triangles[0].positions, [c, a, b], "component type {component}");
    }
}

/// The document with vertex normals.
fn with_normals(normals: [Vec3; 3]) -> Value {
    let mut document = document();
    let values: Vec<f32> = normals.iter().flat_map(|normal| normal.to_array()).collect();
    let index = with_floats(&mut document, "VEC3", 3, &values);
    set(&mut document, &format!("{PRIMITIVE}/attributes/NORMAL"), json!(index));
    document
}

#[test]
fn normals_stay_perpendicular_to_the_surface_under_any_transform() {
    let tilted = vec3(0.6, 0.0, 0.8);
    let mut document = with_normals([tilted; 3]);
    assert_eq!(load(&document).triangles[0].normals, [tilted; 3]);
    // (0.6, 0, 0.8) is normal to (0.8, 0, −0.6) and to Y, which become (8, 0, −0.6) and Y.
    set(&mut document, "/nodes/0/scale", json!([10, 1, 1]));
    for normal in load(&document).triangles[0].normals {
        assert!((normal.dot(vec3(8.0, 0.0, -0.6)).abs() < 1e-6) && normal.z > 0.0, "{normal}");
        assert!((normal.length() - 1.0).abs() < 1e-6, "{normal}");
    }
    // A mirrored mesh has mirrored normals, which are still on its front.
    set(&mut document, "/nodes/0/scale", json!([-1, 1, 1]));
    assert_eq!(load(&document).triangles[0].normals, [vec3(-0.6, 0.0, 0.8); 3]);
    // Normals that point to the back are flipped.
    assert_eq!(load(&with_normals([-tilted; 3])).triangles[0].normals, [tilted; 3]);
    // Normals without a direction become zero.
    let broken = load(&with_normals([Vec3::ZERO, Vec3::NAN, tilted]));
    assert_eq!(broken.triangles[0].normals, [Vec3::ZERO, Vec3::ZERO, tilted]);
}

#[test]
fn vertex_colours_of_all_types_are_loaded() {
    let white = load(&document()).triangles[0].colors;
    assert_eq!(white, [Triangle::WHITE; 3]);
    let colored = |shape: &str, component: u32, bytes: &[u8]| {
        let mut document = document();
        let index = accessor(&mut document, shape, component, 3, bytes);
        set(&mut document, &format!("/accessors/{index}/normalized"), json!(component != 5126));
        set(&mut document, &format!("{PRIMITIVE}/attributes/COLOR_0"), json!(index));
        load(&document).triangles[0].colors
    };
    let first = [65535, 0, 32768, 65535];
    let rgb: Vec<f32> = [[1.0, 0.0, 0.5], [2.0, -1.0, f32::NAN], [0.0; 3]].concat();
    assert_eq!(colored("VEC3", 5126, &floats(&rgb)), [first, [65535, 0, 0, 65535], [0, 0, 0, 65535]]);
    let rgba = [[255_u8, 0, 51, 102]; 3].concat();
    assert_eq!(colored("VEC4", 5121, &rgba), [[65535, 0, 51 * 257, 102 * 257]; 3]);
    let words: Vec<u8> =
        [[65535_u16, 1, 2, 3]; 3].concat().iter().flat_map(|word| word.to_le_bytes()).collect();
    assert_eq!(colored("VEC4", 5123, &words), [[65535, 1, 2, 3]; 3]);
}

#[test]
fn morph_targets_are_applied_with_their_rest_weights() {
    let mut document = with_normals([Vec3::Z; 3]);
    let shift = with_floats(&mut document, "VEC3", 3, &[0.0, 0.0, -1.0].repeat(3));
    let turn = with_floats(&mut document, "VEC3", 3, &[1.0, 0.0, 0.0].repeat(3));
    let sparse = accessor(&mut document, "VEC3", 5126, 3, &[]);
    document["accessors"][sparse].as_object_mut().expect("an accessor").remove("bufferView");
    set(
        &mut document,
        &format!("{PRIMITIVE}/targets"),
        json!([{ "POSITION": shift, "NORMAL": turn }, { "POSITION": sparse }]),
    );
    let z = |document: &Value| load(document).triangles[0].positions.map(|position| position.z);
    assert_eq!(z(&document), [-2.0; 3], "weights are zero when left out");
    set(&mut document, "/meshes/0/weights", json!([0.5, 1.0]));
    assert_eq!(z(&document), [-2.5; 3]);
    let normal = load(&document).triangles[0].normals[0];
    assert!(normal.distance(vec3(0.5, 0.0, 1.0).normalize()) < 1e-6, "{normal}");
    set(&mut document, "/nodes/0/weights", json!([2.0]));
    assert_eq!(z(&document), [-4.0; 3], "the node's weights override the mesh's");
    set(&mut document, "/nodes/0/weights", json!([1e39]));
    assert_eq!(
        fault(&document, None).0,
        "mesh 0 \"triangle\", primitive 0: the weight of its morph target 0 is inf"
    );
}

/// The document with a skin. The first two vertices are bound to joint 0, and the third to both joints with
/// weights of one half. Joint 1 is at x = 10.
fn skinned() -> Value {
    let mut document = with(&[
        ("/nodes/0", json!({ "name": "sheet", "mesh": 0, "skin": 0, "translation": [0, 0, 100] })),
        ("/nodes/2", json!({ "children": [3], "translation": [0, 0, -1] })),
        ("/nodes/3", json!({ "translation": [10, 0, 0] })),
        ("/scenes/0/nodes", json!([0, 1, 2])),
    ]);
    let joints = accessor(&mut document, "VEC4", 5121, 3, &[0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0]);
    let weights = [[1.0, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.5, 0.5, 0.0, 0.0]].concat();
    let weights = with_floats(&mut document, "VEC4", 3, &weights);
    let mut bind = [0.0; 32];
    for matrix in bind.chunks_exact_mut(16) {
        for diagonal in [0, 5, 10, 15] {
            matrix[diagonal] = 1.0;
        }
    }
    // In the bind pose the second joint is at x = 4.
    bind[16 + 12] = -4.0;
    let bind = with_floats(&mut document, "MAT4", 2, &bind);
    set(&mut document, &format!("{PRIMITIVE}/attributes/JOINTS_0"), json!(joints));
    set(&mut document, &format!("{PRIMITIVE}/attributes/WEIGHTS_0"), json!(weights));
    set(&mut document, "/skins", json!([{ "joints": [2, 3], "inverseBindMatrices": bind }]));
    document
}

#[test]
fn skinned_vertices_follow_the_rest_pose_of_their_joints() {
    let positions = load(&skinned()).triangles[0].positions;
    // The node's own translation has no effect. The third vertex moves by half of 10 − 4.
    assert_eq!(positions, [vec3(0.0, 0.0, -3.0), vec3(1.0, 0.0, -3.0), vec3(3.0, 1.0, -3.0)]);
}

#[test]
fn invalid_skins_are_refused() {
    let refused = |changes: &[(&str, Value)], expected: &str| {
        let mut document = skinned();
        for (pointer, value) in changes {
            set(&mut document, pointer, value.clone());
        }
        assert_eq!(fault(&document, None).0, expected);
    };
    let primitive = "mesh 0 \"triangle\", primitive 0";
    refused(&[("/nodes/0/skin", json!(3))], "node 0 \"sheet\" refers to skin 3, which does not exist");
    refused(&[("/skins/0/joints", json!([2, 9]))], "skin 0: its joint 9 is not a node of the scene");
    refused(&[("/scenes/0/nodes", json!([0, 1]))], "skin 0: its joint 2 is not a node of the scene");
    refused(
        &[("/skins/0/joints", json!([2, 3, 2]))],
        "skin 0: its inverse bind matrix 2 is missing or not affine",
    );
    refused(
        &[("/skins/0", json!({ "joints": [2] }))],
        &format!("{primitive}: vertex 2 is bound to no joint, or to one that the skin does not have"),
    );
    refused(
        &[(&format!("{PRIMITIVE}/attributes"), json!({ "POSITION": 0 }))],
        &format!("{primitive} is skinned, but lacks JOINTS_0 or WEIGHTS_0"),
    );
}

#[test]
fn instances_are_placed_by_the_extension() {
    let mut document = with(&[
        ("/nodes/0/translation", json!([0, 0, -10])),
        ("/extensionsRequired", json!(["EXT_mesh_gpu_instancing"])),
    ]);
    let places = with_floats(&mut document, "VEC3", 2, &[0.0, 0.0, 0.0, 5.0, 0.0, 0.0]);
    let scales = with_floats(&mut document, "VEC3", 2, &[1.0, 1.0, 1.0, 2.0, 2.0, -1.0]);
    let attributes = json!({ "TRANSLATION": places, "SCALE": scales });
    set(&mut document, "/nodes/0/extensions/EXT_mesh_gpu_instancing", json!({ "attributes": attributes }));
    let scene = load(&document);
    let corners = CORNERS.map(Vec3::from_array);
    assert_eq!(scene.triangles[0].positions, corners.map(|corner| corner - 10.0 * Vec3::Z));
    // The second instance is mirrored. Two of its corners are exchanged, so that the front stays where it
    // was.
    let [a, b, c] = corners.map(|corner| corner * vec3(2.0, 2.0, -1.0) + vec3(5.0, 0.0, -10.0));
    assert_eq!(scene.triangles[1].positions, [a, c, b]);
    assert_eq!((scene.triangles.len(), scene.regions.as_slice()), (2, ["sheet".to_string()].as_slice()));

    let short = with_floats(&mut document, "VEC3", 1, &[1.0, 1.0, 1.0]);
    let at = "/nodes/0/extensions/EXT_mesh_gpu_instancing/attributes/SCALE";
    set(&mut document, at, json!(short));
    assert_eq!(fault(&document, None).0, "node 0 \"sheet\" has 2 instances, and 1 in another list of them");
    set(&mut document, at, json!(0));
    set(&mut document, "/accessors/0/componentType", json!(5120));
    assert_eq!(
        fault(&document, None).0,
        "node 0 \"sheet\": SCALE of its instances has components of type I8; expected one of [F32]"
    );
}
