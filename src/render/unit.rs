//! The unit of length of the tracer.
//!
//! Offsets of rays, products of lengths and hidden thresholds suit distances of about 1. Therefore all geometry on the device is in units of the
//! power of two that the median distance between camera and surfaces is not below. Photos of a scene that is `2^k` times as large have the same
//! bits, times `2^-2k`.

use glam::{DVec3, Vec3};

use crate::scene::Scene;
use crate::scene::place::Distances;

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
        for corner in scene.triangles.iter().flat_map(|triangle| triangle.positions) {
            distances.add(corner.as_dvec3().distance(camera));
        }
        Self { metres: 2_f64.powi(distances.median_power()) }
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
