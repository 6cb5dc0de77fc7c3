//! The sampling strategies: paths from the camera, and also paths from the projector if it stands apart.

use std::ops::Range;

use glam::{DMat3, DVec3, Vec3};

use super::Tracer;
use super::batch::RecordLayout;
use super::dispatch::max_paths_per_invocation;
use super::geometry::Unit;
use super::kernel::{Features, GpuEndpoint, Parameters};
use super::light_buffer::no_light_buffer;
use super::photons::{ChainRequest, PhotonMap};
use super::settings::{StartPixels, TraceSettings};
use crate::error::Result;
use crate::image::Resolution;
use crate::scene::{Camera, Scene};

/// One sampling strategy: the paths that start at one endpoint of the rig, with all inputs of their kernel.
pub(super) struct Strategy {
    /// The parameters of the strategy's dispatches. Each dispatch selects its own paths.
    pub(super) parameters: Parameters,
    pub(super) features: Features,
    pub(super) max_paths_per_invocation: u32,
    pub(super) chains: PhotonMap,
    /// The light buffer of the shared pinhole, or a placeholder if no ray uses it.
    pub(super) light_buffer: wgpu::TextureView,
    pub(super) layout: RecordLayout,
}

impl Strategy {
    #[cfg(test)]
    pub(super) fn paths(&self) -> u64 {
        self.parameters.start.pixels() * u64::from(self.parameters.samples)
    }

    /// The range of the path numbers that start from these pixels.
    pub(super) fn paths_from(&self, pixels: &StartPixels) -> Range<u64> {
        let samples = u64::from(self.parameters.samples);
        let own = if self.layout.from_camera { &pixels.camera } else { &pixels.projector };
        own.start as u64 * samples..own.end as u64 * samples
    }
}

impl Tracer {
    /// The strategies for these settings: paths from the camera, and paths from the projector unless the rig is coaxial.
    pub(super) fn strategies(&mut self, settings: &TraceSettings) -> Result<Vec<Strategy>> {
        let (camera, projector) = (self.rig.camera(settings), self.rig.projector(settings));
        if self.rig.coaxial(settings) {
            return Ok(vec![self.strategy(settings, [camera, camera], [settings.samples; 2], true)?]);
        }
        let share = camera.pixels() as f64 / projector.pixels() as f64;
        let samples = [settings.samples, (f64::from(settings.samples) * share).round().max(1.0) as u32];
        Ok(vec![
            self.strategy(settings, [camera, projector], samples, true)?,
            self.strategy(settings, [projector, camera], [samples[1], samples[0]], false)?,
        ])
    }

    /// The strategy of paths from the first of two endpoints to the second. `samples` and `end_samples` are the numbers of paths per pixel
    /// that start at the first and at the second endpoint.
    pub(super) fn strategy(
        &mut self,
        settings: &TraceSettings,
        [start, end]: [GpuEndpoint; 2],
        [samples, end_samples]: [u32; 2],
        from_camera: bool,
    ) -> Result<Strategy> {
        let coaxial = self.rig.coaxial(settings);
        let coaxial_pinhole = self.rig.coaxial_pinhole(settings);
        let ambient = self.scene.ambient && from_camera;
        // If light may pass straight through a surface, a ray needs its hits in order, and the light buffer does not give their order.
        let (light_buffer, light_buffer_side) = if coaxial_pinhole && !self.scene.features.passable {
            self.light_buffers.lists(&self.gpu, &self.scene, start.tangent)?
        } else {
            (no_light_buffer(&self.gpu)?, 0)
        };
        let mut features = Features {
            scene: self.scene.features,
            ambient,
            lenses: start.radius > 0.0 || end.radius > 0.0,
            coaxial_pinhole,
            roulette: settings.russian_roulette,
            several_paths: false,
            light_buffer_side,
        };
        let mut parameters = parameters(settings, [start, end], [samples, end_samples], from_camera, coaxial);
        parameters.scale *= self.scene.unit.radiance();
        let chains = if self.scene.features.chains {
            let request = ChainRequest { features, endpoint: end, gather: settings.gather, base: parameters };
            self.chains.map(&self.gpu, &self.scene, request, &mut self.dispatches)?
        } else {
            PhotonMap::empty(&self.gpu)?
        };
        let gathers = chains.bucket_mask != 0;
        let max_paths_per_invocation =
            max_paths_per_invocation(&self.gpu, &self.scene.features, gathers, settings.max_bounces);
        features.several_paths = max_paths_per_invocation > 1;
        let layout = RecordLayout {
            samples,
            max_bounces: settings.max_bounces,
            direct: coaxial_pinhole,
            gathers,
            ambient,
            symmetric: coaxial,
            from_camera,
        };
        parameters.stride = layout.stride() as u32;
        parameters.bucket_mask = chains.bucket_mask;
        parameters.photons = chains.count;
        parameters.gather_radius = chains.radius;
        parameters.inverse_cell = chains.inverse_cell();
        Ok(Strategy { parameters, features, max_paths_per_invocation, chains, light_buffer, layout })
    }
}

