//! `cornell`: a coloured box with two blocks.

use glam::{DVec3, Vec3, dvec3, vec3};

use super::model::{Model, Part, camera_along_z, matte};

/// tan 20°
const TAN_HALF_FOV: f32 = 0.363_970_22;

/// A box of 1 m that is open towards the camera, which stands 1.3 m in front of the opening. Floor, ceiling
/// and back wall are white, the left wall is red, the right one green. A short and a tall white block stand
/// in the box. The five parts are named regions, not labels, since all of them exchange light.
pub fn cornell() -> Model {
    let low = -0.5;
    let high = 0.5;
    let mut white = Part::new("white", None);
    white.quad([vec3(low, low, 0.0), vec3(high, low, 0.0), vec3(high, low, -1.0), vec3(low, low, -1.0)]);
    white.quad([vec3(low, high, -1.0), vec3(high, high, -1.0), vec3(high, high, 0.0), vec3(low, high, 0.0)]);
    white.quad([vec3(low, low, -1.0), vec3(high, low, -1.0), vec3(high, high, -1.0), vec3(low, high, -1.0)]);
    let mut red = Part::new("red", None);
    red.quad([vec3(low, low, 0.0), vec3(low, low, -1.0), vec3(low, high, -1.0), vec3(low, high, 0.0)]);
    red.material = 1;
    let mut green = Part::new("green", None);
    green.quad([vec3(high, low, -1.0), vec3(high, low, 0.0), vec3(high, high, 0.0), vec3(high, high, -1.0)]);
    green.material = 2;
    Model {
        name: "cornell",
        parts: vec![
            white,
            red,
            green,
            block("short", dvec3(0.17, -0.5, -0.33), 0.3, 0.3),
            block("tall", dvec3(-0.17, -0.5, -0.62), 0.6, -0.35),
        ],
        materials: vec![
            matte("white", Vec3::splat(0.73)),
            matte("red", vec3(0.63, 0.065, 0.05)),
            matte("green", vec3(0.14, 0.45, 0.091)),
        ],
        camera: camera_along_z(vec3(0.0, 0.0, 1.3), TAN_HALF_FOV),
    }
}

/// A block with a base of 0.3 m × 0.3 m around the floor point `foot`, rotated by `turn` radians about the
/// vertical.
fn block(name: &str, foot: DVec3, height: f64, turn: f64) -> Part {
    let (sine, cosine) = turn.sin_cos();
    // Corners are named by their place before the rotation: left or right, bottom or top, back or front.
    let corner = |x: f64, y: f64, z: f64| {
        let (x, z) = (0.3 * (x - 0.5), 0.3 * (z - 0.5));
        (foot + dvec3(cosine * x + sine * z, y * height, cosine * z - sine * x)).as_vec3()
    };
    let mut part = Part::new(name, None);
    let [lbb, lbf, ltf, ltb] =
        [corner(0.0, 0.0, 0.0), corner(0.0, 0.0, 1.0), corner(0.0, 1.0, 1.0), corner(0.0, 1.0, 0.0)];
    let [rbb, rbf, rtf, rtb] =
        [corner(1.0, 0.0, 0.0), corner(1.0, 0.0, 1.0), corner(1.0, 1.0, 1.0), corner(1.0, 1.0, 0.0)];
    part.quad([lbb, lbf, ltf, ltb]);
    part.quad([rbb, rtb, rtf, rbf]);
    part.quad([lbb, rbb, rbf, lbf]);
    part.quad([ltb, ltf, rtf, rtb]);
    part.quad([lbb, ltb, rtb, rbb]);
    part.quad([lbf, rbf, rtf, ltf]);
    part
}
