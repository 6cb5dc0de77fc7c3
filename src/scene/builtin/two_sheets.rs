//! `two-sheets`: two curved sheets of paper. `two-sheets-post`: the same sheets behind a post.

use glam::{DVec2, Vec3, dvec2, dvec3, vec3};

use super::model::{Model, Part, camera_along_z, matte, white_paper};

const TAN_HALF_FOV: f32 = 0.45;

/// Distance of all rims from the camera along its axis, in metres.
const RIM: f64 = 0.85;

/// Number of flat strips that approximate each sheet.
const STRIPS: usize = 24;

/// Two white sheets of paper side by side. Each is bent about a vertical axis into a trough that opens
/// towards the camera: a part of a cylinder, of 120° on the left and 100° on the right. They are 0.43 m and
/// 0.41 m wide from rim to rim and 0.9 m high, with a gap of 2 mm between them. Both rims of both sheets are
/// 0.85 m from the camera, and everything else lies behind them. Every line from one sheet to the other is
/// blocked by the rims, so the sheets exchange no light. The left sheet is region 0, the right one region 1.
/// Unlike the sheets of `zigzag`, they are not mirror images of each other.
pub fn two_sheets() -> Model {
    Model {
        name: "two-sheets",
        parts: vec![
            trough("left sheet", 0, [-0.441, -0.011], 60.0),
            trough("right sheet", 1, [-0.009, 0.401], 50.0),
        ],
        materials: white_paper(),
        camera: camera_along_z(Vec3::ZERO, TAN_HALF_FOV),
    }
}

/// The same sheets with a black post in front of the left one, 3 cm wide and 3 cm behind the plane of the
/// rims. In the picture the post divides the left sheet into two patches that do not touch, but light passes
/// from one to the other behind the post. The post is region 2; it reflects no light.
pub fn two_sheets_post() -> Model {
    let mut model = Model { name: "two-sheets-post", ..two_sheets() };
    let mut post = Part::new("post", Some(2));
    let [left, right, depth] = [-0.241, -0.211, -0.88];
    post.quad([
        vec3(left, -0.5, depth),
        vec3(right, -0.5, depth),
        vec3(right, 0.5, depth),
        vec3(left, 0.5, depth),
    ]);
    post.material = 1;
    model.parts.push(post);
    model.materials.push(matte("black", Vec3::ZERO));
    model
}

/// A sheet bent to a circular arc from `left` to `right` (metres along x). The arc spans `2·angle` degrees.
fn trough(name: &str, label: u32, [left, right]: [f64; 2], angle: f64) -> Part {
    let angle = angle.to_radians();
    let radius = (right - left) / (2.0 * angle.sin());
    let axis = dvec2((left + right) / 2.0, -RIM + radius * angle.cos());
    let profile = |strip: usize| -> DVec2 {
        // The ends are not computed: rounding must not move one rim in front of the other.
        match strip {
            0 => dvec2(left, -RIM),
            STRIPS => dvec2(right, -RIM),
            _ => {
                let turn = angle * (2.0 * strip as f64 / STRIPS as f64 - 1.0);
                axis + radius * dvec2(turn.sin(), -turn.cos())
            }
        }
    };
    let mut part = Part::new(name, Some(label));
    part.grid(STRIPS, 1, |strip, end| {
        let at = profile(strip);
        let height = if end == 0 { -0.45 } else { 0.45 };
        dvec3(at.x, height, at.y).as_vec3()
    });
    part
}
