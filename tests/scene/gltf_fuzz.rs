//! Fuzz tests of the glTF loader: for any bytes, loading ends with a scene or an error, without panic,
//! endless loop or excessive memory.
//!
//! `KRYLUX_FUZZ_CASES=100000 cargo test --release --test scene gltf_fuzz` tests more cases.

#![allow(clippy::panic, reason = "a failed test panics")]

use crate::scene_support::{self, fuzz};
use krylux::scene::{self, builtin};
use proptest::prelude::*;
use serde_json::{Value, json};

fn check(bytes: &[u8]) {
    let written = scene_support::write_bytes("scene.glb", bytes);
    if let Ok(scene) = scene::load(&written.path, None) {
        fuzz::check(&scene);
    }
}

/// A document and its binary chunk, as a start for mutations: a small shipped scene, or a document with other
/// features of the format.
fn seed(choice: usize) -> (Value, Vec<u8>) {
    let models = [builtin::zigzag(), builtin::cornell(), builtin::corner()];
    match models.get(choice) {
        Some(model) => split(&model.to_glb()),
        None if choice == models.len() => rich(),
        None => {
            let picture = scene_support::png(2, 1, &[[1, 2, 3, 255], [4, 5, 6, 255]]);
            let mut binary = scene_support::buffer();
            let offset = binary.len();
            binary.extend(&picture);
            let mut document = scene_support::with(&[
                (
                    "/nodes/2",
                    json!({ "children": [0], "rotation": [0, 0, 0, 1], "scale": [1, 2, 1], "extras": { "region": 1 } }),
                ),
                ("/scenes/0/nodes", json!([2, 1])),
                (
                    "/materials/0/pbrMetallicRoughness/baseColorTexture",
                    json!({ "index": 0, "extensions": { "KHR_texture_transform": { "scale": [2, 2] } } }),
                ),
                ("/materials/0/extensions", json!({ "KHR_materials_ior": { "ior": 1.4 } })),
                ("/textures", json!([{ "source": 0, "sampler": 0 }])),
                ("/samplers", json!([{ "wrapS": 33071 }])),
                ("/images", json!([{ "bufferView": 3, "mimeType": "image/png" }])),
                ("/bufferViews/3", json!({ "buffer": 0, "byteOffset": offset, "byteLength": picture.len() })),
                ("/bufferViews/0/byteStride", json!(12)),
                ("/buffers/0/byteLength", json!(binary.len())),
            ]);
            document["buffers"][0].as_object_mut().expect("a buffer").remove("uri");
            (document, binary)
        }
    }
}

