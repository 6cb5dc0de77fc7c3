//! `KHR_materials_pbrSpecularGlossiness`: an older description of materials, converted to the one that is traced.
//!
//! The diffuse colour becomes the base colour of a dielectric. Its reflectance at normal incidence becomes the specular colour, which
//! multiplies the 0.04 of an index of refraction of 1.5; a metal is such a surface without diffuse colour. Roughness is 1 minus glossiness.

use gltf_json as json;
use serde::Deserialize;

use super::Document;
use super::checks::Checks;
use super::textures::{TextureUse, Textures};
use crate::error::Result;
use crate::scene::{Material, TextureRef};

pub(super) const NAME: &str = "KHR_materials_pbrSpecularGlossiness";

/// The reflectance at normal incidence of a dielectric whose index of refraction is 1.5.
const REFLECTANCE: f32 = 0.04;

/// The extension of a material.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Glossiness {
    #[serde(default = "white")]
    diffuse_factor: [f32; 4],
    diffuse_texture: Option<json::texture::Info>,
    #[serde(default = "ones")]
    specular_factor: [f32; 3],
    #[serde(default = "one")]
    glossiness_factor: f32,
    specular_glossiness_texture: Option<json::texture::Info>,
}

fn white() -> [f32; 4] {
    [1.0; 4]
}

fn ones() -> [f32; 3] {
    [1.0; 3]
}

fn one() -> f32 {
    1.0
}

impl Glossiness {
    /// The extension of the material that `what` names, if it has it.
    pub(super) fn read(document: &Document, what: &str, source: &json::Material) -> Result<Option<Self>> {
        let others = source.extensions.as_ref().map(|extensions| &extensions.others);
        let Some(value) = others.and_then(|others| others.get(NAME)) else { return Ok(None) };
        serde_json::from_value(value.clone()).map(Some).map_err(|error| {
            document.fault(format!("{what}: {NAME} cannot be read: {error}"), "export the scene again")
        })
    }

    /// Replaces the metallic-roughness part of a material. `what` names the material.
    pub(super) fn replace(
        &self,
        document: &mut Document,
        what: &str,
        textures: &mut Textures,
        material: &mut Material,
    ) -> Result<()> {
        let checked = Checks { document, what };
        let [red, green, blue, alpha] = self.diffuse_factor;
        material.base_color = checked.fractions("diffuseFactor", [red, green, blue])?;
        material.opacity = checked.fraction("alpha in diffuseFactor", alpha)?;
        let glossiness = checked.fraction("glossinessFactor", self.glossiness_factor)?;
        material.specular_color = checked.fractions("specularFactor", self.specular_factor)? / REFLECTANCE;
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
            // The picture's alpha is glossiness. Green is the channel of roughness.
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
