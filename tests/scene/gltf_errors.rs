//! Tests that errors about glTF files name the file, the object at fault and what to do.

#![allow(clippy::panic, reason = "a failed test panics")]

use crate::scene_support::{self, data_uri, document, fault, png, try_load, with, write, write_bytes};
use krylux::error::Error;
use krylux::scene;
use serde_json::{Value, json};

/// Asserts that the document with these changes is refused with the message `expected`.
#[track_caller]
fn refuses(changes: &[(&str, Value)], expected: &str) {
    assert_eq!(fault(&with(changes), None).0, expected);
}

#[test]
fn the_unchanged_document_loads() {
    let scene = scene_support::load(&document());
    assert_eq!((scene.triangles.len(), scene.warnings.as_slice()), (1, [].as_slice()));
}

#[test]
fn dangling_references_are_refused() {
    refuses(&[("/scene", json!(3))], "the default scene is 3, but there are only 1");
    refuses(&[("/scenes/0/nodes", json!([0, 9]))], "the scene has node 9, which does not exist");
    refuses(&[("/nodes/0/children", json!([7]))], "node 0 \"sheet\" has a child 7, which does not exist");
    refuses(&[("/nodes/0/mesh", json!(5))], "node 0 \"sheet\" refers to mesh 5, which does not exist");
    refuses(&[("/nodes/1/camera", json!(5))], "node 1 \"eye\" refers to camera 5, which does not exist");
    let primitive = "mesh 0 \"triangle\", primitive 0";
    let at = "/meshes/0/primitives/0";
    refuses(
        &[(&format!("{at}/material"), json!(4))],
        &format!("{primitive} refers to material 4, which does not exist"),
    );
    refuses(
        &[(&format!("{at}/indices"), json!(9))],
        &format!("{primitive}: its index list refers to accessor 9, which does not exist"),
    );
    refuses(
        &[(&format!("{at}/attributes/POSITION"), json!(9))],
        &format!("{primitive}: POSITION refers to accessor 9, which does not exist"),
    );
    refuses(
        &[("/accessors/0/bufferView", json!(9))],
        "accessor 0 refers to buffer view 9, which does not exist",
    );
    refuses(&[("/bufferViews/0/buffer", json!(2))], "buffer view 0 refers to buffer 2, which does not exist");
    let texture = ("/materials/0/pbrMetallicRoughness/baseColorTexture/index", json!(0));
    refuses(std::slice::from_ref(&texture), "material 0 \"paint\" refers to texture 0, which does not exist");
    refuses(
        &[texture.clone(), ("/textures", json!([{ "source": 1 }]))],
        "texture 0 refers to image 1, which does not exist",
    );
    refuses(
        &[texture, ("/textures", json!([{ "source": 0, "sampler": 1 }]))],
        "texture 0 refers to sampler 1, which does not exist",
    );
}

#[test]
fn nodes_that_do_not_form_a_tree_are_refused() {
    refuses(&[("/nodes/0/children", json!([0]))], "node 0 \"sheet\" is its own ancestor");
    refuses(
        &[
            ("/scenes/0/nodes", json!([0])),
            ("/nodes/0/children", json!([1])),
            ("/nodes/1/children", json!([0])),
        ],
        "node 0 \"sheet\" is its own ancestor",
    );
    refuses(&[("/scenes/0/nodes", json!([0, 0]))], "the scene lists node 0 \"sheet\" twice");
    refuses(
        &[("/nodes/0/children", json!([1]))],
        "the scene lists node 1 \"eye\", which is a child of node 0 \"sheet\"",
    );
    refuses(
        &[("/nodes/2", json!({})), ("/nodes/0/children", json!([2])), ("/nodes/1/children", json!([2]))],
        "node 2 has two parents, node 0 \"sheet\" and node 1 \"eye\"",
    );
}

#[test]
fn transforms_that_are_not_affine_are_refused() {
    refuses(
        &[("/nodes/0/rotation", json!([0, 0, 0, 0]))],
        "node 0 \"sheet\": its rotation is not a unit quaternion",
    );
    refuses(&[("/nodes/0/scale", json!([1e60, 1, 1]))], "node 0 \"sheet\": its transform is not finite");
    let projective = json!([1, 0, 0, 0.5, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]);
    refuses(&[("/nodes/0/matrix", projective)], "node 0 \"sheet\": its matrix is not affine");
}

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
    refuses(&[("/meshes/0/primitives/0/mode", json!(0))], expected);
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

