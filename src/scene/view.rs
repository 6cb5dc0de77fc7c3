//! The camera's view of a scene: reasons for a black photo, found with a few rays, and the direct light predicted from the geometry.

use std::collections::BTreeSet;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::{AlphaMode, Camera, Scene, TextureRef, Triangle};
use crate::finding::decimal;
use crate::image::Resolution;

/// The largest number of ray–triangle intersections that are computed. They take a fraction of a second.
const MAX_INTERSECTIONS: usize = 1 << 24;
/// The largest number of rays along one side of the picture.
const MAX_SIDE: usize = 32;
/// Surfaces beyond this distance, in metres, count as far. They send back about a ten-thousandth of a pattern or less.
const FAR: f32 = 50.0;

/// Surfaces with a lower roughness count as mirrors here.
const SMOOTH: f32 = 0.05;

#[derive(Clone, Copy, Debug, PartialEq)]
struct Hit {
    distance: f32,
    material: u32,
    is_front: bool,
}

/// The reason why a visible surface sends back little or no light.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Darkness {
    /// A one-sided surface shows its back.
    Back,
    Black,
    /// The surface is invisible: its opacity is 0.
    Absent,
    Mirror,
}

impl Darkness {
    /// The end of a sentence whose subject is the surface, and advice.
    fn words(self) -> [&'static str; 2] {
        match self {
            Self::Back => [
                "is seen from its back, which is black",
                "turn the faces around, or make the materials double-sided",
            ],
            Self::Black => {
                ["has a colour of 0, which is black", "give the material a colour (Kd, baseColorFactor)"]
            }
            Self::Absent => {
                ["has an opacity of 0", "raise the material's opacity (d, the alpha of baseColorFactor)"]
            }
            Self::Mirror => [
                "is a smooth mirror or clear glass, which sends light back only where it faces the camera",
                "make it rougher, or put something around it that it mirrors",
            ],
        }
    }
}

/// Explains in one sentence why photos of this scene are black or nearly black. `None` if a near surface in view shows its front.
pub fn reason_for_darkness(scene: &Scene, resolution: Resolution) -> Option<String> {
    let side = (MAX_INTERSECTIONS / scene.triangles.len().max(1)).isqrt().clamp(4, MAX_SIDE);
    let camera = &scene.camera;
    let (width, height) = (resolution.width as f32, resolution.height as f32);
    let rays: Vec<Vec3> = (0..side * side)
        .map(|at| {
            let [x, y] = [at % side, at / side].map(|at| (at as f32 + 0.5) / side as f32);
            camera.ray_direction(x * width, y * height, resolution).normalize()
        })
        .collect();
    // There are so few rays that testing them against all triangles is faster than building a tree.
    let hits: Vec<Hit> = rays.par_iter().filter_map(|&ray| first_hit(scene, camera, ray)).collect();
    if hits.is_empty() {
        return nothing_in_view(scene, resolution, rays.len());
    }
    let seen: BTreeSet<(u32, bool)> = hits.iter().map(|hit| (hit.material, hit.is_front)).collect();
    let reasons = seen.into_iter().map(|(material, is_front)| darkness(scene, material, is_front));
    if let Some(reasons) = reasons.collect::<Option<BTreeSet<Darkness>>>() {
        let [predicates, advice] = [(0, ", or "), (1, "; ")].map(|(at, separator)| {
            reasons.iter().map(|of| of.words()[at]).collect::<Vec<_>>().join(separator)
        });
        return Some(format!("every surface in view {predicates}: {advice}"));
    }
    far_away(hits.iter().map(|hit| hit.distance).collect())
}

/// The explanation for surfaces at these distances, if they are far away.
fn far_away(mut distances: Vec<f32>) -> Option<String> {
    distances.sort_by(f32::total_cmp);
    let middle = *distances.get(distances.len() / 2)?;
    (middle > FAR).then(|| {
        format!(
            "the surfaces in view are {middle:.0} m away, where a projector's light is faint: lengths are metres, so scale the scene if \
             its unit is another one"
        )
    })
}

