//! Scenes whose light transport is known in closed form.

use glam::{Vec3, vec3};

use super::icosphere::icosphere;
use super::model::{Model, Part, camera_along_z, matte};
use crate::scene::Scene;

/// A fronto-parallel matte plane with albedo `albedo` at `distance` metres. It is much larger than the view;
/// half the field of view has tangent 0.5. Under an all-ones pattern each pixel of the photo is
/// `albedo/(π·distance²)`.
pub fn plane(distance: f32, albedo: f32) -> Scene {
    let mut part = Part::new("plane", None);
    let side = 10.0 * distance;
    part.quad(
        [(-side, -side), (side, -side), (side, side), (-side, side)].map(|(x, y)| vec3(x, y, -distance)),
    );
    matte_scene("plane", vec![part], albedo, 0.5)
}

/// Two square matte plates that face each other, left and right of the optical axis. Their sides are `side`
/// metres long, and they are `separation` metres apart. The camera sees the inner faces of both. Their near
/// edges are `separation` metres in front of the camera along the axis.
///
/// With `x = side/separation`, the form factor from one plate to the other is
/// `2/(π x²)·(ln√((1+x²)²/(1+2x²)) + 2x√(1+x²)·atan(x/√(1+x²)) − 2x·atan x)`.
pub fn parallel_plates(side: f32, separation: f32, albedo: f32) -> Scene {
    let [x, y] = [separation / 2.0, side / 2.0];
    let [near, far] = [-separation, -separation - side];
    let mut left = Part::new("left", None);
    left.quad([vec3(-x, -y, near), vec3(-x, -y, far), vec3(-x, y, far), vec3(-x, y, near)]);
    let mut right = Part::new("right", None);
    right.quad([vec3(x, -y, far), vec3(x, -y, near), vec3(x, y, near), vec3(x, y, far)]);
    // The field of view contains the near edges, which are the outermost points of the view.
    let tan_half_fov = 1.05 * x.max(y) / separation;
    matte_scene("parallel-plates", vec![left, right], albedo, tan_half_fov)
}

/// A matte sphere of `radius` metres around the camera, whose fronts face inwards. It is an icosahedron whose
/// triangles are split into four `subdivisions` times (at most 8 times), which gives `20·4^subdivisions`
/// triangles. The camera's field of view is 90°.
///
/// In the limit of a true sphere, the form factor between any two points is the same. Light of two bounces
/// and more is uniform.
pub fn inside_sphere(radius: f32, subdivisions: u32, albedo: f32) -> Scene {
    let (vertices, triangles) = icosphere(subdivisions);
    let mut part = Part::new("sphere", None);
    part.positions = vertices.iter().map(|vertex| (f64::from(radius) * *vertex).as_vec3()).collect();
    part.triangles = triangles;
    matte_scene("inside-sphere", vec![part], albedo, 1.0)
}

/// A scene of one matte material whose camera is at the origin.
fn matte_scene(name: &'static str, parts: Vec<Part>, albedo: f32, tan_half_fov: f32) -> Scene {
    let materials = vec![matte("matte", Vec3::splat(albedo))];
    Model { name, parts, materials, camera: camera_along_z(Vec3::ZERO, tan_half_fov) }.to_scene()
}
