//! What to do about a file that requires an extension that is not supported.

/// Advice for a file that requires an unsupported extension.
pub(super) fn advice(name: &str) -> &'static str {
    match name {
        "KHR_texture_basisu" => {
            "convert its pictures: npx @gltf-transform/cli ktxdecompress SCENE.glb PLAIN.glb, with `ktx` of KTX-Software installed (or export the scene with PNG or JPEG pictures)"
        }
        "EXT_texture_avif" => {
            "convert its pictures: npx @gltf-transform/cli png SCENE.glb PLAIN.glb (or export the scene with PNG or JPEG pictures)"
        }
        _ if name.starts_with("KHR_materials_") => {
            "export the scene with materials that have metallic-roughness, specular, transmission and volume only"
        }
        _ => "export the scene without this extension",
    }
}
