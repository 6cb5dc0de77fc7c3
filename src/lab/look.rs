//! A picture of a scene for people: the colours of the surfaces from the camera's position, lit from the camera. It needs no device.

use glam::{Vec2, Vec3};

use crate::error::Result;
use crate::image::{Image, Resolution};
use crate::io::raster::decode_srgb;
use crate::scene::{AlphaMode, Scene, SurfacePoint, Texture, TextureRef, Wrap, first_hits};

/// Rays for each pixel along each axis.
const RAYS: usize = 2;

/// A blended surface with an opacity below this value is drawn as a hole.
const FAINT: f32 = 0.5;

/// The fraction of light that does not depend on the angle of a surface. The remaining light is proportional to the cosine of the angle.
const AMBIENT: f32 = 0.25;

/// Draws the scene from its camera, in linear RGB in \[0,1\]. Empty space and the backs of one-sided surfaces are black, as in photos.
///
/// # Errors
/// [`crate::Error::Dimension`] for a picture without pixels.
pub fn look(scene: &Scene, size: Resolution) -> Result<Image> {
    let (columns, rows) = (size.width * RAYS, size.height * RAYS);
    let (camera, fine) = (&scene.camera, Resolution::new(columns, rows));
    let direction = |at: usize| {
        let (x, y) = ((at % columns) as f32 + 0.5, (at / columns) as f32 + 0.5);
        camera.ray_direction(x, y, fine).normalize()
    };
    let rays: Vec<Vec3> = (0..fine.pixels()).map(direction).collect();
    let hits = first_hits(scene, camera.position, &rays, |point| is_hole(scene, point));
    let mut samples = vec![0.0; 3 * size.pixels()];
    for (at, (hit, ray)) in hits.iter().zip(&rays).enumerate() {
        let Some(hit) = hit else { continue };
        let pixel = at / columns / RAYS * size.width + at % columns / RAYS;
        let color = lit(scene, hit, *ray) / (RAYS * RAYS) as f32;
        samples[3 * pixel..3 * pixel + 3]
            .iter_mut()
            .zip(color.to_array())
            .for_each(|(sum, part)| *sum += part);
    }
    Image::new(size, 3, samples)
}

/// Whether a ray passes through the surface at this point.
fn is_hole(scene: &Scene, point: &SurfacePoint) -> bool {
    let opacity = || base(scene, point).1;
    match scene.materials[scene.triangles[point.triangle].material as usize].alpha_mode {
        AlphaMode::Opaque => false,
        AlphaMode::Mask { cutoff } => opacity() < cutoff,
        AlphaMode::Blend => opacity() < FAINT,
    }
}

fn lit(scene: &Scene, point: &SurfacePoint, ray: Vec3) -> Vec3 {
    let triangle = &scene.triangles[point.triangle];
    let material = &scene.materials[triangle.material as usize];
    if !point.is_front && !material.double_sided && !material.lets_light_through() {
        return Vec3::ZERO;
    }
    let [a, b, c] = triangle.positions;
    let cosine = (b - a).cross(c - a).normalize_or_zero().dot(ray).abs();
    base(scene, point).0 * (AMBIENT + (1.0 - AMBIENT) * cosine)
}

fn base(scene: &Scene, point: &SurfacePoint) -> (Vec3, f32) {
    let triangle = &scene.triangles[point.triangle];
    let material = &scene.materials[triangle.material as usize];
    let mut color = material.base_color.extend(material.opacity);
    let corners = triangle.colors.iter().zip(point.weights);
    let vertex = corners.fold(glam::Vec4::ZERO, |sum, (color, weight)| {
        sum + weight * glam::Vec4::from(color.map(|channel| f32::from(channel) / 65535.0))
    });
    color *= vertex;
    if let Some(reference) = &material.base_color_texture {
        let corners = triangle.texcoords.iter().zip(point.weights);
        let at = corners.fold(Vec2::ZERO, |sum, (sets, weight)| sum + weight * sets[reference.set as usize]);
        color *= texel(&scene.textures[reference.texture as usize], reference, at);
    }
    (color.truncate(), color.w)
}

