//! The acceleration structure for rays: a compressed eight-wide bounding volume hierarchy (CWBVH), and first hits of rays on the CPU.

use std::collections::HashSet;
use std::fmt;
use std::sync::{Arc, Mutex, PoisonError};

use glam::Vec3;
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::node::Bvh2Node;
use obvhs::cwbvh::CwBvh;
use obvhs::cwbvh::builder::build_cwbvh;
use obvhs::cwbvh::bvh2_to_cwbvh::bvh2_to_cwbvh;
use obvhs::ray::{Ray, RayHit};
use rayon::prelude::*;

use super::Scene;
use super::view::intersection;

/// The largest number of boxes for which the slow, thorough builder is used. At this number, the builder takes about 50 ms and saves up to
/// a seventh of the work for each ray. For 100,000 boxes, it takes 0.13 s longer than the medium builder; for a million boxes, 2.7 s
/// longer. For tessellated, bumpy boxes of that size, no gain was measured.
const MAX_THOROUGH: usize = 1 << 15;

/// The number of levels that the shaders' traversal stack can store.
const MAX_DEPTH: usize = 32;

/// A bounding volume hierarchy in the shaders' layout.
#[derive(Debug)]
pub struct Bvh {
    /// The nodes, five 16-byte texels each, in the layout of the crate `obvhs`.
    pub nodes: Vec<[u32; 4]>,
    /// The index of the box at each leaf position.
    pub order: Vec<u32>,
}

/// The tree that was last built for a scene that may change. Copies of the scene share it, so that a scene whose materials change builds it
/// once. The default keeps no tree.
#[derive(Clone, Default)]
pub struct KeptTree(Option<Arc<Mutex<Option<KeyedTree>>>>);

/// A tree with the hash of its boxes.
type KeyedTree = (blake3::Hash, Arc<Bvh>);

impl KeptTree {
    /// Keeps the tree that is built next.
    pub(super) fn keeping() -> Self {
        Self(Some(Arc::default()))
    }

    /// The tree over these boxes. It is built unless it is the kept one.
    pub(crate) fn of(&self, boxes: &[[Vec3; 2]]) -> Arc<Bvh> {
        let build = || Arc::new(Bvh::build(boxes.iter().copied()));
        let Some(kept) = &self.0 else { return build() };
        let key = blake3::hash(bytemuck::cast_slice(boxes));
        let mut kept = kept.lock().unwrap_or_else(PoisonError::into_inner);
        match &*kept {
            Some((of, tree)) if *of == key => Arc::clone(tree),
            _ => Arc::clone(&kept.insert((key, build())).1),
        }
    }
}

impl fmt::Debug for KeptTree {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("KeptTree")
    }
}

impl Bvh {
    /// Builds the tree over boxes given by their minimum and maximum corners.
    pub fn build(boxes: impl Iterator<Item = [Vec3; 2]>) -> Self {
        let bvh = tree(boxes);
        let nodes = bvh.nodes.iter().flat_map(|node| {
            let texels: [[u32; 4]; 5] = bytemuck::cast(*node);
            texels
        });
        Self { nodes: nodes.collect(), order: bvh.primitive_indices }
    }
}

/// Builds the tree over boxes, of at most [`MAX_DEPTH`] levels.
///
/// If many boxes lie at one point, cost-based builders take long and build deep trees. In that case, a balanced tree is built instead. Its
/// depth is the logarithm of the number of boxes.
pub(super) fn tree(boxes: impl Iterator<Item = [Vec3; 2]>) -> CwBvh {
    let boxes: Vec<_> = boxes.map(|[low, high]| Aabb::new(low.into(), high.into())).collect();
    let params = match boxes.len() {
        ..=MAX_THOROUGH => BvhBuildParams::very_slow_build(),
        _ => BvhBuildParams::medium_build(),
    };
    let places: HashSet<_> = boxes.iter().map(|of| of.center().to_array().map(f32::to_bits)).collect();
    let costly = 2 * places.len() >= boxes.len();
    let costly = costly.then(|| build_cwbvh(&boxes, params, &mut Default::default()));
    match costly.filter(|bvh| depth(bvh) <= MAX_DEPTH) {
        Some(bvh) => bvh,
        None => bvh2_to_cwbvh(&balanced(&boxes), 3, true, false),
    }
}

