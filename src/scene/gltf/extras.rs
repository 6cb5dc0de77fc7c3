//! The extras of camera nodes and of their cameras: `krylux`, `aperture_radius`, `focus_distance` and
//! `resolution`.

use gltf_json as json;

use super::Document;
use crate::error::Result;
use crate::image::Resolution;
use crate::scene::Lens;

/// The members of an object's extras; empty if it has none.
#[derive(Clone, Default)]
pub(super) struct Extras(serde_json::Map<String, json::Value>);

impl Extras {
    /// Parses extras. Extras that are no JSON object count as empty.
    pub(super) fn of(extras: &json::Extras) -> Self {
        let parsed = extras.as_ref().and_then(|extras| serde_json::from_str(extras.get()).ok());
        Self(match parsed {
            Some(json::Value::Object(members)) => members,
            _ => serde_json::Map::new(),
        })
    }

    /// The members of both. Where both have a member, the one of `self` is taken.
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
            Some(_) => Err(document.fault(
                format!("{}: its extras.krylux is not \"projector\"", what()),
                "mark the projector's node by \"krylux\": \"projector\", and remove extras.krylux from other nodes",
            )),
        }
    }

    /// The lens of the camera `name`.
    pub(super) fn lens(&self, document: &Document, name: &str) -> Result<Lens> {
        let number = |key: &str| match self.0.get(key) {
            None => Ok(None),
            Some(value) => {
                value.as_f64().map(Some).ok_or_else(|| format!("has an {key} that is not a number"))
            }
        };
        number("aperture_radius")
            .and_then(|radius| Lens::checked(radius, number("focus_distance")?))
            .map_err(|what| document.fault(format!("camera `{name}` {what}"), Lens::HELP))
    }

    /// The resolution of the projector `name`, if stated.
    pub(super) fn resolution(&self, document: &Document, name: &str) -> Result<Option<Resolution>> {
        let Some(value) = self.0.get("resolution") else { return Ok(None) };
        match serde_json::from_value::<[usize; 2]>(value.clone()) {
            Ok([width @ 1..=16384, height @ 1..=16384]) => Ok(Some(Resolution::new(width, height))),
            _ => Err(document.fault(
                format!("camera `{name}` has a resolution that is not [width, height]"),
                "give 1 to 16384 pixels a side",
            )),
        }
    }
}
