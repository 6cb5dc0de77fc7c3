//! Region labels by the scene's author: `extras.region` of nodes, meshes and primitives.

use gltf_json as json;

use super::Document;
use crate::error::Result;

/// The largest length of a label in bytes. A limit is needed because every node below a labelled one holds a
/// copy of its label.
const MAX_NAME_BYTES: usize = 200;

/// A region label. The order of labels is the order of the regions, so that a region's index does not depend
/// on the order of the nodes: numbers by value, then names, then the region of surfaces without a label.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) enum Label {
    /// A non-negative integer.
    Number(u64),
    /// Any other name.
    Name(String),
    /// Surfaces without a label in a file that has labels.
    Absent,
}

impl std::fmt::Display for Label {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Number(number) => write!(f, "{number}"),
            Self::Name(name) => f.write_str(name),
            Self::Absent => f.write_str("unlabelled"),
        }
    }
}

/// The label of an object from `extras.region`, if it has one. `what` names the object.
pub(super) fn label(document: &Document, what: &str, extras: &json::Extras) -> Result<Option<Label>> {
    let Some(extras) = extras else { return Ok(None) };
    let parsed: Option<json::Value> = serde_json::from_str(extras.get()).ok();
    let Some(region) = parsed.as_ref().and_then(|extras| extras.get("region")) else { return Ok(None) };
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
        document.fault(
            format!("{what}: its extras.region is {}, which is not a label", shortened(region)),
            format!("label regions by a non-negative integer or a name of at most {MAX_NAME_BYTES} bytes"),
        )
    })
}

/// The first 60 characters of a value as JSON, for a message of one line.
fn shortened(value: &json::Value) -> String {
    let text = value.to_string();
    match text.char_indices().nth(60) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text,
    }
}