/// A document with all supported features of meshes and materials: sparse positions, normals, colours, morph
/// targets, a skin, instances, every supported extension, a projector and a lens.
fn rich() -> (Value, Vec<u8>) {
    let mut document = scene_support::document();
    let mut binary = scene_support::buffer();
    let mut accessor = |shape: &str, component: u32, count: usize, bytes: Vec<u8>| {
        binary.resize(binary.len().next_multiple_of(4), 0);
        let lists = ["accessors", "bufferViews"].map(|list| document[list].as_array().map_or(0, Vec::len));
        let view = json!({ "buffer": 0, "byteOffset": binary.len(), "byteLength": bytes.len() });
        scene_support::set(&mut document, &format!("/bufferViews/{}", lists[1]), view);
        let value =
            json!({ "bufferView": lists[1], "componentType": component, "type": shape, "count": count });
        scene_support::set(&mut document, &format!("/accessors/{}", lists[0]), value);
        binary.extend(bytes);
        lists[0]
    };
    let floats = |values: &[f32]| values.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<u8>>();
    let up = floats(&[0.0, 0.0, 1.0].repeat(3));
    let normals = accessor("VEC3", 5126, 3, up.clone());
    let shift = accessor("VEC3", 5126, 3, up);
    let colors = accessor("VEC4", 5121, 3, vec![200; 12]);
    let joints = accessor("VEC4", 5121, 3, [0, 1, 0, 0].repeat(3));
    let weights = accessor("VEC4", 5126, 3, floats(&[0.5, 0.5, 0.0, 0.0].repeat(3)));
    let places = accessor("VEC3", 5126, 2, floats(&[0.0, 0.0, 0.0, 3.0, 0.0, 0.0]));
    let turns = accessor("VEC4", 5126, 2, floats(&[0.0, 0.0, 0.0, 1.0].repeat(2)));
    let picture = scene_support::png(2, 1, &[[1, 2, 3, 255], [4, 5, 6, 255]]);
    let image = accessor("SCALAR", 5121, picture.len(), picture);
    let texture = json!({ "index": 0, "extensions": { "KHR_texture_transform": { "offset": [0.5, 0], "rotation": 1 } } });
    let primitive = "/meshes/0/primitives/0";
    let sparse = json!({
        "count": 2,
        "indices": { "bufferView": 1, "byteOffset": 2, "componentType": 5123 },
        "values": { "bufferView": 0, "byteOffset": 12 },
    });
    for (pointer, value) in [
        ("/accessors/0/sparse", sparse),
        (&format!("{primitive}/attributes/NORMAL"), json!(normals)),
        (&format!("{primitive}/attributes/COLOR_0"), json!(colors)),
        (&format!("{primitive}/attributes/JOINTS_0"), json!(joints)),
        (&format!("{primitive}/attributes/WEIGHTS_0"), json!(weights)),
        (&format!("{primitive}/targets"), json!([{ "POSITION": shift, "NORMAL": shift }])),
        ("/meshes/0/weights", json!([0.5])),
        ("/skins", json!([{ "joints": [2, 3] }])),
        ("/scenes/0/nodes", json!([0, 1, 2, 4, 5])),
        ("/nodes/0/skin", json!(0)),
        ("/nodes/1/extras", json!({ "aperture_radius": 0.01, "focus_distance": 2 })),
        ("/nodes/2", json!({ "children": [3] })),
        ("/nodes/3", json!({ "translation": [1, 0, 0] })),
        (
            "/nodes/4",
            json!({ "camera": 0, "extras": { "krylux": "projector", "resolution": [8, 6] }, "translation": [1, 0, 0] }),
        ),
        (
            "/nodes/5",
            json!({
                "mesh": 0,
                "extensions": {
                    "EXT_mesh_gpu_instancing": { "attributes": { "TRANSLATION": places, "ROTATION": turns } },
                },
            }),
        ),
        ("/textures", json!([{ "source": 0 }])),
        ("/images", json!([{ "bufferView": image, "mimeType": "image/png" }])),
        (
            "/materials/0",
            json!({
                "pbrMetallicRoughness": { "baseColorTexture": texture, "metallicRoughnessTexture": texture },
                "normalTexture": texture,
                "emissiveTexture": texture,
                "alphaMode": "MASK",
                "extensions": {
                    "KHR_materials_specular": { "specularFactor": 0.5, "specularColorTexture": texture },
                    "KHR_materials_transmission": { "transmissionFactor": 0.5, "transmissionTexture": texture },
                    "KHR_materials_volume": { "thicknessFactor": 1, "attenuationDistance": 2, "attenuationColor": [1, 0.5, 0] },
                    "KHR_materials_diffuse_transmission": {
                        "diffuseTransmissionFactor": 0.5,
                        "diffuseTransmissionColorTexture": texture,
                    },
                },
            }),
        ),
    ] {
        scene_support::set(&mut document, pointer, value);
    }
    document["buffers"][0].as_object_mut().expect("a buffer").remove("uri");
    document["buffers"][0]["byteLength"] = json!(binary.len());
    (document, binary)
}

const SEEDS: usize = 5;

/// Splits a `.glb` file into its document and its binary chunk.
fn split(file: &[u8]) -> (Value, Vec<u8>) {
    let length = u32::from_le_bytes(file[12..16].try_into().expect("four bytes")) as usize;
    let document = serde_json::from_slice(&file[20..20 + length]).expect("our own writer writes JSON");
    (document, file[28 + length..].to_vec())
}

