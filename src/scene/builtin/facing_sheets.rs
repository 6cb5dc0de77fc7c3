//! `facing-sheets`: two sheets of paper opposite each other.

use glam::{Vec3, vec3};

use super::model::{Model, Part, camera_along_z, white_paper};

const TAN_HALF_FOV: f32 = 0.5;

/// Two white sheets on the left and the right of the view, each 1 m high. They extend from 0.7 m to 1.3 m in
/// front of the camera; their distance from the optical axis is 0.35 m at the near edge and 0.15 m at the far
/// edge. The photo is dark between them. A flat sheet does not illuminate itself, so all indirect light is
/// exchanged between the two sheets. The left sheet is region 0, the right one region 1.
pub fn facing_sheets() -> Model {
    let mut left = Part::new("left sheet", Some(0));
    left.quad([
        vec3(-0.35, -0.5, -0.7),
        vec3(-0.15, -0.5, -1.3),
        vec3(-0.15, 0.5, -1.3),
        vec3(-0.35, 0.5, -0.7),
    ]);
    let mut right = Part::new("right sheet", Some(1));
    right.quad([
        vec3(0.15, -0.5, -1.3),
        vec3(0.35, -0.5, -0.7),
        vec3(0.35, 0.5, -0.7),
        vec3(0.15, 0.5, -1.3),
    ]);
    Model {
        name: "facing-sheets",
        parts: vec![left, right],
        materials: white_paper(),
        camera: camera_along_z(Vec3::ZERO, TAN_HALF_FOV),
    }
}
