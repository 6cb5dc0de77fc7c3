//! The choice of an adapter, the device that is opened on it, and the kernels that the device has compiled.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use super::kept::Kept;

use crate::error::{Error, Result};
use crate::machine;

const INSTALL: &str = "install a GPU's Vulkan driver, or the software one: apt-get install -y --no-install-recommends mesa-vulkan-drivers";

const OUT_OF_MEMORY: &str = "use a smaller --size, fewer --spp, a simpler scene or another --adapter, or close other programs that use the device; --memory bounds the memory of the machine, which is another";

const LOST: &str = "run it again: the driver has reset the device, or its memory is used up. With --resume a run goes on, and no photo of its journal is taken again. If it happens again, use a smaller --size or another --adapter";

/// The value of [`AdapterSummary::kind`] for an adapter that is the processor itself.
const SOFTWARE: &str = "software";

/// The fraction of the memory granted by a GPU's driver that this process may use, in per cent. Larger allocations fail as out of memory,
/// before the driver starts to evict data.
const MEMORY_SHARE: u8 = 80;

/// The name that stands for all adapters that are equal to the fastest one.
pub(crate) const ALL: &str = "all";

/// The maximum address space, in bytes, that a graphics driver reserves for a small scene. 600 MiB were enough for software Vulkan, and 400
/// MiB were not.
const ADDRESS_SPACE: u64 = 1 << 30;

/// Name, driver and limits of an adapter.
#[derive(Clone, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct AdapterSummary {
    /// The device's name, e.g. `llvmpipe (LLVM 15.0.6, 256 bits)`.
    pub name: String,
    /// `discrete GPU`, `integrated GPU`, `virtual GPU` or `software`.
    pub kind: String,
    /// The driver's name.
    pub driver: String,
    /// The driver's version.
    pub driver_version: String,
    /// Largest buffer that a shader can be given, in bytes.
    pub max_storage_binding: u64,
    /// Largest buffer, in bytes.
    pub max_buffer: u64,
    /// Largest side of a texture, in texels.
    pub max_texture_side: u32,
    /// Whether shaders can calculate in `f64`.
    pub double_precision: bool,
}

impl AdapterSummary {
    fn of(adapter: &wgpu::Adapter) -> Self {
        let info = adapter.get_info();
        let limits = adapter.limits();
        Self {
            name: info.name,
            kind: match info.device_type {
                wgpu::DeviceType::DiscreteGpu => "discrete GPU",
                wgpu::DeviceType::IntegratedGpu => "integrated GPU",
                wgpu::DeviceType::VirtualGpu => "virtual GPU",
                wgpu::DeviceType::Cpu => SOFTWARE,
                wgpu::DeviceType::Other => "other",
            }
            .into(),
            driver: info.driver,
            driver_version: info.driver_info,
            max_storage_binding: limits.max_storage_buffer_binding_size,
            max_buffer: limits.max_buffer_size,
            max_texture_side: limits.max_texture_dimension_2d,
            double_precision: adapter.features().contains(wgpu::Features::SHADER_F64),
        }
    }

    /// Whether the adapter is software Vulkan, which runs on the processor.
    pub fn is_processor(&self) -> bool {
        self.kind == SOFTWARE
    }
}

/// An open device with its queue. All users of an adapter share device and queue, also those in other threads.
#[derive(Clone)]
pub(crate) struct Gpu {
    pub(crate) device: wgpu::Device,
    pub(crate) queue: wgpu::Queue,
    pub(crate) summary: AdapterSummary,
    /// Whether the device is the processor itself, so that the host reads results in place. A GPU that shares the host's memory would also
    /// allow this, but it was not measured whether it is faster.
    pub(crate) shares_memory: bool,
    pub(crate) compiled: Option<Compiled>,
    /// The driver's reason, if the device was lost or failed outside of [`Gpu::guarded`].
    pub(crate) failure: Arc<OnceLock<String>>,
    /// Kernels and other things that live as long as the device.
    pub(crate) kept: Arc<Kept>,
}

