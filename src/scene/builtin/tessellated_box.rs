//! An open box with a chosen number of triangles, for benchmarks.

use std::f64::consts::PI;

use glam::{DVec3, Vec3, dvec3, vec3};

use super::model::{Model, Part, camera_along_z, white_paper};
use crate::scene::Scene;

/// tan 20°
const TAN_HALF_FOV: f32 = 0.363_970_22;

/// Height of the bumps, in metres.
const BUMP: f64 = 0.01;
/// Number of bumps along a wall.
const BUMPS: f64 = 6.0;

/// A white box of 1 m that is open towards the camera, which stands 1.3 m in front of the opening. Its five
/// walls are slightly bumpy, and each is tessellated by the same grid of `n × n` cells. The box has `10·n²`
/// triangles, where `n` is `√(target_triangles / 10)` rounded, but at least 1. Each wall is a region.
pub fn tessellated_box(target_triangles: usize) -> Scene {
    let cells = ((target_triangles as f64 / 10.0).sqrt().round() as usize).max(1);
    // Each wall has an origin and the directions of its columns and rows, whose cross product points inwards.
    let walls = [
        ("floor", dvec3(-0.5, -0.5, 0.0), DVec3::X, DVec3::NEG_Z),
        ("ceiling", dvec3(-0.5, 0.5, -1.0), DVec3::X, DVec3::Z),
        ("back", dvec3(-0.5, -0.5, -1.0), DVec3::X, DVec3::Y),
        ("left", dvec3(-0.5, -0.5, 0.0), DVec3::NEG_Z, DVec3::Y),
        ("right", dvec3(0.5, -0.5, -1.0), DVec3::Z, DVec3::Y),
    ];
    let parts = walls.map(|(name, origin, along, up)| {
        let mut part = Part::new(name, None);
        let inwards = along.cross(up);
        part.grid(cells, cells, |column, row| -> Vec3 {
            let [s, t] = [column, row].map(|index| index as f64 / cells as f64);
            // There are no bumps on the edges, so that the walls meet.
            let edge = column == 0 || column == cells || row == 0 || row == cells;
            let bump =
                if edge { 0.0 } else { BUMP * ((BUMPS * PI * s).sin() * (BUMPS * PI * t).sin()).powi(2) };
            (origin + s * along + t * up + bump * inwards).as_vec3()
        });
        part
    });
    let model = Model {
        name: "tessellated-box",
        parts: parts.into(),
        materials: white_paper(),
        camera: camera_along_z(vec3(0.0, 0.0, 1.3), TAN_HALF_FOV),
    };
    model.to_scene()
}