/// Values that mutations insert into the JSON document.
fn hostile() -> impl Strategy<Value = Value> {
    prop_oneof![
        Just(Value::Null),
        any::<bool>().prop_map(Value::from),
        (0..20_u64).prop_map(Value::from),
        any::<u64>().prop_map(Value::from),
        any::<i64>().prop_map(Value::from),
        (u64::MAX - 20..=u64::MAX).prop_map(Value::from),
        (u64::from(u32::MAX) - 3..=u64::from(u32::MAX) + 3).prop_map(Value::from),
        any::<f64>().prop_map(Value::from),
        prop::collection::vec(0..6_u64, 0..20).prop_map(Value::from),
        prop::collection::vec(any::<f32>(), 0..20).prop_map(Value::from),
        prop::sample::select(vec![
            "",
            "VEC3",
            "SCALAR",
            "data:;base64,",
            "..",
            "%",
            "orthographic",
            "KHR_materials_unlit",
            "projector",
            "MASK",
            "VEC4",
            "é"
        ])
        .prop_map(Value::from),
        Just(json!({})),
        Just(json!([])),
    ]
}

/// Replaces (`action` 0), removes (1) or duplicates (2) the value number `at` of a document, counted depth
/// first. Returns whether it found the value.
fn mutate(value: &mut Value, at: &mut usize, with: &Value, action: u8) -> bool {
    if *at == 0 {
        *value = with.clone();
        return true;
    }
    *at -= 1;
    match value {
        Value::Array(items) => {
            for index in 0..items.len() {
                if *at == 0 && action > 0 {
                    if action == 1 {
                        items.remove(index);
                    } else {
                        items.push(items[index].clone());
                    }
                    return true;
                }
                if mutate(&mut items[index], at, with, action) {
                    return true;
                }
            }
        }
        Value::Object(members) => {
            let keys: Vec<String> = members.keys().cloned().collect();
            for key in keys {
                if *at == 0 && action == 1 {
                    members.remove(&key);
                    return true;
                }
                if members.get_mut(&key).is_some_and(|member| mutate(member, at, with, action)) {
                    return true;
                }
            }
        }
        _ => {}
    }
    false
}

/// The number of values in a document.
fn count(value: &Value) -> usize {
    1 + match value {
        Value::Array(items) => items.iter().map(count).sum(),
        Value::Object(members) => members.values().map(count).sum(),
        _ => 0,
    }
}

#[test]
fn every_seed_loads_unchanged() {
    for choice in 0..SEEDS {
        let (document, binary) = seed(choice);
        let written = scene_support::write_bytes("scene.glb", &scene_support::glb(&document, &binary));
        scene::load(&written.path, None).expect("mutations must start from a file that loads");
    }
}

proptest! {
    #![proptest_config(fuzz::config())]

    #[test]
    fn changed_bytes_never_crash_the_loader(
        choice in 0..SEEDS,
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..8),
        cut in prop::option::weighted(0.1, any::<prop::sample::Index>()),
    ) {
        let (document, binary) = seed(choice);
        let mut file = scene_support::glb(&document, &binary);
        for (at, byte) in changes {
            let at = at.index(file.len());
            file[at] = byte;
        }
        if let Some(cut) = cut {
            file.truncate(cut.index(file.len()));
        }
        check(&file);
    }

    #[test]
    fn changed_json_never_crashes_the_loader(
        choice in 0..SEEDS,
        changes in prop::collection::vec((any::<prop::sample::Index>(), hostile(), 0..4_u8), 1..5),
    ) {
        let (mut document, binary) = seed(choice);
        for (at, with, action) in changes {
            // The root is not changed, since the result would not be a document.
            let total = count(&document);
            if total > 1 {
                mutate(&mut document, &mut (1 + at.index(total - 1)), &with, action.saturating_sub(1));
            }
        }
        check(&scene_support::glb(&document, &binary));
    }
}
