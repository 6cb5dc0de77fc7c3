//! Tests that materials of a glTF file are loaded into the scene or refused.

#![allow(clippy::panic, reason = "a failed test panics")]

use crate::scene_support::{data_uri, document, fault, load, png, strict_fault, with};
use glam::{Vec3, vec2, vec3};
use krylux::scene::{AlphaMode, Scene, TextureRef, Volume};
use serde_json::{Value, json};

const PRIMITIVE: &str = "/meshes/0/primitives/0";

/// Asserts that the document with these changes is refused with the message `expected`.
#[track_caller]
fn refuses(changes: &[(&str, Value)], expected: &str) {
    assert_eq!(fault(&with(changes), None).0, expected);
}

/// The scene of the document with one picture and this material.
fn material(material: Value) -> Scene {
    load(&with(&[
        ("/materials/0", material),
        ("/textures", json!([{ "source": 0 }, { "source": 0, "sampler": 0 }])),
        ("/samplers", json!([{ "magFilter": 9728 }])),
        ("/images", json!([{ "uri": data_uri("image/png", &png(1, 1, &[[1, 2, 3, 4]])) }])),
        (&format!("{PRIMITIVE}/attributes/TEXCOORD_1"), json!(2)),
    ]))
}

#[test]
fn material_factors_are_loaded() {
    let scene = load(&with(&[(
        "/materials/0",
        json!({
            "name": "lacquer",
            "pbrMetallicRoughness": {
                "baseColorFactor": [0.1, 0.2, 0.3, 1],
                "metallicFactor": 0.25,
                "roughnessFactor": 0.5,
            },
            "emissiveFactor": [0.5, 0, 1],
            "doubleSided": true,
            "extensions": {
                "KHR_materials_specular": { "specularFactor": 0.75, "specularColorFactor": [1, 2, 3] },
                "KHR_materials_ior": { "ior": 1.33 },
                "KHR_materials_emissive_strength": { "emissiveStrength": 4 },
            },
        }),
    )]));
    let material = &scene.materials[0];
    assert_eq!(material.name, "lacquer");
    assert_eq!(material.base_color, vec3(0.1, 0.2, 0.3));
    assert_eq!((material.metallic, material.roughness, material.specular), (0.25, 0.5, 0.75));
    assert_eq!((material.specular_color, material.ior), (vec3(1.0, 2.0, 3.0), 1.33));
    assert_eq!(material.emission, vec3(2.0, 0.0, 4.0));
    assert!(material.double_sided);
    assert_eq!(scene.warnings.len(), 0, "{:?}", scene.warnings);
}

#[test]
fn defaults_of_materials_are_those_of_gltf() {
    let empty = load(&document());
    let mut without = document();
    without["meshes"][0]["primitives"][0].as_object_mut().expect("a primitive").remove("material");
    let absent = load(&without);
    for material in [&empty.materials[0], &absent.materials[0]] {
        assert_eq!((material.base_color, material.metallic, material.roughness), (Vec3::ONE, 1.0, 1.0));
        assert_eq!((material.specular, material.ior, material.double_sided), (1.0, 1.5, false));
    }
    assert_eq!(
        absent.warnings,
        ["surfaces without a material get glTF's default, which is a rough white metal"]
    );
}

