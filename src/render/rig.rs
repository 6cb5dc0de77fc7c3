//! The rig in the camera's frame, which the tracer uses: the lens centre of the camera is the origin, and the
//! camera looks along −z.

use glam::{DMat3, DVec3, Vec3};

use super::parameters::GpuEndpoint;
use super::settings::TraceSettings;
use super::unit::Unit;
use crate::image::Resolution;
use crate::scene::{Camera, Scene};

/// Camera and projector, the endpoints of light paths.
pub(super) struct Rig {
    camera: Camera,
    projector: Option<Camera>,
    unit: Unit,
}

impl Rig {
    /// The rig of a scene, with lengths in `unit`. A scene without a projector has a coaxial rig.
    pub(super) fn new(scene: &Scene, unit: Unit) -> Self {
        Self { camera: scene.camera.clone(), projector: scene.projector.clone(), unit }
    }

    /// Whether camera and projector share one lens and one image plane, so that transport is symmetric.
    pub(super) fn coaxial(&self, settings: &TraceSettings) -> bool {
        self.projector.is_none()
            && settings.projector.is_none_or(|resolution| resolution == settings.resolution)
    }

    /// Whether they share a pinhole, so that light can return along its own path.
    pub(super) fn coaxial_pinhole(&self, settings: &TraceSettings) -> bool {
        self.coaxial(settings) && self.camera.lens.radius == 0.0
    }

    /// The camera as an endpoint.
    pub(super) fn camera(&self, settings: &TraceSettings) -> GpuEndpoint {
        self.endpoint(&self.camera, settings.resolution)
    }

    /// The projector as an endpoint.
    pub(super) fn projector(&self, settings: &TraceSettings) -> GpuEndpoint {
        let resolution = settings.projector.unwrap_or(settings.resolution);
        self.endpoint(self.projector.as_ref().unwrap_or(&self.camera), resolution)
    }

    fn endpoint(&self, endpoint: &Camera, resolution: Resolution) -> GpuEndpoint {
        let to_camera = axes(&self.camera).transpose();
        let [right, up, back] = if *endpoint == self.camera {
            // Exact axes, without rounding.
            [Vec3::X, Vec3::Y, Vec3::Z]
        } else {
            let turned = to_camera * axes(endpoint);
            [turned.x_axis, turned.y_axis, turned.z_axis].map(|axis| axis.as_vec3())
        };
        let position: DVec3 = to_camera * (endpoint.position.as_dvec3() - self.camera.position.as_dvec3());
        let shape = resolution.width as f32 / resolution.height as f32;
        GpuEndpoint {
            right,
            radius: self.unit.length(endpoint.lens.radius),
            up,
            focus: self.unit.length(endpoint.lens.focus),
            back,
            padding: 0.0,
            position: self.unit.vector(position),
            padding2: 0.0,
            tangent: [endpoint.tan_half_fov * shape, endpoint.tan_half_fov],
            resolution: [resolution.width as u32, resolution.height as u32],
        }
    }
}

/// The rotation from the endpoint's frame to the world.
fn axes(endpoint: &Camera) -> DMat3 {
    DMat3::from_cols(endpoint.right.as_dvec3(), endpoint.up.as_dvec3(), -endpoint.forward.as_dvec3())
}

impl GpuEndpoint {
    /// Number of pixels.
    pub(super) fn pixels(&self) -> u64 {
        u64::from(self.resolution[0]) * u64::from(self.resolution[1])
    }

    /// Area of the image plane at distance 1.
    pub(super) fn image_area(&self) -> f64 {
        4.0 * f64::from(self.tangent[0]) * f64::from(self.tangent[1])
    }
}
