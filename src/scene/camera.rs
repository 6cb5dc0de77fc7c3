//! The geometry of a camera or a projector: its pose, its image plane and its lens.

use glam::{DVec3, Vec3};

use super::{Material, Triangle};
use crate::image::Resolution;

/// A pinhole or thin-lens camera with an image plane at unit distance. The file states the vertical field of view. The horizontal field
/// follows from the resolution, because pixels are square.
///
/// A continuous raster point has the coordinates `u` in `[0, w]` from the left and `v` in `[0, h]` from the top. The ray through it has the
/// direction `forward + (2u/w − 1)·(w/h)·tan_half_fov·right − (2v/h − 1)·tan_half_fov·up`.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Camera {
    /// The name of the camera's node in the file.
    pub name: String,
    /// Centre of projection, in metres.
    pub position: Vec3,
    /// Unit vector towards the right edge of the image.
    pub right: Vec3,
    /// Unit vector towards the top edge of the image.
    pub up: Vec3,
    /// Unit vector along the optical axis, into the scene.
    pub forward: Vec3,
    /// Tangent of half the vertical field of view.
    pub tan_half_fov: f32,
    /// Width over height of the image, if the file states it.
    pub aspect: Option<f32>,
    /// The lens; a pinhole by default.
    pub lens: Lens,
}

/// A thin lens through the camera's position, perpendicular to the optical axis.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Lens {
    /// Radius of the aperture in metres; 0 is a pinhole.
    pub radius: f32,
    /// Distance of the plane in focus, in metres along the optical axis. It has no effect on a pinhole.
    pub focus: f32,
}

impl Lens {
    /// A pinhole. All distances are in focus.
    pub const PINHOLE: Self = Self { radius: 0.0, focus: 1.0 };

    pub(super) const HELP: &str =
        "an open aperture needs its radius and the distance of the plane in focus, in metres";

    /// The lens that a file states: a pinhole if no radius is stated. `Err` has the end of a sentence whose subject is the camera.
    pub(super) fn checked(radius: Option<f64>, focus: Option<f64>) -> Result<Self, String> {
        let radius = radius.unwrap_or(0.0);
        if !(radius.is_finite() && radius >= 0.0) {
            return Err(format!("has an aperture_radius of {radius}"));
        }
        match focus {
            _ if radius as f32 == 0.0 => Ok(Self::PINHOLE),
            // The check uses single precision, because a very small or large distance rounds to zero or infinity there.
            Some(focus) if (focus as f32).is_finite() && focus as f32 > 0.0 => {
                Ok(Self { radius: radius as f32, focus: focus as f32 })
            }
            Some(focus) => Err(format!("has a focus_distance of {focus}")),
            None => Err("has an aperture_radius, but no focus_distance".into()),
        }
    }
}

impl Default for Lens {
    fn default() -> Self {
        Self::PINHOLE
    }
}

/// The tangent of half a field of view (in radians). `None` if the field is too narrow or too wide for single precision.
pub(super) fn tan_half(field: f64) -> Option<f32> {
    let tangent = (field / 2.0).tan();
    (field > 0.0 && field < std::f64::consts::PI && (1e-6..1e6).contains(&tangent)).then_some(tangent as f32)
}

/// Right, up and forward of a camera that looks along `forward`, as an orthonormal frame. `None` if a direction is zero, or if both are
/// parallel.
pub(super) fn axes(forward: DVec3, up: DVec3) -> Option<[DVec3; 3]> {
    let forward = forward.try_normalize()?;
    let right = forward.cross(up.try_normalize()?);
    // If the axes are closer to parallel than this, rounding determines the result.
    let right = (right.length() > 1e-6).then(|| right.normalize())?;
    Some([right, right.cross(forward), forward])
}

/// A camera with its position in the file's coordinates, in double precision.
#[derive(Clone)]
pub(super) struct Posed {
    /// The camera. Its field `position` is not used here.
    pub camera: Camera,
    /// The position in the file's coordinates.
    pub position: DVec3,
}

impl Posed {
    /// The camera in coordinates with their origin at `origin`.
    pub(super) fn around(self, origin: DVec3) -> Camera {
        Camera { position: (self.position - origin).as_vec3(), ..self.camera }
    }
}

