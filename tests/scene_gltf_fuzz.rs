//! Whatever the bytes, loading ends with a scene or an error: no panic, no endless loop, no runaway memory.
//!
//! `PROPTEST_CASES=100000 cargo test --test scene_gltf_fuzz` looks further.

#![allow(clippy::panic, reason = "a failed test panics")]

mod scene_support;

use krylux::scene::{self, builtin};
use proptest::prelude::*;
use serde_json::{Value, json};

/// Loads the bytes; whatever loads must hold what its type promises.
fn check(bytes: &[u8]) {
    let written = scene_support::write_bytes("scene.glb", bytes);
    let Ok(scene) = scene::load(&written.path, None) else { return };
    assert!(!scene.triangles.is_empty());
    for triangle in &scene.triangles {
        assert!(triangle.positions.iter().all(|position| position.is_finite()));
        assert!((triangle.material as usize) < scene.materials.len());
        assert!((triangle.region as usize) < scene.regions.len());
    }
    for material in &scene.materials {
        assert!(material.textures().all(|(_, texture)| (texture.texture as usize) < scene.textures.len()));
    }
    assert!((scene.camera.right.cross(scene.camera.up) + scene.camera.forward).length() < 1e-5);
}

/// The small shipped scenes, and a document that uses what they do not.
fn seed(choice: usize) -> (Value, Vec<u8>) {
    let models = [builtin::zigzag(), builtin::cornell(), builtin::corner()];
    match models.get(choice) {
        Some(model) => split(&model.to_glb()),
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

const SEEDS: usize = 4;

fn split(file: &[u8]) -> (Value, Vec<u8>) {
    let length = u32::from_le_bytes(file[12..16].try_into().expect("four bytes")) as usize;
    let document = serde_json::from_slice(&file[20..20 + length]).expect("our own writer writes JSON");
    (document, file[28 + length..].to_vec())
}

/// What JSON mutations put in the place of a value.
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
            "é"
        ])
        .prop_map(Value::from),
        Just(json!({})),
        Just(json!([])),
    ]
}

/// Replaces, removes or doubles the `at`-th value, counted depth first.
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

fn count(value: &Value) -> usize {
    1 + match value {
        Value::Array(items) => items.iter().map(count).sum(),
        Value::Object(members) => members.values().map(count).sum(),
        _ => 0,
    }
}

/// Repeatable in the test suite; `PROPTEST_CASES` overrides the number.
fn config() -> ProptestConfig {
    ProptestConfig {
        cases: std::env::var("PROPTEST_CASES").ok().and_then(|cases| cases.parse().ok()).unwrap_or(2000),
        rng_seed: proptest::test_runner::RngSeed::Fixed(1),
        failure_persistence: None,
        ..ProptestConfig::default()
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
    #![proptest_config(config())]

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
            // Never the root: what is left would be no document at all.
            let total = count(&document);
            if total > 1 {
                mutate(&mut document, &mut (1 + at.index(total - 1)), &with, action.saturating_sub(1));
            }
        }
        check(&scene_support::glb(&document, &binary));
    }
}
