//! The node graph: the nodes of the default scene, their transforms to world space, and the regions of their meshes.

use std::collections::{BTreeMap, HashMap, HashSet};

use glam::{DAffine3, DQuat, DVec3};
use gltf_json as json;
use serde::Deserialize;

use super::extensions::Label;
use super::geometry::Surface;
use super::{Document, extensions, geometry, object_name, pose};
use crate::error::Result;
use crate::scene::{Mesh, Triangle};

/// The translation of each node relative to its parent in double precision (the crate `gltf-json` reads single). Empty if the text is
/// unreadable.
pub(super) fn translations(text: &[u8]) -> Vec<Option<DVec3>> {
    #[derive(Deserialize)]
    struct File {
        #[serde(default)]
        nodes: Vec<Node>,
    }
    #[derive(Deserialize)]
    struct Node {
        translation: Option<[f64; 3]>,
        matrix: Option<[f64; 16]>,
    }
    let of = |node: Node| match (node.matrix, node.translation) {
        (Some(matrix), _) => Some(DVec3::from_slice(&matrix[12..15])),
        (None, translation) => translation.map(DVec3::from_array),
    };
    serde_json::from_slice(text)
        .map_or_else(|_| Vec::new(), |File { nodes }| nodes.into_iter().map(of).collect())
}

pub(super) struct Placed {
    pub node: usize,
    /// The transform from the node's frame to world space, in double precision because chains of transforms accumulate rounding errors.
    pub transform: DAffine3,
    /// The label of the node, or else of its nearest ancestor with a label.
    pub label: Option<Label>,
}

/// Lists every node of the default scene. Parents precede their children, and siblings are in the file's order.
pub(super) fn walk(document: &mut Document) -> Result<Vec<Placed>> {
    let parents = parents(document)?;
    let listed = roots(document, &parents)?;
    let roots = trees(document, &parents, listed)?;

    // The traversal is not recursive, because a chain of a million nodes would overflow the thread's stack.
    let mut stack: Vec<(usize, DAffine3, Option<Label>)> =
        roots.iter().rev().map(|&root| (root, DAffine3::IDENTITY, None)).collect();
    let mut placed = Vec::new();
    while let Some((index, parent, inherited)) = stack.pop() {
        let node = &document.root.nodes[index];
        let transform = parent * local_transform(document, index, node)?;
        if !transform.is_finite() {
            return Err(document
                .fault(format!("{}: its transform is not finite", document.node_name(index)))
                .help("correct the node's matrix, translation, rotation or scale"));
        }
        let what = document.node_name(index);
        let label = extensions::label(document, &what, &node.extras)?.or(inherited);
        let children = document.root.nodes[index].children.as_deref().unwrap_or_default();
        stack.extend(children.iter().rev().map(|child| (child.value(), transform, label.clone())));
        placed.push(Placed { node: index, transform, label });
    }
    Ok(placed)
}

/// The root nodes of the file's default scene, or else of its first scene. All nodes are shown in a file without scenes (a library).
fn roots(document: &mut Document, parents: &[Option<usize>]) -> Result<Vec<usize>> {
    let index = document.root.scene.map_or(0, |scene| scene.value());
    let count = document.root.scenes.len();
    if count == 0 && !parents.is_empty() {
        document.file.warn("the file has no scene: all of its nodes are shown");
        return Ok((0..parents.len()).filter(|&node| parents[node].is_none()).collect());
    }
    let Some(scene) = document.root.scenes.get(index) else {
        return Err(document
            .fault(if count == 0 {
                "the file has no scene and no nodes".to_string()
            } else {
                format!("the default scene is {index}, but there are only {count}")
            })
            .help("export the objects as a scene"));
    };
    let roots = scene.nodes.iter().map(|node| node.value()).collect();
    if count > 1 {
        let used = object_name("scene", index, scene.name.as_ref());
        document.file.warn(format!("the file has {count} scenes; only {used} is used"));
    }
    Ok(roots)
}

const FOREST: &str = "the file is damaged: nodes must form a tree; export it again";

/// The parent of each node. A node with several parents is an error.
fn parents(document: &Document) -> Result<Vec<Option<usize>>> {
    let nodes = &document.root.nodes;
    let name = |index: usize| document.node_name(index);
    let mut parents: Vec<Option<usize>> = vec![None; nodes.len()];
    for (index, node) in nodes.iter().enumerate() {
        for child in node.children.iter().flatten() {
            let child = child.value();
            if child >= nodes.len() {
                return Err(document
                    .fault(format!("{} has a child {child}, which does not exist", name(index)))
                    .help(FOREST));
            }
            if let Some(other) = parents[child].replace(index) {
                return Err(document
                    .fault(format!("{} has two parents, {} and {}", name(child), name(other), name(index)))
                    .help(FOREST));
            }
        }
    }
    Ok(parents)
}