/// An instance of the graphics driver, its adapters (the fastest kinds first), and the devices that are open on them.
///
/// It is never dropped. Drivers do not expect to be loaded and unloaded by many threads at once, and at the end of the process the system
/// frees everything in less time.
struct Driver {
    adapters: Vec<wgpu::Adapter>,
    devices: HashMap<usize, Gpu>,
}

/// The drivers of this process, by its number and by the share of the memory that their devices use at most, in per cent. A forked child
/// inherits those of its parent, which work in the parent only; it loads its own.
static DRIVERS: Mutex<Vec<(DriverOf, Driver)>> = Mutex::new(Vec::new());

type DriverOf = (u32, Option<u8>);

impl Driver {
    fn new(share: Option<u8>) -> Self {
        let instance = wgpu::Instance::new(wgpu::InstanceDescriptor {
            backends: wgpu::Backends::VULKAN,
            memory_budget_thresholds: wgpu::MemoryBudgetThresholds {
                for_resource_creation: share,
                for_device_loss: None,
            },
            ..wgpu::InstanceDescriptor::new_without_display_handle()
        });
        let mut adapters = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::VULKAN));
        adapters.sort_by_key(|adapter| match adapter.get_info().device_type {
            wgpu::DeviceType::DiscreteGpu => 0,
            wgpu::DeviceType::IntegratedGpu => 1,
            wgpu::DeviceType::VirtualGpu => 2,
            wgpu::DeviceType::Other => 3,
            wgpu::DeviceType::Cpu => 4,
        });
        Self { adapters, devices: HashMap::new() }
    }

    /// Calls `work` with the driver for this share of the memory, which is loaded at first use. Fails with [`Error::Device`] if this
    /// process has too little address space.
    fn with<T>(share: Option<u8>, work: impl FnOnce(&mut Self) -> Result<T>) -> Result<T> {
        require_address_space(machine::address_space())?;
        let mut drivers = DRIVERS.lock().unwrap_or_else(PoisonError::into_inner);
        let wanted = (std::process::id(), share);
        let index = match drivers.iter().position(|(of, _)| *of == wanted) {
            Some(index) => index,
            None => {
                drivers.push((wanted, Self::new(share)));
                drivers.len() - 1
            }
        };
        work(&mut drivers[index].1)
    }

    /// The index of the adapter whose name contains `wanted`; for `None`, of the first adapter. If several adapters have this name, `turn`
    /// selects one cyclically.
    fn choose(&self, wanted: Option<&str>, turn: usize) -> Result<usize> {
        if self.adapters.is_empty() {
            return Err(no_adapter());
        }
        let names: Vec<String> = self.adapters.iter().map(|adapter| adapter.get_info().name).collect();
        place(&names, wanted, turn).ok_or_else(|| Error::NoAdapter {
            detail: wanted.map(|wanted| format!(" whose name contains `{wanted}`")).unwrap_or_default(),
            help: format!("--adapter takes part of one of these names: {}", names.join("; ")),
        })
    }

    /// The device of an adapter. It is opened unless a device is open that has not failed.
    fn device(&mut self, index: usize) -> Result<Gpu> {
        if let Some(gpu) = self.devices.get(&index).filter(|gpu| gpu.failure.get().is_none()) {
            return Ok(gpu.clone());
        }
        let gpu = Gpu::on(&self.adapters[index])?;
        self.devices.insert(index, gpu.clone());
        Ok(gpu)
    }
}

