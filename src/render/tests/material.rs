//! Materials under test.

use glam::Vec3;

/// As `Bsdf` in `shaders/shared/bsdf.wgsl`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bsdf {
    pub(super) base_color: Vec3,
    pub(super) metallic: f32,
    pub(super) f0: Vec3,
    pub(super) f90: f32,
    pub(super) alpha: f32,
}

/// Reads a [`Bsdf`] from three elements of `input`.
pub(super) const READ_BSDF: &str = "
fn bsdf_at(first: u32) -> Bsdf {
    let base = input[first];
    let reflectance = input[first + 1u];
    return Bsdf(base.xyz, base.w, reflectance.xyz, reflectance.w, input[first + 2u].x,
        0.0, 0.0, 1.0, vec3f(0.0), 1.0, 1.0, vec3f(0.0, 0.0, 1.0));
}
";

impl Bsdf {
    pub(super) fn lambertian(albedo: f32) -> Self {
        Self { base_color: Vec3::splat(albedo), metallic: 0.0, f0: Vec3::ZERO, f90: 0.0, alpha: 1.0 }
    }

    /// Index of refraction 1.5.
    pub(super) fn dielectric(albedo: f32, alpha: f32) -> Self {
        Self { f0: Vec3::splat(0.04), f90: 1.0, alpha, ..Self::lambertian(albedo) }
    }

    pub(super) fn metal(albedo: f32, alpha: f32) -> Self {
        Self { metallic: 1.0, ..Self::dielectric(albedo, alpha) }
    }

    pub(super) fn encode(&self) -> [[f32; 4]; 3] {
        [
            self.base_color.extend(self.metallic).to_array(),
            self.f0.extend(self.f90).to_array(),
            [self.alpha, 0.0, 0.0, 0.0],
        ]
    }
}
