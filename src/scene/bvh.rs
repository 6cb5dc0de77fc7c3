//! The acceleration structure: an eight-wide compressed BVH over a scene's triangles.

use glam::Vec3;
use obvhs::{BvhBuildParams, cwbvh::CwBvh, cwbvh::builder::build_cwbvh_from_tris};

/// Triangles up to which the tree is built with all care: some 50 ms for so many, and up to a seventh less work for each ray. For a hundred
/// thousand it takes another 0.13 s, for a million 2.7 s, and bumpy boxes of so many gain nothing.
const CAREFULLY: usize = 1 << 15;

/// Levels that the shaders' traversal stack holds.
const MAX_DEPTH: usize = 32;

/// Nodes in the shaders' layout, and the triangles in the order of the leaves.
#[derive(Debug)]
pub struct Bvh {
    /// Five 16-byte texels a node, as the crate obvhs lays it out.
    pub nodes: Vec<[u32; 4]>,
    /// Index of the scene's triangle at each leaf position.
    pub order: Vec<u32>,
}

impl Bvh {
    /// Builds over triangles given by their corners. `None` if the tree is deeper than the traversal can follow, which
    /// takes geometry with thousands of triangles in one spot.
    pub fn build(corners: &[[Vec3; 3]]) -> Option<Self> {
        let triangles: Vec<_> = corners
            .iter()
            .map(|c| obvhs::triangle::Triangle { v0: c[0].into(), v1: c[1].into(), v2: c[2].into() })
            .collect();
        let params = match triangles.len() {
            // Triangles are not split: that makes more leaves, and no quicker rays.
            ..=CAREFULLY => BvhBuildParams { pre_split: false, ..BvhBuildParams::very_slow_build() },
            _ => BvhBuildParams::medium_build(),
        };
        let bvh = build_cwbvh_from_tris(&triangles, params, &mut Default::default());
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
