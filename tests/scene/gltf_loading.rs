//! Tests that the content of a glTF file is loaded into the scene.

#![allow(clippy::panic, reason = "a failed test panics")]

use crate::scene_support::{CORNERS, buffer, data_uri, document, glb, load, set, with, write, write_bytes};
use glam::{Vec3, vec3};
use krylux::scene::{self, Scene};
use serde_json::{Value, json};

fn corners() -> [Vec3; 3] {
    CORNERS.map(Vec3::from_array)
}

/// The normal of the first triangle's front, with twice the triangle's area as its length.
fn front(scene: &Scene) -> Vec3 {
    let [a, b, c] = scene.triangles[0].positions;
    (b - a).cross(c - a)
}

#[test]
fn data_uris_external_files_and_binary_chunks_hold_the_same_buffer() {
    let embedded = load(&document());
    assert_eq!(embedded.triangles[0].positions, corners());

    let external = with(&[("/buffers/0/uri", json!("parts/my%20mesh.bin"))]);
    let written = write(&external);
    let parts = written.folder.path().join("parts");
    std::fs::create_dir(&parts).expect("a new folder is writable");
    std::fs::write(parts.join("my mesh.bin"), buffer()).expect("a new folder is writable");
    let first = scene::load(&written.path, None).expect("the buffer is there");
    assert_eq!(first.triangles, embedded.triangles);

    let mut in_chunk = document();
    in_chunk["buffers"][0].as_object_mut().expect("a buffer").remove("uri");
    let written_glb = write_bytes("scene.glb", &glb(&in_chunk, &buffer()));
    let scene = scene::load(&written_glb.path, None).expect("the buffer is in the chunk");
    assert_eq!(scene.triangles, embedded.triangles);

    // The hash covers the external file.
    let mut other = buffer();
    other[0] ^= 1;
    std::fs::write(parts.join("my mesh.bin"), other).expect("the file is ours");
    let second = scene::load(&written.path, None).expect("the buffer is there");
    assert_ne!(first.hash, second.hash);
}

#[test]
fn the_hash_depends_on_the_file_and_the_camera_but_not_on_the_path() {
    let two =
        with(&[("/scenes/0/nodes", json!([0, 1, 2])), ("/nodes/2", json!({ "camera": 0, "name": "other" }))]);
    let hash = |document: &Value, camera| {
        scene::load(&write(document).path, Some(camera)).expect("the camera exists").hash
    };
    assert_eq!(hash(&two, "eye"), hash(&two, "eye"));
    assert_ne!(hash(&two, "eye"), hash(&two, "other"));
    assert_ne!(hash(&two, "eye"), hash(&document(), "eye"));
}

#[test]
fn nested_transforms_are_applied_from_the_leaf_to_the_root() {
    // A quarter turn about Z maps +X to +Y.
    let half = std::f32::consts::FRAC_1_SQRT_2;
    let scene = load(&with(&[
        ("/scenes/0/nodes", json!([1, 2])),
        ("/nodes/2", json!({ "children": [0], "translation": [10, 0, 0], "rotation": [0, 0, half, half] })),
        ("/nodes/0/scale", json!([2, 3, 1])),
    ]));
    let expected = corners().map(|corner| vec3(10.0 - 3.0 * corner.y, 2.0 * corner.x, corner.z));
    for (position, expected) in scene.triangles[0].positions.into_iter().zip(expected) {
        // The quaternion is rounded to single precision.
        assert!(position.distance(expected) < 1e-6, "{position} is not {expected}");
    }
}

#[test]
fn a_matrix_is_read_column_by_column() {
    let scene = load(&with(&[("/nodes/0/matrix", json!([0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1, 0, 5, 6, 7, 1]))]));
    let expected = corners().map(|corner| vec3(5.0 - corner.y, 6.0 + corner.x, 7.0 + corner.z));
    assert_eq!(scene.triangles[0].positions, expected);
}

#[test]
fn mirrored_triangles_keep_their_front() {
    assert!(front(&load(&document())).z > 0.0);
    // Mirroring x leaves the front towards +Z; mirroring z flips it.
    assert!(front(&load(&with(&[("/nodes/0/scale", json!([-1, 1, 1]))]))).z > 0.0);
    assert!(front(&load(&with(&[("/nodes/0/scale", json!([1, 1, -1]))]))).z < 0.0);
    assert!(front(&load(&with(&[("/nodes/0/scale", json!([-1, -1, 1]))]))).z > 0.0);
}

