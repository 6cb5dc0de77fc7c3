//! Tests that the pictures of a glTF file become the scene's textures.

#![allow(clippy::panic, reason = "a failed test panics")]

use crate::scene_support::{data_uri, load, png, set, with, write};
use glam::{Vec2, vec2};
use krylux::scene::{self, TextureRef, Wrap};
use serde_json::{Value, json};

/// The document with this picture as base colour texture. `info` is the texture reference and `sampler` the
/// sampler.
fn textured(uri: &str, info: Value, sampler: Value) -> Value {
    let mut document = with(&[
        ("/materials/0/pbrMetallicRoughness/baseColorTexture", info),
        ("/textures", json!([{ "source": 0, "sampler": 0 }])),
        ("/images", json!([{ "uri": uri }])),
        ("/samplers", json!([sampler])),
    ]);
    set(&mut document, "/materials/0/pbrMetallicRoughness/baseColorTexture/index", json!(0));
    document
}

const TEXELS: [[u8; 4]; 6] =
    [[1, 2, 3, 255], [4, 5, 6, 255], [7, 8, 9, 255], [10, 11, 12, 128], [13, 14, 15, 0], [16, 17, 18, 255]];

#[test]
fn texels_and_samplers_of_pictures_are_loaded() {
    let uri = data_uri("image/png", &png(3, 2, &TEXELS));
    let sampler = json!({ "wrapS": 33071, "wrapT": 33648, "magFilter": 9728 });
    let scene = load(&textured(&uri, json!({}), sampler));
    assert_eq!(scene.materials[0].base_color_texture, Some(TextureRef::new(0)));
    let texture = &scene.textures[0];
    assert_eq!((texture.width, texture.height, texture.texels.as_slice()), (3, 2, TEXELS.as_slice()));
    assert_eq!((texture.wrap, texture.linear), ([Wrap::ClampToEdge, Wrap::MirroredRepeat], false));
    assert_eq!(
        scene.triangles[0].texcoords.map(|[first, _]| first),
        [vec2(0.0, 0.0), vec2(1.0, 0.0), vec2(0.0, 1.0)]
    );

    let defaults = load(&textured(&uri, json!({}), json!({})));
    assert_eq!((defaults.textures[0].wrap, defaults.textures[0].linear), ([Wrap::Repeat; 2], true));
}

#[test]
fn pictures_may_be_files_or_buffer_views_in_png_or_jpeg() {
    let picture = png(3, 2, &TEXELS);
    let written = write(&textured("paint%20layer.png", json!({}), json!({})));
    std::fs::write(written.folder.path().join("paint layer.png"), &picture).expect("the folder is ours");
    let scene = scene::load(&written.path, None).expect("the picture is there");
    assert_eq!(scene.textures[0].texels, TEXELS);

    let mut in_view = textured("", json!({}), json!({}));
    set(&mut in_view, "/images/0", json!({ "bufferView": 3, "mimeType": "image/png" }));
    set(&mut in_view, "/bufferViews/3", json!({ "buffer": 1, "byteLength": picture.len() }));
    set(&mut in_view, "/buffers/1", json!({ "byteLength": picture.len(), "uri": data_uri("", &picture) }));
    assert_eq!(load(&in_view).textures[0].texels, TEXELS);

    let mut jpeg = std::io::Cursor::new(Vec::new());
    image::RgbImage::from_pixel(8, 8, image::Rgb([200, 100, 50]))
        .write_to(&mut jpeg, image::ImageFormat::Jpeg)
        .expect("JPEG holds any RGB picture");
    let scene = load(&textured(&data_uri("image/jpeg", jpeg.get_ref()), json!({}), json!({})));
    let [red, green, blue, alpha] = scene.textures[0].texels[0];
    // JPEG is lossy. A uniform colour changes by a few steps at most.
    assert!(red.abs_diff(200) < 4 && green.abs_diff(100) < 4 && blue.abs_diff(50) < 4 && alpha == 255);
}

