//! `folded-sheet`: a folded sheet of paper that leans, so that direct light is brightest in one spot of it.

use glam::{DQuat, DVec3, dvec3};

use super::model::{Model, Part, camera_along_z, white_paper};

/// tan 25°, as for `zigzag`
const TAN_HALF_FOV: f32 = 0.466_307_67;

/// Half of the sheet's height, in metres.
const HALF_HEIGHT: f64 = 0.35;
/// The folds' positions across the sheet and their depths behind its ridges, in metres: those of `zigzag`.
const FOLDS: [[f64; 2]; 5] = [[-0.4, 0.0], [-0.2, -0.3], [0.0, 0.0], [0.2, -0.3], [0.4, 0.0]];
/// Distance of the middle of the sheet's middle ridge from the camera, in metres.
const DISTANCE: f64 = 0.85;
/// The sheet leans back by this angle from its lower edge upwards, …
const LEAN: f64 = 35.0;
/// … and is turned by this one about the vertical, so that the faces beside its middle ridge are not equally bright.
const TURN: f64 = 20.0;

/// One white sheet, folded like the two of `zigzag` (`\/\/` seen from above), that leans back and is turned to its left. Direct light is
/// brightest in one spot, at the lower end of the middle ridge, 0.65 m from the camera. On an upright sheet it is equally bright along a
/// whole ridge. The sheet is region 0.
pub fn folded_sheet() -> Model {
    let turn = DQuat::from_rotation_y(TURN.to_radians());
    let lean = DQuat::from_rotation_x(-LEAN.to_radians());
    let at = |[x, depth]: [f64; 2], height: f64| {
        (lean * (dvec3(0.0, height, 0.0) + turn * dvec3(x, 0.0, depth)) - DISTANCE * DVec3::Z).as_vec3()
    };
    let mut sheet = Part::new("folded sheet", Some(0));
    for pair in FOLDS.windows(2) {
        let [left, right] = [pair[0], pair[1]];
        sheet.quad([
            at(left, -HALF_HEIGHT),
            at(right, -HALF_HEIGHT),
            at(right, HALF_HEIGHT),
            at(left, HALF_HEIGHT),
        ]);
    }
    Model {
        name: "folded-sheet",
        parts: vec![sheet],
        materials: white_paper(),
        camera: camera_along_z(glam::Vec3::ZERO, TAN_HALF_FOV),
    }
}
