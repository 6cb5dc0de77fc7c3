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
//! | `KHR_draco_mesh_compression`, `EXT_meshopt_compression`, `KHR_meshopt_compression` | decompressed with the feature `compressed`, which is on by default; without it an error where the file requires the extension, and otherwise the uncompressed copy in the file is read |
//! | `EXT_texture_webp` | supported |
//! | `KHR_texture_basisu`, `EXT_texture_avif`, `MSFT_texture_dds` | another picture of the texture is used; where there is none, the texture is left out with a warning; an error where the file requires the extension |
//! | `KHR_lights_punctual` | ignored with a warning: the projector is the light |
//! | any other, required | an error |
//! | any other, used | a warning, unless the extension has no effect on the picture |
//! | `KHR_materials_unlit` | a matte surface of the base colour, with a warning: an unlit surface transports no light |
//!
//! Supported parts of the core format: all metallic-roughness textures; alpha modes; `COLOR_0`; `TEXCOORD_0` and `TEXCOORD_1`; normals;
//! sparse accessors; morph targets and skins in their rest pose, without animations. Occlusion textures are ignored, because occlusion is
//! traced. `TANGENT` is ignored, because normal maps are read in the frame of their texture coordinates.
//!
//! The extras of a camera node may have `"krylux": "projector"`, `resolution`, `aperture_radius` and `focus_distance`.

use gltf_json as json;

use super::cameras::Exact;
use super::textures::WEBP;
use super::{Document, materials};
use crate::error::Result;
use crate::image::Resolution;
use crate::scene::Lens;

const SUPPORTED: [&str; 12] = [
    materials::GLOSSINESS,
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

pub(super) const DRACO: &str = "KHR_draco_mesh_compression";

/// The two names of the meshopt extension.
pub(super) const MESHOPT: [&str; 2] = ["EXT_meshopt_compression", "KHR_meshopt_compression"];

fn compresses(name: &str) -> bool {
    name == DRACO || MESHOPT.contains(&name)
}

fn is_supported(name: &str) -> bool {
    SUPPORTED.contains(&name) || cfg!(feature = "compressed") && compresses(name)
}

pub(super) const INSTANCING: &str = "EXT_mesh_gpu_instancing";

const LIGHTS: &str = "KHR_lights_punctual";

/// Extensions that do not change the picture of a scene at rest.
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

/// Extensions for image formats. They matter only for textures without a picture in another format.
const CHECKED_AT_USE: [&str; 3] = ["KHR_texture_basisu", "EXT_texture_avif", "MSFT_texture_dds"];

/// Refuses unsupported extensions that are required, and warns about other unsupported extensions.
pub(super) fn check(document: &mut Document) -> Result<()> {
    for name in &document.root.extensions_required {
        let name = name.as_str();
        if !is_supported(name) && name != LIGHTS && !WITHOUT_EFFECT.contains(&name) {
            let why = if compresses(name) { "this krylux is built without" } else { "is not supported" };
            let fault = format!("the file requires the extension {name}, which {why}");
            return Err(document.fault(fault).help(advice(name)));
        }
    }
    for name in &document.root.extensions_used {
        let name = name.as_str();
        if name == LIGHTS {
            document
                .file
                .warn(format!("the file's lights ({LIGHTS}) are ignored: the projector is the light"));
        } else if !is_supported(name)
            && !WITHOUT_EFFECT.contains(&name)
            && !CHECKED_AT_USE.contains(&name)
            // A warning about a material extension names the material, so it is added where materials are read.
            && !name.starts_with("KHR_materials_")
        {
            document.file.warn(format!("the extension {name} is not supported and ignored"));
        }
    }
    Ok(())
}

pub(super) fn advice(name: &str) -> &'static str {
    match name {
        "KHR_texture_basisu" => {
            "convert its pictures: npx @gltf-transform/cli ktxdecompress SCENE.glb PLAIN.glb, with `ktx` of KTX-Software installed (or export the scene with PNG or JPEG pictures)"
        }
        "EXT_texture_avif" => {
            "convert its pictures: npx @gltf-transform/cli png SCENE.glb PLAIN.glb (or export the scene with PNG or JPEG pictures)"
        }
        _ if compresses(name) => {
            "decompress it: npx @gltf-transform/cli copy SCENE.glb PLAIN.glb (or build krylux with its decoders: cargo build --release)"
        }
        _ if name.starts_with("KHR_materials_") => {
            "export the scene with materials that have metallic-roughness, specular, transmission and volume only"
        }
        _ => "export the scene without this extension",
    }
}