/// The explanation when none of `rays` rays meets a surface. If a corner is in view, the surface is only too small for the rays.
fn nothing_in_view(scene: &Scene, resolution: Resolution, rays: usize) -> Option<String> {
    let camera = &scene.camera;
    let corners = || scene.triangles.iter().flat_map(|triangle| triangle.positions);
    let (width, height) = (resolution.width as f32, resolution.height as f32);
    let is_in_view = |corner: &Vec3| {
        let at = camera.project(*corner, resolution);
        at.is_some_and(|(u, v)| (0.0..=width).contains(&u) && (0.0..=height).contains(&v))
    };
    let seen: Vec<f32> =
        corners().filter(is_in_view).map(|corner| corner.distance(camera.position)).collect();
    if !seen.is_empty() {
        return far_away(seen);
    }
    let Camera { name, forward, .. } = camera;
    let in_file = |place: Vec3| place.as_dvec3() + scene.origin;
    let [low, high] = scene.bounds().map(in_file);
    let [position, low, high] = [in_file(camera.position), low, high]
        .map(|place| place.to_array().map(|metres| decimal(metres, 3)).join(", "));
    Some(format!(
        "no surface in view: none of {rays} rays meets one. The camera `{name}` stands at [{position}] and looks along \
         {forward:.3}; the scene lies between [{low}] and [{high}]"
    ))
}

/// Returns why a surface of this material is dark from this side, if it is. A texture matters only if its colours are black everywhere.
fn darkness(scene: &Scene, material: u32, is_front: bool) -> Option<Darkness> {
    let material = &scene.materials[material as usize];
    if matches!(material.alpha_mode, AlphaMode::Blend) && material.opacity == 0.0 {
        return Some(Darkness::Absent);
    }
    if !is_front && !material.double_sided && !material.lets_light_through() {
        return Some(Darkness::Back);
    }
    let is_colored = |color: Vec3, texture: &Option<TextureRef>| {
        let picture = texture.as_ref().and_then(|texture| scene.textures.get(texture.texture as usize));
        let mut texels = picture.iter().flat_map(|picture| &picture.texels);
        let is_black = picture.is_some() && texels.all(|&[red, green, blue, _]| red | green | blue == 0);
        color.max_element() > 0.0 && !is_black
    };
    let has_color = is_colored(material.base_color, &material.base_color_texture);
    let reflects =
        material.specular > 0.0 && is_colored(material.specular_color, &material.specular_color_texture);
    let is_smooth = material.roughness < SMOOTH && material.metallic_roughness_texture.is_none();
    let scatters = has_color && material.metallic < 1.0 && material.transmission < 1.0
        || material.diffuse_transmission > 0.0;
    let glints = reflects || has_color && (material.metallic > 0.0 || material.transmission > 0.0);
    match (scatters, glints) {
        (true, _) => None,
        (false, false) => Some(Darkness::Black),
        (false, true) => is_smooth.then_some(Darkness::Mirror),
    }
}

fn first_hit(scene: &Scene, camera: &Camera, ray: Vec3) -> Option<Hit> {
    let hits = scene.triangles.iter().filter_map(|triangle| {
        let (distance, is_front, _) = intersection(triangle, camera.position, ray)?;
        Some(Hit { distance, material: triangle.material, is_front })
    });
    hits.min_by(|a, b| a.distance.total_cmp(&b.distance))
}

/// Intersects a ray of unit length with a triangle. Returns the distance, whether the ray meets the front, and the barycentric weights of
/// the second and the third corner.
pub(super) fn intersection(triangle: &Triangle, origin: Vec3, ray: Vec3) -> Option<(f32, bool, [f32; 2])> {
    let [a, b, c] = triangle.positions;
    let (ab, ac) = (b - a, c - a);
    let across = ray.cross(ac);
    let determinant = ab.dot(across);
    let from_a = origin - a;
    let u = from_a.dot(across) / determinant;
    let turned = from_a.cross(ab);
    let v = ray.dot(turned) / determinant;
    let distance = ac.dot(turned) / determinant;
    // If the ray lies in the triangle's plane, the determinant is zero, and these comparisons fail.
    let is_inside = u >= 0.0 && v >= 0.0 && u + v <= 1.0;
    (is_inside && distance > 0.0).then_some((distance, determinant > 0.0, [u, v]))
}

