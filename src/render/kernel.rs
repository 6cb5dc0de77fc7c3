//! The kernels that trace a scene: their compilation for the features of a scene and its rig, and their parameters.

use std::borrow::Cow;

use glam::Vec3;

use crate::error::Result;
use crate::gpu::pipeline::{READ, TEXEL_ARRAY, UNIFORM, WRITE};
use crate::gpu::{Gpu, shader};

/// A compiled kernel. Bind group 0 holds the parameters and the scene. Bind group 1 holds the results, the photon map and the light buffer.
pub(super) struct Pipeline {
    pub(super) pipeline: wgpu::ComputePipeline,
    pub(super) scene_layout: wgpu::BindGroupLayout,
    pub(super) output_layout: wgpu::BindGroupLayout,
}

impl Pipeline {
    /// Composes and compiles the shader `name` for a scene and rig with these features. `name` is also the name of the entry point.
    pub(super) fn new(gpu: &Gpu, name: &str, features: &Features) -> Result<Self> {
        let kernel = shader::kernel(name, &features.constants())?;
        gpu.guarded(name, || {
            let scene_layout = gpu.layout(
                "scene",
                &[UNIFORM, TEXEL_ARRAY, TEXEL_ARRAY, TEXEL_ARRAY, TEXEL_ARRAY, READ, TEXEL_ARRAY, READ],
            );
            let output_layout = gpu.layout("output", &[WRITE, TEXEL_ARRAY, READ, TEXEL_ARRAY]);
            let module = gpu.module(name, wgpu::ShaderSource::Naga(Cow::Owned(kernel)));
            let [pipeline] = gpu.pipelines(name, &module, &[&scene_layout, &output_layout], [name]);
            Self { pipeline, scene_layout, output_layout }
        })
    }
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub(super) struct Features {
    pub(super) scene: SceneFeatures,
    /// Whether the scene emits light. If so, the paths record it.
    pub(super) ambient: bool,
    /// The camera or the projector has an aperture.
    pub(super) lenses: bool,
    /// Camera and projector are one pinhole.
    pub(super) coaxial_pinhole: bool,
    pub(super) roulette: bool,
    /// The number of texels in a row of the light buffer, if rays from and to the pinhole use it ([`crate::render::light_buffer`]); or 0.
    pub(super) light_buffer_side: u32,
    /// Whether one invocation traces several paths, one after the other.
    pub(super) several_paths: bool,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub(super) struct SceneFeatures {
    /// Every surface is plain Lambertian.
    pub(super) matte: bool,
    /// Some surfaces have textures, or normals and colours at their corners.
    pub(super) corners: bool,
    /// Some surfaces are rough, and neither plain Lambertian nor smooth.
    pub(super) facets: bool,
    pub(super) transmits: bool,
    /// Some surfaces reflect or refract light into a single direction.
    pub(super) chains: bool,
    /// Some surfaces let light pass straight through.
    pub(super) passable: bool,
    /// Some surfaces border on a medium.
    pub(super) media: bool,
    /// The nodes of the search tree lie in one texture row, and so do its triangles. Node indices fit into 16 bits.
    pub(super) small_tree: bool,
    /// The number of pairs of triangles, if each ray tests all of them; 0 if rays traverse the search tree.
    pub(super) few_pairs: u32,
}

impl Features {
    fn constants(&self) -> [(&'static str, f64); 15] {
        let scene = &self.scene;
        let flag = |set: bool| f64::from(u8::from(set));
        [
            ("MATTE", flag(scene.matte)),
            ("CORNERS", flag(scene.corners)),
            ("FACETS", flag(scene.facets)),
            ("TRANSMITS", flag(scene.transmits)),
            ("CHAINS", flag(scene.chains)),
            ("PASSABLE", flag(scene.passable)),
            ("MEDIA", flag(scene.media)),
            ("AMBIENT", flag(self.ambient)),
            ("LENSES", flag(self.lenses)),
            ("COAXIAL_PINHOLE", flag(self.coaxial_pinhole)),
            ("ROULETTE", flag(self.roulette)),
            ("LIGHT_BUFFER_SIDE", f64::from(self.light_buffer_side)),
            ("SEVERAL_PATHS", flag(self.several_paths)),
            ("SMALL_TREE", flag(scene.small_tree)),
            ("FEW_PAIRS", f64::from(scene.few_pairs)),
        ]
    }
}

/// An endpoint of the rig, in the layout of `Endpoint` in `shaders/shared/parameters.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub(super) struct GpuEndpoint {
    pub(super) right: Vec3,
    pub(super) radius: f32,
    pub(super) up: Vec3,
    pub(super) focus: f32,
    pub(super) back: Vec3,
    pub(super) padding: f32,
    pub(super) position: Vec3,
    pub(super) padding2: f32,
    pub(super) tangent: [f32; 2],
    pub(super) resolution: [u32; 2],
}

/// The parameters of a dispatch, in the layout of `Parameters` in `shaders/shared/parameters.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub(super) struct Parameters {
    pub(super) start: GpuEndpoint,
    pub(super) end: GpuEndpoint,
    pub(super) first_pixel: u32,
    pub(super) first_sample: u32,
    pub(super) paths: u32,
    pub(super) samples: u32,
    pub(super) max_bounces: u32,
    pub(super) seed: u32,
    pub(super) mark: u32,
    pub(super) end_to_start: f32,
    pub(super) scale: f32,
    pub(super) gather_radius: f32,
    pub(super) inverse_cell: f32,
    pub(super) bucket_mask: u32,
    pub(super) stride: u32,
    pub(super) sampling: u32,
    pub(super) paths_per_invocation: u32,
    pub(super) photons: u32,
}

impl Parameters {
    /// The parameters of a dispatch of these paths. Paths are numbered `pixel · samples + sample`.
    pub(super) fn of_paths(self, first_path: u64, paths: u32, mark: u32) -> Self {
        let samples = u64::from(self.samples);
        let (first_pixel, first_sample) = ((first_path / samples) as u32, (first_path % samples) as u32);
        Self { first_pixel, first_sample, paths, mark, ..self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::layout::assert_layout;

    #[test]
    fn exactly_the_shaders_overrides_are_set() {
        let module = shader::module("trace_paths").unwrap_or_else(|e| unreachable!("{e}"));
        let mut declared: Vec<_> =
            module.overrides.iter().filter_map(|(_, constant)| constant.name.clone()).collect();
        let mut set: Vec<_> = Features::default().constants().map(|(name, _)| name.to_owned()).into();
        declared.sort();
        set.sort();
        assert_eq!(declared, set);
    }

    #[test]
    fn parameters_have_the_layout_of_the_shader() {
        assert_layout!(
            "trace_paths", "Parameters", Parameters: start, end, first_pixel, first_sample, paths, samples, max_bounces, seed, mark, end_to_start,
            scale, gather_radius, inverse_cell, bucket_mask, stride, sampling, paths_per_invocation, photons
        );
        assert_layout!(
            "trace_paths", "Endpoint", GpuEndpoint: right, radius, up, focus, back, padding, position, padding2, tangent, resolution
        );
    }
}
