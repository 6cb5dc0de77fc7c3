//! The uniform block of a dispatch. `shaders/shared/parameters.wgsl` describes its members.

use glam::Vec3;

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
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::layout::{assert_layout, offsets};
    use std::mem::size_of;

    #[test]
    fn parameters_have_the_layout_of_the_shader() {
        let members = offsets!(
            Parameters: start, end, first_pixel, first_sample, paths, samples, max_bounces, seed, mark, end_to_start,
            scale, gather_radius, inverse_cell, bucket_mask, stride, sampling, paths_per_invocation, photons
        );
        assert_layout("trace_paths", "Parameters", members, size_of::<Parameters>());
        let members = offsets!(
            GpuEndpoint: right, radius, up, focus, back, padding, position, padding2, tangent, resolution
        );
        assert_layout("trace_paths", "Endpoint", members, size_of::<GpuEndpoint>());
    }
}
