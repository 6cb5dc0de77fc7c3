//! Regions: one for each label, or, in a scene without labels, one for each mesh node.

use std::collections::{BTreeMap, HashMap, HashSet};

use super::counts;
use super::geometry::Surface;
use super::labels::Label;
use super::nodes::Placed;
use super::{Document, object_name};
use crate::error::Result;
use crate::scene::Triangle;

/// The largest number of labels. They are stored as bytes, and 255 stands for a masked pixel.
const MAX_LABELS: usize = 255;

/// Sets the region of every triangle. Returns the triangles, the names of the regions, and whether the
/// regions are labels.
pub(super) fn name(
    document: &mut Document,
    placed: &[Placed],
    surfaces: Vec<Surface>,
) -> Result<(Vec<Triangle>, Vec<String>, bool)> {
    let labelled = surfaces.iter().any(|surface| surface.label.is_some());
    let (names, region_of) =
        if labelled { by_label(document, &surfaces)? } else { by_node(document, placed, &surfaces) };
    let count = surfaces.iter().map(|surface| surface.triangles.len()).sum();
    let mut triangles = Vec::new();
    triangles.try_reserve_exact(count).map_err(|_| counts::too_many(document, count))?;
    for (mut surface, region) in surfaces.into_iter().zip(region_of) {
        surface.triangles.iter_mut().for_each(|triangle| triangle.region = region);
        triangles.append(&mut surface.triangles);
    }
    Ok((triangles, names, labelled))
}

/// The names of the regions, and the region of each surface.
type Naming = (Vec<String>, Vec<u32>);

/// One region for each label, in the order of labels.
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

/// One region for each mesh node, in the order of nodes.
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
                let mut name = given.cloned().unwrap_or_else(|| object_name("node", node, None));
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
