//! The author's labels of regions: `extras.region` of nodes, meshes and primitives.

use gltf_json as json;

use super::Document;
use crate::error::Result;

/// Every node below a labelled one holds a copy of its label.
const MAX_NAME_BYTES: usize = 200;

/// An author's label. Numbers come first, by value, so that the index of a region does not depend on the order of
/// the nodes; then names; then what was left without a label.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) enum Label {
    /// A non-negative integer.
    Number(u64),
    /// Any other name.
    Name(String),
    /// No label, in a file that has labels elsewhere.
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

/// `extras.region` of an object, if it has one. `what` names the object.
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
            format!("{what}: its extras.region is {}, which is no label", shortened(region)),
            format!("label regions by a non-negative integer or a name of at most {MAX_NAME_BYTES} bytes"),
        )
    })
}

/// The beginning of a value, for a message of one line.
fn shortened(value: &json::Value) -> String {
    let text = value.to_string();
    match text.char_indices().nth(60) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text,
    }
}