#[test]
fn webp_pictures_are_used_where_a_texture_has_no_other() {
    let mut webp = std::io::Cursor::new(Vec::new());
    let samples = TEXELS.as_flattened();
    image::write_buffer_with_format(
        &mut webp,
        samples,
        3,
        2,
        image::ExtendedColorType::Rgba8,
        image::ImageFormat::WebP,
    )
    .expect("lossless WebP holds any RGBA picture");
    let mut document = textured("", json!({}), json!({}));
    set(&mut document, "/extensionsRequired", json!(["EXT_texture_webp"]));
    set(&mut document, "/textures/0", json!({ "extensions": { "EXT_texture_webp": { "source": 0 } } }));
    set(&mut document, "/images/0", json!({ "uri": data_uri("image/webp", webp.get_ref()) }));
    assert_eq!(load(&document).textures[0].texels, TEXELS);

    // A picture that every reader knows comes first.
    set(&mut document, "/textures/0/source", json!(1));
    set(&mut document, "/images/1", json!({ "uri": data_uri("image/png", &png(1, 1, &[[9, 8, 7, 255]])) }));
    assert_eq!(load(&document).textures[0].texels, [[9, 8, 7, 255]]);
}

#[test]
fn texture_transforms_are_loaded_with_the_texture_reference() {
    let transform = |value: Value| {
        let uri = data_uri("image/png", &png(1, 1, &[[255; 4]]));
        let info = json!({ "extensions": { "KHR_texture_transform": value } });
        let scene = load(&textured(&uri, info, json!({})));
        let texture = scene.materials[0].base_color_texture.expect("it is textured");
        scene.triangles[0].texcoords.map(|[first, _]| texture.transform.transform_point2(first))
    };
    let scaled = transform(json!({ "offset": [0.5, 0.25], "scale": [2, 4] }));
    assert_eq!(scaled, [vec2(0.5, 0.25), vec2(2.5, 0.25), vec2(0.5, 4.25)]);
    // The rotation is counter-clockwise as seen, and v points down: +u is mapped to −v.
    let turned = transform(json!({ "rotation": std::f32::consts::FRAC_PI_2 }));
    for (turned, expected) in turned.into_iter().zip([Vec2::ZERO, vec2(0.0, -1.0), vec2(1.0, 0.0)]) {
        // The tolerance allows for sine and cosine of a rounded π/2.
        assert!(turned.distance(expected) < 1e-6, "{turned} is not {expected}");
    }
}

#[test]
fn a_texture_transform_may_select_another_set_of_coordinates() {
    let uri = data_uri("image/png", &png(1, 1, &[[255; 4]]));
    let info = json!({ "texCoord": 0, "extensions": { "KHR_texture_transform": { "texCoord": 1 } } });
    let mut document = textured(&uri, info, json!({}));
    set(&mut document, "/meshes/0/primitives/0/attributes", json!({ "POSITION": 0, "TEXCOORD_1": 2 }));
    let scene = load(&document);
    assert_eq!(scene.materials[0].base_color_texture, Some(TextureRef { set: 1, ..TextureRef::new(0) }));
    assert_eq!(scene.triangles[0].texcoords[1], [Vec2::ZERO, vec2(1.0, 0.0)]);
}

#[test]
fn a_missing_picture_is_left_out_with_a_warning_or_an_error_where_that_is_asked_for() {
    let mut document = textured("gone.png", json!({}), json!({}));
    for texture in ["normalTexture", "emissiveTexture"] {
        set(&mut document, &format!("/materials/0/{texture}"), json!({ "index": 0 }));
    }
    set(&mut document, "/materials/0/emissiveFactor", json!([1, 1, 1]));
    let written = write(&document);
    let strict = |strict| {
        scene::load_with(&written.path, &scene::LoadOptions { strict, ..scene::LoadOptions::default() })
    };
    let found = strict(false).expect("what is missing is left out");
    let material = &found.materials[0];
    let texel = |texture: &Option<TextureRef>| {
        let texture = &found.textures[texture.as_ref().expect("it has one").texture as usize];
        texture.texels.clone()
    };
    assert_eq!(texel(&material.base_color_texture), [[255; 4]], "the material's own colour");
    assert_eq!(texel(&material.normal_texture), [[128, 128, 255, 255]], "no bumps");
    assert_eq!(texel(&material.emission_texture), [[0, 0, 0, 255]], "no light");
    let said = found.warnings.join("; ");
    assert!(said.contains("gone.png is missing: the base colour texture of material 0"), "{said}");
    let error = strict(true).expect_err("it is missing").to_string();
    assert!(error.contains("the picture gone.png is missing"), "{error}");
}
