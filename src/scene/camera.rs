//! The geometry of the coaxial rig: one pinhole and one image plane for camera and projector.

use glam::Vec3;

/// A pinhole with an image plane at unit distance. Pixels are square: the vertical field of view is the file's, the
/// horizontal one follows from the resolution's shape.
///
/// The continuous raster point `(u, v)`, with `u` in `[0, w]` from the left and `v` in `[0, h]` from the top, looks
/// along `forward + (2u/w − 1)·(w/h)·tan_half_fov·right − (2v/h − 1)·tan_half_fov·up`.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    /// The node's name in the file.
    pub name: String,
    /// Centre of projection, in metres.
    pub position: Vec3,
    /// Unit vector to the right of the image.
    pub right: Vec3,
    /// Unit vector to the top of the image.
    pub up: Vec3,
    /// Unit vector along the optical axis, into the scene.
    pub forward: Vec3,
    /// Tangent of half the vertical field of view.
    pub tan_half_fov: f32,
    /// Width over height as the file states it, if it does.
    pub aspect: Option<f32>,
}
