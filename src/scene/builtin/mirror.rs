//! `mirror`: a wall and a mirror at a right angle.

use glam::{Vec3, vec3};

use super::model::{Model, Part, camera_along_z, white_paper};
use crate::scene::Material;

/// tan 20°
const TAN_HALF_FOV: f32 = 0.363_970_22;

/// The [`corner`](super::corner()) with a perfect mirror as its right half. Light returns from the wall along
/// four kinds of path: directly, or by the mirror before the wall, after the wall, or both. The wall (left)
/// is region 0, the mirror (right) region 1.
pub fn mirror() -> Model {
    let mut left = Part::new("wall", Some(0));
    left.quad([vec3(-0.6, -0.7, -0.6), vec3(0.0, -0.7, -1.2), vec3(0.0, 0.7, -1.2), vec3(-0.6, 0.7, -0.6)]);
    let mut right = Part::new("mirror", Some(1));
    right.quad([vec3(0.0, -0.7, -1.2), vec3(0.6, -0.7, -0.6), vec3(0.6, 0.7, -0.6), vec3(0.0, 0.7, -1.2)]);
    right.material = 1;
    let mut materials = white_paper();
    materials.push(Material {
        name: "perfect mirror".into(),
        metallic: 1.0,
        roughness: 0.0,
        specular: 1.0,
        ..Material::default()
    });
    Model {
        name: "mirror",
        parts: vec![left, right],
        materials,
        camera: camera_along_z(Vec3::ZERO, TAN_HALF_FOV),
    }
}