#[test]
fn a_mesh_may_be_placed_by_several_nodes() {
    let scene = load(&with(&[
        ("/scenes/0/nodes", json!([0, 1, 2])),
        ("/nodes/2", json!({ "mesh": 0, "name": "sheet", "translation": [0, 0, -1] })),
    ]));
    assert_eq!(scene.triangles.len(), 2);
    assert_eq!(scene.triangles[1].positions, corners().map(|corner| corner - Vec3::Z));
    assert_eq!(scene.regions, ["sheet", "sheet (node 2)"]);
    assert_eq!(scene.triangles.iter().map(|triangle| triangle.region).collect::<Vec<_>>(), [0, 1]);
}

/// A scene whose mesh has the four corners of a unit square in z = 0, counter-clockwise, drawn in this mode
/// with these indices.
fn square(mode: u32, indices: &[u8]) -> Scene {
    let positions = [[0.0_f32, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
    let mut bytes: Vec<u8> = positions.as_flattened().iter().flat_map(|value| value.to_le_bytes()).collect();
    bytes.extend(indices);
    load(&with(&[
        (
            "/meshes/0/primitives/0",
            json!({ "attributes": { "POSITION": 0 }, "indices": 1, "mode": mode, "material": 0 }),
        ),
        ("/accessors/0/count", json!(4)),
        (
            "/accessors/1",
            json!({ "bufferView": 1, "componentType": 5121, "type": "SCALAR", "count": indices.len() }),
        ),
        ("/bufferViews/0/byteLength", json!(48)),
        ("/bufferViews/1", json!({ "buffer": 0, "byteOffset": 48, "byteLength": indices.len() })),
        ("/buffers/0", json!({ "byteLength": bytes.len(), "uri": data_uri("", &bytes) })),
    ]))
}

#[test]
fn all_triangles_of_strips_and_fans_face_the_same_way() {
    for (mode, indices) in [(4, vec![0, 1, 2, 0, 2, 3]), (5, vec![0, 1, 3, 2]), (6, vec![0, 1, 2, 3])] {
        let scene = square(mode, &indices);
        let normals: Vec<Vec3> = scene
            .triangles
            .iter()
            .map(|triangle| {
                let [a, b, c] = triangle.positions;
                (b - a).cross(c - a)
            })
            .collect();
        assert_eq!(normals, [Vec3::Z, Vec3::Z], "mode {mode}");
    }
}

#[test]
fn triangles_without_area_are_dropped_with_one_warning() {
    let scene = square(4, &[0, 1, 2, 0, 0, 1, 3, 3, 3]);
    assert_eq!(scene.triangles.len(), 1);
    assert_eq!(scene.warnings, ["2 triangles without area were dropped"]);
}

#[test]
fn interleaved_and_quantized_vertices_are_read() {
    // Each position has three normalized 16-bit coordinates; the stride is 8 bytes.
    let words: [[u16; 4]; 3] = [[0, 0, 0, 9], [65535, 0, 0, 9], [0, 65535, 0, 9]];
    let bytes: Vec<u8> = words.as_flattened().iter().flat_map(|word| word.to_le_bytes()).collect();
    let scene = load(&with(&[
        ("/extensionsRequired", json!(["KHR_mesh_quantization"])),
        ("/meshes/0/primitives/0", json!({ "attributes": { "POSITION": 0 }, "material": 0 })),
        (
            "/accessors/0",
            json!({ "bufferView": 0, "componentType": 5123, "normalized": true, "type": "VEC3", "count": 3 }),
        ),
        ("/bufferViews/0", json!({ "buffer": 0, "byteLength": 24, "byteStride": 8 })),
        ("/buffers/0", json!({ "byteLength": 24, "uri": data_uri("", &bytes) })),
    ]));
    assert_eq!(scene.triangles[0].positions, [Vec3::ZERO, Vec3::X, Vec3::Y]);
}

#[test]
fn the_camera_has_the_pose_of_its_node() {
    // A quarter turn about −X makes the camera look down. The scale must have no effect.
    let half = std::f32::consts::FRAC_1_SQRT_2;
    let scene = load(&with(&[
        ("/nodes/1/rotation", json!([-half, 0, 0, half])),
        ("/nodes/1/translation", json!([1, 2, 3])),
        ("/nodes/1/scale", json!([0.5, 2, 7])),
        ("/cameras/0/perspective/aspectRatio", json!(1.5)),
    ]));
    let camera = &scene.camera;
    assert_eq!(
        (camera.name.as_str(), camera.position, camera.aspect),
        ("eye", vec3(1.0, 2.0, 3.0), Some(1.5))
    );
    assert!((camera.tan_half_fov - 0.5_f32.tan()).abs() < 1e-7);
    // The quaternion is rounded to single precision.
    for (axis, expected) in [(camera.forward, Vec3::NEG_Y), (camera.up, Vec3::NEG_Z), (camera.right, Vec3::X)]
    {
        assert!(axis.distance(expected) < 1e-6, "{axis} is not {expected}");
    }
}

#[test]
fn without_labels_each_mesh_node_is_a_region() {
    let scene = load(&document());
    assert_eq!(scene.regions, ["sheet"]);
    assert!(!scene.regions_are_labels);
    assert_eq!(load(&with(&[("/nodes/0", json!({ "mesh": 0 }))])).regions, ["node 0"]);
}

#[test]
fn the_innermost_label_is_used() {
    let label = |region: u32| json!({ "region": region });
    let mut document = with(&[
        ("/scenes/0/nodes", json!([1, 2])),
        ("/nodes/2", json!({ "children": [0], "extras": label(4) })),
    ]);
    assert_eq!(load(&document).regions, ["4"], "inherited from the parent");
    set(&mut document, "/nodes/0/extras", label(3));
    assert_eq!(load(&document).regions, ["3"], "of the node");
    set(&mut document, "/meshes/0/extras", label(2));
    assert_eq!(load(&document).regions, ["2"], "of the mesh");
    set(&mut document, "/meshes/0/primitives/0/extras", label(1));
    assert_eq!(load(&document).regions, ["1"], "of the primitive");
}

#[test]
fn regions_are_ordered_by_label_and_not_by_node() {
    let labels = [json!("lid"), json!(10), json!(2), Value::Null, json!("10")];
    let node = |(at, label): (usize, &Value)| json!({ "mesh": 0, "translation": [at, 0, 0], "extras": { "region": label } });
    let mut nodes: Vec<Value> = labels.iter().enumerate().map(node).collect();
    nodes.push(json!({ "camera": 0 }));
    let scene = load(&with(&[("/scenes/0/nodes", json!([0, 1, 2, 3, 4, 5])), ("/nodes", json!(nodes))]));
    assert!(scene.regions_are_labels);
    assert_eq!(scene.regions, ["2", "10", "lid", "unlabelled"]);
    let regions: Vec<u32> = scene.triangles.iter().map(|triangle| triangle.region).collect();
    assert_eq!(regions, [2, 1, 0, 3, 1]);
    assert_eq!(
        scene.warnings,
        ["1 triangles have no extras.region while others have one; they form the region `unlabelled`"]
    );
}

#[test]
fn each_ignored_feature_gives_one_warning() {
    let coated = json!({ "extensions": { "KHR_materials_clearcoat": { "clearcoatFactor": 1 } } });
    let scene = load(&with(&[
        ("/scenes/0/nodes", json!([0, 1, 2])),
        ("/nodes/2", json!({ "mesh": 0, "translation": [1, 0, 0] })),
        (
            "/extensionsUsed",
            json!(["KHR_lights_punctual", "VENDOR_fog", "KHR_xmp_json_ld", "KHR_materials_sheen"]),
        ),
        ("/materials/0/occlusionTexture", json!({ "index": 7 })),
        ("/materials/0/extensions/KHR_materials_clearcoat", json!({ "clearcoatFactor": 1 })),
        ("/materials/1", coated),
        ("/meshes/0/primitives/1", json!({ "attributes": { "POSITION": 0 }, "mode": 1 })),
        ("/meshes/0/primitives/2", json!({ "attributes": { "POSITION": 0 }, "material": 1 })),
    ]));
    assert_eq!(
        scene.warnings,
        [
            "the file's lights (KHR_lights_punctual) are ignored: the projector is the light",
            "the extension VENDOR_fog is not supported and ignored",
            "KHR_materials_clearcoat is not supported and ignored; material 0 \"paint\" uses it first",
            "mesh 0 \"triangle\", primitive 1 consists of points or lines, which have no area: ignored",
        ]
    );
}

#[test]
fn only_the_default_scene_is_loaded() {
    let scene = load(&with(&[
        ("/scene", json!(1)),
        ("/scenes", json!([{ "nodes": [2] }, { "nodes": [0, 1], "name": "second" }])),
        ("/nodes/2", json!({ "mesh": 0 })),
    ]));
    assert_eq!(scene.regions, ["sheet"]);
    assert_eq!(scene.warnings, ["the file has 2 scenes; only scene 1 \"second\" is used"]);
}
