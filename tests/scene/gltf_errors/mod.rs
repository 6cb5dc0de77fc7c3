//! Tests that errors about glTF files name the file, the object at fault and what to do.

#![allow(clippy::panic, reason = "a failed test panics")]

mod arrays;
mod files;

use crate::scene_support::{self, document, fault, try_load, with, write};
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
        &[
            ("/scenes/0/nodes", json!([2])),
            ("/nodes/0/children", json!([1])),
            ("/nodes/1/children", json!([0, 2])),
            ("/nodes/2", json!({})),
        ],
        "node 2 lies below a node that is its own ancestor",
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
        (
            "KHR_texture_basisu",
            "convert its pictures: npx @gltf-transform/cli ktxdecompress SCENE.glb PLAIN.glb, with `ktx` of KTX-Software installed (or export the scene with PNG or JPEG pictures)",
        ),
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

#[cfg(not(feature = "compressed"))]
#[test]
fn compressed_meshes_are_refused_with_the_command_that_decompresses_them() {
    for (file, name) in [
        ("carton-draco.glb", "KHR_draco_mesh_compression"),
        ("carton-meshopt.glb", "EXT_meshopt_compression"),
    ] {
        let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/reference/compressed");
        let error = scene::load(&folder.join(file), None).expect_err("its decoder is not built").to_string();
        let what = format!("the file requires the extension {name}, which this krylux is built without");
        assert!(error.contains(&what), "{error}");
        assert!(error.contains("npx @gltf-transform/cli copy SCENE.glb PLAIN.glb"), "{error}");
        assert!(error.contains("with its decoders: cargo build --release"), "{error}");
    }
}

#[cfg(not(feature = "compressed"))]
#[test]
fn meshes_that_need_not_be_decompressed_are_read_as_they_are() {
    let draco = "/meshes/0/primitives/0/extensions/KHR_draco_mesh_compression";
    let plain = scene_support::load(&document());
    let both = with(&[
        ("/extensionsUsed", json!(["KHR_draco_mesh_compression"])),
        (draco, json!({ "bufferView": 0, "attributes": { "POSITION": 0 } })),
    ]);
    let scene = scene_support::load(&both);
    assert_eq!(scene.triangles, plain.triangles);
    assert_eq!(scene.warnings, ["the extension KHR_draco_mesh_compression is not supported and ignored"]);
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
fn deep_chains_of_nodes_do_not_overflow_the_stack() {
    const DEPTH: usize = 100_000;
    let mut nodes: Vec<Value> = (0..DEPTH).map(|index| json!({ "children": [index + 1] })).collect();
    nodes.push(json!({ "mesh": 0 }));
    nodes.push(json!({ "camera": 0 }));
    let document = with(&[("/scenes/0/nodes", json!([0, DEPTH + 1])), ("/nodes", json!(nodes))]);
    assert_eq!(try_load(&document).expect("a deep tree is a tree").triangles.len(), 1);
}
