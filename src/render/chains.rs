//! The maps of specular chains that were made last, since every retraced photo needs the same again.

use super::dispatch::Dispatches;
use super::geometry::GpuScene;
use super::photons::{ChainRequest, PhotonMap};
use crate::error::Result;
use crate::gpu::Gpu;

/// A separated rig needs one map for each end.
const KEPT: usize = 2;

/// Maps of one scene on the device, the latest last.
#[derive(Default)]
pub(super) struct ChainCache {
    made: Vec<(ChainRequest, PhotonMap)>,
}

impl ChainCache {
    /// As [`PhotonMap::trace`], unless that has been done.
    pub(super) fn map(
        &mut self,
        gpu: &Gpu,
        scene: &GpuScene,
        request: ChainRequest,
        dispatches: &mut Dispatches,
    ) -> Result<PhotonMap> {
        if let Some((_, map)) = self.made.iter().find(|(made, _)| *made == request) {
            return Ok(map.clone());
        }
        let map = PhotonMap::trace(gpu, scene, &request, dispatches)?;
        if self.made.len() == KEPT {
            self.made.remove(0);
        }
        self.made.push((request, map.clone()));
        Ok(map)
    }
}