#[test]
fn one_of_several_cameras_is_selected_by_name() {
    let none = with(&[("/nodes/1", json!({}))]);
    let (what, help) = fault(&none, None);
    assert_eq!(what, "no camera in the scene");
    assert!(help.starts_with("add a perspective camera"), "{help}");

    let two = with(&[("/scenes/0/nodes", json!([0, 1, 2])), ("/nodes/2", json!({ "camera": 0 }))]);
    let (what, help) = fault(&two, None);
    assert_eq!((what.as_str(), help.as_str()), ("2 cameras: `eye`, `rig`", "choose one with --camera NAME"));
    assert_eq!(fault(&two, Some("left")).0, "no camera is called `left`; there are `eye`, `rig`");
    let chosen = scene::load(&write(&two).path, Some("rig")).expect("there is one of this name");
    assert_eq!(chosen.camera.name, "rig");

    let same =
        with(&[("/scenes/0/nodes", json!([0, 1, 2])), ("/nodes/2", json!({ "camera": 0, "name": "eye" }))]);
    assert_eq!(fault(&same, Some("eye")).0, "2 cameras are called `eye`");
}

#[test]
fn cameras_without_a_valid_perspective_are_refused() {
    let orthographic =
        json!({ "type": "orthographic", "orthographic": { "xmag": 1, "ymag": 1, "znear": 0, "zfar": 1 } });
    refuses(&[("/cameras/0", orthographic)], "camera `eye` is orthographic");
    refuses(&[("/cameras/0", json!({ "type": "perspective" }))], "camera `eye` has no perspective");
    let field = "/cameras/0/perspective/yfov";
    refuses(&[(field, json!(0))], "camera `eye` has a vertical field of view of 0 rad");
    refuses(&[(field, json!(4))], "camera `eye` has a vertical field of view of 4 rad");
    refuses(
        &[("/cameras/0/perspective/aspectRatio", json!(0))],
        "camera `eye` has an aspect ratio that is not positive",
    );
    refuses(
        &[("/nodes/1/translation", json!([1e10, 0, 0]))],
        "camera `eye` stands more than 1e9 m from the origin",
    );
    refuses(&[("/nodes/1/scale", json!([1, 1, -1]))], "camera `eye` is mirrored by its node's transform");
    refuses(&[("/nodes/1/scale", json!([1, 0, 1]))], "camera `eye` is scaled to nothing");
    let sheared = json!([1, 0, 0, 0, 0.5, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]);
    refuses(&[("/nodes/1/matrix", sheared)], "camera `eye` is sheared by its node's transform");
}

#[test]
fn unsupported_required_extensions_are_refused_with_advice() {
    for (name, advice) in [
        ("KHR_draco_mesh_compression", "export the scene without mesh compression"),
        ("EXT_meshopt_compression", "export the scene without mesh compression"),
        ("KHR_texture_basisu", "export the scene with PNG or JPEG pictures"),
        (
            "KHR_materials_clearcoat",
            "export the scene with materials that have metallic-roughness, specular, transmission and volume only",
        ),
        ("VENDOR_unheard_of", "export the scene without this extension"),
    ] {
        let (what, help) = fault(&with(&[("/extensionsRequired", json!([name]))]), None);
        assert_eq!(what, format!("the file requires the extension {name}, which is not supported"));
        assert_eq!(help, advice);
    }
}

#[test]
fn compressed_meshes_without_a_fallback_are_refused() {
    let mut draco = with(&[
        ("/extensionsUsed", json!(["KHR_draco_mesh_compression"])),
        ("/meshes/0/primitives/0/extensions/KHR_draco_mesh_compression", json!({ "bufferView": 0 })),
    ]);
    draco["accessors"][0].as_object_mut().expect("an accessor").remove("bufferView");
    assert_eq!(
        fault(&draco, None).0,
        "mesh 0 \"triangle\", primitive 0: POSITION has no data of its own: the file is compressed with \
         KHR_draco_mesh_compression"
    );
    draco["extensionsUsed"] = json!([]);
    assert_eq!(
        fault(&draco, None).0,
        "mesh 0 \"triangle\", primitive 0: POSITION has no data: accessor 0 has no buffer view"
    );
    refuses(
        &[
            ("/extensionsUsed", json!(["EXT_meshopt_compression"])),
            ("/buffers/1", json!({ "byteLength": 8 })),
        ],
        "buffer 1 has no data of its own: the file is compressed with EXT_meshopt_compression",
    );
    refuses(
        &[("/buffers/1", json!({ "byteLength": 8 }))],
        "buffer 1 has neither a URI nor a binary chunk in the file",
    );
}

