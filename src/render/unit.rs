//! The unit of length of the tracer.
//!
//! Offsets of rays, products of lengths and hidden thresholds suit distances of about 1. Therefore all geometry on the device is in units of a
//! power of two: that of the distance within which a quarter of the surfaces lies, as the camera sees them. Far surfaces are offset by their own
//! coordinates, so that they bear a small unit, and near ones would not bear a large one. Photos of a scene that is `2^k` times as large have the
//! same bits, times `2^-2k`.

use glam::{DVec3, Vec3};

use crate::scene::Scene;
use crate::scene::place::Distances;

/// The share of what the camera sees within whose distance the unit is.
const NEAR: f64 = 0.25;

/// A power of two of metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Unit {
    /// The length of the unit in metres.
    pub(super) metres: f64,
}

impl Unit {
    /// The unit for a scene.
    pub(super) fn of(scene: &Scene) -> Self {
        let camera = scene.camera.position.as_dvec3();
        let mut distances = Distances::new();
        for triangle in &scene.triangles {
            let corners = triangle.positions.map(|corner| corner.as_dvec3() - camera);
            let [a, b, c] = corners;
            let (area, middle) = (0.5 * (b - a).cross(c - a).length(), (a + b + c) / 3.0);
            // The solid angle, without the slope: at most that of the sphere.
            let angle = (area / middle.length_squared()).min(4.0 * std::f64::consts::PI);
            corners.iter().for_each(|corner| distances.add(corner.length(), angle));
        }
        Self { metres: 2_f64.powi(distances.power(NEAR)) }
    }

    /// A length in units, from metres.
    pub(super) fn length(self, metres: f32) -> f32 {
        (f64::from(metres) / self.metres) as f32
    }

    /// A vector in units, from metres.
    pub(super) fn vector(self, metres: DVec3) -> Vec3 {
        (metres / self.metres).as_vec3()
    }

    /// Radiance in W/(m² sr), from that in W/(unit² sr).
    pub(super) fn radiance(self) -> f32 {
        self.metres.powi(-2) as f32
    }
}
