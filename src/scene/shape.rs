//! The direct light that a scene's shape predicts, independent of its materials.

use glam::{DVec3, Vec3};

use super::{Camera, Scene};
use crate::image::Resolution;

/// The direct image of the scene under an all-ones pattern, if all its surfaces were white Lambertian and the
/// projector were at the camera's pinhole: one radiance for each pixel, row by row.
///
/// The value at a pixel's centre is `|n·d| / (π t²)`, where `t` is the depth of the nearest surface along the
/// camera's axis, `n` the unit normal of that surface, and `d` the ray direction with component 1 along the
/// axis. The scale of `d` accounts for the projector's falloff towards the image's edges. The value is 0
/// where the camera sees no surface.
///
/// Triangles are rasterized into a depth buffer, so that no tracer is needed. Mirrors, glass and masked
/// surfaces count as opaque.
pub fn predicted_direct(scene: &Scene, resolution: Resolution) -> Vec<f64> {
    let mut depth = vec![f64::INFINITY; resolution.pixels()];
    let mut direct = vec![0.0; resolution.pixels()];
    let camera = &scene.camera;
    for triangle in &scene.triangles {
        let corners = triangle.positions.map(|corner| (corner - camera.position).as_dvec3());
        let [a, b] = [corners[1] - corners[0], corners[2] - corners[0]];
        let normal = a.cross(b).normalize_or_zero();
        let (columns, rows) = bounds(camera, triangle.positions, resolution);
        for row in rows {
            for column in columns.clone() {
                let ray = camera.ray_direction(column as f32 + 0.5, row as f32 + 0.5, resolution).as_dvec3();
                let pixel = row * resolution.width + column;
                if let Some(t) = hit(ray, corners[0], a, b)
                    && t < depth[pixel]
                {
                    depth[pixel] = t;
                    direct[pixel] = normal.dot(ray).abs() / (std::f64::consts::PI * t * t);
                }
            }
        }
    }
    direct
}

/// The ranges of columns and rows that a triangle may cover. They are the whole raster if a corner lies
/// behind the camera.
fn bounds(
    camera: &Camera,
    corners: [Vec3; 3],
    resolution: Resolution,
) -> (std::ops::Range<usize>, std::ops::Range<usize>) {
    let [Some(a), Some(b), Some(c)] = corners.map(|corner| camera.project(corner, resolution)) else {
        return (0..resolution.width, 0..resolution.height);
    };
    let span = |values: [f32; 3], length: usize| {
        let low = values.into_iter().fold(f32::INFINITY, f32::min).floor().max(0.0) as usize;
        let high = values.into_iter().fold(0.0_f32, f32::max).ceil().max(0.0) as usize;
        low.min(length)..high.min(length)
    };
    (span([a.0, b.0, c.0], resolution.width), span([a.1, b.1, c.1], resolution.height))
}

/// The parameter `t > 0` at which the ray `t · ray` from the origin meets the triangle `corner`,
/// `corner + a`, `corner + b` (Möller and Trumbore, doi:10.1080/10867651.1997.10487468).
fn hit(ray: DVec3, corner: DVec3, a: DVec3, b: DVec3) -> Option<f64> {
    let p = ray.cross(b);
    let determinant = a.dot(p);
    if determinant == 0.0 {
        return None;
    }
    let u = -corner.dot(p) / determinant;
    let q = (-corner).cross(a);
    let v = ray.dot(q) / determinant;
    let t = b.dot(q) / determinant;
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0).then_some(t)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::builtin;

    #[test]
    fn a_fronto_parallel_wall_is_predicted_as_one_over_pi_d_squared() {
        let scene = builtin::plane(1.5, 0.8);
        let direct = predicted_direct(&scene, Resolution::new(9, 6));
        for value in direct {
            // The wall's corners are rounded to single precision.
            assert!((value * std::f64::consts::PI * 2.25 - 1.0).abs() < 1e-5, "{value}");
        }
    }

    #[test]
    fn the_nearer_of_two_surfaces_is_the_visible_one() {
        let scene = builtin::carton_eggs().to_scene();
        let [eggs, empty] = [scene, builtin::carton().to_scene()]
            .map(|scene| predicted_direct(&scene, Resolution::new(30, 30)));
        assert!(eggs.iter().all(|value| *value > 0.0) && empty.iter().all(|value| *value > 0.0));
        // Cup 0 has an egg, whose top is nearer than the cup's floor; cup 1 has none.
        assert!(eggs[3 * 30 + 5] > 1.05 * empty[3 * 30 + 5]);
        assert_eq!(eggs[3 * 30 + 15], empty[3 * 30 + 15]);
    }
}