/// The nodes at which the traversal starts: the nodes that the scene lists, unless they are below another listed node. Each node is thus
/// visited at most once. Some exporters list a node but not its parent. The node is then shown without its parent, as in other viewers.
fn trees(document: &mut Document, parents: &[Option<usize>], listed: Vec<usize>) -> Result<Vec<usize>> {
    let name = |index: usize| document.node_name(index);
    let mut is_listed = vec![false; parents.len()];
    for &root in &listed {
        if root >= parents.len() {
            return Err(document
                .fault(format!("the scene has node {root}, which does not exist"))
                .help(FOREST));
        }
        if std::mem::replace(&mut is_listed[root], true) {
            return Err(document.fault(format!("the scene lists {} twice", name(root))).help(FOREST));
        }
    }
    let is_below_listed = is_below_listed(document, parents, &is_listed);
    let mut trees = Vec::new();
    let mut warnings = Vec::new();
    for root in listed {
        let Some(parent) = parents[root] else {
            trees.push(root);
            continue;
        };
        let what = format!("the scene lists {}, which is a child of {}", name(root), name(parent));
        match is_below_listed[root] {
            Some(true) => warnings.push(format!("{what}: it is shown once")),
            Some(false) => {
                let left_out = "but does not list that: the parent and its transform are left out";
                warnings.push(format!("{what}, {left_out}"));
                trees.push(root);
            }
            None => {
                let cycle = if in_cycle(parents, root) { "is" } else { "lies below a node that is" };
                return Err(document.fault(format!("{} {cycle} its own ancestor", name(root))).help(FOREST));
            }
        }
    }
    warnings.into_iter().for_each(|warning| document.file.warn(warning));
    Ok(trees)
}

/// For each node, whether the scene lists a node above it. `None` for nodes in a cycle or below a cycle.
fn is_below_listed(document: &Document, parents: &[Option<usize>], is_listed: &[bool]) -> Vec<Option<bool>> {
    let mut known = vec![None; parents.len()];
    let tops = (0..parents.len()).filter(|&node| parents[node].is_none());
    let mut stack: Vec<(usize, bool)> = tops.map(|node| (node, false)).collect();
    while let Some((node, is_below)) = stack.pop() {
        known[node] = Some(is_below);
        let children = document.root.nodes[node].children.iter().flatten();
        stack.extend(children.map(|child| (child.value(), is_below || is_listed[node])));
    }
    known
}

fn in_cycle(parents: &[Option<usize>], start: usize) -> bool {
    let mut at = start;
    // If `start` is on a cycle, the loop returns to `start` after at most as many steps as there are nodes.
    for _ in 0..parents.len() {
        match parents[at] {
            Some(parent) if parent == start => return true,
            Some(parent) => at = parent,
            None => return false,
        }
    }
    false
}

/// The transform from the frame of a node to its parent's frame.
fn local_transform(document: &Document, index: usize, node: &json::Node) -> Result<DAffine3> {
    let stated = document.translations.get(index).copied().flatten();
    if let Some(matrix) = node.matrix {
        let Some(transform) = pose::affine(matrix) else {
            return Err(document
                .fault(format!("{}: its matrix is not affine", document.node_name(index)))
                .help("the last row of a node's matrix must be 0 0 0 1"));
        };
        return Ok(DAffine3 { translation: stated.unwrap_or(transform.translation), ..transform });
    }
    let scale = node.scale.map_or(DVec3::ONE, |scale| DVec3::from_array(scale.map(f64::from)));
    let read = node.translation.map_or(DVec3::ZERO, |to| DVec3::from_array(to.map(f64::from)));
    let translation = stated.unwrap_or(read);
    let rotation = node.rotation.map_or(DQuat::IDENTITY, |turn| DQuat::from_array(turn.0.map(f64::from)));
    let length = rotation.length();
    if !(length.is_finite() && length > 1e-6) {
        return Err(document
            .fault(format!("{}: its rotation is not a unit quaternion", document.node_name(index)))
            .help("correct the node's rotation"));
    }
    Ok(DAffine3::from_scale_rotation_translation(scale, rotation.normalize(), translation))
}

/// The largest number of labels. Labels are stored as bytes, and 255 stands for a masked pixel.
const MAX_LABELS: usize = 255;

/// Triangles and meshes, the names of the regions, and whether the regions are labels.
type Named = (Vec<Triangle>, Vec<Mesh>, (Vec<String>, bool));

/// Sets the region of every triangle and mesh, and the names of the meshes. Returns both, with the names of the regions and whether the
/// regions are labels.
pub(super) fn name_regions(
    document: &mut Document,
    placed: &[Placed],
    surfaces: Vec<Surface>,
) -> Result<Named> {
    let labelled = surfaces.iter().any(|surface| surface.label.is_some());
    let (mesh_names, of_node) = by_node(document, placed, &surfaces);
    let (names, region_of) =
        if labelled { by_label(document, &surfaces)? } else { (mesh_names.clone(), of_node.clone()) };
    let count = surfaces.iter().map(|surface| surface.triangles.len()).sum();
    let mut triangles = geometry::with_room(document, count, geometry::TRIANGLES)?;
    let mut meshes = Vec::new();
    for ((mut surface, region), node) in surfaces.into_iter().zip(region_of).zip(of_node) {
        surface.triangles.iter_mut().for_each(|triangle| triangle.region = region);
        triangles.append(&mut surface.triangles);
        let name = &mesh_names[node as usize];
        meshes.extend(surface.meshes.into_iter().map(|mesh| Mesh { name: name.clone(), region, ..mesh }));
    }
    Ok((triangles, meshes, (names, labelled)))
}

type Naming = (Vec<String>, Vec<u32>);

/// One region for each label, in the order of labels.
fn by_label(document: &mut Document, surfaces: &[Surface]) -> Result<Naming> {
    let mut index: BTreeMap<Label, u32> =
        surfaces.iter().map(|surface| (surface.label.clone().unwrap_or(Label::Absent), 0)).collect();
    if index.len() > MAX_LABELS {
        return Err(document
            .fault(format!(
                "{} different region labels, but at most {MAX_LABELS} can be told apart",
                index.len()
            ))
            .help("use fewer labels in extras.region"));
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
        document.file.warn(format!(
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