impl Camera {
    /// A pinhole for tests, with its horizontal axis level.
    #[cfg(test)]
    pub(crate) fn looking(position: Vec3, forward: Vec3) -> Self {
        let forward = forward.normalize();
        let right = forward.cross(Vec3::Y).normalize();
        let up = right.cross(forward);
        let (name, lens) = ("test".into(), Lens::PINHOLE);
        Self { name, position, right, up, forward, tan_half_fov: 0.4, aspect: None, lens }
    }

    /// The name of a camera that krylux placed because the scene has none.
    pub const PLACED: &str = "auto";

    /// A pinhole with a field of view of 40° that sees all of these triangles from the front (+Z, as in glTF), somewhat from the right and
    /// above. If nearly all surfaces turn black backs to this camera, it is placed behind, beside or below the scene instead.
    pub fn in_front_of(triangles: &[Triangle], materials: &[Material]) -> Self {
        let corners = || triangles.iter().flat_map(|triangle| triangle.positions);
        let low = corners().fold(Vec3::INFINITY, Vec3::min);
        let high = corners().fold(Vec3::NEG_INFINITY, Vec3::max);
        let (centre, radius) = (0.5 * (low + high), (0.5 * (high - low).length()).max(f32::MIN_POSITIVE));
        let half_field = 20.0_f32.to_radians();
        let forward = -side_to_see(triangles, materials);
        // The bounding sphere of the scene touches the edges of the picture.
        let position = centre - radius / half_field.sin() * forward;
        let right = forward.cross(Vec3::Y).normalize();
        let (up, tan_half_fov) = (right.cross(forward), half_field.tan());
        let (name, lens) = (Self::PLACED.to_owned(), Lens::PINHOLE);
        Self { name, position, right, up, forward, tan_half_fov, aspect: None, lens }
    }

    /// The `[camera]` table of a camera file for this camera. `origin` is the origin of the scene's coordinates
    /// ([`Scene::origin`](super::Scene::origin)).
    pub fn to_toml(&self, origin: DVec3) -> String {
        let vector = |v: Vec3| format!("[{}, {}, {}]", v.x, v.y, v.z);
        let mut text = format!(
            "[camera]\nposition = {}\nforward = {}\nup = {}\nvertical_fov_degrees = {}\n",
            if origin == DVec3::ZERO {
                vector(self.position)
            } else {
                (origin + self.position.as_dvec3()).to_string()
            },
            vector(self.forward),
            vector(self.up),
            2.0 * f64::from(self.tan_half_fov).atan().to_degrees()
        );
        if self.lens.radius > 0.0 {
            let Lens { radius, focus } = self.lens;
            text.push_str(&format!("aperture_radius = {radius}\nfocus_distance = {focus}\n"));
        }
        text
    }

    /// Whether `other` has the same pose, field of view and lens, up to rounding. `distance` is the distance of visible surfaces in metres.
    pub fn coincides(&self, other: &Self, distance: f32) -> bool {
        let close = |a: Vec3, b: Vec3, unit: f32| a.distance(b) <= 1e-6 * (unit + a.length());
        close(self.position, other.position, distance)
            && close(self.right, other.right, 1.0)
            && close(self.up, other.up, 1.0)
            && close(self.forward, other.forward, 1.0)
            && (self.tan_half_fov - other.tan_half_fov).abs() <= 1e-6 * self.tan_half_fov
            && self.lens == other.lens
    }

    /// The direction of the ray through the raster point `(u, v)`. It is not normalized: its component along `forward` is 1.
    pub fn ray_direction(&self, u: f32, v: f32, resolution: Resolution) -> Vec3 {
        let [horizontal, vertical] = self.half_extents(resolution);
        let x = (2.0 * u / resolution.width as f32 - 1.0) * horizontal;
        let y = (1.0 - 2.0 * v / resolution.height as f32) * vertical;
        self.forward + x * self.right + y * self.up
    }

