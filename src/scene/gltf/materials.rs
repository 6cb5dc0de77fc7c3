//! Conversion of glTF materials: factors, textures, and warnings about unsupported extensions.

use std::collections::HashMap;

use glam::Vec3;
use gltf_json as json;
use gltf_json::validation::Checked;
use serde::Deserialize;

use super::textures::{TextureUse, Textures};
use super::{Document, object_name};
use crate::error::{Error, Result};
use crate::scene::{AlphaMode, Material, TextureRef, Volume};

/// The materials that surfaces use, in order of their first use.
#[derive(Default)]
pub(super) struct Materials {
    /// The materials. [`crate::scene::Triangle::material`] is an index into this list.
    pub list: Vec<Material>,
    pub textures: Textures,
    /// The index into the list for each material of the file. The key `None` stands for glTF's default material.
    index_of: HashMap<Option<usize>, usize>,
    /// Copies of materials without some textures, for primitives that lack coordinates. The key has the material and the available
    /// coordinate sets.
    bare: HashMap<(u32, [bool; 2]), u32>,
}

impl Materials {
    /// The scene's index of the file's material `index`, or of glTF's default material for `None`. `what` names the primitive in messages.
    pub(super) fn index_of(
        &mut self,
        document: &mut Document,
        what: &str,
        index: Option<usize>,
    ) -> Result<u32> {
        if let Some(&position) = self.index_of.get(&index) {
            return Ok(position as u32);
        }
        let material = match index {
            Some(index) => self.convert(document, what, index)?,
            None => {
                document.file.warn(
                    "surfaces without a material get glTF's default, which is a rough white metal"
                        .to_string(),
                );
                Material {
                    metallic: 1.0,
                    specular: 1.0,
                    double_sided: false,
                    name: "default".into(),
                    ..Material::default()
                }
            }
        };
        let position = self.list.len();
        self.list.push(material);
        self.index_of.insert(index, position);
        Ok(position as u32)
    }

    /// The material for a primitive that has these sets of texture coordinates. If textures of the material `position` need a missing set,
    /// the result is a copy without these textures, and a warning says so. `what` names the primitive.
    pub(super) fn with_coordinates(
        &mut self,
        document: &mut Document,
        what: &str,
        position: u32,
        has_set: [bool; 2],
    ) -> Result<u32> {
        let material = &self.list[position as usize];
        let Some((role, texture)) = material.textures().find(|(_, texture)| !has_set[texture.set as usize])
        else {
            return Ok(position);
        };
        if let Some(&bare) = self.bare.get(&(position, has_set)) {
            return Ok(bare);
        }
        let set = texture.set;
        document.file.tolerate(
            format!("{what} has no TEXCOORD_{set}, but its material's {role} texture reads it"),
            "the texture is left out",
            "unwrap the mesh, or remove the texture from the material",
        )?;
        let mut bare = material.clone();
        bare.retain_textures(|texture| has_set[texture.set as usize]);
        self.list.push(bare);
        let index = self.list.len() as u32 - 1;
        self.bare.insert((position, has_set), index);
        Ok(index)
    }

    /// Converts the file's material `index`. `user` names the primitive that uses it.
    fn convert(&mut self, document: &mut Document, user: &str, index: usize) -> Result<Material> {
        let source = document.referred(&document.root.materials, user, "material", index)?.clone();
        let what = object_name("material", index, source.name.as_ref());
        let is_unlit = check_extensions(document, &what, &source);

        let extensions = source.extensions.as_ref().map(|extensions| &extensions.others);
        let transmission = TransmissionExtensions {
            regular: document.extension(&what, extensions, TRANSMISSION)?.unwrap_or_default(),
            diffuse: document.extension(&what, extensions, DIFFUSE_TRANSMISSION)?.unwrap_or_default(),
            medium: document.extension(&what, extensions, VOLUME)?.unwrap_or_default(),
        };
        let checked = Checks { document, what: &what };
        let mut material = factors(&checked, index, &source, &transmission)?;
        self.refer_to_textures(document, &what, &source, &transmission, &mut material)?;
        if let Some(glossiness) = document.extension::<Glossiness>(&what, extensions, GLOSSINESS)? {
            glossiness.replace(document, &what, &mut self.textures, &mut material)?;
        }
        if is_unlit {
            (material.metallic, material.roughness, material.specular) = (0.0, 1.0, 0.0);
            material.metallic_roughness_texture = None;
        }
        Ok(material)
    }

