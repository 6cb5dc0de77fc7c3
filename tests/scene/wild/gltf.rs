//! glTF files as exporters write them.

use glam::{Vec3, vec3};
use krylux::scene::{self, Camera, LoadOptions};
use serde_json::{Value, json};

use super::{FACE, automatic, obj, warns};
use crate::scene_support::{self, data_uri, document, fault, load, png, set, with, write, write_bytes};

#[test]
fn a_listed_child_is_shown_without_the_parent_that_the_scene_lacks() {
    // UniGLTF writes scenes that list the child, and not the node above it.
    let changes = [
        ("/nodes/2", json!({ "name": "above", "children": [0], "translation": [5, 0, 0] })),
        ("/scenes/0/nodes", json!([0, 1])),
    ];
    let scene = load(&with(&changes));
    assert_eq!(scene.triangles[0].positions, scene_support::CORNERS.map(Vec3::from_array));
    warns(&scene, "which is a child of node 2 \"above\", but does not list that");
    // If the scene lists both, the child is shown once, at its place.
    let mut both = with(&changes);
    set(&mut both, "/scenes/0/nodes", json!([0, 1, 2]));
    let scene = load(&both);
    assert_eq!((scene.triangles.len(), scene.triangles[0].positions[0].x), (1, 5.0));
    warns(&scene, "it is shown once");
}

#[test]
fn a_file_without_scenes_shows_all_of_its_nodes() {
    let mut document = document();
    let members = document.as_object_mut().expect("an object");
    members.remove("scenes");
    members.remove("scene");
    let scene = load(&document);
    assert_eq!((scene.triangles.len(), scene.camera.name.as_str()), (1, "eye"));
    warns(&scene, "the file has no scene: all of its nodes are shown");
}

#[test]
fn an_empty_scene_is_no_damaged_file() {
    let mut document = document();
    document["scenes"][0].as_object_mut().expect("an object").remove("nodes");
    let options = LoadOptions { auto_camera: true, ..LoadOptions::default() };
    let error = scene::load_with(&write(&document).path, &options).expect_err("it is empty").to_string();
    assert!(error.contains("no triangles in the scene"), "{error}");
}

#[test]
fn elements_without_data_are_zero() {
    let mut document = document();
    let count = document["accessors"][0]["count"].clone();
    set(&mut document, "/accessors/3", json!({ "componentType": 5126, "type": "VEC3", "count": count }));
    set(&mut document, "/meshes/0/primitives/0/attributes/NORMAL", json!(3));
    assert_eq!(load(&document).triangles[0].normals, [Vec3::ZERO; 3]);
    document["accessors"][0].as_object_mut().expect("an object").remove("bufferView");
    assert_eq!(fault(&document, None).0, "no triangles in the scene", "all corners are at the origin");
}

#[test]
fn a_file_of_gltf_1_is_named_as_such_with_the_command_that_converts_it() {
    // Its objects have names, not numbers, and its version may be a number.
    let old = json!({ "asset": { "version": 1.0 }, "scenes": { "all": { "nodes": ["root"] } }, "nodes": {} });
    let (what, help) = fault(&old, None);
    assert_eq!(what, "glTF version `1.0` is not supported");
    assert!(help.contains("npx gltf-pipeline -i OLD.gltf -o NEW.glb"), "{help}");
}

#[test]
fn a_byte_order_mark_is_read_past() {
    let text = [b"\xEF\xBB\xBF".as_slice(), document().to_string().as_bytes()].concat();
    assert!(scene::load(&write_bytes("scene.gltf", &text).path, None).is_ok());
}

#[test]
fn a_pointer_of_git_lfs_is_named_as_such() {
    let pointer = b"version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 1\n";
    for name in ["scene.glb", "scene.gltf", "scene.obj"] {
        let error = scene::load(&write_bytes(name, pointer).path, None).expect_err("no scene").to_string();
        assert!(error.contains("a pointer of Git LFS") && error.contains("git lfs pull"), "{error}");
    }
}