/// The nearest texel, in linear colour.
fn texel(texture: &Texture, reference: &TextureRef, at: Vec2) -> glam::Vec4 {
    let at = reference.transform.transform_point2(at);
    let index = |coordinate: f32, wrap: Wrap, size: u32| {
        let within = match wrap {
            Wrap::Repeat => coordinate.rem_euclid(1.0),
            Wrap::MirroredRepeat => 1.0 - (coordinate.rem_euclid(2.0) - 1.0).abs(),
            Wrap::ClampToEdge => coordinate.clamp(0.0, 1.0),
        };
        // A coordinate that is not finite becomes 0.
        ((within * size as f32) as u32).min(size - 1) as usize
    };
    let (x, y) = (index(at.x, texture.wrap[0], texture.width), index(at.y, texture.wrap[1], texture.height));
    let [red, green, blue, alpha] =
        texture.texels[y * texture.width as usize + x].map(|byte| f32::from(byte) / 255.0);
    let [red, green, blue] = [red, green, blue].map(decode_srgb);
    glam::Vec4::new(red, green, blue, alpha)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::scene::Triangle;

    fn corner() -> Scene {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/scenes/corner/scene.glb");
        crate::scene::load(&path, None).expect("shipped scenes load")
    }

    /// A scene with one triangle that fills the view and has the texture coordinates `at` in all corners. Its texture has 2×2 texels.
    fn painted(at: Vec2) -> Scene {
        let mut scene = corner();
        let (camera, ahead) = (&scene.camera, scene.camera.position + scene.camera.forward);
        let reach = 50.0 * camera.tan_half_fov;
        let corners = [
            ahead - reach * camera.right - reach * camera.up,
            ahead + reach * camera.right - reach * camera.up,
            ahead + 2.0 * reach * camera.up,
        ];
        scene.triangles = vec![Triangle { texcoords: [[at; 2]; 3], ..Triangle::flat(corners, 0, 0) }];
        let texels = vec![[255, 0, 0, 255], [0, 255, 0, 255], [0, 0, 255, 255], [255, 255, 255, 0]];
        let wrap = [Wrap::MirroredRepeat, Wrap::Repeat];
        scene.textures =
            vec![Texture { name: "paint".into(), width: 2, height: 2, texels, wrap, linear: true }];
        let material = &mut scene.materials[0];
        material.base_color = Vec3::ONE;
        material.base_color_texture = Some(TextureRef::new(0));
        scene
    }

    fn seen(scene: &Scene) -> Vec<f32> {
        look(scene, Resolution::new(1, 1)).expect("it has a pixel").samples().to_vec()
    }

    #[test]
    fn the_camera_sees_the_colour_of_the_surface_before_it() {
        for (at, color) in
            [([0.2, 0.2], [1.0, 0.0, 0.0]), ([1.2, 1.2], [0.0, 1.0, 0.0]), ([0.2, -0.3], [0.0, 0.0, 1.0])]
        {
            let found = seen(&painted(at.into()));
            // The ray is perpendicular to the surface, up to half a pixel, so the colour is not darkened.
            assert!(found.iter().zip(color).all(|(a, b)| (a - b).abs() < 0.1), "{at:?}: {found:?}");
        }
    }

    #[test]
    fn backs_and_holes_are_black() {
        let mut scene = painted(Vec2::new(0.7, 0.7));
        assert!(seen(&scene)[0] > 0.9, "an opaque surface has no holes");
        scene.materials[0].alpha_mode = AlphaMode::Mask { cutoff: 0.5 };
        assert_eq!(seen(&scene), [0.0; 3]);
        scene.materials[0].alpha_mode = AlphaMode::Opaque;
        scene.materials[0].double_sided = false;
        scene.triangles[0].positions.swap(1, 2);
        assert_eq!(seen(&scene), [0.0; 3]);
        scene.materials[0].double_sided = true;
        assert!(seen(&scene)[0] > 0.9);
    }

    #[test]
    fn what_is_seen_fills_the_picture_as_its_photo_does() {
        let picture = look(&corner(), Resolution::new(32, 24)).expect("it has pixels");
        let lit = picture.samples().iter().filter(|&&sample| sample > 0.05).count();
        assert!(lit > picture.samples().len() / 2, "{lit}");
    }
}
