//! Buffers, accessors and the meshes made of them.

#![allow(clippy::panic, reason = "a failed test panics")]

use super::refuses;
use crate::scene_support::{self, data_uri, fault, with};
use serde_json::{Value, json};

#[test]
fn arrays_that_exceed_their_buffer_are_refused() {
    refuses(
        &[("/bufferViews/0/byteLength", json!(1000))],
        "buffer view 0 (1000 bytes at 0) ends outside buffer 0 (68 bytes)",
    );
    refuses(
        &[("/bufferViews/0/byteOffset", json!(u64::MAX))],
        "buffer view 0 (36 bytes at 18446744073709551615) ends outside buffer 0 (68 bytes)",
    );
    for (member, value, described) in [
        ("count", json!(4), "4 elements of 12 bytes, stride 12, at 0"),
        ("count", json!(u64::MAX), "18446744073709551615 elements of 12 bytes, stride 12, at 0"),
        ("byteOffset", json!(1), "3 elements of 12 bytes, stride 12, at 1"),
        ("byteOffset", json!(u64::MAX), "3 elements of 12 bytes, stride 12, at 18446744073709551615"),
    ] {
        refuses(
            &[(&format!("/accessors/0/{member}"), value)],
            &format!("accessor 0 ({described}) ends outside its buffer view (36 bytes)"),
        );
    }
    refuses(
        &[("/bufferViews/0/byteStride", json!(4))],
        "accessor 0 has elements of 12 bytes in a buffer view of stride 4",
    );
    refuses(&[("/buffers/0/byteLength", json!(69))], "buffer 0 should have 69 bytes, but there are 68");
}

#[test]
fn accessors_of_the_wrong_type_are_refused() {
    let position = "mesh 0 \"triangle\", primitive 0: POSITION";
    refuses(&[("/accessors/0/type", json!("VEC2"))], &format!("{position} (accessor 0) is not of type Vec3"));
    refuses(&[("/accessors/0/componentType", json!(77))], "accessor 0 has an unknown component type");
    refuses(
        &[("/accessors/1/componentType", json!(5126))],
        "mesh 0 \"triangle\", primitive 0: its index list has components of type F32; expected one of [U8, U16, U32]",
    );
}

#[test]
fn invalid_sparse_accessors_are_refused() {
    let sparse = |indices: Value, values: Value, count: u64| {
        let sparse = json!({ "count": count, "indices": indices, "values": values });
        with(&[("/accessors/0/sparse", sparse)])
    };
    let indices = json!({ "bufferView": 1, "componentType": 5123 });
    let values = json!({ "bufferView": 0 });
    let refused = |document: Value, expected: &str| assert_eq!(fault(&document, None).0, expected);
    let disorder = "accessor 0: its sparse indices do not increase below 3";
    // The three indices are 0, 1, 2. Read as bytes, they are 0, 0, 1.
    scene_support::load(&sparse(indices.clone(), values.clone(), 3));
    refused(sparse(json!({ "bufferView": 1, "componentType": 5121 }), values.clone(), 3), disorder);
    refused(
        sparse(json!({ "bufferView": 0, "byteOffset": 12, "componentType": 5125 }), values.clone(), 1),
        disorder,
    );
    refused(
        sparse(indices.clone(), values, 4),
        "accessor 0, sparse indices (4 elements of 2 bytes, stride 2, at 0) ends outside its buffer view (6 bytes)",
    );
    refused(
        sparse(indices.clone(), json!({ "bufferView": 2 }), 3),
        "accessor 0, sparse values (3 elements of 12 bytes, stride 12, at 0) ends outside its buffer view (24 bytes)",
    );
    refused(
        sparse(indices, json!({ "bufferView": 9 }), 3),
        "accessor 0, sparse values refers to buffer view 9, which does not exist",
    );
}