impl Gpu {
    /// Opens the adapter whose name contains `wanted`, ignoring case; for `None` or [`ALL`], an adapter of the fastest kind. `turn` selects
    /// one of several equal adapters.
    pub(crate) fn open(wanted: Option<&str>, turn: usize) -> Result<Self> {
        let wanted = wanted.filter(|name| !name.eq_ignore_ascii_case(ALL));
        let open = |share: Option<u8>| {
            Driver::with(share, |driver| {
                let index = driver.choose(wanted, turn)?;
                // Software Vulkan uses the machine's memory, which it shares with other programs, so only the operating system limits it.
                let is_processor = AdapterSummary::of(&driver.adapters[index]).is_processor();
                if is_processor == share.is_none() { driver.device(index).map(Some) } else { Ok(None) }
            })
        };
        // The likely kind is tried first, since each kind loads the driver once more.
        let [first, second] =
            if may_have_gpu() { [Some(MEMORY_SHARE), None] } else { [None, Some(MEMORY_SHARE)] };
        match open(first)? {
            Some(gpu) => Ok(gpu),
            None => open(second)?.ok_or_else(no_adapter),
        }
    }

    /// Opens the other adapters that are equal to this one.
    pub(crate) fn open_equals(&self) -> Result<Vec<Self>> {
        let share = (!self.summary.is_processor()).then_some(MEMORY_SHARE);
        Driver::with(share, |driver| {
            let is_equal = |&index: &usize| AdapterSummary::of(&driver.adapters[index]) == self.summary;
            let equal: Vec<usize> = (0..driver.adapters.len()).filter(is_equal).skip(1).collect();
            equal.into_iter().map(|index| driver.device(index)).collect()
        })
    }

    /// A second device on the fastest adapter, which stands for another card.
    #[cfg(test)]
    pub(crate) fn another_for_tests() -> Self {
        let share = if may_have_gpu() { Some(MEMORY_SHARE) } else { None };
        Driver::with(share, |driver| Self::on(&driver.adapters[0])).expect("the adapter opens again")
    }

    fn on(adapter: &wgpu::Adapter) -> Result<Self> {
        let summary = AdapterSummary::of(adapter);
        let available = adapter.limits();
        let limits = wgpu::Limits {
            max_storage_buffer_binding_size: available.max_storage_buffer_binding_size,
            max_buffer_size: available.max_buffer_size,
            max_texture_dimension_2d: available.max_texture_dimension_2d,
            // Geometry, textures, light buffer and photons are storage textures. The largest kernel has seven. Desktop drivers allow eight.
            max_storage_textures_per_shader_stage: available.max_storage_textures_per_shader_stage.min(8),
            ..wgpu::Limits::default()
        };
        let mappable = wgpu::Features::MAPPABLE_PRIMARY_BUFFERS;
        let shares_memory = summary.is_processor() && adapter.features().contains(mappable);
        let optional = wgpu::Features::SHADER_F64
            | wgpu::Features::PIPELINE_CACHE
            | wgpu::Features::TIMESTAMP_QUERY
            | if shares_memory { mappable } else { wgpu::Features::empty() };
        let request = wgpu::DeviceDescriptor {
            label: Some("krylux"),
            required_features: adapter.features() & optional,
            required_limits: limits,
            memory_hints: wgpu::MemoryHints::MemoryUsage,
            ..Default::default()
        };
        let (device, queue) = pollster::block_on(adapter.request_device(&request)).map_err(|error| {
            Error::device(format!("{} cannot be opened: {error}", summary.name)).help(
                "close other programs that use it, or choose another with --adapter; `krylux info` lists them. A limit of \
                 processes (`ulimit -u`) or of address space (`ulimit -v`) may be too small for it",
            )
        })?;
        // Without these callbacks, wgpu would not report a lost device to krylux, and an error outside of a scope would end the process.
        let failure = Arc::new(OnceLock::new());
        let (lost, failed) = (Arc::clone(&failure), Arc::clone(&failure));
        device.set_device_lost_callback(move |_, reason| drop(lost.set(reason)));
        device.on_uncaptured_error(Arc::new(move |error| drop(failed.set(error.to_string()))));
        Ok(Self { device, queue, summary, shares_memory, compiled: None, failure, kept: Arc::default() })
    }

    /// Compiles kernels from now on with the help of `data`, the bytes that an earlier process got from [`Gpu::compiled`] for this device.
    pub(crate) fn restore_compiled(&mut self, data: Option<&[u8]>) {
        self.compiled = Compiled::restore(&self.device, data);
    }

