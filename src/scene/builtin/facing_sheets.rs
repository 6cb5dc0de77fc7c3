//! `facing-sheets`: two sheets of paper that stand opposite each other, with nothing between.

use glam::{Vec3, vec3};

use super::model::{Model, Part, camera_along_z, white_paper};

const TAN_HALF_FOV: f32 = 0.5;

/// Two white sheets, each 1 m high, standing left and right of the view like an open book without its spine: 0.7 m to 1.3 m
/// from the camera, from 0.35 m off the axis in front to 0.15 m behind. What is between them in the photo is dark. A flat sheet
/// lights nothing of itself, so that all light is exchanged between the two, across that gap. Left is region 0, right
/// region 1.
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
