//! `white-room`: the box of `cornell` without blocks, all white.

use glam::vec3;

use super::model::{Model, Part, camera_along_z, white_paper};

/// tan 20°
const TAN_HALF_FOV: f32 = 0.363_970_22;

/// A white room of 1 m that is open towards the camera, which stands 1.3 m in front of the opening. Every
/// wall illuminates every other one, so the largest eigenvalue of the light transport matrix is well
/// separated from the others.
pub fn white_room() -> Model {
    let mut room = Part::new("room", None);
    let (low, high) = (-0.5, 0.5);
    room.quad([vec3(low, low, 0.0), vec3(high, low, 0.0), vec3(high, low, -1.0), vec3(low, low, -1.0)]);
    room.quad([vec3(low, high, -1.0), vec3(high, high, -1.0), vec3(high, high, 0.0), vec3(low, high, 0.0)]);
    room.quad([vec3(low, low, -1.0), vec3(high, low, -1.0), vec3(high, high, -1.0), vec3(low, high, -1.0)]);
    room.quad([vec3(low, low, 0.0), vec3(low, low, -1.0), vec3(low, high, -1.0), vec3(low, high, 0.0)]);
    room.quad([vec3(high, low, -1.0), vec3(high, low, 0.0), vec3(high, high, 0.0), vec3(high, high, -1.0)]);
    Model {
        name: "white-room",
        parts: vec![room],
        materials: white_paper(),
        camera: camera_along_z(vec3(0.0, 0.0, 1.3), TAN_HALF_FOV),
    }
}