#[cfg(feature = "compressed")]
#[test]
fn buffers_that_only_compressed_views_name_need_no_data() {
    let whole = std::fs::read(
        std::path::Path::new(env!("CARGO_MANIFEST_DIR"))
            .join("tests/reference/compressed/carton-meshopt.glb"),
    )
    .expect("it is shipped");
    let length = u32::from_le_bytes([whole[12], whole[13], whole[14], whole[15]]) as usize;
    let mut document: Value = serde_json::from_slice(&whole[20..20 + length]).expect("it is JSON");
    let unmarked = |buffer: &mut Value| {
        let buffer = buffer.as_object_mut().expect("an object");
        buffer.remove("extensions").is_some() && buffer.remove("uri").is_none()
    };
    let buffers = document["buffers"].as_array_mut().expect("it has some");
    assert!(buffers.iter_mut().any(unmarked), "one only stands in for compressed views");
    let written = write_bytes("scene.glb", &scene_support::glb(&document, &whole[28 + length..]));
    let marked = write_bytes("scene.glb", &whole);
    let [plain, whole] = [written, marked].map(|file| scene::load(&file.path, None).expect("it is whole"));
    assert_eq!(plain.triangles, whole.triangles);
}

#[test]
fn with_auto_camera_the_first_of_several_perspective_cameras_is_taken() {
    let orthographic =
        json!({ "type": "orthographic", "orthographic": { "xmag": 1, "ymag": 1, "znear": 0, "zfar": 1 } });
    let changes = [
        ("/scenes/0/nodes", json!([0, 1, 2, 3])),
        ("/cameras/1", orthographic.clone()),
        ("/nodes/1", json!({ "camera": 1, "name": "flat" })),
        ("/nodes/2", json!({ "camera": 0, "name": "left" })),
        ("/nodes/3", json!({ "camera": 0, "name": "right" })),
    ];
    let scene = automatic(&with(&changes));
    assert_eq!(scene.camera.name, "left");
    warns(&scene, "of several cameras the first, `left`, is used; --camera chooses another: `right`");
    let scene = automatic(&with(&[("/cameras/0", orthographic)]));
    assert_eq!(scene.camera.name, Camera::PLACED);
    warns(&scene, "cameras without a perspective are not used: `eye`");
}

#[test]
fn a_placed_camera_stands_where_fronts_are_seen() {
    // The triangle shows its front to +Z, and its back after half a turn.
    let turned =
        |rotation: Value| automatic(&with(&[("/nodes/1", json!({})), ("/nodes/0/rotation", rotation)]));
    assert!(turned(json!([0, 0, 0, 1])).camera.forward.z < 0.0);
    assert!(turned(json!([0, 1, 0, 0])).camera.forward.z > 0.0);
}

#[test]
fn surfaces_without_texture_coordinates_are_shown_without_the_texture() {
    let picture = data_uri("image/png", &png(1, 1, &[[9, 9, 9, 255]]));
    let textured = with(&[
        ("/materials/0/pbrMetallicRoughness/baseColorTexture/index", json!(0)),
        ("/materials/0/pbrMetallicRoughness/baseColorFactor", json!([0.5, 0.25, 0.125, 1])),
        ("/textures", json!([{ "source": 0 }])),
        ("/images", json!([{ "uri": picture }])),
        // A second primitive of the same material that has coordinates keeps the texture.
        ("/meshes/0/primitives/1", json!({ "attributes": { "POSITION": 0 }, "indices": 1, "material": 0 })),
    ]);
    let scene = load(&textured);
    let material = |index: usize| &scene.materials[scene.triangles[index].material as usize];
    assert!(material(0).base_color_texture.is_some());
    assert_eq!(material(1).base_color_texture, None);
    assert_eq!(material(1).base_color, vec3(0.5, 0.25, 0.125));
    warns(&scene, "primitive 1 has no TEXCOORD_0");

    let library = b"newmtl m\nKd 0.5 0.25 0.125\nmap_Kd dot.png\n";
    let dot = png(1, 1, &[[9, 9, 9, 255]]);
    let text = format!("mtllib m.mtl\n{FACE}usemtl m\nf 1/1 2/2 3/3\nf 1 3 2\nf 1/7 2/8 3/9\n");
    let scene = obj(&[("scene.obj", text.as_bytes()), ("m.mtl", library), ("dot.png", &dot)]);
    let textures = scene
        .triangles
        .iter()
        .map(|triangle| scene.materials[triangle.material as usize].base_color_texture.is_some());
    // The third face refers to coordinates that the file does not have.
    assert_eq!(textures.collect::<Vec<_>>(), [true, false, false]);
    warns(&scene, "faces of material `m` have no texture coordinates");
    warns(&scene, "faces refer to texture coordinates that the file does not have: they show no texture");
}