/// The direct image of the scene under an all-ones pattern, as if all surfaces were white Lambertian and the projector were at the camera's
/// pinhole. The image has one radiance for each pixel, row by row.
///
/// The value at a pixel's centre is `|n·d| / (π t²)`. Here `t` is the depth of the nearest surface along the camera's axis, `n` is the unit
/// normal of that surface, and `d` is the ray direction with component 1 along the axis. The length of `d` accounts for the projector's
/// falloff towards the image's edges. The value is 0 where the camera sees no surface.
///
/// Triangles are rasterized into a depth buffer, so no ray tracer is needed. Mirrors, glass and masked surfaces count as opaque.
pub fn predicted_direct(scene: &Scene, resolution: Resolution) -> Vec<f64> {
    let mut depth = vec![f64::INFINITY; resolution.pixels()];
    let mut direct = vec![0.0; resolution.pixels()];
    let camera = &scene.camera;
    for triangle in &scene.triangles {
        let corners = triangle.positions.map(|corner| (corner - camera.position).as_dvec3());
        let [a, b] = [corners[1] - corners[0], corners[2] - corners[0]];
        let normal = a.cross(b).normalize_or_zero();
        let (columns, rows) = bounds(camera, triangle.positions, resolution);
        for row in rows {
            for column in columns.clone() {
                let ray = camera.ray_direction(column as f32 + 0.5, row as f32 + 0.5, resolution).as_dvec3();
                let pixel = row * resolution.width + column;
                if let Some(t) = hit(ray, corners[0], a, b)
                    && t < depth[pixel]
                {
                    depth[pixel] = t;
                    direct[pixel] = normal.dot(ray).abs() / (std::f64::consts::PI * t * t);
                }
            }
        }
    }
    direct
}

/// The ranges of columns and rows that a triangle may cover: the whole raster if a corner lies behind the camera.
fn bounds(
    camera: &Camera,
    corners: [Vec3; 3],
    resolution: Resolution,
) -> (std::ops::Range<usize>, std::ops::Range<usize>) {
    let [Some(a), Some(b), Some(c)] = corners.map(|corner| camera.project(corner, resolution)) else {
        return (0..resolution.width, 0..resolution.height);
    };
    let span = |values: [f32; 3], length: usize| {
        let low = values.into_iter().fold(f32::INFINITY, f32::min).floor().max(0.0) as usize;
        let high = values.into_iter().fold(0.0_f32, f32::max).ceil().max(0.0) as usize;
        low.min(length)..high.min(length)
    };
    (span([a.0, b.0, c.0], resolution.width), span([a.1, b.1, c.1], resolution.height))
}

