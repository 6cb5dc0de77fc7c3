//! The glTF features and extensions that are supported, ignored or refused.
//!
//! | extension | treatment |
//! |---|---|
//! | `KHR_materials_specular`, `KHR_materials_ior`, `KHR_materials_emissive_strength` | supported, with their textures |
//! | `KHR_materials_transmission` | supported; the surface is a thin wall unless it has a volume |
//! | `KHR_materials_volume` | makes a surface the boundary of a solid where `thicknessFactor` is above 0; the thickness itself comes from the geometry, so the surface must be closed |
//! | `KHR_materials_diffuse_transmission` | supported |
//! | `KHR_materials_pbrSpecularGlossiness` | converted |
//! | `KHR_texture_transform` | supported, for each texture separately |
//! | `KHR_mesh_quantization` | supported |
//! | `EXT_mesh_gpu_instancing` | supported |
//! | `KHR_draco_mesh_compression`, `EXT_meshopt_compression`, `KHR_meshopt_compression` | decompressed |
//! | `EXT_texture_webp` | supported |
//! | `KHR_texture_basisu`, `EXT_texture_avif`, `MSFT_texture_dds` | another picture of the texture is used; where there is none, the texture is left out with a warning; an error where the file requires the extension |
//! | `KHR_lights_punctual` | ignored with a warning: the projector is the light |
//! | any other, required | an error |
//! | any other, used | a warning, unless the extension has no effect on the picture |
//! | `KHR_materials_unlit` | a matte surface of the base colour, with a warning: an unlit surface transports no light |
//!
//! Of the core format these are supported: all metallic-roughness textures; alpha modes; `COLOR_0`;
//! `TEXCOORD_0` and `TEXCOORD_1`; normals; sparse accessors; morph targets and skins in their rest pose,
//! without animations. Occlusion textures are ignored, since occlusion is traced. `TANGENT` is ignored, since
//! normal maps are read in the frame of their texture coordinates.
//!
//! The extras of a camera node may have `"krylux": "projector"`, `resolution`, `aperture_radius` and
//! `focus_distance`.

use super::advice::advice;
use super::textures::WEBP;
use super::{Document, draco, glossiness, meshopt};
use crate::error::Result;

const SUPPORTED: [&str; 15] = [
    glossiness::NAME,
    draco::NAME,
    meshopt::NAMES[0],
    meshopt::NAMES[1],
    WEBP,
    "KHR_materials_unlit",
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

/// Places one mesh many times.
pub(super) const INSTANCING: &str = "EXT_mesh_gpu_instancing";

const LIGHTS: &str = "KHR_lights_punctual";

/// Extensions that do not change the picture of the scene at rest.
const WITHOUT_EFFECT: [&str; 14] = [
    "EXT_instance_features",
    "EXT_mesh_features",
    "EXT_structural_metadata",
    "FB_ngon_encoding",
    "KHR_xmp",
    "KHR_xmp_json_ld",
    "KHR_materials_variants",
    "KHR_animation_pointer",
    "KHR_audio_emitter",
    "KHR_physics_rigid_bodies",
    "KHR_implicit_shapes",
    "MSFT_lod",
    "VRM",
    "VRMC_vrm",
];

/// Extensions for image formats. Only textures that have no picture in another format lose something.
const CHECKED_AT_USE: [&str; 3] = ["KHR_texture_basisu", "EXT_texture_avif", "MSFT_texture_dds"];

/// Refuses required extensions that are not supported, and adds a warning for each of the other unsupported
/// ones in use.
pub(super) fn check(document: &mut Document) -> Result<()> {
    for name in &document.root.extensions_required {
        let name = name.as_str();
        if !SUPPORTED.contains(&name) && name != LIGHTS && !WITHOUT_EFFECT.contains(&name) {
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
        } else if !SUPPORTED.contains(&name)
            && !WITHOUT_EFFECT.contains(&name)
            && !CHECKED_AT_USE.contains(&name)
            // The warning about a material extension names a material that uses it, so it is made where
            // materials are read.
            && !name.starts_with("KHR_materials_")
        {
            document.warnings.add(format!("the extension {name} is not supported and ignored"));
        }
    }
    Ok(())
}