/// A binary tree with equally many boxes in both halves. Each node is split along the axis with the largest spread of its boxes.
fn balanced(boxes: &[Aabb]) -> Bvh2 {
    let mut order: Vec<u32> = (0..boxes.len() as u32).collect();
    let mut nodes = vec![Bvh2Node::new(Aabb::empty(), 0, 0)];
    split(boxes, &mut order, 0, 0, &mut nodes);
    Bvh2 { nodes, primitive_indices: order, ..Bvh2::default() }
}

/// Makes the node `at` and its descendants from the boxes `order`, which start at index `first` in the order of all boxes.
fn split(boxes: &[Aabb], order: &mut [u32], first: usize, at: usize, nodes: &mut Vec<Bvh2Node>) {
    let all =
        |indices: &[u32]| indices.iter().fold(Aabb::empty(), |all, &index| all.union(&boxes[index as usize]));
    let around = all(order);
    if order.len() <= 1 {
        nodes[at] = Bvh2Node::new(around, order.len() as u32, first as u32);
        return;
    }
    let center = |index: u32| boxes[index as usize].center();
    let [low, high] = [f32::INFINITY, f32::NEG_INFINITY].map(Vec3::splat);
    let (low, high) = order.iter().fold((low, high), |(low, high), &index| {
        let center = Vec3::from_array(center(index).to_array());
        (low.min(center), high.max(center))
    });
    let axis = (high - low).max_position();
    let middle = order.len() / 2;
    order
        .select_nth_unstable_by(middle, |&a, &b| center(a)[axis].total_cmp(&center(b)[axis]).then(a.cmp(&b)));
    let children = nodes.len();
    nodes[at] = Bvh2Node::new(around, 0, children as u32);
    nodes.extend([Bvh2Node::new(around, 0, 0); 2]);
    let (left, right) = order.split_at_mut(middle);
    split(boxes, left, first, children, nodes);
    split(boxes, right, first + middle, children + 1, nodes);
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

/// A point on a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// The index of the triangle.
    pub triangle: usize,
    /// The barycentric weights of the triangle's three corners at the point.
    pub weights: [f32; 3],
    /// Whether the ray meets the front.
    pub is_front: bool,
    /// The distance from the start of the ray in metres.
    pub distance: f32,
}

/// The first surface on each ray from `origin`. The directions have unit length. Rays pass through points for which `is_hole` is true.
pub fn first_hits(
    scene: &Scene,
    origin: Vec3,
    rays: &[Vec3],
    is_hole: impl Fn(&SurfacePoint) -> bool + Sync,
) -> Vec<Option<SurfacePoint>> {
    let extent = |[a, b, c]: [Vec3; 3]| [a.min(b).min(c), a.max(b).max(c)];
    let tree = tree(scene.triangles.iter().map(|triangle| extent(triangle.positions)));
    let hit = |&ray: &Vec3| {
        let mut nearest: Option<SurfacePoint> = None;
        let test = |_: &Ray, leaf: usize| {
            let triangle = tree.primitive_indices[leaf] as usize;
            let found =
                intersection(&scene.triangles[triangle], origin, ray).map(|(distance, is_front, [u, v])| {
                    SurfacePoint { triangle, weights: [1.0 - u - v, u, v], is_front, distance }
                });
            match found {
                Some(point)
                    if nearest.is_none_or(|best| point.distance < best.distance) && !is_hole(&point) =>
                {
                    nearest = Some(point);
                    point.distance
                }
                _ => f32::INFINITY,
            }
        };
        tree.ray_traverse(Ray::new_inf(origin.into(), ray.into()), &mut RayHit::none(), test);
        nearest
    };
    rays.par_iter().map(hit).collect()
}

#[cfg(test)]
mod tests {
    use std::path::Path;
    use std::time::{Duration, Instant};