/// The members of an object's extras. Empty if the object has no extras.
#[derive(Clone, Default)]
pub(super) struct Extras(serde_json::Map<String, json::Value>);

impl Extras {
    /// Parses extras. If they are not a JSON object, the result is empty.
    pub(super) fn of(extras: &json::Extras) -> Self {
        let parsed = extras.as_ref().and_then(|extras| serde_json::from_str(extras.get()).ok());
        Self(match parsed {
            Some(json::Value::Object(members)) => members,
            _ => serde_json::Map::new(),
        })
    }

    /// The members of `self` and `other`. If both have the same member, the value of `self` is used.
    pub(super) fn or(self, other: Self) -> Self {
        let mut members = other.0;
        members.extend(self.0);
        Self(members)
    }

    /// Whether the node is marked as the projector by `"krylux": "projector"`. `what` names the node.
    pub(super) fn is_projector(&self, document: &Document, what: &dyn Fn() -> String) -> Result<bool> {
        match self.0.get("krylux") {
            None => Ok(false),
            Some(role) if role == "projector" => Ok(true),
            Some(_) => {
                let help = "mark the projector's node by \"krylux\": \"projector\", and remove extras.krylux from other nodes";
                Err(document.fault(format!("{}: its extras.krylux is not \"projector\"", what())).help(help))
            }
        }
    }

    pub(super) fn lens(&self, document: &Document, name: &str) -> Result<Lens> {
        let number = |key: &str| match self.0.get(key) {
            None => Ok(None),
            Some(value) => {
                value.as_f64().map(Some).ok_or_else(|| format!("has an {key} that is not a number"))
            }
        };
        number("aperture_radius")
            .and_then(|radius| Lens::checked(radius, number("focus_distance")?))
            .map_err(|what| document.fault(format!("camera `{name}` {what}")).help(Lens::HELP))
    }

    /// The exact numbers of a camera that krylux wrote.
    pub(super) fn exact(&self) -> Option<Exact> {
        serde_json::from_value(self.0.get("krylux_exact")?.clone()).ok()
    }

    /// The resolution of the projector `name`, if stated.
    pub(super) fn resolution(&self, document: &Document, name: &str) -> Result<Option<Resolution>> {
        let Some(value) = self.0.get("resolution") else { return Ok(None) };
        match serde_json::from_value::<[usize; 2]>(value.clone()) {
            Ok([width @ 1..=16384, height @ 1..=16384]) => Ok(Some(Resolution::new(width, height))),
            _ => Err(document
                .fault(format!("camera `{name}` has a resolution that is not [width, height]"))
                .help("give 1 to 16384 pixels a side")),
        }
    }
}

/// The largest length of a label in bytes. The limit is needed because every node below a labelled node has a copy of the label.
const MAX_NAME_BYTES: usize = 200;

/// A region label. Labels are ordered as the regions are: numbers by value, then names, then the region of surfaces without a label. A
/// region's index therefore does not depend on the order of the nodes.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) enum Label {
    Number(u64),
    Name(String),
    /// The label of surfaces without a stated label, in a file that has labels.
    Absent,
}

/// The name of the region of surfaces without a label.
pub(super) const UNLABELLED: &str = "unlabelled";

impl std::fmt::Display for Label {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Number(number) => write!(f, "{number}"),
            Self::Name(name) => f.write_str(name),
            Self::Absent => f.write_str(UNLABELLED),
        }
    }
}

/// The label of an object from `extras.region`, if it has one. `what` names the object.
pub(super) fn label(document: &Document, what: &str, extras: &json::Extras) -> Result<Option<Label>> {
    let Extras(extras) = Extras::of(extras);
    let Some(region) = extras.get("region") else { return Ok(None) };
    let label = match region {
        json::Value::Null => return Ok(None),
        json::Value::Number(number) => number.as_u64().map(Label::Number),
        json::Value::String(name) if name.is_empty() || name.len() > MAX_NAME_BYTES => None,
        json::Value::String(name) => {
            Some(name.parse().map_or_else(|_| Label::Name(name.clone()), Label::Number))
        }
        _ => None,
    };
    label.map(Some).ok_or_else(|| {
        document
            .fault(format!("{what}: its extras.region is {}, which is not a label", shortened(region)))
            .help(format!(
                "label regions by a non-negative integer or a name of at most {MAX_NAME_BYTES} bytes"
            ))
    })
}

fn shortened(value: &json::Value) -> String {
    let text = value.to_string();
    match text.char_indices().nth(60) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text,
    }
}