    pub(crate) fn pipeline_cache(&self) -> Option<&wgpu::PipelineCache> {
        self.compiled.as_ref().map(|compiled| &compiled.cache)
    }

    /// Runs `work`. A failure, a lack of memory, or the loss of the device becomes an error instead of a panic.
    pub(crate) fn guarded<T>(&self, what: &str, work: impl FnOnce() -> T) -> Result<T> {
        use wgpu::ErrorFilter::{Internal, OutOfMemory, Validation};
        let scopes = [Internal, OutOfMemory, Validation].map(|filter| self.device.push_error_scope(filter));
        let result = work();
        let popped = scopes.into_iter().rev().map(|scope| pollster::block_on(scope.pop()));
        let faults: Vec<wgpu::Error> = popped.flatten().collect();
        // If the device is lost or memory is lacking, the requested object is invalid, too.
        self.require_working()?;
        let short = faults.iter().any(|fault| matches!(fault, wgpu::Error::OutOfMemory { .. }));
        match faults.first() {
            None => Ok(result),
            Some(_) if short => {
                Err(Error::device(format!("no memory of {} is left for {what}", self.summary.name))
                    .help(OUT_OF_MEMORY))
            }
            Some(e) => Err(Error::device(format!("{what}: {e}"))
                .help("this is a fault in krylux or in the driver; try another --adapter, and report it")),
        }
    }

    /// Waits until `submission` is done. For `None`, waits until all submissions are done.
    pub(crate) fn wait(&self, submission: Option<wgpu::SubmissionIndex>) -> Result<()> {
        let until = wgpu::PollType::Wait { submission_index: submission, timeout: None };
        // wgpu panics if the driver reports here that the device is lost.
        let outcome = machine::unless_panics(|| self.device.poll(until));
        self.require_working()?;
        match outcome {
            Some(Ok(_)) => Ok(()),
            Some(Err(error)) => Err(self.lost(&error.to_string())),
            None => Err(self.lost("it cannot be waited for")),
        }
    }

    pub(crate) fn require_working(&self) -> Result<()> {
        self.failure.get().map_or(Ok(()), |why| Err(self.lost(why)))
    }

    /// Fails with [`Error::Device`] if shaders cannot calculate in `f64`, which `what` need.
    pub(crate) fn require_double_precision(&self, what: &str) -> Result<()> {
        if self.summary.double_precision {
            return Ok(());
        }
        Err(Error::device(format!("{} cannot calculate in f64, which {what} need", self.summary.name)))
    }

    pub(super) fn lost(&self, why: &str) -> Error {
        let why = why.trim().trim_end_matches('.');
        Error::device(format!("{} was lost: {why}", self.summary.name)).help(LOST)
    }
}

/// All graphics adapters of this machine that can trace. The list may be empty. The call fails with [`Error::Device`] if `ulimit -v` leaves
/// too little address space for a driver.
pub fn adapters() -> Result<Vec<AdapterSummary>> {
    let share = may_have_gpu().then_some(MEMORY_SHARE);
    Driver::with(share, |driver| Ok(driver.adapters.iter().map(AdapterSummary::of).collect()))
}

/// The error for a machine without any adapter. It says which packages to install.
pub fn no_adapter() -> Error {
    Error::NoAdapter { detail: String::new(), help: INSTALL.into() }
}

/// Whether a GPU may be in this machine. On Linux, the driver of each GPU makes one of these files.
fn may_have_gpu() -> bool {
    let files = ["/dev/dri", "/dev/nvidiactl", "/dev/nvidia0", "/dev/dxg", "/dev/kgsl-3d0", "/dev/mali0"];
    cfg!(not(target_os = "linux")) || files.iter().any(|file| std::path::Path::new(file).exists())
}

