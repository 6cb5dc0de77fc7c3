//! The first surface that each of many rays meets, found on the processor by a search tree.

use glam::Vec3;
use obvhs::ray::{Ray, RayHit};
use rayon::prelude::*;

use super::view::intersection;
use super::{Scene, bvh};

/// A point on a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// The index of the triangle.
    pub triangle: usize,
    /// The shares of its three corners in the point.
    pub weights: [f32; 3],
    /// Whether the ray meets the front.
    pub is_front: bool,
    /// The distance from the start of the ray in metres.
    pub distance: f32,
}

/// The first surface on each ray from `origin`; the directions have unit length. Points that are a hole of their surface are passed.
pub fn first_hits(
    scene: &Scene,
    origin: Vec3,
    rays: &[Vec3],
    is_hole: impl Fn(&SurfacePoint) -> bool + Sync,
) -> Vec<Option<SurfacePoint>> {
    let extent = |[a, b, c]: [Vec3; 3]| [a.min(b).min(c), a.max(b).max(c)];
    let tree = bvh::tree(scene.triangles.iter().map(|triangle| extent(triangle.positions)));
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

    use super::*;
    use crate::error::Result;
    use crate::image::Resolution;

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

        // Where everything is a hole, nothing is hit; where the first surface is one, the next is.
        assert!(first_hits(&scene, origin, &rays, |_| true).iter().all(Option::is_none));
        let first = found.iter().flatten().next().map(|hit| hit.triangle);
        let behind = first_hits(&scene, origin, &rays, |point| Some(point.triangle) == first);
        assert!(behind.iter().flatten().all(|hit| Some(hit.triangle) != first));
        Ok(())
    }
}
