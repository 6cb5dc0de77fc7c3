//! A cache of the photon maps of specular chains: every photo that is traced anew needs the same maps.

use super::dispatch::Dispatches;
use super::geometry::GpuScene;
use super::photons::{ChainRequest, PhotonMap};
use crate::error::Result;
use crate::gpu::Gpu;

/// Maps kept at a time: a rig with a separate projector needs one for each endpoint.
const CAPACITY: usize = 2;

/// The photon maps of one scene that were traced last, on the device; the newest is the last.
#[derive(Default)]
pub(super) struct ChainCache {
    maps: Vec<(ChainRequest, PhotonMap)>,
}

impl ChainCache {
    /// The map for `request`: from the cache, or by [`PhotonMap::trace`].
    pub(super) fn map(
        &mut self,
        gpu: &Gpu,
        scene: &GpuScene,
        request: ChainRequest,
        dispatches: &mut Dispatches,
    ) -> Result<PhotonMap> {
        if let Some((_, map)) = self.maps.iter().find(|(known, _)| *known == request) {
            return Ok(map.clone());
        }
        let map = PhotonMap::trace(gpu, scene, &request, dispatches)?;
        if self.maps.len() == CAPACITY {
            self.maps.remove(0);
        }
        self.maps.push((request, map.clone()));
        Ok(map)
    }
}