    /// Adds the textures of `material`. `what` names the material in messages.
    fn refer_to_textures(
        &mut self,
        document: &mut Document,
        what: &str,
        source: &json::Material,
        transmission: &TransmissionExtensions,
        material: &mut Material,
    ) -> Result<()> {
        let normal = source.normal_texture.as_ref().map(TextureUse::of_normal);
        if let Some(None) = normal {
            return Err(document
                .damaged(format!("{what}: the KHR_texture_transform of its normal texture cannot be read")));
        }
        let pbr = &source.pbr_metallic_roughness;
        let specular = specular(source);
        let of = |info: &Option<json::texture::Info>| info.as_ref().map(TextureUse::of);
        let textures = [
            of(&pbr.base_color_texture),
            of(&pbr.metallic_roughness_texture),
            normal.flatten(),
            of(&source.emissive_texture),
            of(&specular.specular_texture),
            of(&specular.specular_color_texture),
            of(&transmission.regular.transmission_texture),
            of(&transmission.diffuse.diffuse_transmission_texture),
            of(&transmission.diffuse.diffuse_transmission_color_texture),
        ];
        for ((role, slot), texture) in material.texture_slots().into_iter().zip(textures) {
            if let Some(texture) = texture {
                *slot = self.textures.refer(document, what, role, &texture)?;
            }
        }
        Ok(())
    }
}

/// Converts the file's material `index` without its textures.
fn factors(
    checked: &Checks<'_>,
    index: usize,
    source: &json::Material,
    transmission: &TransmissionExtensions,
) -> Result<Material> {
    let pbr = &source.pbr_metallic_roughness;
    let extensions = source.extensions.as_ref();
    let specular = specular(source);
    let ior = extensions.and_then(|extensions| extensions.ior.clone()).unwrap_or_default();
    let strength = extensions
        .and_then(|extensions| extensions.emissive_strength.as_ref())
        .map_or(1.0, |strength| strength.emissive_strength.0);
    let [red, green, blue, alpha] = pbr.base_color_factor.0;
    let mut material = Material {
        name: source.name.clone().unwrap_or_else(|| object_name("material", index, None)),
        base_color: checked.fractions("baseColorFactor", [red, green, blue])?,
        opacity: checked.fraction("alpha in baseColorFactor", alpha)?,
        alpha_mode: alpha_mode(checked, source)?,
        metallic: checked.fraction("metallicFactor", pbr.metallic_factor.0)?,
        roughness: checked.fraction("roughnessFactor", pbr.roughness_factor.0)?,
        specular: checked.fraction("specularFactor", specular.specular_factor.0)?,
        specular_color: checked.not_negative("specularColorFactor", specular.specular_color_factor.0)?,
        ior: checked.ior(ior.ior.0)?,
        emission: checked
            .not_negative("emissiveFactor", source.emissive_factor.0.map(|factor| factor * strength))?,
        double_sided: source.double_sided,
        ..Material::default()
    };
    transmission.check_into(checked, &mut material)?;
    if let Some(normal) = &source.normal_texture {
        material.normal_scale = checked.finite("normalTexture.scale", normal.scale)?;
    }
    Ok(material)
}

fn specular(source: &json::Material) -> json::extensions::material::Specular {
    source.extensions.as_ref().and_then(|extensions| extensions.specular.clone()).unwrap_or_default()
}

fn alpha_mode(checked: &Checks<'_>, source: &json::Material) -> Result<AlphaMode> {
    Ok(match source.alpha_mode {
        Checked::Valid(json::material::AlphaMode::Opaque) => AlphaMode::Opaque,
        Checked::Valid(json::material::AlphaMode::Blend) => AlphaMode::Blend,
        Checked::Valid(json::material::AlphaMode::Mask) => {
            let cutoff = source.alpha_cutoff.map_or(0.5, |cutoff| cutoff.0);
            AlphaMode::Mask { cutoff: checked.finite("alphaCutoff", cutoff)? }
        }
        Checked::Invalid => {
            return Err(checked
                .document
                .fault(format!("{} has an unknown alphaMode", checked.what))
                .help("use OPAQUE, MASK or BLEND"));
        }
    })
}

/// The extension of surfaces that show the same colour under any light.
const UNLIT: &str = "KHR_materials_unlit";