#[test]
fn transmission_and_volumes_are_loaded() {
    let scene = material(json!({
        "pbrMetallicRoughness": { "baseColorFactor": [1, 1, 1, 0.25] },
        "extensions": {
            "KHR_materials_transmission": { "transmissionFactor": 0.5 },
            "KHR_materials_diffuse_transmission": {
                "diffuseTransmissionFactor": 0.75,
                "diffuseTransmissionColorFactor": [0.1, 0.2, 0.3],
            },
            "KHR_materials_volume": {
                "thicknessFactor": 2,
                "attenuationDistance": 0.5,
                "attenuationColor": [0.9, 0.8, 0.7],
            },
        },
    }));
    let glass = &scene.materials[0];
    assert_eq!((glass.transmission, glass.diffuse_transmission, glass.opacity), (0.5, 0.75, 0.25));
    assert_eq!(glass.diffuse_transmission_color, vec3(0.1, 0.2, 0.3));
    let volume = Volume { attenuation_color: vec3(0.9, 0.8, 0.7), attenuation_distance: 0.5 };
    assert_eq!(glass.volume, Some(volume));
    assert!(glass.lets_light_through());
    assert_eq!(scene.warnings.len(), 0, "{:?}", scene.warnings);

    // A volume without thickness is a thin wall.
    let extension = json!({ "KHR_materials_volume": { "attenuationDistance": 0.5 } });
    let thin = material(json!({ "extensions": extension })).materials[0].clone();
    assert_eq!((thin.volume, thin.lets_light_through()), (None, false));
    let clear = json!({ "KHR_materials_volume": { "thicknessFactor": 1 } });
    let volume = Volume { attenuation_color: Vec3::ONE, attenuation_distance: f32::INFINITY };
    assert_eq!(material(json!({ "extensions": clear })).materials[0].volume, Some(volume));
}

#[test]
fn alpha_modes_are_loaded() {
    let mode = |value: Value| material(value).materials[0].alpha_mode;
    assert_eq!(mode(json!({})), AlphaMode::Opaque);
    assert_eq!(mode(json!({ "alphaMode": "BLEND" })), AlphaMode::Blend);
    assert_eq!(mode(json!({ "alphaMode": "MASK" })), AlphaMode::Mask { cutoff: 0.5 });
    assert_eq!(mode(json!({ "alphaMode": "MASK", "alphaCutoff": 0.25 })), AlphaMode::Mask { cutoff: 0.25 });
}

#[test]
fn all_textures_of_a_material_are_loaded() {
    let scene = material(json!({
        "pbrMetallicRoughness": {
            "baseColorTexture": { "index": 0 },
            "metallicRoughnessTexture": { "index": 1 },
        },
        "normalTexture": {
            "index": 0,
            "scale": 0.5,
            "texCoord": 1,
            "extensions": { "KHR_texture_transform": { "offset": [0.5, 0.25] } },
        },
        "emissiveTexture": { "index": 0, "texCoord": 1 },
        "extensions": {
            "KHR_materials_specular": { "specularTexture": { "index": 0 }, "specularColorTexture": { "index": 0 } },
            "KHR_materials_transmission": { "transmissionTexture": { "index": 0 } },
            "KHR_materials_diffuse_transmission": {
                "diffuseTransmissionTexture": { "index": 0 },
                "diffuseTransmissionColorTexture": { "index": 0, "texCoord": 1 },
            },
        },
    }));
    let material = &scene.materials[0];
    let plain = TextureRef::new(0);
    let second = TextureRef { set: 1, ..plain };
    let normal = material.normal_texture.expect("it has one");
    assert_eq!((normal.set, normal.transform.transform_point2(vec2(1.0, 1.0))), (1, vec2(1.5, 1.25)));
    assert_eq!(material.normal_scale, 0.5);
    let found: Vec<_> = material
        .textures()
        .filter(|(role, _)| *role != "normal")
        .map(|(role, texture)| (role, *texture))
        .collect();
    assert_eq!(
        found,
        [
            ("base colour", plain),
            // The same picture with another sampler is another texture.
            ("metallic-roughness", TextureRef::new(1)),
            ("specular", plain),
            ("specular colour", plain),
            ("emissive", second),
            ("transmission", plain),
            ("diffuse transmission", plain),
            ("diffuse transmission colour", second),
        ]
    );
    assert_eq!(scene.textures.len(), 2, "references to the same picture and sampler share a texture");
    let coordinates = [vec2(0.0, 0.0), vec2(1.0, 0.0), vec2(0.0, 1.0)];
    assert_eq!(scene.triangles[0].texcoords, coordinates.map(|uv| [uv, uv]));
}