    /// The raster point `(u, v)` at which the camera sees `point`: the inverse of [`Camera::ray_direction`]. `None` when the point is not
    /// in front of the camera. A point in front of the camera that is out of view has a result outside `[0, w]` × `[0, h]`.
    pub fn project(&self, point: Vec3, resolution: Resolution) -> Option<(f32, f32)> {
        let offset = point - self.position;
        let depth = offset.dot(self.forward);
        if depth <= 0.0 {
            return None;
        }
        let [horizontal, vertical] = self.half_extents(resolution);
        let x = offset.dot(self.right) / (depth * horizontal);
        let y = offset.dot(self.up) / (depth * vertical);
        Some(((1.0 + x) / 2.0 * resolution.width as f32, (1.0 - y) / 2.0 * resolution.height as f32))
    }

    /// The fraction of the picture, in the shape stated by its file, that photos of this resolution cut off at the left and right. `None`
    /// if at most half a pixel is cut off on each side.
    pub fn cropped(&self, resolution: Resolution) -> Option<f64> {
        let whole = f64::from(self.aspect?) * resolution.height as f64;
        let width = resolution.width as f64;
        (whole > width + 1.0).then(|| 1.0 - width / whole)
    }

    /// Half the width and height of the image plane at unit distance.
    pub(super) fn half_extents(&self, resolution: Resolution) -> [f32; 2] {
        let shape = resolution.width as f32 / resolution.height as f32;
        [self.tan_half_fov * shape, self.tan_half_fov]
    }
}

/// Directions from a scene to a camera, in the order of preference.
const SIDES: [Vec3; 5] = [
    Vec3::new(0.5, 0.35, 1.0),
    Vec3::new(-0.5, 0.35, -1.0),
    Vec3::new(1.0, 0.35, -0.5),
    Vec3::new(-1.0, 0.35, 0.5),
    Vec3::new(0.5, -1.0, 1.0),
];

/// A preferred side is chosen if the surface visible from it is at least this fraction of the surface visible from the best side.
const ENOUGH: f32 = 0.1;

/// The unit vector from a scene to a camera that sees the fronts of the scene's surfaces.
fn side_to_see(triangles: &[Triangle], materials: &[Material]) -> Vec3 {
    let sides = SIDES.map(|side| side.normalize());
    let mut seen = [0.0_f32; SIDES.len()];
    for triangle in triangles {
        let [a, b, c] = triangle.positions;
        let doubled = (b - a).cross(c - a);
        let has_back = materials
            .get(triangle.material as usize)
            .is_some_and(|material| material.double_sided || material.lets_light_through());
        for (seen, side) in seen.iter_mut().zip(sides) {
            let facing = doubled.dot(side);
            *seen += if has_back { facing.abs() } else { facing.max(0.0) };
        }
    }
    let most = seen.into_iter().fold(0.0, f32::max);
    let good = seen.iter().position(|&seen| seen >= ENOUGH * most);
    sides[good.unwrap_or_default()]
}

#[cfg(test)]
mod tests {
    use glam::vec3;

    use super::*;

    fn camera() -> Camera {
        Camera {
            name: "test".into(),
            position: vec3(1.0, 2.0, 3.0),
            right: Vec3::NEG_Y,
            up: Vec3::Z,
            forward: Vec3::X,
            tan_half_fov: 0.5,
            aspect: None,
            lens: Lens::PINHOLE,
        }
    }

    #[test]
    fn a_wide_raster_has_a_wider_horizontal_field_of_view() {
        let resolution = Resolution::new(8, 4);
        assert_eq!(camera().ray_direction(4.0, 2.0, resolution), vec3(1.0, 0.0, 0.0));
        assert_eq!(camera().ray_direction(0.0, 0.0, resolution), vec3(1.0, 1.0, 0.5), "top left");
        assert_eq!(camera().ray_direction(8.0, 4.0, resolution), vec3(1.0, -1.0, -0.5), "bottom right");
    }

