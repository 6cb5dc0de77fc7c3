//! Compiled kernels as bytes, where the driver gives them out: a later process on an equal device need not compile them again.
//!
//! Most drivers keep compiled kernels on disk themselves. Software Vulkan and drivers without such a store of the application give nothing out.

/// The kernels that a device has compiled. Clones share them.
#[derive(Clone)]
pub(crate) struct Compiled {
    cache: wgpu::PipelineCache,
    /// Bytes of a store without kernels: a driver that never gives out more has nothing to keep.
    empty: usize,
    /// Hash of what was restored, so that only news are kept.
    restored: Option<blake3::Hash>,
}

impl Compiled {
    /// A store on this device, with the kernels in `data` if these are of an equal device and driver; others are ignored. `None` where the
    /// driver has no such store.
    ///
    /// `data` comes from [`Compiled::data`]: the driver may trust it without looking.
    pub(crate) fn restore(device: &wgpu::Device, data: Option<&[u8]>) -> Option<Self> {
        if !device.features().contains(wgpu::Features::PIPELINE_CACHE) {
            return None;
        }
        let empty = open(device, None).get_data()?.len();
        let cache = open(device, data);
        Some(Self { cache, empty, restored: data.map(blake3::hash) })
    }

    /// The store, for a pipeline that is being made.
    pub(crate) fn cache(&self) -> &wgpu::PipelineCache {
        &self.cache
    }

    /// All kernels so far as bytes; `None` where there is nothing to keep that was not restored.
    pub(crate) fn data(&self) -> Option<Vec<u8>> {
        let data = self.cache.get_data()?;
        (data.len() > self.empty && Some(blake3::hash(&data)) != self.restored).then_some(data)
    }
}

#[allow(unsafe_code, reason = "wgpu cannot know where the bytes come from; whoever keeps them checks that")]
fn open(device: &wgpu::Device, data: Option<&[u8]>) -> wgpu::PipelineCache {
    let description = wgpu::PipelineCacheDescriptor { label: Some("krylux"), data, fallback: true };
    // SAFETY: `data` is what `Compiled::data` gave out: the folder of the cache is its user's alone, and a checksum shows accidents. wgpu
    // compares device and driver.
    unsafe { device.create_pipeline_cache(&description) }
}