#[test]
fn a_texture_without_a_picture_or_with_one_that_is_not_read_leaves_the_surface_its_colour() {
    let textured = |textures: Value, images: Value| {
        load(&with(&[
            ("/materials/0/pbrMetallicRoughness/baseColorTexture/index", json!(0)),
            ("/textures", textures),
            ("/images", images),
        ]))
    };
    let image = |bytes: &[u8]| json!([{ "uri": data_uri("image/x", bytes) }]);
    let own = json!([{ "source": 0 }]);
    for (scene, what) in [
        (textured(own.clone(), image(b"\xABKTX 20\xBB\r\n\x1A\n")), "has the format KTX2, which is not read"),
        (textured(own.clone(), image(b"DDS |\0\0\0")), "has the format DDS, which is not read"),
        (textured(own.clone(), image(b"\0\0\0\x20ftypavif")), "has the format AVIF, which is not read"),
        (textured(own, json!([{ "uri": "https://example.org/a.png" }])), "since it is not next to the scene"),
        (textured(json!([{}]), json!([])), "texture 0 has no picture"),
    ] {
        assert_eq!(scene.textures[0].texels, [[255; 4]]);
        warns(&scene, what);
    }
}

#[test]
fn specular_and_glossiness_are_those_of_a_dielectric_with_this_reflectance() {
    let picture = png(2, 1, &[[255, 128, 0, 255], [255, 255, 255, 51]]);
    let scene = load(&with(&[
        ("/extensionsRequired", json!(["KHR_materials_pbrSpecularGlossiness"])),
        (
            "/materials/0/extensions/KHR_materials_pbrSpecularGlossiness",
            json!({
                "diffuseFactor": [0.5, 0.25, 0.125, 0.75],
                "specularFactor": [0.04, 0.08, 1.0],
                "glossinessFactor": 0.5,
                "specularGlossinessTexture": { "index": 0 },
            }),
        ),
        ("/textures", json!([{ "source": 0 }])),
        ("/images", json!([{ "uri": data_uri("image/png", &picture) }])),
    ]));
    let material = &scene.materials[0];
    assert_eq!((material.base_color, material.opacity), (vec3(0.5, 0.25, 0.125), 0.75));
    assert_eq!((material.metallic, material.specular, material.ior), (0.0, 1.0, 1.5));
    // Times 0.04, the reflectance of glass of index 1.5, this is the specular factor; a division rounds.
    assert!(material.specular_color.abs_diff_eq(vec3(1.0, 2.0, 25.0), 1e-4), "{}", material.specular_color);
    let texels = |texture: &Option<scene::TextureRef>| {
        let texture = texture.as_ref().expect("it has one").texture;
        scene.textures[texture as usize].texels.clone()
    };
    assert_eq!(texels(&material.specular_color_texture)[0], [255, 128, 0, 255]);
    // Roughness is 1 − 0.5 · alpha: 0.5 and 0.9.
    let rough: Vec<u8> = texels(&material.metallic_roughness_texture).iter().map(|texel| texel[1]).collect();
    assert_eq!((material.roughness, rough), (1.0, vec![128, 230]));
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
}

#[test]
fn metadata_gives_no_warning() {
    let names = json!(["EXT_mesh_features", "EXT_structural_metadata", "FB_ngon_encoding"]);
    assert!(load(&with(&[("/extensionsUsed", names)])).warnings.is_empty());
}