/// Warns about an unlit material and about unsupported extensions. Returns whether the material is unlit.
fn check_extensions(document: &mut Document, what: &str, source: &json::Material) -> bool {
    let Some(others) = source.extensions.as_ref().map(|extensions| &extensions.others) else {
        return false;
    };
    let is_unlit = others.contains_key(UNLIT);
    if is_unlit {
        let warning =
            format!("{what} is unlit ({UNLIT}), which transports no light: it is a matte surface here");
        document.file.warn(warning);
    }
    let supported = |name: &str| [UNLIT, GLOSSINESS].contains(&name) || READ_HERE.contains(&name);
    for name in others.keys().filter(|name| !supported(name)) {
        let warning = format!("{name} is not supported and ignored; {what} uses it first");
        document.file.warn_once(name, warning);
    }
    is_unlit
}

/// The tolerance by which a fraction may lie outside `[0, 1]`. Exporters that compute in single precision exceed this range by rounding.
const ROUNDING: f32 = 1e-5;

/// Range checks. Their errors name the material and the factor.
pub(super) struct Checks<'a> {
    pub document: &'a Document,
    pub what: &'a str,
}

impl Checks<'_> {
    pub(super) fn fraction(&self, factor: &str, value: f32) -> Result<f32> {
        // If the value is NaN, this comparison fails.
        if (-ROUNDING..=1.0 + ROUNDING).contains(&value) {
            return Ok(value.clamp(0.0, 1.0));
        }
        Err(self.out_of_range(factor, value, "between 0 and 1"))
    }

    pub(super) fn fractions(&self, factor: &str, values: [f32; 3]) -> Result<Vec3> {
        let [red, green, blue] = values;
        Ok(Vec3::new(
            self.fraction(factor, red)?,
            self.fraction(factor, green)?,
            self.fraction(factor, blue)?,
        ))
    }

    pub(super) fn not_negative(&self, factor: &str, values: [f32; 3]) -> Result<Vec3> {
        match values.iter().find(|value| !(value.is_finite() && **value >= 0.0)) {
            Some(&value) => Err(self.out_of_range(factor, value, "finite and not negative")),
            None => Ok(Vec3::from_array(values)),
        }
    }

    pub(super) fn finite(&self, factor: &str, value: f32) -> Result<f32> {
        if value.is_finite() { Ok(value) } else { Err(self.out_of_range(factor, value, "finite")) }
    }

    /// Checks for a positive value. It may be infinite, which means no limit.
    pub(super) fn positive(&self, factor: &str, value: f32) -> Result<f32> {
        if value > 0.0 { Ok(value) } else { Err(self.out_of_range(factor, value, "positive")) }
    }

    /// Checks an index of refraction: at least 1, or 0.
    pub(super) fn ior(&self, value: f32) -> Result<f32> {
        // KHR_materials_ior: an index of 0 stands for a Fresnel term of 1 at all angles.
        if value == 0.0 || (value.is_finite() && value >= 1.0) {
            return Ok(value);
        }
        Err(self.out_of_range("ior", value, "0 or at least 1"))
    }

    fn out_of_range(&self, factor: &str, value: f32, expected: &str) -> Error {
        self.document
            .fault(format!("{}: its {factor} is {value}", self.what))
            .help(format!("correct the material: the value must be {expected}"))
    }
}

pub(super) const GLOSSINESS: &str = "KHR_materials_pbrSpecularGlossiness";

/// The reflectance at normal incidence of a dielectric with an index of refraction of 1.5.
const REFLECTANCE: f32 = 0.04;

/// `KHR_materials_pbrSpecularGlossiness`, an older description of materials.
///
/// The diffuse colour becomes the base colour of a dielectric with an index of refraction of 1.5, which reflects 0.04 at normal incidence.
/// The file's specular reflectance, divided by 0.04, becomes the specular colour. A metal becomes such a dielectric without diffuse colour.
/// Roughness is 1 minus glossiness.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Glossiness {
    diffuse_factor: Option<[f32; 4]>,
    diffuse_texture: Option<json::texture::Info>,
    specular_factor: Option<[f32; 3]>,
    glossiness_factor: Option<f32>,
    specular_glossiness_texture: Option<json::texture::Info>,
}