/// The parameter `t > 0` at which the ray `t · ray` from the origin meets a triangle (Möller and Trumbore,
/// doi:10.1080/10867651.1997.10487468). The triangle has the vertices `corner`, `corner + a` and `corner + b`.
fn hit(ray: DVec3, corner: DVec3, a: DVec3, b: DVec3) -> Option<f64> {
    let p = ray.cross(b);
    let determinant = a.dot(p);
    if determinant == 0.0 {
        return None;
    }
    let u = -corner.dot(p) / determinant;
    let q = (-corner).cross(a);
    let v = ray.dot(q) / determinant;
    let t = b.dot(q) / determinant;
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0).then_some(t)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::error::Result;
    use crate::scene::{Material, Texture, Wrap, builtin};

    fn reason(change: impl Fn(&mut Scene)) -> Result<Option<String>> {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/scenes/corner/scene.glb");
        let mut scene = crate::scene::load(&path, None)?;
        change(&mut scene);
        Ok(reason_for_darkness(&scene, Resolution::new(40, 30)))
    }

    #[test]
    fn each_black_scene_has_its_reason() -> Result<()> {
        assert_eq!(reason(|_| ())?, None);
        let says = |reason: Option<String>, what: &str| {
            assert!(reason.as_deref().is_some_and(|r| r.contains(what)), "{reason:?}");
        };
        says(
            reason(|scene| scene.camera.forward = -scene.camera.forward)?,
            "no surface in view: none of 1024 rays",
        );
        let one_sided = |scene: &mut Scene| {
            scene.materials.iter_mut().for_each(|material| material.double_sided = false);
        };
        let turned = |scene: &mut Scene| {
            for triangle in &mut scene.triangles {
                *triangle = triangle.flipped();
            }
        };
        let backs = [
            reason(one_sided)?,
            reason(|scene| {
                one_sided(scene);
                turned(scene);
            })?,
        ];
        assert!(backs.contains(&None), "one side is the front: {backs:?}");
        says(backs.into_iter().flatten().next(), "seen from its back");
        let with = |change: fn(&mut Material)| reason(|scene| scene.materials.iter_mut().for_each(change));
        says(with(|material| material.base_color = Vec3::ZERO)?, "has a colour of 0");
        says(
            with(|material| (material.metallic, material.roughness) = (1.0, 0.0))?,
            "is a smooth mirror or clear glass",
        );
        assert_eq!(
            with(|material| (material.metallic, material.roughness) = (1.0, 0.5))?,
            None,
            "rough metal"
        );
        let black = Texture {
            name: "black".into(),
            width: 1,
            height: 1,
            texels: vec![[0, 0, 0, 255]],
            wrap: [Wrap::Repeat; 2],
            linear: true,
        };
        let painted = reason(|scene| {
            scene.textures = vec![black.clone()];
            let paint = |material: &mut Material| material.base_color_texture = Some(TextureRef::new(0));
            scene.materials.iter_mut().for_each(paint);
        })?;
        says(painted, "has a colour of 0");
        says(
            with(|material| (material.alpha_mode, material.opacity) = (AlphaMode::Blend, 0.0))?,
            "has an opacity of 0",
        );
        // All rays miss the surface because it is small, but it is still in view.
        let speck = reason(|scene| {
            let centre = scene.camera.position + 1.37 * scene.camera.forward;
            scene.triangles.truncate(1);
            let corners = [Vec3::ZERO, 1e-4 * Vec3::X, 1e-4 * Vec3::Y].map(|corner| centre + corner);
            scene.triangles[0].positions = corners;
        })?;
        assert_eq!(speck, None);
        assert_eq!(reason(turned)?, None, "both sides of these materials are seen");
        says(
            reason(|scene| {
                scene
                    .triangles
                    .iter_mut()
                    .for_each(|triangle| triangle.positions = triangle.positions.map(|p| 100.0 * p));
                scene.camera.position *= 100.0;
            })?,
            "m away",
        );
        Ok(())
    }

    #[test]
    fn a_fronto_parallel_wall_is_predicted_as_one_over_pi_d_squared() {
        let scene = builtin::plane(1.5, 0.8);
        let direct = predicted_direct(&scene, Resolution::new(9, 6));
        for value in direct {
            // The tolerance allows for the rounding of the wall's corners to single precision.
            assert!((value * std::f64::consts::PI * 2.25 - 1.0).abs() < 1e-5, "{value}");
        }
    }

    #[test]
    fn the_nearer_of_two_surfaces_is_the_visible_one() {
        let scene = builtin::carton_eggs().to_scene();
        let [eggs, empty] = [scene, builtin::carton().to_scene()]
            .map(|scene| predicted_direct(&scene, Resolution::new(30, 30)));
        assert!(eggs.iter().all(|value| *value > 0.0) && empty.iter().all(|value| *value > 0.0));
        // Cup 0 has an egg, whose top is nearer than the cup's floor. Cup 1 has no egg.
        assert!(eggs[3 * 30 + 5] > 1.05 * empty[3 * 30 + 5]);
        assert_eq!(eggs[3 * 30 + 15], empty[3 * 30 + 15]);
    }
}
