//! The acceleration structure: an eight-wide compressed BVH over boxes.

use glam::Vec3;
use obvhs::{BvhBuildParams, aabb::Aabb, cwbvh::CwBvh, cwbvh::builder::build_cwbvh};

/// Boxes up to which the tree is built with all care: some 50 ms for so many, and up to a seventh less work for each ray. For a hundred
/// thousand it takes another 0.13 s, for a million 2.7 s, and bumpy boxes of so many gain nothing.
const CAREFULLY: usize = 1 << 15;

/// Levels that the shaders' traversal stack holds.
const MAX_DEPTH: usize = 32;

/// Nodes in the shaders' layout, and what the boxes stand for in the order of the leaves.
#[derive(Debug)]
pub struct Bvh {
    /// Five 16-byte texels a node, as the crate obvhs lays it out.
    pub nodes: Vec<[u32; 4]>,
    /// Index of the box at each leaf position.
    pub order: Vec<u32>,
}

impl Bvh {
    /// Builds over boxes given by their least and greatest coordinates. `None` if the tree is deeper than the traversal can follow,
    /// which takes thousands of boxes in one spot.
    pub fn build(boxes: impl Iterator<Item = [Vec3; 2]>) -> Option<Self> {
        let boxes: Vec<_> = boxes.map(|[low, high]| Aabb::new(low.into(), high.into())).collect();
        let params = match boxes.len() {
            ..=CAREFULLY => BvhBuildParams::very_slow_build(),
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