#[test]
fn meshes_with_invalid_indices_or_positions_are_refused() {
    let primitive = "mesh 0 \"triangle\", primitive 0";
    let mut bytes = scene_support::buffer();
    bytes[36] = 3;
    refuses(
        &[("/buffers/0/uri", json!(data_uri("", &bytes)))],
        &format!("{primitive}: an index asks for vertex 3, but there are 3"),
    );
    let mut bytes = scene_support::buffer();
    bytes[12..16].copy_from_slice(&f32::NAN.to_le_bytes());
    refuses(
        &[("/buffers/0/uri", json!(data_uri("", &bytes)))],
        &format!("{primitive}: vertex 1 has a position that is not finite: [NaN, 0, -2]"),
    );
    refuses(
        &[("/nodes/0/translation", json!([1e10, 0, 0]))],
        &format!("{primitive}: vertex 0 lies more than 1e9 m from the origin"),
    );
    refuses(&[("/meshes/0/primitives/0/attributes", json!({}))], &format!("{primitive} has no POSITION"));
    refuses(
        &[("/accessors/1/count", json!(2))],
        &format!("{primitive} has 2 corners, which is not a multiple of 3"),
    );
    refuses(&[("/meshes/0/primitives/0/mode", json!(12))], &format!("{primitive} has an unknown mode"));
}

#[test]
fn scenes_without_triangles_are_refused() {
    let expected = "no triangles in the scene";
    refuses(&[("/nodes/0", json!({}))], expected);
    refuses(&[("/nodes/0/scale", json!([0, 0, 0]))], expected);
    let points = "no triangles in the scene, but points or lines, which have no area and show nothing";
    refuses(&[("/meshes/0/primitives/0/mode", json!(0))], points);
}

#[test]
fn a_small_file_cannot_make_an_unlimited_number_of_triangles() {
    // A strip that repeats one index has 2²⁰ triangles, and is placed 20 times.
    let indices = vec![0_u8; (1 << 20) + 2];
    let mut nodes: Vec<Value> = (0..20).map(|_| json!({ "mesh": 0 })).collect();
    nodes.push(json!({ "camera": 0 }));
    let document = with(&[
        ("/scenes/0/nodes", json!((0..nodes.len()).collect::<Vec<_>>())),
        ("/nodes", json!(nodes)),
        ("/meshes/0/primitives/0/mode", json!(5)),
        (
            "/accessors/1",
            json!({ "bufferView": 1, "componentType": 5121, "type": "SCALAR", "count": indices.len() }),
        ),
        ("/bufferViews/1", json!({ "buffer": 1, "byteLength": indices.len() })),
        ("/buffers/1", json!({ "byteLength": indices.len(), "uri": data_uri("", &indices) })),
    ]);
    assert_eq!(fault(&document, None).0, "more than 16777216 triangles, all instances counted");
}

#[cfg(feature = "compressed")]
#[test]
fn compressed_meshes_that_cannot_be_decompressed_are_refused() {
    let draco = "/meshes/0/primitives/0/extensions/KHR_draco_mesh_compression";
    let (what, help) =
        fault(&with(&[(draco, json!({ "bufferView": 0, "attributes": { "POSITION": 0 } }))]), None);
    assert!(what.starts_with("mesh 0 \"triangle\", primitive 0 cannot be decompressed (Draco): "), "{what}");
    assert!(help.contains("without mesh compression"), "{help}");
    let (what, _) = fault(&with(&[(draco, json!({ "bufferView": 0 }))]), None);
    assert!(what.contains("its KHR_draco_mesh_compression cannot be read"), "{what}");
    let (what, _) = fault(&with(&[(draco, json!({ "bufferView": 9, "attributes": {} }))]), None);
    assert!(what.contains("refers to buffer view 9"), "{what}");

    let meshopt = |more: Value| {
        let mut members =
            json!({ "buffer": 0, "byteLength": 36, "byteStride": 12, "count": 3, "mode": "ATTRIBUTES" });
        members.as_object_mut().expect("an object").extend(more.as_object().expect("an object").clone());
        fault(&with(&[("/bufferViews/0/extensions/EXT_meshopt_compression", members)]), None).0
    };
    for (more, why) in [
        (json!({}), "invalid encoded stream"),
        (json!({ "byteLength": 69 }), "its data end outside buffer 0"),
        (json!({ "buffer": 4 }), "its data end outside buffer 4"),
        (json!({ "mode": "STRIPS" }), "its mode is STRIPS"),
        (json!({ "count": 1_u64 << 40 }), "the views have more than 1073741824 bytes"),
        (json!({ "count": -1 }), "invalid value"),
    ] {
        let what = meshopt(more);
        assert!(what.starts_with("buffer view 0 cannot be decompressed (meshopt): "), "{what}");
        assert!(what.contains(why), "{what}");
    }
}

#[test]
fn buffers_without_data_are_refused() {
    refuses(
        &[("/buffers/1", json!({ "byteLength": 8 }))],
        "buffer 1 has neither a URI nor a binary chunk in the file",
    );
}
