//! `zigzag`: two folded sheets side by side.

use glam::{Vec3, vec3};

use super::model::{Model, Part, camera_along_z, white_paper};

/// tan 25°
const TAN_HALF_FOV: f32 = 0.466_307_67;

/// Two white sheets side by side, each folded along the vertical into a valley: `\/\/` seen from above. Their
/// rims are 0.8 m from the camera and their valleys 1.1 m. Each sheet is 0.4 m wide and 1.4 m high, and
/// together they fill the view. A straight line from one sheet to the other would have to pass in front of
/// the ridge between them, but no point of a sheet is in front of the ridge. The sheets therefore exchange no
/// light. The left sheet is region 0, the right one region 1. They are mirror images of each other.
pub fn zigzag() -> Model {
    let left = fold("left sheet", 0, [-0.4, -0.2, 0.0]);
    let right = fold("right sheet", 1, [0.0, 0.2, 0.4]);
    Model {
        name: "zigzag",
        parts: vec![left, right],
        materials: white_paper(),
        camera: camera_along_z(Vec3::ZERO, TAN_HALF_FOV),
    }
}

/// A folded sheet with the given x coordinates of its left rim, its valley and its right rim, in metres.
fn fold(name: &str, label: u32, [left, valley, right]: [f32; 3]) -> Part {
    let mut part = Part::new(name, Some(label));
    for [(x0, z0), (x1, z1)] in [[(left, -0.8), (valley, -1.1)], [(valley, -1.1), (right, -0.8)]] {
        part.quad([vec3(x0, -0.7, z0), vec3(x1, -0.7, z1), vec3(x1, 0.7, z1), vec3(x0, 0.7, z0)]);
    }
    part
}