/// The parameters of a strategy's dispatches, without its photon map. The arguments are those of [`Tracer::strategy`].
fn parameters(
    settings: &TraceSettings,
    [start, end]: [GpuEndpoint; 2],
    [samples, end_samples]: [u32; 2],
    from_camera: bool,
    coaxial: bool,
) -> Parameters {
    // The number of paths per area of the image plane at distance 1.
    let density = |endpoint: &GpuEndpoint, samples: u32| {
        f64::from(samples) * endpoint.pixels() as f64 / endpoint.image_area()
    };
    let end_to_start =
        if coaxial { 1.0 } else { density(&end, end_samples) / density(&start, samples) } as f32;
    Parameters {
        start,
        end,
        samples,
        max_bounces: settings.max_bounces,
        // The paths of both endpoints use different random numbers.
        seed: if from_camera { settings.seed } else { settings.seed ^ 0x9e37_79b9 },
        end_to_start,
        // The factor that converts an estimate per projector sample to one per camera sample. Lengths are in metres.
        scale: if from_camera { 1.0 } else { end_to_start },
        sampling: settings.sampler.word(),
        paths_per_invocation: 1,
        ..bytemuck::Zeroable::zeroed()
    }
}

/// Camera and projector as the endpoints of light paths, in the camera's frame: the camera is at the origin and looks along −z.
pub(super) struct Endpoints {
    camera: Camera,
    projector: Option<Camera>,
    unit: Unit,
}

impl Endpoints {
    /// The rig of a scene, with lengths in `unit`. A scene without a projector has a coaxial rig.
    pub(super) fn new(scene: &Scene, unit: Unit) -> Self {
        Self { camera: scene.camera.clone(), projector: scene.projector.clone(), unit }
    }

    pub(super) fn coaxial(&self, settings: &TraceSettings) -> bool {
        self.projector.is_none()
            && settings.projector.is_none_or(|resolution| resolution == settings.resolution)
    }

    /// Whether camera and projector share a pinhole, so that light can return along its own path.
    pub(super) fn coaxial_pinhole(&self, settings: &TraceSettings) -> bool {
        self.coaxial(settings) && self.camera.lens.radius == 0.0
    }

    pub(super) fn camera(&self, settings: &TraceSettings) -> GpuEndpoint {
        self.endpoint(&self.camera, settings.resolution)
    }

    pub(super) fn projector(&self, settings: &TraceSettings) -> GpuEndpoint {
        let resolution = settings.projector.unwrap_or(settings.resolution);
        self.endpoint(self.projector.as_ref().unwrap_or(&self.camera), resolution)
    }

    fn endpoint(&self, endpoint: &Camera, resolution: Resolution) -> GpuEndpoint {
        let to_camera = axes(&self.camera).transpose();
        let [right, up, back] = if *endpoint == self.camera {
            // These axes are exact; a computation would round them.
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
            position: self.unit.vector(position),
            tangent: [endpoint.tan_half_fov * shape, endpoint.tan_half_fov],
            resolution: [resolution.width as u32, resolution.height as u32],
            ..bytemuck::Zeroable::zeroed()
        }
    }
}

/// The axes of an endpoint's frame: right, up, and backwards.
pub(super) fn axes(endpoint: &Camera) -> DMat3 {
    DMat3::from_cols(endpoint.right.as_dvec3(), endpoint.up.as_dvec3(), -endpoint.forward.as_dvec3())
}

impl GpuEndpoint {
    pub(super) fn pixels(&self) -> u64 {
        u64::from(self.resolution[0]) * u64::from(self.resolution[1])
    }

    /// Area of the image plane at distance 1.
    pub(super) fn image_area(&self) -> f64 {
        4.0 * f64::from(self.tangent[0]) * f64::from(self.tangent[1])
    }
}
