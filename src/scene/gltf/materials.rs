//! Materials: factors checked, textures noted, and warnings of what is not followed.

use std::collections::HashMap;

use glam::Vec3;
use gltf::json;
use gltf::json::material::AlphaMode;
use gltf::json::validation::Checked;

use super::textures::{Coordinates, Textures};
use super::{Document, called};
use crate::error::Result;
use crate::scene::Material;

/// Exporters that compute in single precision overshoot 1 by rounding.
const ROUNDING: f32 = 1e-5;

/// The materials that surfaces use, in the order met.
#[derive(Default)]
pub(super) struct Materials {
    /// What [`crate::scene::Triangle::material`] indexes.
    pub list: Vec<Material>,
    /// The textures that they refer to.
    pub textures: Textures,
    coordinates: Vec<Option<Coordinates>>,
    index_of: HashMap<Option<usize>, usize>,
}

impl Materials {
    /// The scene's index of the file's material `index` (`None`: glTF's default), and how its texture is read.
    /// `what` names the primitive that uses it.
    pub(super) fn index_of(
        &mut self,
        document: &mut Document,
        what: &str,
        index: Option<usize>,
    ) -> Result<(u32, Option<Coordinates>)> {
        if let Some(&position) = self.index_of.get(&index) {
            return Ok((position as u32, self.coordinates[position].clone()));
        }
        let (material, coordinates) = match index {
            Some(index) => self.convert(document, what, index)?,
            None => {
                document.warnings.add(
                    "surfaces without a material get glTF's default, which is a rough white metal"
                        .to_string(),
                );
                (
                    Material {
                        metallic: 1.0,
                        specular: 1.0,
                        double_sided: false,
                        name: "default".into(),
                        ..Material::default()
                    },
                    None,
                )
            }
        };
        let position = self.list.len();
        self.list.push(material);
        self.coordinates.push(coordinates.clone());
        self.index_of.insert(index, position);
        Ok((position as u32, coordinates))
    }

    fn convert(
        &mut self,
        document: &mut Document,
        user: &str,
        index: usize,
    ) -> Result<(Material, Option<Coordinates>)> {
        let Some(source) = document.root.materials.get(index).cloned() else {
            return Err(document.fault(
                format!("{user} refers to material {index}, which does not exist"),
                "the file is damaged: export it again",
            ));
        };
        let what = called("material", index, source.name.as_ref());
        warn_of_ignored(document, &what, &source)?;

        let pbr = &source.pbr_metallic_roughness;
        let extensions = source.extensions.clone().unwrap_or_default();
        let specular = extensions.specular.unwrap_or_default();
        let strength = extensions.emissive_strength.map_or(1.0, |strength| strength.emissive_strength.0);
        let checked = Checks { document, what: &what };
        let [red, green, blue, _] = pbr.base_color_factor.0;
        let mut material = Material {
            name: source.name.clone().unwrap_or_else(|| called("material", index, None)),
            base_color: checked.fractions("baseColorFactor", [red, green, blue])?,
            base_color_texture: None,
            metallic: checked.fraction("metallicFactor", pbr.metallic_factor.0)?,
            roughness: checked.fraction("roughnessFactor", pbr.roughness_factor.0)?,
            specular: checked.fraction("specularFactor", specular.specular_factor.0)?,
            specular_color: checked.not_negative("specularColorFactor", specular.specular_color_factor.0)?,
            ior: checked.ior(extensions.ior.unwrap_or_default().ior.0)?,
            emission: checked
                .not_negative("emissiveFactor", source.emissive_factor.0.map(|factor| factor * strength))?,
            double_sided: source.double_sided,
        };
        let mut coordinates = None;
        if let Some(info) = &pbr.base_color_texture {
            material.base_color_texture =
                Some(self.textures.index_of(document, &what, info.index.value())?);
            coordinates = Some(Coordinates::of(document, &what, info)?);
        }
        Ok((material, coordinates))
    }
}

