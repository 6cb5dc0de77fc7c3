//! `corner`: two planes at a right angle.

use glam::{Vec3, vec3};

use super::model::{Model, Part, camera_along_z, white_paper};

/// tan 20°
const TAN_HALF_FOV: f32 = 0.363_970_22;

/// Two white planes that meet at a right angle along a vertical edge, 1.2 m in front of the camera. Each
/// extends 0.6 m towards the camera and 0.6 m to its side. They fill the view. The left plane is region 0,
/// the right one region 1.
pub fn corner() -> Model {
    let mut left = Part::new("left", Some(0));
    left.quad([vec3(-0.6, -0.7, -0.6), vec3(0.0, -0.7, -1.2), vec3(0.0, 0.7, -1.2), vec3(-0.6, 0.7, -0.6)]);
    let mut right = Part::new("right", Some(1));
    right.quad([vec3(0.0, -0.7, -1.2), vec3(0.6, -0.7, -0.6), vec3(0.6, 0.7, -0.6), vec3(0.0, 0.7, -1.2)]);
    Model {
        name: "corner",
        parts: vec![left, right],
        materials: white_paper(),
        camera: camera_along_z(Vec3::ZERO, TAN_HALF_FOV),
    }
}