#[test]
fn material_factors_out_of_range_are_refused() {
    let pbr = "/materials/0/pbrMetallicRoughness";
    let extensions = "/materials/0/extensions";
    for (pointer, value, expected) in [
        (format!("{pbr}/baseColorFactor"), json!([0.5, 1.5, 0.5, 1]), "baseColorFactor is 1.5"),
        (format!("{pbr}/metallicFactor"), json!(-0.25), "metallicFactor is -0.25"),
        (format!("{pbr}/roughnessFactor"), json!(2), "roughnessFactor is 2"),
        (format!("{extensions}/KHR_materials_specular/specularFactor"), json!(1.5), "specularFactor is 1.5"),
        (
            format!("{extensions}/KHR_materials_specular/specularColorFactor"),
            json!([1, -1, 1]),
            "specularColorFactor is -1",
        ),
        (format!("{extensions}/KHR_materials_ior/ior"), json!(0.5), "ior is 0.5"),
        ("/materials/0/emissiveFactor".into(), json!([1e39, 0, 0]), "emissiveFactor is inf"),
        (format!("{pbr}/baseColorFactor"), json!([1, 1, 1, 2]), "alpha in baseColorFactor is 2"),
        (
            format!("{extensions}/KHR_materials_transmission/transmissionFactor"),
            json!(1.5),
            "transmissionFactor is 1.5",
        ),
        (
            format!("{extensions}/KHR_materials_diffuse_transmission/diffuseTransmissionFactor"),
            json!(-1),
            "diffuseTransmissionFactor is -1",
        ),
        (
            format!("{extensions}/KHR_materials_volume/attenuationDistance"),
            json!(0),
            "attenuationDistance is 0",
        ),
        (
            format!("{extensions}/KHR_materials_volume/attenuationColor"),
            json!([2, 1, 1]),
            "attenuationColor is 2",
        ),
        (format!("{extensions}/KHR_materials_volume/thicknessFactor"), json!(-1), "thicknessFactor is -1"),
    ] {
        refuses(&[(&pointer, value)], &format!("material 0 \"paint\": its {expected}"));
    }
}

#[test]
fn malformed_materials_are_refused() {
    refuses(&[("/materials/0/alphaMode", json!("FADE"))], "material 0 \"paint\" has an unknown alphaMode");
    let (what, _) = fault(
        &with(&[(
            "/materials/0/extensions/KHR_materials_transmission",
            json!({ "transmissionFactor": "all" }),
        )]),
        None,
    );
    assert!(
        what.starts_with("material 0 \"paint\": KHR_materials_transmission cannot be read: invalid type"),
        "{what}"
    );
    let third = "material 0 \"paint\": its emissive texture reads TEXCOORD_2, and only 0 and 1 are supported";
    let document = with(&[("/materials/0/emissiveTexture", json!({ "index": 0, "texCoord": 2 }))]);
    assert_eq!(strict_fault(&document, third).0, third);
    let transform = |value: Value| json!({ "index": 0, "extensions": { "KHR_texture_transform": value } });
    refuses(
        &[("/materials/0/normalTexture", transform(json!({ "scale": "big" })))],
        "material 0 \"paint\": the KHR_texture_transform of its normal texture cannot be read",
    );
    refuses(
        &[("/materials/0/normalTexture", transform(json!({ "scale": [1e39, 1] })))],
        "material 0 \"paint\": the KHR_texture_transform of its normal texture is not finite",
    );
}

#[test]
fn an_unlit_material_is_a_matte_surface_with_a_warning() {
    let unlit = json!({
        "pbrMetallicRoughness": { "baseColorFactor": [0.1, 0.2, 0.3, 1] },
        "extensions": { "KHR_materials_unlit": {} },
    });
    let scene = load(&with(&[
        ("/materials/0", unlit),
        ("/extensionsUsed", json!(["KHR_materials_unlit"])),
        ("/extensionsRequired", json!(["KHR_materials_unlit"])),
    ]));
    let material = &scene.materials[0];
    assert_eq!((material.base_color, material.metallic, material.roughness), (vec3(0.1, 0.2, 0.3), 0.0, 1.0));
    assert_eq!(scene.warnings.len(), 1);
    assert!(scene.warnings[0].contains("unlit"), "{:?}", scene.warnings);
}
