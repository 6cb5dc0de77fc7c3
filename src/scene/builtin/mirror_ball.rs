//! `mirror-ball`: a mirror ball on the floor of a white room.

use glam::{DVec3, Vec3, dvec3, vec3};

use super::icosphere::icosphere;
use super::model::{Model, Part, camera_along_z, matte};
use crate::scene::Material;

/// tan 20°
const TAN_HALF_FOV: f32 = 0.363_970_22;

/// The centre of the ball, in metres.
const CENTER: DVec3 = dvec3(0.04, -0.22, -0.42);
/// The radius of the ball, in metres.
const RADIUS: f64 = 0.28;

/// Four subdivisions give 5120 facets, each about 4° wide: about one facet per pixel in a picture where the
/// ball is 60 pixels wide.
const SUBDIVISIONS: u32 = 4;

/// A white room of 1 m that is open towards the camera, which stands 1.3 m in front of the opening. A perfect
/// mirror ball lies on its floor. The ball reflects the projected pattern onto the walls without blurring it,
/// and the room is seen sharply in the ball. Separation by high-frequency patterns therefore counts some
/// indirect light as direct light, and some direct light as indirect. A path to a point of the room and back
/// along the same mirrors scatters only once and is direct light. The room is region 0 and the ball region 1.
/// These are named regions, not labels, since they exchange light.
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
    ball.positions = vertices.iter().map(|vertex| (CENTER + RADIUS * *vertex).as_vec3()).collect();
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