/// The document with a base colour texture of this image.
fn textured(image: Value) -> Value {
    with(&[
        ("/materials/0/pbrMetallicRoughness/baseColorTexture/index", json!(0)),
        ("/textures", json!([{ "source": 0 }])),
        ("/images", json!([image])),
    ])
}

#[test]
fn unusable_pictures_are_refused_by_name() {
    let gif = textured(json!({ "name": "logo", "uri": data_uri("image/gif", b"GIF89a..........") }));
    assert_eq!(fault(&gif, None).0, "image 0 \"logo\" is neither PNG nor JPEG");

    let mut cut = png(8, 8, &[[1, 2, 3, 255]; 64]);
    cut.truncate(cut.len() - 20);
    let (what, _) = fault(&textured(json!({ "uri": data_uri("image/png", &cut) })), None);
    assert!(what.starts_with("image 0 cannot be decoded: "), "{what}");

    let wide = png(20000, 1, &vec![[0; 4]; 20000]);
    let (what, _) = fault(&textured(json!({ "uri": data_uri("image/png", &wide) })), None);
    assert_eq!(what, "image 0 is 20000x1 pixels");

    // The picture is refused by its header alone, before memory is allocated.
    let mut bomb = png(1, 1, &[[0; 4]]);
    bomb[16..24].copy_from_slice(&[0, 0, 0x40, 0, 0, 0, 0x40, 0]);
    let crc = crc32(&bomb[12..29]);
    bomb[29..33].copy_from_slice(&crc.to_be_bytes());
    let (what, _) = fault(&textured(json!({ "uri": data_uri("image/png", &bomb) })), None);
    assert_eq!(what, "image 0 is 16384x16384 pixels");

    assert_eq!(fault(&textured(json!({})), None).0, "image 0 has no data");
    let basis = with(&[
        ("/materials/0/pbrMetallicRoughness/baseColorTexture/index", json!(0)),
        ("/textures", json!([{ "extensions": { "KHR_texture_basisu": { "source": 0 } } }])),
    ]);
    let (what, help) = fault(&basis, None);
    assert_eq!(what, "texture 0 has its picture only as KHR_texture_basisu, which is not supported");
    assert_eq!(help, "export the scene with PNG or JPEG pictures");
}

/// The CRC-32 of PNG chunks, computed bit by bit.
fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(u32::MAX, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |crc, _| (crc >> 1) ^ (0xEDB8_8320 & (crc & 1).wrapping_neg()))
    })
}

#[test]
fn textures_need_texture_coordinates() {
    let picture = json!({ "uri": data_uri("image/png", &png(1, 1, &[[255; 4]])) });
    let mut document = textured(picture);
    scene_support::set(&mut document, "/meshes/0/primitives/0/attributes", json!({ "POSITION": 0 }));
    assert_eq!(
        fault(&document, None).0,
        "mesh 0 \"triangle\", primitive 0 has no TEXCOORD_0, but its material's base colour texture reads it"
    );
}

#[test]
fn uris_other_than_data_and_relative_paths_are_refused() {
    for (uri, expected) in [
        (
            "https://example.org/mesh.bin",
            "buffer 0: `https://example.org/mesh.bin` is not a relative path; only files next to the scene are read",
        ),
        (
            "file:///mesh.bin",
            "buffer 0: `file:///mesh.bin` is not a relative path; only files next to the scene are read",
        ),
        ("/mesh.bin", "buffer 0: `/mesh.bin` is an absolute path; only files next to the scene are read"),
        ("%2Fmesh.bin", "buffer 0: `%2Fmesh.bin` is an absolute path; only files next to the scene are read"),
        ("mesh%0.bin", "buffer 0: `mesh%0.bin` is not a valid URI (percent-encoding or UTF-8)"),
        ("", "buffer 0: its URI is empty"),
        ("data:;base64", "buffer 0: its data URI has no comma before the data"),
        ("data:,text", "buffer 0: its data URI is not base64"),
    ] {
        refuses(&[("/buffers/0/uri", json!(uri))], expected);
    }
    let (what, _) = fault(&with(&[("/buffers/0/uri", json!("data:;base64,!!"))]), None);
    assert!(what.starts_with("buffer 0: its base64 data is damaged: "), "{what}");
}

#[test]
fn the_error_about_a_missing_buffer_names_the_path_of_the_buffer() {
    let written = write(&with(&[("/buffers/0/uri", json!("parts/my%20mesh.bin"))]));
    match scene::load(&written.path, None) {
        Err(Error::Read { path, .. }) => assert_eq!(path, written.folder.path().join("parts/my mesh.bin")),
        other => panic!("not an error about reading: {other:?}"),
    }
}