/// Errors that name the material and the factor.
struct Checks<'a> {
    document: &'a Document,
    what: &'a str,
}

impl Checks<'_> {
    fn fraction(&self, factor: &str, value: f32) -> Result<f32> {
        // NaN fails the comparison, too.
        if (-ROUNDING..=1.0 + ROUNDING).contains(&value) {
            return Ok(value.clamp(0.0, 1.0));
        }
        Err(self.out_of_range(factor, value, "between 0 and 1"))
    }

    fn fractions(&self, factor: &str, values: [f32; 3]) -> Result<Vec3> {
        let [red, green, blue] = values;
        Ok(Vec3::new(
            self.fraction(factor, red)?,
            self.fraction(factor, green)?,
            self.fraction(factor, blue)?,
        ))
    }

    fn not_negative(&self, factor: &str, values: [f32; 3]) -> Result<Vec3> {
        match values.iter().find(|value| !(value.is_finite() && **value >= 0.0)) {
            Some(&value) => Err(self.out_of_range(factor, value, "finite and not negative")),
            None => Ok(Vec3::from_array(values)),
        }
    }

    fn ior(&self, value: f32) -> Result<f32> {
        // Zero is the extension's way to ask for a Fresnel term of 1 everywhere.
        if value == 0.0 || (value.is_finite() && value >= 1.0) {
            return Ok(value);
        }
        Err(self.out_of_range("ior", value, "0 or at least 1"))
    }

    fn out_of_range(&self, factor: &str, value: f32, expected: &str) -> crate::error::Error {
        self.document.fault(
            format!("{}: its {factor} is {value}", self.what),
            format!("correct the material: the value must be {expected}"),
        )
    }
}

fn warn_of_ignored(document: &mut Document, what: &str, source: &json::Material) -> Result<()> {
    let others = source.extensions.as_ref().map(|extensions| &extensions.others);
    if others.is_some_and(|others| others.contains_key("KHR_materials_unlit")) {
        return Err(document.fault(
            format!("{what} is unlit (KHR_materials_unlit): such a surface transports no light"),
            super::extensions::advice("KHR_materials_unlit"),
        ));
    }
    let mut warnings = Vec::new();
    for name in others.into_iter().flat_map(|others| others.keys()) {
        warnings.push(match name.as_str() {
            "KHR_materials_transmission"
            | "KHR_materials_volume"
            | "KHR_materials_diffuse_transmission"
            | "KHR_materials_dispersion"
            | "KHR_materials_volume_scatter" => {
                format!("{what}: {name} is not supported; the surface is opaque")
            }
            _ => format!("{what}: {name} is not supported and ignored"),
        });
    }
    match source.alpha_mode {
        Checked::Valid(AlphaMode::Opaque) => {}
        Checked::Valid(mode) => {
            let mode = format!("{mode:?}").to_uppercase();
            warnings.push(format!("{what}: its alphaMode {mode} is not supported; the surface is opaque"));
        }
        Checked::Invalid => {
            return Err(document.fault(
                format!("{what} has an unknown alphaMode"),
                "use OPAQUE: other modes are not supported",
            ));
        }
    }
    let specular = source.extensions.as_ref().and_then(|extensions| extensions.specular.as_ref());
    let textures = [
        ("metallic-roughness", source.pbr_metallic_roughness.metallic_roughness_texture.is_some()),
        ("normal", source.normal_texture.is_some()),
        ("emissive", source.emissive_texture.is_some()),
        ("specular", specular.is_some_and(|specular| specular.specular_texture.is_some())),
        ("specular colour", specular.is_some_and(|specular| specular.specular_color_texture.is_some())),
    ];
    for (texture, present) in textures {
        if present {
            warnings.push(format!("{what}: its {texture} texture is not supported and ignored"));
        }
    }
    warnings.into_iter().for_each(|warning| document.warnings.add(warning));
    Ok(())
}
