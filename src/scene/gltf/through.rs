//! Material extensions for light that passes through a surface, parsed from their JSON.

use gltf_json as json;
use serde::Deserialize;
use serde::de::DeserializeOwned;

use super::Document;
use super::checks::Checks;
use crate::error::Result;
use crate::scene::{Material, Volume};

const TRANSMISSION: &str = "KHR_materials_transmission";
const DIFFUSE_TRANSMISSION: &str = "KHR_materials_diffuse_transmission";
const VOLUME: &str = "KHR_materials_volume";

/// The extensions that this module reads.
pub(super) const SUPPORTED: [&str; 3] = [TRANSMISSION, DIFFUSE_TRANSMISSION, VOLUME];

/// `KHR_materials_transmission`.
#[derive(Default, Deserialize)]
pub(super) struct Transmission {
    #[serde(default, rename = "transmissionFactor")]
    factor: f32,
    #[serde(default, rename = "transmissionTexture")]
    pub texture: Option<json::texture::Info>,
}

/// `KHR_materials_diffuse_transmission`.
#[derive(Default, Deserialize)]
pub(super) struct DiffuseTransmission {
    #[serde(default, rename = "diffuseTransmissionFactor")]
    factor: f32,
    #[serde(default, rename = "diffuseTransmissionTexture")]
    pub texture: Option<json::texture::Info>,
    #[serde(default, rename = "diffuseTransmissionColorFactor")]
    color: Option<[f32; 3]>,
    #[serde(default, rename = "diffuseTransmissionColorTexture")]
    pub color_texture: Option<json::texture::Info>,
}

/// `KHR_materials_volume`. A thickness above 0 makes a solid; how thick it is follows from the geometry.
#[derive(Default, Deserialize)]
struct Medium {
    #[serde(default, rename = "thicknessFactor")]
    thickness: f32,
    #[serde(default, rename = "attenuationDistance")]
    attenuation_distance: Option<f32>,
    #[serde(default, rename = "attenuationColor")]
    attenuation_color: Option<[f32; 3]>,
}

/// The three extensions of a material; defaults for those that it does not have.
#[derive(Default)]
pub(super) struct Through {
    pub transmission: Transmission,
    pub diffuse: DiffuseTransmission,
    medium: Medium,
}

impl Through {
    /// Parses the extensions of the material that `what` names.
    pub(super) fn read(
        document: &Document,
        what: &str,
        extensions: &serde_json::Map<String, json::Value>,
    ) -> Result<Self> {
        Ok(Self {
            transmission: read(document, what, extensions, TRANSMISSION)?,
            diffuse: read(document, what, extensions, DIFFUSE_TRANSMISSION)?,
            medium: read(document, what, extensions, VOLUME)?,
        })
    }

    /// Checks the factors and stores them in `material`.
    pub(super) fn check_into(&self, checked: &Checks<'_>, material: &mut Material) -> Result<()> {
        material.transmission = checked.fraction("transmissionFactor", self.transmission.factor)?;
        material.diffuse_transmission = checked.fraction("diffuseTransmissionFactor", self.diffuse.factor)?;
        if let Some(color) = self.diffuse.color {
            material.diffuse_transmission_color =
                checked.fractions("diffuseTransmissionColorFactor", color)?;
        }
        let distance = self.medium.attenuation_distance.unwrap_or(f32::INFINITY);
        let volume = Volume {
            attenuation_color: checked
                .fractions("attenuationColor", self.medium.attenuation_color.unwrap_or([1.0; 3]))?,
            attenuation_distance: checked.positive("attenuationDistance", distance)?,
        };
        let [thickness, _, _] =
            checked.not_negative("thicknessFactor", [self.medium.thickness, 0.0, 0.0])?.to_array();
        material.volume = (thickness > 0.0).then_some(volume);
        Ok(())
    }
}

/// Parses the extension `name`, or returns its default if the material does not have it.
fn read<T: Default + DeserializeOwned>(
    document: &Document,
    what: &str,
    extensions: &serde_json::Map<String, json::Value>,
    name: &str,
) -> Result<T> {
    let Some(value) = extensions.get(name) else { return Ok(T::default()) };
    serde_json::from_value(value.clone()).map_err(|error| {
        document.fault(format!("{what}: {name} cannot be read: {error}"), "export the scene again")
    })
}
