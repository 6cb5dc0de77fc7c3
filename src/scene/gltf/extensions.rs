//! Which glTF extensions are followed, which are ignored, and which a scene cannot be loaded with.
//!
//! | extension | here |
//! |---|---|
//! | `KHR_materials_specular`, `KHR_materials_ior`, `KHR_materials_emissive_strength` | followed, with their textures |
//! | `KHR_materials_transmission` | followed: thin walls |
//! | `KHR_materials_volume` | makes solids of them where `thicknessFactor` is above 0; the thickness itself comes from the geometry, so the surface must be closed |
//! | `KHR_materials_diffuse_transmission` | followed |
//! | `KHR_texture_transform` | followed, for each texture by itself |
//! | `KHR_mesh_quantization` | followed |
//! | `EXT_mesh_gpu_instancing` | followed |
//! | `KHR_lights_punctual` | ignored with a warning: the projector is the light |
//! | any other, required | error |
//! | any other, used | one warning, unless it has no effect on the picture |
//! | `KHR_materials_unlit` | error where a surface uses it: an unlit surface transports no light |
//!
//! Without extensions: every texture of metallic-roughness but occlusion, which is ignored (it stands for light that is
//! traced here); alpha modes; `COLOR_0`; `TEXCOORD_0` and `TEXCOORD_1`; normals (`TANGENT` is ignored: normal maps are read
//! in the frame of their texture coordinates); sparse accessors; morph targets and skins at rest, where animations leave
//! them alone. Extras of camera nodes: `"krylux": "projector"`, `resolution`, `aperture_radius`, `focus_distance`.

use super::Document;
use crate::error::Result;

const FOLLOWED: [&str; 9] = [
    INSTANCING,
    "KHR_materials_transmission",
    "KHR_materials_diffuse_transmission",
    "KHR_materials_volume",
    "KHR_materials_specular",
    "KHR_materials_ior",
    "KHR_materials_emissive_strength",
    "KHR_texture_transform",
    "KHR_mesh_quantization",
];

/// Many places for one mesh.
pub(super) const INSTANCING: &str = "EXT_mesh_gpu_instancing";

const LIGHTS: &str = "KHR_lights_punctual";

/// Used, these change nothing in the picture of the scene as the file presents it.
const WITHOUT_EFFECT: [&str; 8] = [
    "KHR_xmp",
    "KHR_xmp_json_ld",
    "KHR_materials_variants",
    "KHR_animation_pointer",
    "KHR_audio_emitter",
    "KHR_physics_rigid_bodies",
    "KHR_implicit_shapes",
    "MSFT_lod",
];

const COMPRESSION: [&str; 3] =
    ["KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_meshopt_compression"];

/// These are met, or not, where a mesh or a texture turns out to have no other data, or where a material uses them.
const CHECKED_AT_USE: [&str; 3] = ["KHR_texture_basisu", "EXT_texture_webp", "EXT_texture_avif"];

/// Refuses required extensions that are not followed, and warns of used ones.
pub(super) fn check(document: &mut Document) -> Result<()> {
    for name in &document.root.extensions_required {
        let name = name.as_str();
        if !FOLLOWED.contains(&name) && name != LIGHTS && !WITHOUT_EFFECT.contains(&name) {
            return Err(document.fault(
                format!("the file requires the extension {name}, which is not supported"),
                advice(name),
            ));
        }
    }
    for name in &document.root.extensions_used {
        let name = name.as_str();
        if name == LIGHTS {
            document
                .warnings
                .add(format!("the file's lights ({LIGHTS}) are ignored: the projector is the light"));
        } else if !FOLLOWED.contains(&name)
            && !WITHOUT_EFFECT.contains(&name)
            && !CHECKED_AT_USE.contains(&name)
            && !COMPRESSION.contains(&name)
            // Named with the material that uses it, and not at all if none does.
            && !name.starts_with("KHR_materials_")
        {
            document.warnings.add(format!("the extension {name} is not supported and ignored"));
        }
    }
    Ok(())
}

/// The mesh compression that the file uses, if any: the likely reason why data is not where it should be.
pub(super) fn compression(document: &Document) -> Option<&str> {
    document.root.extensions_used.iter().map(String::as_str).find(|name| COMPRESSION.contains(name))
}

/// What to do about an extension that is required but not supported.
pub(super) fn advice(name: &str) -> &'static str {
    match name {
        _ if COMPRESSION.contains(&name) => "export the scene without mesh compression",
        "KHR_texture_basisu" | "EXT_texture_webp" | "EXT_texture_avif" => {
            "export the scene with PNG or JPEG pictures"
        }
        "KHR_materials_unlit" => {
            "give the surfaces a metallic-roughness material: unlit ones transport no light"
        }
        _ if name.starts_with("KHR_materials_") => {
            "export the scene with materials that have metallic-roughness, specular, transmission and volume only"
        }
        _ => "export the scene without this extension",
    }
}