impl Glossiness {
    /// Replaces the metallic-roughness part of a material. `what` names the material.
    pub(super) fn replace(
        &self,
        document: &mut Document,
        what: &str,
        textures: &mut Textures,
        material: &mut Material,
    ) -> Result<()> {
        let checked = Checks { document, what };
        let [red, green, blue, alpha] = self.diffuse_factor.unwrap_or([1.0; 4]);
        material.base_color = checked.fractions("diffuseFactor", [red, green, blue])?;
        material.opacity = checked.fraction("alpha in diffuseFactor", alpha)?;
        let glossiness = checked.fraction("glossinessFactor", self.glossiness_factor.unwrap_or(1.0))?;
        let specular = checked.fractions("specularFactor", self.specular_factor.unwrap_or([1.0; 3]))?;
        material.specular_color = specular / REFLECTANCE;
        (material.metallic, material.specular, material.ior) = (0.0, 1.0, 1.5);
        material.roughness = 1.0 - glossiness;
        (material.metallic_roughness_texture, material.specular_texture) = (None, None);

        let mut refer = |role: &str, info: &Option<json::texture::Info>| match info {
            Some(info) => textures.refer(document, what, role, &TextureUse::of(info)),
            None => Ok(None),
        };
        material.base_color_texture = refer("diffuse", &self.diffuse_texture)?;
        material.specular_color_texture = refer("specular-glossiness", &self.specular_glossiness_texture)?;
        if let Some(specular) = material.specular_color_texture {
            // The picture's alpha is the glossiness. The roughness is written to the green channel.
            let rough = |[.., alpha]: [u8; 4]| {
                let roughness = 1.0 - glossiness * f32::from(alpha) / 255.0;
                [255, (255.0 * roughness).round() as u8, 255, 255]
            };
            material.roughness = 1.0;
            material.metallic_roughness_texture =
                textures.derive(specular.texture, rough).map(|texture| TextureRef { texture, ..specular });
        }
        Ok(())
    }
}

const TRANSMISSION: &str = "KHR_materials_transmission";
const DIFFUSE_TRANSMISSION: &str = "KHR_materials_diffuse_transmission";
const VOLUME: &str = "KHR_materials_volume";

const READ_HERE: [&str; 3] = [TRANSMISSION, DIFFUSE_TRANSMISSION, VOLUME];

#[derive(Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
struct Transmission {
    transmission_factor: f32,
    transmission_texture: Option<json::texture::Info>,
}

#[derive(Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
struct DiffuseTransmission {
    diffuse_transmission_factor: f32,
    diffuse_transmission_texture: Option<json::texture::Info>,
    diffuse_transmission_color_factor: Option<[f32; 3]>,
    diffuse_transmission_color_texture: Option<json::texture::Info>,
}

/// `KHR_materials_volume`. A thickness above 0 makes the object solid. Its actual thickness follows from the geometry.
#[derive(Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
struct Medium {
    thickness_factor: f32,
    attenuation_distance: Option<f32>,
    attenuation_color: Option<[f32; 3]>,
}

/// The three extensions of a material, with defaults for missing ones.
#[derive(Default)]
struct TransmissionExtensions {
    pub regular: Transmission,
    pub diffuse: DiffuseTransmission,
    medium: Medium,
}

impl TransmissionExtensions {
    fn check_into(&self, checked: &Checks<'_>, material: &mut Material) -> Result<()> {
        let Self { regular, diffuse, medium } = self;
        material.transmission = checked.fraction("transmissionFactor", regular.transmission_factor)?;
        material.diffuse_transmission =
            checked.fraction("diffuseTransmissionFactor", diffuse.diffuse_transmission_factor)?;
        if let Some(color) = diffuse.diffuse_transmission_color_factor {
            material.diffuse_transmission_color =
                checked.fractions("diffuseTransmissionColorFactor", color)?;
        }
        let color = medium.attenuation_color.unwrap_or([1.0; 3]);
        let distance = medium.attenuation_distance.unwrap_or(f32::INFINITY);
        let volume = Volume {
            attenuation_color: checked.fractions("attenuationColor", color)?,
            attenuation_distance: checked.positive("attenuationDistance", distance)?,
        };
        let Vec3 { x: thickness, .. } =
            checked.not_negative("thicknessFactor", [medium.thickness_factor, 0.0, 0.0])?;
        material.volume = (thickness > 0.0).then_some(volume);
        Ok(())
    }
}
