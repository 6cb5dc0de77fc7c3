//! Scenes with very many triangles in one place, which a kilobyte of glTF can hold.

use std::path::Path;

use base64::Engine;
use krylux::io::npy;
use serde_json::{Value, json};
use tempfile::TempDir;

use crate::program::{command, folder, inside, text};

/// A camera before `count` instances of a triangle 2 m away, all in one place; or with `is_spread`, the last one 1 mm aside and
/// the others in between.
fn pile(folder: &TempDir, name: &str, count: usize, is_spread: bool) -> String {
    let corners: [f32; 9] = [-0.5, -0.5, -2.0, 0.5, -0.5, -2.0, 0.0, 0.5, -2.0];
    let places =
        (0..if is_spread { count } else { 0 }).flat_map(|at| [at as f32 / count as f32 * 1e-3, 0.0, 0.0]);
    let floats: Vec<f32> = corners.into_iter().chain([0.0; 4]).chain(places).collect();
    let bytes: Vec<u8> = floats.iter().flat_map(|value| value.to_le_bytes()).collect();
    let uri = format!("data:;base64,{}", base64::engine::general_purpose::STANDARD.encode(&bytes));
    // Without data of its own, an accessor is zero but for its sparse elements, of which there is at least one.
    let zeros = json!({ "count": 1, "indices": { "bufferView": 1, "componentType": 5125 }, "values": { "bufferView": 2 } });
    let mut instances = json!({ "componentType": 5126, "type": "VEC3", "count": count });
    match is_spread {
        true => instances["bufferView"] = json!(3),
        false => instances["sparse"] = zeros,
    }
    let instancing = json!({ "EXT_mesh_gpu_instancing": { "attributes": { "TRANSLATION": 1 } } });
    let view = |at: usize, length: usize| json!({ "buffer": 0, "byteOffset": at, "byteLength": length });
    let document: Value = json!({
        "asset": { "version": "2.0" },
        "extensionsUsed": ["EXT_mesh_gpu_instancing"],
        "scenes": [{ "nodes": [0, 1] }],
        "nodes": [{ "mesh": 0, "extensions": instancing }, { "camera": 0 }],
        "cameras": [{ "type": "perspective", "perspective": { "yfov": 1.0, "znear": 0.1 } }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 } }] }],
        "accessors": [{ "bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 3 }, instances],
        "bufferViews": [view(0, 36), view(36, 4), view(40, 12), view(52, bytes.len() - 52)],
        "buffers": [{ "byteLength": bytes.len(), "uri": uri }],
    });
    let path = inside(folder, name);
    std::fs::write(&path, document.to_string()).expect("the folder can be written");
    path
}

/// Takes a photo; gives what the program says on stderr and its exit status.
fn photo(scene: &str, file: &str) -> (String, Option<i32>) {
    let output =
        command(&["photo", scene, "--size", "16", "--spp", "4", "--max-bounces", "3", "-o", file]).output();
    let output = output.expect("the program is built with the tests");
    (text(&output.stderr), output.status.code())
}

#[test]
fn triangles_that_repeat_another_one_change_no_photo() {
    let folder = folder();
    let (one, many) = (pile(&folder, "one.gltf", 1, false), pile(&folder, "many.gltf", 1 << 17, false));
    let photos = [one, many].map(|scene| {
        let file = format!("{scene}.npy");
        let (said, status) = photo(&scene, &file);
        assert_eq!(status, Some(0), "{said}");
        let is_many = scene.ends_with("many.gltf");
        assert_eq!(
            said.contains("triangles that repeat another one exactly were dropped: 131071"),
            is_many,
            "{said}"
        );
        npy::read_image(Path::new(&file)).expect("it was written")
    });
    assert!(photos[0].samples().iter().any(|&sample| sample > 0.0));
    assert_eq!(photos[0].samples(), photos[1].samples());
}

#[test]
fn too_many_triangles_in_one_place_are_named_where_the_driver_stops_paths() {
    let folder = folder();
    let scene = pile(&folder, "spread.gltf", 1 << 17, true);
    let (said, status) = photo(&scene, &inside(&folder, "photo.npy"));
    // A device without the limit of software Vulkan takes the photo.
    if status != Some(0) {
        assert_eq!(status, Some(2), "{said}");
        for part in
            ["light paths never finished", " triangles lie in one place, 1.414 m wide", "remove the objects"]
        {
            assert!(said.contains(part), "`{part}` is missing in: {said}");
        }
    }
}