/// Checks that `ulimit -v` leaves a graphics driver enough address space. With too little, the driver may end the process without a
/// message.
fn require_address_space(limit: Option<u64>) -> Result<()> {
    match limit {
        Some(limit) if limit < ADDRESS_SPACE => Err(Error::device(format!(
            "this process may use {} MiB of address space (`ulimit -v`), too little for a graphics driver",
            limit >> 20
        ))
        .help(format!(
            "raise the limit to {} KiB or more, or lift it: ulimit -v unlimited",
            ADDRESS_SPACE >> 10
        ))),
        _ => Ok(()),
    }
}

fn place(names: &[String], wanted: Option<&str>, turn: usize) -> Option<usize> {
    let wanted = wanted.unwrap_or_default().to_lowercase();
    let first = names.iter().find(|name| name.to_lowercase().contains(&wanted))?;
    let equal: Vec<usize> = (0..names.len()).filter(|&at| names[at] == *first).collect();
    Some(equal[turn % equal.len()])
}

/// The kernels that a device has compiled, as bytes if the driver returns them. A later process on an equal device need not compile them
/// again. Clones share the kernels.
///
/// Most drivers keep compiled kernels on disk themselves. Software Vulkan, and drivers without a cache for applications, return nothing.
#[derive(Clone)]
pub(crate) struct Compiled {
    cache: wgpu::PipelineCache,
    /// The number of bytes of a cache without kernels. If the driver never returns more, there is nothing to keep.
    empty: usize,
    /// The hash of the restored kernels. If the hash has not changed, there are no new kernels to keep.
    restored: Option<blake3::Hash>,
}

impl Compiled {
    /// A pipeline cache on this device, with the kernels in `data` if an equal device and driver compiled them. `None` if the driver has no
    /// such cache.
    ///
    /// `data` must come from [`Compiled::data`], because the driver may trust it without checks.
    pub(crate) fn restore(device: &wgpu::Device, data: Option<&[u8]>) -> Option<Self> {
        if !device.features().contains(wgpu::Features::PIPELINE_CACHE) {
            return None;
        }
        let empty = open(device, None).get_data()?.len();
        let cache = open(device, data);
        Some(Self { cache, empty, restored: data.map(blake3::hash) })
    }

    /// All kernels so far as bytes; `None` if there are no kernels beside the restored ones.
    pub(crate) fn data(&self) -> Option<Vec<u8>> {
        let data = self.cache.get_data()?;
        (data.len() > self.empty && Some(blake3::hash(&data)) != self.restored).then_some(data)
    }
}

#[allow(unsafe_code, reason = "wgpu cannot know where the bytes come from; whoever keeps them checks that")]
fn open(device: &wgpu::Device, data: Option<&[u8]>) -> wgpu::PipelineCache {
    let description = wgpu::PipelineCacheDescriptor { label: Some("krylux"), data, fallback: true };
    // SAFETY: `data` comes from `Compiled::data`. The folder of the cache belongs to its user, and a checksum detects accidental changes.
    // wgpu compares device and driver.
    unsafe { device.create_pipeline_cache(&description) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn processes_take_turns_among_equal_adapters() {
        let names = ["Card A", "Card B", "Card A", "llvmpipe"].map(String::from);
        let places = |wanted| (0..4).map(|turn| place(&names, wanted, turn)).collect::<Vec<_>>();
        assert_eq!(places(None), [Some(0), Some(2), Some(0), Some(2)]);
        assert_eq!(places(Some("card b")), [Some(1); 4]);
        assert_eq!(places(Some("LLVM")), [Some(3); 4]);
        assert_eq!(places(Some("Card C")), [None; 4]);
    }

    #[test]
    fn too_little_address_space_is_an_error_before_a_driver_is_loaded() {
        let error = require_address_space(Some(400 << 20)).expect_err("400 MiB are too little").to_string();
        assert!(error.contains("400 MiB") && error.contains("ulimit -v unlimited"), "{error}");
        assert!(require_address_space(Some(ADDRESS_SPACE)).is_ok() && require_address_space(None).is_ok());
    }
}
