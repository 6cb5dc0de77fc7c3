//! `EXT_mesh_gpu_instancing`: a node that places its mesh many times.

use glam::{DAffine3, DQuat, DVec3};
use gltf_json as json;
use gltf_json::accessor::{ComponentType, Type};
use serde::Deserialize;

use super::Document;
use super::accessor::{self, Array};
use super::extensions::INSTANCING;
use crate::error::Result;

/// The largest number of instances at one node; it bounds the loading time.
const MAX_INSTANCES: usize = 1 << 20;

#[derive(Deserialize)]
struct Instancing {
    attributes: Attributes,
}

#[derive(Deserialize)]
struct Attributes {
    #[serde(rename = "TRANSLATION")]
    translation: Option<json::Index<json::Accessor>>,
    #[serde(rename = "ROTATION")]
    rotation: Option<json::Index<json::Accessor>>,
    #[serde(rename = "SCALE")]
    scale: Option<json::Index<json::Accessor>>,
}

/// The transforms from each instance's frame to the frame of `node`. `None` if the node does not use the
/// extension. `what` names the node.
pub(super) fn instances(document: &Document, what: &str, node: &json::Node) -> Result<Option<Vec<DAffine3>>> {
    let extension = node.extensions.as_ref().and_then(|extensions| extensions.others.get(INSTANCING));
    let Some(extension) = extension else { return Ok(None) };
    let Attributes { translation, rotation, scale } = match serde_json::from_value(extension.clone()) {
        Ok(Instancing { attributes }) => attributes,
        Err(error) => {
            return Err(document
                .fault(format!("{what}: {INSTANCING} cannot be read: {error}"), "export the scene again"));
        }
    };
    let open =
        |name: &str, accessor: Option<json::Index<json::Accessor>>, shape, components: &[ComponentType]| {
            let what = format!("{what}: {name} of its instances");
            accessor.map(|accessor| accessor::open(document, &what, accessor, shape, components)).transpose()
        };
    let translations = open("TRANSLATION", translation, Type::Vec3, &[ComponentType::F32])?;
    let rotations =
        open("ROTATION", rotation, Type::Vec4, &[ComponentType::F32, ComponentType::I8, ComponentType::I16])?;
    let scales = open("SCALE", scale, Type::Vec3, &[ComponentType::F32])?;
    let counts = [&translations, &rotations, &scales].into_iter().flatten().map(|array| array.count);
    let (Some(least), Some(most)) = (counts.clone().min(), counts.max()) else { return Ok(Some(Vec::new())) };
    if least != most || most > MAX_INSTANCES {
        return Err(document.fault(
            format!("{what} has {most} instances, and {least} in another list of them"),
            format!("give all lists the same length, of at most {MAX_INSTANCES} instances"),
        ));
    }

    let vector = |array: &Option<Array<'_>>, index: usize, default: DVec3| match array {
        None => Some(default),
        Some(array) => array.vector(index).map(|value: [f32; 3]| DVec3::from_array(value.map(f64::from))),
    };
    let place = |index: usize| {
        let rotation = match &rotations {
            None => DQuat::IDENTITY,
            Some(array) => DQuat::from_array(array.vector::<4>(index)?.map(f64::from)),
        };
        let scale = vector(&scales, index, DVec3::ONE)?;
        let translation = vector(&translations, index, DVec3::ZERO)?;
        let usable = rotation.length() > 1e-6 && rotation.is_finite();
        let place = DAffine3::from_scale_rotation_translation(
            scale,
            if usable { rotation.normalize() } else { return None },
            translation,
        );
        place.is_finite().then_some(place)
    };
    (0..most)
        .map(|index| {
            place(index).ok_or_else(|| {
                document.fault(
                    format!(
                        "{what}: the transform of its instance {index} is not finite, or its rotation is zero"
                    ),
                    "correct the instance's translation, rotation and scale",
                )
            })
        })
        .collect::<Result<Vec<_>>>()
        .map(Some)
}