    use glam::{Vec2, vec3};

    use super::*;
    use crate::error::Result;
    use crate::image::Resolution;

    /// Builds a tree over triangles. Asserts that building is fast and that each box occurs once.
    fn check(what: &str, triangles: impl Iterator<Item = [Vec3; 3]>) {
        let extent = |corners: [Vec3; 3]| {
            corners.iter().fold([corners[0]; 2], |[low, high], c| [low.min(*c), high.max(*c)])
        };
        let boxes: Vec<_> = triangles.map(extent).collect();
        let start = Instant::now();
        let mut order = Bvh::build(boxes.iter().copied()).order;
        // The largest fan takes eight seconds of a processor. A time that is quadratic in the triangles would be many minutes.
        assert!(start.elapsed() < Duration::from_secs(120), "{what}: {:?}", start.elapsed());
        order.sort_unstable();
        assert!(order.into_iter().eq(0..boxes.len() as u32), "{what}");
    }

    #[test]
    fn boxes_at_one_place_and_fans_have_trees() {
        let triangle = [Vec3::ZERO, Vec3::X, Vec3::Y];
        check("256 alike", std::iter::repeat_n(triangle, 256));
        check("131072 alike", std::iter::repeat_n(triangle, 1 << 17));
        let corner = |step: usize, steps: usize| {
            Vec2::from_angle(std::f32::consts::TAU * step as f32 / steps as f32).extend(0.0)
        };
        for steps in [1500, 2000, 40_000] {
            check(
                "a fan",
                (1..steps - 1).map(|at| [corner(0, steps), corner(at, steps), corner(at + 1, steps)]),
            );
        }
        let copies = |at: usize| triangle.map(|corner| corner + vec3((at % 64) as f32, 0.0, 0.0));
        check("64 places", (0..1 << 16).map(copies));
        check("one", std::iter::once(triangle));
    }

    #[test]
    fn a_balanced_tree_is_whole() {
        let boxes: Vec<_> = (0..1000_u32)
            .map(|at| {
                let low = vec3((at * 7 % 31) as f32, (at * 13 % 17) as f32, (at * 3 % 11) as f32);
                Aabb::new(low.into(), (low + Vec3::ONE).into())
            })
            .collect();
        let tree = balanced(&boxes);
        let found = tree.validate(&boxes, false, false);
        assert_eq!((found.discovered_primitives.len(), found.max_depth <= 12), (1000, true));
    }

    #[test]
    fn the_tree_finds_what_a_test_of_all_triangles_finds() -> Result<()> {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/scenes/mirror-ball/scene.glb");
        let scene = crate::scene::load(&path, None)?;
        let size = Resolution::new(24, 24);
        let (camera, origin) = (&scene.camera, scene.camera.position);
        let rays: Vec<Vec3> = (0..size.pixels())
            .map(|at| {
                let (x, y) = ((at % 24) as f32 + 0.5, (at / 24) as f32 + 0.5);
                camera.ray_direction(x, y, size).normalize()
            })
            .collect();
        let all = |ray: &Vec3| {
            let met = scene.triangles.iter().filter_map(|triangle| intersection(triangle, origin, *ray));
            met.map(|(distance, ..)| distance).min_by(f32::total_cmp)
        };
        let found = first_hits(&scene, origin, &rays, |_| false);
        let distances: Vec<Option<f32>> = found.iter().map(|hit| hit.map(|hit| hit.distance)).collect();
        assert_eq!(distances, rays.iter().map(all).collect::<Vec<_>>());
        assert!(found.iter().flatten().count() > 100, "the ball and its room are in view");

        // If all points are holes, no ray hits a surface. If the first surface is a hole, the next surface is hit.
        assert!(first_hits(&scene, origin, &rays, |_| true).iter().all(Option::is_none));
        let first = found.iter().flatten().next().map(|hit| hit.triangle);
        let behind = first_hits(&scene, origin, &rays, |point| Some(point.triangle) == first);
        assert!(behind.iter().flatten().all(|hit| Some(hit.triangle) != first));
        Ok(())
    }
}
