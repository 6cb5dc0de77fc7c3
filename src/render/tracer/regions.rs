//! What the camera's pixels see first.

use super::Tracer;
use crate::error::Result;
use crate::image::Resolution;
use crate::render::dispatch::MAX_PATHS;
use crate::render::materials::NONE;
use crate::render::output::{Output, StagingBuffers};
use crate::render::parameters::Parameters;
use crate::render::pipeline::Pipeline;
use crate::render::settings::TraceSettings;

impl Tracer {
    /// The region that the centre of each camera pixel sees, as an index into [`Scene::regions`](crate::scene::Scene::regions); `None`
    /// where it sees nothing.
    ///
    /// # Errors
    /// [`crate::Error::Device`] when the device failed.
    pub fn regions(&mut self, resolution: Resolution) -> Result<Vec<Option<u32>>> {
        let settings = TraceSettings { max_bounces: 1, ..TraceSettings::new(resolution, 1) };
        settings.check()?;
        let camera = self.rig.camera(&settings);
        let template = self.strategy_builder().strategy(&settings, [camera; 2], [1; 2], true)?;
        let kernel = Pipeline::new(&self.gpu, "primary_regions", &template.features)?;
        let total = resolution.pixels() as u64;
        let capacity = total.min(u64::from(MAX_PATHS)).max(64);
        let (chains, light_buffer) = (&template.chains.buffers, &template.light_buffer);
        let staging = StagingBuffers::new(&self.gpu, capacity * 4)?;
        let output = Output::new(&self.gpu, &kernel, &self.scene, chains, light_buffer, staging)?;
        let mut regions = Vec::with_capacity(resolution.pixels());
        while (regions.len() as u64) < total {
            let first_pixel = regions.len() as u32;
            let pixels = capacity.min(total - u64::from(first_pixel));
            let parameters = Parameters { first_pixel, paths: pixels as u32, ..template.parameters };
            let view = output.run(&self.gpu, &kernel, &parameters, pixels * 4)?;
            let seen: &[u32] = bytemuck::cast_slice(&view);
            regions.extend(seen.iter().map(|&region| (region != NONE).then_some(region)));
            drop(view);
            output.release();
        }
        Ok(regions)
    }
}