    #[test]
    fn a_point_on_a_ray_projects_to_the_raster_point_of_the_ray() {
        let resolution = Resolution::new(7, 5);
        let camera = camera();
        for (u, v) in [(0.5, 0.25), (3.0, 4.75), (6.9, 2.0), (-1.0, 6.0)] {
            let point = camera.position + 3.0 * camera.ray_direction(u, v, resolution);
            let (back_u, back_v) =
                camera.project(point, resolution).expect("the point lies in front of the camera");
            // The tolerance allows for a few roundings of numbers below 10.
            assert!((back_u - u).abs() < 1e-5 && (back_v - v).abs() < 1e-5, "{u} {v} → {back_u} {back_v}");
        }
    }

    #[test]
    fn photos_crop_what_the_picture_has_beyond_their_edges() {
        for (aspect, size, share) in [
            (16.0 / 9.0, [128, 128], Some(7.0 / 16.0)),
            (16.0 / 9.0, [128, 72], None),
            // A loss of half a pixel on each side is tolerated.
            (2.0, [143, 72], None),
            (2.0, [142, 72], Some(1.0 / 72.0)),
            (16.0 / 9.0, [160, 72], None),
            (1.0, [128, 128], None),
            (1.0, [64, 128], Some(0.5)),
            (0.5, [128, 128], None),
        ] {
            let resolution = Resolution::new(size[0], size[1]);
            let camera = Camera { aspect: Some(aspect), ..camera() };
            let found = camera.cropped(resolution);
            assert_eq!(found.is_some(), share.is_some(), "{aspect} {size:?}");
            // The aspect is in single precision.
            assert!(
                (found.unwrap_or(0.0) - share.unwrap_or(0.0)).abs() < 1e-6,
                "{aspect} {size:?}: {found:?}"
            );
            // The photo ends at its last column. The picture of the stated shape extends farther.
            let [edge, _] = camera.half_extents(resolution);
            let left_out = 1.0 - f64::from(edge / (camera.tan_half_fov * aspect));
            assert!((found.unwrap_or(left_out) - left_out).abs() < 1e-6, "{aspect} {size:?}");
        }
        assert_eq!(camera().cropped(Resolution::new(1, 99)), None, "the file states no shape");
    }

    #[test]
    fn a_placed_camera_sees_all_of_the_scene() {
        let corners = [vec3(-3.0, 0.0, 1.0), vec3(5.0, 0.1, 2.0), vec3(0.0, 4.0, -7.0)];
        let camera = Camera::in_front_of(&[Triangle::flat(corners, 0, 0)], &[Material::default()]);
        let resolution = Resolution::new(100, 100);
        for corner in corners {
            let (u, v) = camera.project(corner, resolution).expect("it is in front");
            assert!((0.0..=100.0).contains(&u) && (0.0..=100.0).contains(&v), "{corner}: {u} {v}");
        }
        assert!((camera.right.cross(camera.up) + camera.forward).length() < 1e-5, "{camera:?}");
        assert!(camera.up.y > 0.9 && camera.forward.z < -0.5, "{camera:?}");
    }

    #[test]
    fn a_placed_camera_sees_fronts() {
        let corners = [vec3(0.0, 0.0, 0.0), vec3(1.0, 0.0, 0.0), vec3(0.0, 1.0, 0.0)];
        let (front, back) = (Triangle::flat(corners, 0, 0), Triangle::flat(corners, 0, 0).flipped());
        let one_sided = [Material { double_sided: false, ..Material::default() }];
        assert!(Camera::in_front_of(&[front], &one_sided).forward.z < 0.0);
        assert!(Camera::in_front_of(&[back], &one_sided).forward.z > 0.0, "from behind");
        assert!(Camera::in_front_of(&[back], &[Material::default()]).forward.z < 0.0, "both sides are seen");
        let ceiling = Triangle::flat(corners.map(|corner| vec3(corner.x, 0.0, corner.y)), 0, 0);
        assert!(Camera::in_front_of(&[ceiling], &one_sided).forward.y > 0.0, "from below");
    }

    #[test]
    fn a_point_behind_or_beside_the_camera_has_no_projection() {
        let resolution = Resolution::new(4, 4);
        assert_eq!(camera().project(vec3(0.0, 2.0, 3.0), resolution), None);
        assert_eq!(camera().project(vec3(1.0, 5.0, 3.0), resolution), None, "beside it");
    }
}
