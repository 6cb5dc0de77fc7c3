//! The acceleration structure for rays: a compressed eight-wide bounding volume hierarchy (CWBVH) over boxes.

use glam::Vec3;
use obvhs::{BvhBuildParams, aabb::Aabb, cwbvh::CwBvh, cwbvh::builder::build_cwbvh};

/// The largest number of boxes for which the slow, thorough builder is used. At this number it takes about 50
/// ms and saves up to a seventh of the work for each ray. With 100,000 boxes it costs 0.13 s more than the
/// medium builder, with a million 2.7 s, and no gain was measured on tessellated, bumpy boxes of that size.
const MAX_THOROUGH: usize = 1 << 15;

/// Number of levels that the shaders' traversal stack holds.
const MAX_DEPTH: usize = 32;

/// A bounding volume hierarchy in the shaders' layout.
#[derive(Debug)]
pub struct Bvh {
    /// The nodes, five 16-byte texels each, in the layout of the crate `obvhs`.
    pub nodes: Vec<[u32; 4]>,
    /// The index of the box at each leaf position.
    pub order: Vec<u32>,
}

impl Bvh {
    /// Builds the tree over boxes given by their minimum and maximum corners. Returns `None` if the tree is
    /// deeper than the shaders' traversal stack, which takes thousands of boxes at one point.
    pub fn build(boxes: impl Iterator<Item = [Vec3; 2]>) -> Option<Self> {
        let boxes: Vec<_> = boxes.map(|[low, high]| Aabb::new(low.into(), high.into())).collect();
        let params = match boxes.len() {
            ..=MAX_THOROUGH => BvhBuildParams::very_slow_build(),
            _ => BvhBuildParams::medium_build(),
        };
        let bvh = build_cwbvh(&boxes, params, &mut Default::default());
        if depth(&bvh) > MAX_DEPTH {
            return None;
        }
        let nodes = bvh.nodes.iter().flat_map(|node| {
            let texels: [[u32; 4]; 5] = bytemuck::cast(*node);
            texels
        });
        Some(Self { nodes: nodes.collect(), order: bvh.primitive_indices })
    }
}

/// The number of levels of a tree; the root alone has one.
fn depth(bvh: &CwBvh) -> usize {
    let mut deepest = 0;
    let mut pending = vec![(0_usize, 1_usize)];
    while let Some((index, level)) = pending.pop() {
        deepest = deepest.max(level);
        let node = &bvh.nodes[index];
        for child in (0..8).filter(|&child| !node.is_leaf(child)) {
            pending.push((node.child_node_index(child) as usize, level + 1));
        }
    }
    deepest
}
