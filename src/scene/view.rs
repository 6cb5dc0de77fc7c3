//! What the camera sees of a scene, by a few rays: reasons for a black photo.

use glam::Vec3;
use rayon::prelude::*;

use super::{Camera, Scene, Triangle};
use crate::image::Resolution;

/// The most intersections of a ray with a triangle that are computed: a fraction of a second.
const MAX_INTERSECTIONS: usize = 1 << 24;
/// The most rays on a side of the picture.
const MAX_SIDE: usize = 32;
/// Surfaces further away than this, in metres, send back less than a ten-thousandth of a pattern.
const FAR: f32 = 50.0;

/// The first surface on a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Hit {
    distance: f32,
    /// Whether a one-sided surface shows its back.
    is_back: bool,
}

/// Why photos of this scene are black or nearly so, as one sentence; `None` if some surface is in view, near enough and from its front.
pub fn reason_for_darkness(scene: &Scene, resolution: Resolution) -> Option<String> {
    let side = (MAX_INTERSECTIONS / scene.triangles.len().max(1)).isqrt().clamp(4, MAX_SIDE);
    let camera = &scene.camera;
    let rays: Vec<Vec3> = (0..side * side)
        .map(|at| {
            let [x, y] = [at % side, at / side].map(|at| (at as f32 + 0.5) / side as f32);
            let (width, height) = (resolution.width as f32, resolution.height as f32);
            camera.ray_direction(x * width, y * height, resolution).normalize()
        })
        .collect();
    let hits: Vec<Hit> = rays.par_iter().filter_map(|&ray| first_hit(scene, camera, ray)).collect();
    if hits.is_empty() {
        let Camera { name, position, forward, .. } = camera;
        let corners = || scene.triangles.iter().flat_map(|triangle| triangle.positions);
        let low = corners().fold(Vec3::INFINITY, Vec3::min);
        let high = corners().fold(Vec3::NEG_INFINITY, Vec3::max);
        return Some(format!(
            "no surface in view: none of {} rays meets one. The camera `{name}` stands at {position:.3} and looks along \
             {forward:.3}; the scene lies between {low:.3} and {high:.3}",
            rays.len()
        ));
    }
    if hits.iter().all(|hit| hit.is_back) {
        return Some(
            "every surface in view is seen from its back, which is black: turn the faces around, or make the materials double-sided"
                .into(),
        );
    }
    let mut distances: Vec<f32> = hits.iter().map(|hit| hit.distance).collect();
    distances.sort_by(f32::total_cmp);
    let middle = distances[distances.len() / 2];
    (middle > FAR).then(|| {
        format!(
            "the surfaces in view are {middle:.0} m away, where a projector's light is faint: lengths are metres, so scale the scene if \
             its unit is another one"
        )
    })
}

fn first_hit(scene: &Scene, camera: &Camera, ray: Vec3) -> Option<Hit> {
    let nearest = |best: Option<Hit>, triangle: &Triangle| match intersection(triangle, camera.position, ray)
    {
        Some((distance, is_front, _)) if best.is_none_or(|best| distance < best.distance) => {
            let is_one_sided = !scene.materials[triangle.material as usize].double_sided;
            Some(Hit { distance, is_back: is_one_sided && !is_front })
        }
        _ => best,
    };
    scene.triangles.iter().fold(None, nearest)
}

/// The distance at which a ray of unit length meets a triangle, whether it meets its front, and the shares of the second and the
/// third corner in the point.
pub(super) fn intersection(triangle: &Triangle, origin: Vec3, ray: Vec3) -> Option<(f32, bool, [f32; 2])> {
    let [a, b, c] = triangle.positions;
    let (ab, ac) = (b - a, c - a);
    let across = ray.cross(ac);
    let determinant = ab.dot(across);
    let from_a = origin - a;
    let u = from_a.dot(across) / determinant;
    let turned = from_a.cross(ab);
    let v = ray.dot(turned) / determinant;
    let distance = ac.dot(turned) / determinant;
    // A ray in the triangle's plane has a determinant of zero, and fails these comparisons.
    let is_inside = u >= 0.0 && v >= 0.0 && u + v <= 1.0;
    (is_inside && distance > 0.0).then_some((distance, determinant > 0.0, [u, v]))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::error::Result;

    fn reason(change: impl Fn(&mut Scene)) -> Result<Option<String>> {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/scenes/corner/scene.glb");
        let mut scene = crate::scene::load(&path, None)?;
        change(&mut scene);
        Ok(reason_for_darkness(&scene, Resolution::new(40, 30)))
    }

    #[test]
    fn each_black_scene_has_its_reason() -> Result<()> {
        assert_eq!(reason(|_| ())?, None);
        let says = |reason: Option<String>, what: &str| {
            assert!(reason.as_deref().is_some_and(|r| r.contains(what)), "{reason:?}");
        };
        says(
            reason(|scene| scene.camera.forward = -scene.camera.forward)?,
            "no surface in view: none of 1024 rays",
        );
        let one_sided = |scene: &mut Scene| {
            scene.materials.iter_mut().for_each(|material| material.double_sided = false);
        };
        let turned = |scene: &mut Scene| {
            for triangle in &mut scene.triangles {
                *triangle = triangle.flipped();
            }
        };
        let backs = [
            reason(one_sided)?,
            reason(|scene| {
                one_sided(scene);
                turned(scene);
            })?,
        ];
        assert!(backs.contains(&None), "one side is the front: {backs:?}");
        says(backs.into_iter().flatten().next(), "seen from its back");
        assert_eq!(reason(turned)?, None, "both sides of these materials are seen");
        says(
            reason(|scene| {
                scene
                    .triangles
                    .iter_mut()
                    .for_each(|triangle| triangle.positions = triangle.positions.map(|p| 100.0 * p));
                scene.camera.position *= 100.0;
            })?,
            "m away",
        );
        Ok(())
    }
}
