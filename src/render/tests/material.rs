//! Materials under test.

use glam::{Vec3, vec3};

#[derive(Clone, Copy, Debug)]
pub(super) struct Bsdf {
    pub(super) base_color: Vec3,
    pub(super) metallic: f32,
    pub(super) f0: Vec3,
    pub(super) f90: f32,
    pub(super) alpha: f32,
    pub(super) transmission: f32,
    pub(super) diffuse_transmission: f32,
    pub(super) opacity: f32,
    pub(super) diffuse_transmission_color: Vec3,
    pub(super) eta_o: f32,
    pub(super) eta_t: f32,
    pub(super) shading: Vec3,
}

pub(super) const BSDF_SIZE: usize = 5;

pub(super) const READ_BSDF: &str = "
fn bsdf_at(first: u32) -> Bsdf {
    let base = input[first];
    let reflectance = input[first + 1u];
    let shares = input[first + 2u];
    let through = input[first + 3u];
    let shading = input[first + 4u];
    return Bsdf(base.xyz, base.w, reflectance.xyz, reflectance.w, shares.x, shares.y, shares.z, shares.w,
        through.xyz, through.w, shading.w, shading.xyz);
}
";

impl Bsdf {
    pub(super) fn lambertian(albedo: f32) -> Self {
        Self {
            base_color: Vec3::splat(albedo),
            metallic: 0.0,
            f0: Vec3::ZERO,
            f90: 0.0,
            alpha: 1.0,
            transmission: 0.0,
            diffuse_transmission: 0.0,
            opacity: 1.0,
            diffuse_transmission_color: Vec3::ONE,
            eta_o: 1.0,
            eta_t: 1.0,
            shading: Vec3::Z,
        }
    }

    /// A dielectric with refractive index 1.5.
    pub(super) fn dielectric(albedo: f32, alpha: f32) -> Self {
        Self { f0: Vec3::splat(0.04), f90: 1.0, alpha, ..Self::lambertian(albedo) }
    }

    pub(super) fn metal(albedo: f32, alpha: f32) -> Self {
        Self { metallic: 1.0, ..Self::dielectric(albedo, alpha) }
    }

    /// A colourless wall without thickness.
    pub(super) fn pane(alpha: f32) -> Self {
        Self { transmission: 1.0, ..Self::dielectric(1.0, alpha) }
    }

    /// Colourless glass of index 1.5, seen from the air.
    pub(super) fn glass(alpha: f32) -> Self {
        Self { eta_t: 1.5, ..Self::pane(alpha) }
    }

    /// The same surface, seen from the other side.
    pub(super) fn beyond(self) -> Self {
        let shading = vec3(-self.shading.x, -self.shading.y, self.shading.z);
        Self { eta_o: self.eta_t, eta_t: self.eta_o, shading, ..self }
    }

    /// The same surface, with this angle between its shading normal and its geometric normal.
    pub(super) fn tilted(self, degrees: f32) -> Self {
        let (sin, cos) = degrees.to_radians().sin_cos();
        Self { shading: vec3(0.8 * sin, 0.6 * sin, cos), ..self }
    }

    pub(super) fn describe(&self) -> String {
        let Self { metallic, alpha, transmission, diffuse_transmission, opacity, eta_o, eta_t, .. } = self;
        format!(
            "albedo {}, metallic {metallic}, f0 {}, α {alpha}, transmission {transmission} and {diffuse_transmission}, \
             opacity {opacity}, {eta_o} to {eta_t}, normal {}",
            self.base_color.x, self.f0.x, self.shading
        )
    }

    pub(super) fn encode(&self) -> [[f32; 4]; BSDF_SIZE] {
        [
            self.base_color.extend(self.metallic).to_array(),
            self.f0.extend(self.f90).to_array(),
            [self.alpha, self.transmission, self.diffuse_transmission, self.opacity],
            self.diffuse_transmission_color.extend(self.eta_o).to_array(),
            self.shading.extend(self.eta_t).to_array(),
        ]
    }
}

/// WGSL for random materials of all kinds: white if `white`, smooth if `smooth_ones`, tilted if `tilted`.
pub(super) const RANDOM_BSDF: &str = "
fn random_bsdf(index: u32, white: bool, smooth_ones: bool, tilted: bool) -> Bsdf {
    let color = select(mix(vec4f(0.02), vec4f(1.0), random4(index, 0u, 1u, 3u)), vec4f(1.0), white);
    let through = select(mix(vec4f(0.02), vec4f(1.0), random4(index, 1u, 1u, 3u)), vec4f(1.0), white);
    let reflectance = mix(vec4f(0.2), vec4f(1.0), random4(index, 0u, 2u, 3u));
    let kind = random4(index, 0u, 3u, 3u);
    let share = random4(index, 1u, 3u, 3u);
    let media = random4(index, 2u, 3u, 3u);
    let tilt = random4(index, 3u, 3u, 3u);
    // A third each: none, all, and between.
    let metallic = select(select(kind.y, 1.0, kind.x < 0.667), 0.0, kind.x < 0.333);
    let transmission = select(select(share.y, 1.0, share.x < 0.667), 0.0, share.x < 0.333);
    let diffuse_transmission = select(select(share.w, 1.0, share.z < 0.667), 0.0, share.z < 0.333);
    let alpha = select(mix(0.02, 1.0, kind.z), 0.0, smooth_ones);
    // Out of a denser medium, thin, and into one.
    let eta = 1.1 + media.y;
    let eta_o = select(1.0, eta, media.x < 0.333);
    let eta_t = select(1.0, eta, media.x > 0.667);
    // A specular colour, but for half of the white ones.
    let tinted = !white || media.z < 0.5;
    let f0 = reflectance.w * select(vec3f(0.04), reflectance.xyz, tinted);
    let sine = select(0.0, 0.7 * tilt.x, tilted);
    let shading = vec3f(sine * cos(6.28 * tilt.y), sine * sin(6.28 * tilt.y), sqrt(1.0 - sine * sine));
    return Bsdf(color.xyz, metallic, f0, select(reflectance.w, 1.0, white), alpha, transmission, diffuse_transmission,
        select(1.0, kind.w, media.w < 0.5), through.xyz, eta_o, eta_t, normalize(shading));
}
fn uniform_direction(u: vec2f) -> vec3f {
    let z = 2.0 * u.x - 1.0;
    let height = select(-1.0, 1.0, z >= 0.0) * max(abs(z), 1e-4);
    let radius = sqrt(1.0 - height * height);
    return normalize(vec3f(radius * cos(2.0 * PI * u.y), radius * sin(2.0 * PI * u.y), height));
}
";
