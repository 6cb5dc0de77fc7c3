//! `mirror-ball`: a mirror ball on the floor of a white room.

use glam::{DVec3, Vec3, dvec3, vec3};

use super::icosphere::icosphere;
use super::model::{Model, Part, camera_along_z, matte};
use crate::scene::Material;

/// tan 20°
const TAN_HALF_FOV: f32 = 0.363_970_22;

/// The ball: its middle and its radius in metres.
const MIDDLE: DVec3 = dvec3(0.04, -0.22, -0.42);
const RADIUS: f64 = 0.28;

/// 5120 facets, 4° each: about one a pixel where the ball is 60 pixels wide.
const SUBDIVISIONS: u32 = 4;

/// A white room of 1 m, open towards the camera that stands 1.3 m in front of it, and on its floor a perfect mirror in the shape of a
/// ball. Light that the ball throws on walls and floor, and light of the room that is seen in it, is as sharp as what is projected, so that
/// separation by patterns of high frequency takes some of it for direct light, and loses direct light to it. What is seen and lit by
/// way of the ball along the same chain of mirrors scatters once, and is direct light. Room is region 0, ball region 1 by name, not
/// labels: they exchange light.
pub fn mirror_ball() -> Model {
    let (low, high) = (-0.5, 0.5);
    let mut room = Part::new("room", None);
    room.quad([vec3(low, low, 0.0), vec3(high, low, 0.0), vec3(high, low, -1.0), vec3(low, low, -1.0)]);
    room.quad([vec3(low, high, -1.0), vec3(high, high, -1.0), vec3(high, high, 0.0), vec3(low, high, 0.0)]);
    room.quad([vec3(low, low, -1.0), vec3(high, low, -1.0), vec3(high, high, -1.0), vec3(low, high, -1.0)]);
    room.quad([vec3(low, low, 0.0), vec3(low, low, -1.0), vec3(low, high, -1.0), vec3(low, high, 0.0)]);
    room.quad([vec3(high, low, -1.0), vec3(high, low, 0.0), vec3(high, high, 0.0), vec3(high, high, -1.0)]);
    let mut ball = Part::new("ball", None);
    let (vertices, inwards) = icosphere(SUBDIVISIONS);
    ball.positions = vertices.iter().map(|vertex| (MIDDLE + RADIUS * *vertex).as_vec3()).collect();
    ball.triangles = inwards.into_iter().map(|[a, b, c]| [a, c, b]).collect();
    ball.material = 1;
    let mirror = Material {
        name: "perfect mirror".into(),
        metallic: 1.0,
        roughness: 0.0,
        specular: 1.0,
        ..Material::default()
    };
    Model {
        name: "mirror-ball",
        parts: vec![room, ball],
        materials: vec![matte("white", Vec3::splat(0.7)), mirror],
        camera: camera_along_z(vec3(0.0, 0.0, 1.3), TAN_HALF_FOV),
    }
}
