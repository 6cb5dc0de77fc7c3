//! Conversion of glTF materials: factors, textures, and warnings about unsupported extensions.

use std::collections::HashMap;

use gltf_json as json;
use gltf_json::validation::Checked;

use super::checks::Checks;
use super::textures::{Textures, Use};
use super::through::Through;
use super::{Document, called};
use crate::error::Result;
use crate::scene::{AlphaMode, Material};

/// The materials that surfaces use, in the order of their first use.
#[derive(Default)]
pub(super) struct Materials {
    /// The materials that [`crate::scene::Triangle::material`] indexes.
    pub list: Vec<Material>,
    /// The textures that they refer to.
    pub textures: Textures,
    /// By the file's index; `None` is glTF's default material.
    index_of: HashMap<Option<usize>, usize>,
}

impl Materials {
    /// The scene's index of the file's material `index`, or of glTF's default material for `None`. `what`
    /// names the primitive that uses it.
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
                document.warnings.add(
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

    /// Converts the file's material `index`. `user` names the primitive that uses it.
    fn convert(&mut self, document: &mut Document, user: &str, index: usize) -> Result<Material> {
        let Some(source) = document.root.materials.get(index).cloned() else {
            return Err(document.fault(
                format!("{user} refers to material {index}, which does not exist"),
                "the file is damaged: export it again",
            ));
        };
        let what = called("material", index, source.name.as_ref());
        check_extensions(document, &what, &source)?;

        let pbr = &source.pbr_metallic_roughness;
        let extensions = source.extensions.clone().unwrap_or_default();
        let through = Through::read(document, &what, &extensions.others)?;
        let specular = extensions.specular.unwrap_or_default();
        let strength = extensions.emissive_strength.map_or(1.0, |strength| strength.emissive_strength.0);
        let checked = Checks { document, what: &what };
        let [red, green, blue, alpha] = pbr.base_color_factor.0;
        let mut material = Material {
            name: source.name.clone().unwrap_or_else(|| called("material", index, None)),
            base_color: checked.fractions("baseColorFactor", [red, green, blue])?,
            opacity: checked.fraction("alpha in baseColorFactor", alpha)?,
            alpha_mode: alpha_mode(&checked, &source)?,
            metallic: checked.fraction("metallicFactor", pbr.metallic_factor.0)?,
            roughness: checked.fraction("roughnessFactor", pbr.roughness_factor.0)?,
            specular: checked.fraction("specularFactor", specular.specular_factor.0)?,
            specular_color: checked.not_negative("specularColorFactor", specular.specular_color_factor.0)?,
            ior: checked.ior(extensions.ior.unwrap_or_default().ior.0)?,
            emission: checked
                .not_negative("emissiveFactor", source.emissive_factor.0.map(|factor| factor * strength))?,
            double_sided: source.double_sided,
            ..Material::default()
        };
        through.check_into(&checked, &mut material)?;
        if let Some(normal) = &source.normal_texture {
            material.normal_scale = checked.finite("normalTexture.scale", normal.scale)?;
        }

        let normal = source.normal_texture.as_ref().map(Use::of_normal);
        if let Some(None) = normal {
            return Err(document.fault(
                format!("{what}: the KHR_texture_transform of its normal texture cannot be read"),
                "the file is damaged: export it again",
            ));
        }
        for (role, slot, info) in [
            ("base colour", &mut material.base_color_texture, pbr.base_color_texture.as_ref().map(Use::of)),
            (
                "metallic-roughness",
                &mut material.metallic_roughness_texture,
                pbr.metallic_roughness_texture.as_ref().map(Use::of),
            ),
            ("normal", &mut material.normal_texture, normal.flatten()),
            ("emissive", &mut material.emission_texture, source.emissive_texture.as_ref().map(Use::of)),
            ("specular", &mut material.specular_texture, specular.specular_texture.as_ref().map(Use::of)),
            (
                "specular colour",
                &mut material.specular_color_texture,
                specular.specular_color_texture.as_ref().map(Use::of),
            ),
            (
                "transmission",
                &mut material.transmission_texture,
                through.transmission.texture.as_ref().map(Use::of),
            ),
            (
                "diffuse transmission",
                &mut material.diffuse_transmission_texture,
                through.diffuse.texture.as_ref().map(Use::of),
            ),
            (
                "diffuse transmission colour",
                &mut material.diffuse_transmission_color_texture,
                through.diffuse.color_texture.as_ref().map(Use::of),
            ),
        ] {
            if let Some(info) = info {
                *slot = Some(self.textures.refer(document, &what, role, &info)?);
            }
        }
        Ok(material)
    }
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
                .fault(format!("{} has an unknown alphaMode", checked.what), "use OPAQUE, MASK or BLEND"));
        }
    })
}

/// Refuses an unlit material, and warns about the other extensions of a material that are not supported.
fn check_extensions(document: &mut Document, what: &str, source: &json::Material) -> Result<()> {
    let Some(others) = source.extensions.as_ref().map(|extensions| &extensions.others) else {
        return Ok(());
    };
    if others.contains_key("KHR_materials_unlit") {
        return Err(document.fault(
            format!("{what} is unlit (KHR_materials_unlit): such a surface transports no light"),
            super::extensions::advice("KHR_materials_unlit"),
        ));
    }
    for name in others.keys().filter(|name| !super::through::SUPPORTED.contains(&name.as_str())) {
        let warning = format!("{name} is not supported and ignored; {what} uses it first");
        document.warnings.add_once(name, warning);
    }
    Ok(())
}