#[test]
fn a_buffer_that_is_a_folder_is_refused() {
    let written = write(&with(&[("/buffers/0/uri", json!("../"))]));
    match scene::load(&written.path, None) {
        Err(Error::Scene { fault, .. }) => {
            assert!(fault.starts_with("not a file, but buffer 0 of "), "{fault}");
        }
        other => panic!("not an error about the scene: {other:?}"),
    }
}

#[test]
fn labels_that_are_neither_numbers_nor_names_are_refused() {
    for (region, shown) in [(json!(-1), "-1"), (json!(1.5), "1.5"), (json!([2]), "[2]"), (json!(""), "\"\"")]
    {
        refuses(
            &[("/nodes/0/extras/region", region)],
            &format!("node 0 \"sheet\": its extras.region is {shown}, which is not a label"),
        );
    }
}

#[test]
fn more_than_255_labels_are_refused() {
    let nodes = |count: usize| {
        let mut nodes: Vec<Value> =
            (0..count).map(|label| json!({ "mesh": 0, "extras": { "region": label } })).collect();
        nodes.push(json!({ "camera": 0 }));
        with(&[("/scenes/0/nodes", json!((0..=count).collect::<Vec<_>>())), ("/nodes", json!(nodes))])
    };
    assert_eq!(scene_support::load(&nodes(255)).regions.len(), 255);
    assert_eq!(fault(&nodes(256), None).0, "256 different region labels, but at most 255 can be told apart");
}

#[test]
fn files_that_are_not_gltf_2_are_refused() {
    let refused = |name: &str, bytes: &[u8], expected: &str| {
        let written = write_bytes(name, bytes);
        match scene::load(&written.path, None) {
            Err(Error::Scene { path, fault, .. }) => {
                assert_eq!(path, written.path);
                assert!(fault.starts_with(expected), "{fault}");
            }
            other => panic!("not an error about the scene: {other:?}"),
        }
    };
    refused("scene.stl", b"solid", "not a known scene format");
    refused("scene", b"", "not a known scene format");
    refused("scene.gltf", b"{ \"asset\": ", "not a valid glTF document: EOF while parsing");
    refused("scene.gltf", br#"{ "asset": { "version": "1.0" } }"#, "glTF version `1.0` is not supported");
    refused("scene.gltf", br#"{ "asset": { "version": "2.0" } }"#, "the file has no scene");
    refused("scene.glb", b"{}", "not a GLB file: it does not begin with `glTF`");
    let whole = scene_support::glb(&document(), &scene_support::buffer());
    refused("scene.glb", &whole[..10], "the GLB header is cut short");
    refused("scene.glb", &whole[..100], "the GLB header says");
    let mut tiny = whole.clone();
    tiny[8..12].copy_from_slice(&3_u32.to_le_bytes());
    refused("scene.glb", &tiny, "the GLB header says 3 bytes");
    let mut long_chunk = whole.clone();
    long_chunk[12..16].copy_from_slice(&u32::MAX.to_le_bytes());
    refused("scene.glb", &long_chunk, "a GLB chunk says 4294967295 bytes, but the file ends before");
    let mut binary_first = whole.clone();
    binary_first[16..20].copy_from_slice(b"BIN\0");
    refused("scene.glb", &binary_first, "the first GLB chunk is not JSON");
    let mut old = whole;
    old[4] = 1;
    refused("scene.glb", &old, "GLB version 1 is not supported, only 2 is");
}

#[test]
fn a_missing_scene_gives_a_read_error() {
    let folder = tempfile::tempdir().expect("the system's folder for temporary files is writable");
    let missing = folder.path().join("nowhere.glb");
    let error = scene::load(&missing, None).expect_err("there is no such file");
    assert!(matches!(&error, Error::Read { path, .. } if *path == missing), "{error}");
}

#[test]
fn deep_chains_of_nodes_do_not_overflow_the_stack() {
    const DEPTH: usize = 100_000;
    let mut nodes: Vec<Value> = (0..DEPTH).map(|index| json!({ "children": [index + 1] })).collect();
    nodes.push(json!({ "mesh": 0 }));
    nodes.push(json!({ "camera": 0 }));
    let document = with(&[("/scenes/0/nodes", json!([0, DEPTH + 1])), ("/nodes", json!(nodes))]);
    assert_eq!(try_load(&document).expect("a deep tree is a tree").triangles.len(), 1);
}
