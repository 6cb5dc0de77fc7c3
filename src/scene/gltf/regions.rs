//! Regions: the author's labels from `extras.region`, or else one region per mesh node.

use std::collections::{BTreeMap, HashMap, HashSet};

use gltf::json;

use super::geometry::Surface;
use super::nodes::Placed;
use super::{Document, called};
use crate::error::Result;
use crate::scene::Triangle;

/// Labels are stored as bytes, and 255 stands for a masked pixel.
const MAX_LABELS: usize = 255;

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

/// Gives every triangle its region: the triangles, the regions' names, and whether they are the author's labels.
pub(super) fn name(
    document: &mut Document,
    placed: &[Placed],
    surfaces: Vec<Surface>,
) -> Result<(Vec<Triangle>, Vec<String>, bool)> {
    let labelled = surfaces.iter().any(|surface| surface.label.is_some());
    let (names, region_of) =
        if labelled { by_label(document, &surfaces)? } else { by_node(document, placed, &surfaces) };
    let mut triangles = Vec::with_capacity(surfaces.iter().map(|surface| surface.triangles.len()).sum());
    for (mut surface, region) in surfaces.into_iter().zip(region_of) {
        surface.triangles.iter_mut().for_each(|triangle| triangle.region = region);
        triangles.append(&mut surface.triangles);
    }
    Ok((triangles, names, labelled))
}

/// Names of the regions, and the region of each surface.
type Naming = (Vec<String>, Vec<u32>);

fn by_label(document: &mut Document, surfaces: &[Surface]) -> Result<Naming> {
    let mut index: BTreeMap<Label, u32> =
        surfaces.iter().map(|surface| (surface.label.clone().unwrap_or(Label::Absent), 0)).collect();
    if index.len() > MAX_LABELS {
        return Err(document.fault(
            format!("{} different region labels, but at most {MAX_LABELS} can be told apart", index.len()),
            "use fewer labels in extras.region",
        ));
    }
    for (position, region) in index.values_mut().enumerate() {
        *region = position as u32;
    }
    if index.contains_key(&Label::Absent) {
        let count: usize = surfaces
            .iter()
            .filter(|surface| surface.label.is_none())
            .map(|surface| surface.triangles.len())
            .sum();
        document.warnings.add(format!(
            "{count} triangles have no extras.region while others have one; they form the region `{}`",
            Label::Absent
        ));
    }
    let region_of =
        surfaces.iter().map(|surface| index[surface.label.as_ref().unwrap_or(&Label::Absent)]).collect();
    Ok((index.keys().map(Label::to_string).collect(), region_of))
}

fn by_node(document: &Document, placed: &[Placed], surfaces: &[Surface]) -> Naming {
    let mut names = Vec::new();
    let mut taken = HashSet::new();
    let mut region_of_node: HashMap<usize, u32> = HashMap::new();
    let region_of = surfaces
        .iter()
        .map(|surface| {
            let node = placed[surface.placed].node;
            *region_of_node.entry(node).or_insert_with(|| {
                let given = document.root.nodes[node].name.as_ref();
                let mut name = given.cloned().unwrap_or_else(|| called("node", node, None));
                if !taken.insert(name.clone()) {
                    name = format!("{name} (node {node})");
                }
                names.push(name);
                names.len() as u32 - 1
            })
        })
        .collect();
    (names, region_of)
}
