//! Scenes whose light transport is known in closed form.

use glam::{Vec3, vec3};

use super::icosphere::icosphere;
use super::model::{Model, Part, camera_along_z, matte};
use crate::scene::Scene;

/// A matte plane of this albedo at `distance` metres, square to the optical axis, and much larger than the view
/// (half a field of view of tangent 0.5). With an all-ones pattern each pixel reads `albedo/(π·distance²)`.
pub fn plane(distance: f32, albedo: f32) -> Scene {
    let mut part = Part::new("plane", None);
    let side = 10.0 * distance;
    part.quad(
        [(-side, -side), (side, -side), (side, side), (-side, side)].map(|(x, y)| vec3(x, y, -distance)),
    );
    matte_scene("plane", vec![part], albedo, 0.5)
}

/// Two matte square plates that face each other: `side` metres a side, `separation` metres apart, left and
/// right of the optical axis. The camera sees the inner faces of both; their near edges are one `separation`
/// away from it along the axis.
///
/// The form factor from one to the other, with `x = side/separation`, is
/// `2/(π x²)·(ln√((1+x²)²/(1+2x²)) + 2x√(1+x²)·atan(x/√(1+x²)) − 2x·atan x)`.
pub fn parallel_plates(side: f32, separation: f32, albedo: f32) -> Scene {
    let [x, y] = [separation / 2.0, side / 2.0];
    let [near, far] = [-separation, -separation - side];
    let mut left = Part::new("left", None);
    left.quad([vec3(-x, -y, near), vec3(-x, -y, far), vec3(-x, y, far), vec3(-x, y, near)]);
    let mut right = Part::new("right", None);
    right.quad([vec3(x, -y, far), vec3(x, -y, near), vec3(x, y, near), vec3(x, y, far)]);
    // Wide enough for the near edges, the highest and outermost points of the view.
    let tan_half_fov = 1.05 * x.max(y) / separation;
    matte_scene("parallel-plates", vec![left, right], albedo, tan_half_fov)
}

/// A matte sphere around the camera, `radius` metres, fronts inwards: an icosahedron of which each triangle is
/// split into four `subdivisions` times (`20·4^subdivisions` triangles; at most 8 times). The camera's field of
/// view is 90°.
///
/// In the limit of a true sphere every point sees every other alike: once the light has bounced, it is uniform.
pub fn inside_sphere(radius: f32, subdivisions: u32, albedo: f32) -> Scene {
    let (vertices, triangles) = icosphere(subdivisions);
    let mut part = Part::new("sphere", None);
    part.positions = vertices.iter().map(|vertex| (f64::from(radius) * *vertex).as_vec3()).collect();
    part.triangles = triangles;
    matte_scene("inside-sphere", vec![part], albedo, 1.0)
}

fn matte_scene(name: &'static str, parts: Vec<Part>, albedo: f32, tan_half_fov: f32) -> Scene {
    let materials = vec![matte("matte", Vec3::splat(albedo))];
    Model { name, parts, materials, camera: camera_along_z(Vec3::ZERO, tan_half_fov) }.to_scene()
}
