//! Files that are not glTF, and the pictures and buffers that a file refers to.

#![allow(clippy::panic, reason = "a failed test panics")]

use super::refuses;
use crate::scene_support::{self, data_uri, document, fault, png, strict_fault, with, write, write_bytes};
use krylux::error::Error;
use krylux::scene;
use serde_json::{Value, json};

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
    let tiff = textured(json!({ "name": "logo", "uri": data_uri("image/tiff", b"II*\0..........") }));
    let neither = "image 0 \"logo\" is neither PNG, JPEG, WebP, BMP, GIF nor TGA";
    assert_eq!(strict_fault(&tiff, neither).0, neither);

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
    let only = "texture 0 has its picture only as KHR_texture_basisu, which is not supported";
    let (what, help) = strict_fault(&basis, only);
    assert_eq!(what, only);
    assert_eq!(
        help,
        "convert its pictures: npx @gltf-transform/cli ktxdecompress SCENE.glb PLAIN.glb, with `ktx` of KTX-Software installed (or export the scene with PNG or JPEG pictures)"
    );
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
    let expected =
        "mesh 0 \"triangle\", primitive 0 has no TEXCOORD_0, but its material's base colour texture reads it";
    assert_eq!(strict_fault(&document, expected).0, expected);
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
        Err(Error::Scene { path, fault, help }) => {
            assert_eq!(path, written.folder.path().join("parts/my mesh.bin"));
            assert!(fault.starts_with("no such file, but buffer 0 of "), "{fault}");
            assert!(help.contains("where the scene names it"), "{help}");
        }
        other => panic!("not an error about the scene: {other:?}"),
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
    refused("scene.stl", b"solid", "a format of scenes that krylux does not read");
    refused("scene.blend", b"BLENDER", "a file of Blender, which only Blender reads");
    refused("scene.XML", b"<scene version=\"3.0.0\">", "a scene of Mitsuba, as it seems, and not of krylux");
    refused("scene", b"", "not a known scene format");
    refused("scene.gltf", b"{ \"asset\": ", "not a valid glTF document: EOF while parsing");
    refused("scene.gltf", br#"{ "asset": { "version": "1.0" } }"#, "glTF version `1.0` is not supported");
    refused("scene.gltf", br#"{ "asset": { "version": "2.0" } }"#, "the file has no scene and no nodes");
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
    refused("scene.glb", &old, "glTF version `1.0` is not supported");
}

#[test]
fn a_missing_scene_gives_a_read_error() {
    let folder = tempfile::tempdir().expect("the system's folder for temporary files is writable");
    let missing = folder.path().join("nowhere.glb");
    let error = scene::load(&missing, None).expect_err("there is no such file");
    assert!(matches!(&error, Error::Read { path, .. } if *path == missing), "{error}");
}
