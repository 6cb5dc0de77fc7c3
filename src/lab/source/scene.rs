//! A scene as a source: the loaded scene, the device that traces it, and the cache of matrices.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use crate::cache::{Cache, Found, Key};
use crate::error::{Error, Result};
use crate::file;
use crate::gpu::AdapterSummary;
use crate::image::Resolution;
use crate::io::manifest;
use crate::journal::Identity;
use crate::lab::layout::SCENE;
use crate::lab::lock;
use crate::lab::settings::{Settings, View};
use crate::lab::text::grouped;
use crate::lab::traced::{self, report_matrix, report_trace, store};
use crate::lab::{Log, SharedObserver, Truth};
use crate::measure::RunManifest;
use crate::render::{TraceSettings, Tracer};
use crate::scene::{EditableScene, Scene, hash_of_glb};
use crate::transport::{self, Assembled, Backend, Channels};

/// The label of a pixel that sees no region, as in all label images.
const NO_REGION: u8 = 255;

/// A matrix that a GPU assembles in less time is not kept in the cache, since reading it from there would take longer.
const QUICK: Duration = Duration::from_secs(2);

/// A scene, with the device that traces it and the matrices of earlier runs.
#[derive(Clone)]
pub(in crate::lab) struct SceneSource {
    pub(in crate::lab) scene: Arc<Scene>,
    device: Arc<Device>,
    adapter: AdapterSummary,
    pub(in crate::lab) settings: TraceSettings,
    cache: Option<Arc<Cache>>,
    backend: Backend,
    /// The matrix that was last requested. Clones of the source share it.
    kept: Arc<Mutex<Option<Kept>>>,
    /// The scene in memory from which the source was made.
    editable: Option<Arc<EditableScene>>,
    /// The file in which a run keeps that scene, with its hash.
    file: Option<(PathBuf, [u8; 32])>,
    pub(in crate::lab) observer: SharedObserver,
}

/// The device that traces the scene, one job at a time. When it is dropped, its compiled kernels are stored in the cache.
struct Device {
    tracer: Mutex<Tracer>,
    cache: Option<Arc<Cache>>,
}

impl Device {
    fn new(mut tracer: Tracer, cache: Option<Arc<Cache>>) -> Self {
        if let Some(cache) = &cache {
            let kept = cache.kernels(tracer.adapter());
            tracer.restore_kernels(kept.as_deref());
        }
        Self { tracer: Mutex::new(tracer), cache }
    }

    fn tracer(&self) -> MutexGuard<'_, Tracer> {
        self.tracer.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for Device {
    fn drop(&mut self) {
        let Some(cache) = &self.cache else { return };
        let tracer = self.tracer();
        // A failure to store the kernels is ignored, since the next run can compile them again.
        tracer
            .compiled_kernels()
            .into_iter()
            .for_each(|kernels| drop(cache.store_kernels(tracer.adapter(), &kernels)));
    }
}

/// Reports the fraction of the camera's picture that photos of this resolution cut off, if the picture is wider than the photos.
fn note_crop(scene: &Scene, resolution: Resolution, observer: &SharedObserver) {
    let camera = &scene.camera;
    let Some((share, aspect)) = camera.cropped(resolution).zip(camera.aspect) else { return };
    let Resolution { width, height } = resolution;
    let wide = (f64::from(aspect) * height as f64).round();
    let low = (width as f64 / f64::from(aspect)).round().max(1.0);
    observer.note(format_args!(
        "note: the camera `{}` sees {aspect:.2} times as wide as high, and photos of {resolution} pixels show the middle: {:.0} % of its picture is cut off \
         at the left and right; --size {width}x{low} or {wide}x{height} shows all of it (in a rig file, size in [scene])",
        camera.name,
        100.0 * share
    ));
}

/// An assembled matrix, with its channels and whether its second bounce is a separate layer.
type Kept = ((Channels, bool), Arc<Assembled>);

impl SceneSource {
    pub(in crate::lab) fn open(
        path: &Path,
        view: &View,
        trace: TraceSettings,
        settings: &Settings,
        observer: &SharedObserver,
    ) -> Result<Self> {
        let load = || traced::load(path, view.options(), observer);
        let (scene, mut tracer) = Tracer::open(settings.adapter.as_deref(), load)?;
        share(&mut tracer, &scene, settings, observer)?;
        traced::at(observer, 1.0)?;
        Self::new(scene, tracer, trace, settings, observer)
    }

    /// A scene that a program made. Its matrix is not cached, since the scene may differ from the file with the same hash.
    pub(in crate::lab) fn in_memory(
        scene: Scene,
        settings: &Settings,
        observer: &SharedObserver,
    ) -> Result<Self> {
        let mut tracer = Tracer::new(&scene, settings.adapter.as_deref())?;
        share(&mut tracer, &scene, settings, observer)?;
        let source = Self::new(scene, tracer, settings.trace.for_scene(), settings, observer)?;
        Ok(Self { cache: None, ..source })
    }

    /// A scene in memory whose hash is that of its content.
    pub(in crate::lab) fn editable(
        editable: Arc<EditableScene>,
        settings: &Settings,
        observer: &SharedObserver,
    ) -> Result<Self> {
        if let Some(option) = settings.view.first_of_file() {
            let fault = "it says how a scene's file is read, and this scene is in memory";
            let help = "leave it out, and give it where the scene is loaded";
            return Err(Error::option(option, fault).help(help));
        }
        let scene = editable.to_scene(settings.view.auto_camera)?;
        traced::check(&scene, observer)?;
        let mut tracer = Tracer::new(&scene, settings.adapter.as_deref())?;
        share(&mut tracer, &scene, settings, observer)?;
        let source = Self::new(scene, tracer, settings.trace.for_scene(), settings, observer)?;
        Ok(Self { editable: Some(editable), ..source })
    }

    /// Names the file in the folder of a run that will keep a scene in memory. Refuses a folder that has another such file.
    pub(in crate::lab) fn claim_file(&mut self, folder: &Path) -> Result<()> {
        let Some(editable) = &self.editable else { return Ok(()) };
        let (path, bytes) = (folder.join(SCENE), editable.to_glb()?);
        if path.exists() && file::read(&path)? != bytes {
            let fault = format!("{} is another scene than the one in memory", path.display());
            return Err(Error::option("-o", fault).help("name another folder"));
        }
        self.file = Some((path, hash_of_glb(&bytes)?));
        Ok(())
    }

    /// Writes a scene in memory into a folder, so that it can be opened again. Returns the file's name; `None` for a scene from a file.
    pub(in crate::lab) fn keep_scene(&self, folder: &Path) -> Result<Option<String>> {
        let Some(editable) = &self.editable else { return Ok(None) };
        editable.save(&folder.join(SCENE))?;
        Ok(Some(SCENE.to_owned()))
    }

    /// The scene's file, or its name if it is only in memory; and the hash.
    pub(in crate::lab) fn file(&self) -> (&Path, [u8; 32]) {
        match &self.file {
            Some((path, hash)) => (path, *hash),
            None => (&self.scene.path, self.scene.hash),
        }
    }

    fn new(
        scene: Scene,
        mut tracer: Tracer,
        trace: TraceSettings,
        settings: &Settings,
        observer: &SharedObserver,
    ) -> Result<Self> {
        tracer.observe(Arc::clone(&observer.0));
        if settings.operator.backend == Backend::Cpu {
            tracer.assemble_on_device(false);
        }
        let adapter = tracer.adapter().clone();
        let AdapterSummary { name, kind, driver_version, .. } = &adapter;
        let several = match tracer.devices() {
            1 => String::new(),
            count => format!("; {count} of them"),
        };
        observer.detail(format_args!("adapter   {name} ({kind}), {driver_version}{several}"));
        // The scene's rig may define the resolution of the projector.
        let trace = TraceSettings { projector: trace.projector.or(scene.projector_resolution), ..trace };
        // The settings are checked before a pattern of this resolution is made.
        trace.check()?;
        note_crop(&scene, trace.resolution, observer);
        let cache = settings.cache.open().map(Arc::new);
        Ok(Self {
            scene: Arc::new(scene),
            device: Arc::new(Device::new(tracer, cache.clone())),
            adapter,
            settings: trace,
            cache,
            backend: settings.operator.backend,
            kept: Arc::default(),
            editable: None,
            file: None,
            observer: observer.clone(),
        })
    }

    /// A source of the same scene with these settings. The two sources do not share a matrix.
    pub(in crate::lab) fn with_settings(&self, settings: TraceSettings) -> Self {
        Self { settings, kept: Arc::default(), ..self.clone() }
    }

    pub(in crate::lab) fn tracer(&self) -> MutexGuard<'_, Tracer> {
        self.device.tracer()
    }

    pub(in crate::lab) fn is_symmetric(&self) -> bool {
        self.tracer().symmetric(&self.settings)
    }

    /// The cache key of the matrix that a trace would produce.
    pub(in crate::lab) fn key(&self, channels: Channels, split: bool) -> Key {
        Key::new(&self.scene, &self.adapter, &self.settings, channels, split)
    }

    /// Adds all facts that a trace depends on to `identity`.
    pub(in crate::lab) fn identity(&self, identity: Identity, channels: Channels) -> Identity {
        let named = self.facts(channels).into_iter().fold(identity, |all, (name, fact)| all.with(name, fact));
        named.with("all that is traced", self.key(channels, false).hex())
    }

    /// The named facts that a trace depends on, if short strings can describe them.
    pub(in crate::lab) fn facts(&self, channels: Channels) -> Vec<(&'static str, String)> {
        let (settings, adapter) = (&self.settings, &self.adapter);
        vec![
            ("scene", blake3::Hash::from_bytes(self.scene.hash).to_string()),
            ("size", settings.resolution.to_string()),
            ("samples per pixel", settings.samples.to_string()),
            ("bounces", settings.max_bounces.to_string()),
            ("seed", settings.seed.to_string()),
            ("channels", channels.count().to_string()),
            ("adapter", format!("{} {} {}", adapter.name, adapter.driver, adapter.driver_version)),
        ]
    }

    pub(in crate::lab) fn describe(&self, manifest: &mut RunManifest) {
        let (settings, adapter) = (&self.settings, &self.adapter);
        manifest.seed = Some(u64::from(settings.seed));
        manifest.adapter = Some(manifest::Adapter {
            name: adapter.name.clone(),
            driver: format!("{} {}", adapter.driver, adapter.driver_version),
            backend: "vulkan".into(),
        });
        manifest.samples_per_pixel = Some(settings.samples);
        manifest.max_bounces = Some(settings.max_bounces);
    }

    /// The matrix, if it is in memory or complete in the cache.
    pub(in crate::lab) fn cached(&self, channels: Channels) -> Result<Option<Arc<Assembled>>> {
        let (asked, mut kept) = ((channels, false), lock(&self.kept));
        match &*kept {
            Some((of, traced)) if *of == asked => Ok(Some(Arc::clone(traced))),
            _ => {
                let found = self.look_up(&self.key(channels, false));
                found.map(|traced| self.keep(&mut kept, asked, traced)).transpose()
            }
        }
    }

    /// The light transport matrix, on the device that computes products. If it is not in memory, it is obtained as
    /// [`Self::cached_or_traced`]. If `split`, the second bounce is in a separate layer from the third and later bounces.
    pub(in crate::lab) fn assemble(&self, channels: Channels, split: bool) -> Result<Arc<Assembled>> {
        let (asked, mut kept) = ((channels, split), lock(&self.kept));
        match &*kept {
            Some((of, traced)) if *of == asked => Ok(Arc::clone(traced)),
            _ => {
                // The previous matrix is dropped first, since the memory may not suffice for two matrices.
                *kept = None;
                self.keep(&mut kept, asked, self.cached_or_traced(channels, split)?)
            }
        }
    }

    fn keep(
        &self,
        kept: &mut Option<Kept>,
        asked: (Channels, bool),
        mut traced: Assembled,
    ) -> Result<Arc<Assembled>> {
        self.place(&mut traced)?;
        let (_, traced) = kept.insert((asked, Arc::new(traced)));
        Ok(Arc::clone(traced))
    }

    /// The matrix from the cache. Where the device assembles matrices, its own come first, and those of the processor serve as well. Where
    /// the processor does, only its own have its bits.
    fn look_up(&self, key: &Key) -> Option<Assembled> {
        let of_device = self.tracer().assembles_on_device().then(|| key.of_device());
        of_device.iter().chain([key]).find_map(|key| self.load(key))
    }

    fn load(&self, key: &Key) -> Option<Assembled> {
        match self.cache.as_ref()?.load(key) {
            Found::Whole(traced) => Some(*traced),
            Found::Missing => None,
            Found::Damaged(why) => {
                self.observer
                    .note(format_args!("note: the cached matrix is damaged and assembled anew: {why}"));
                None
            }
        }
    }

    /// Finds the light transport matrix in the cache or traces it, and reports the costs.
    fn cached_or_traced(&self, channels: Channels, split: bool) -> Result<Assembled> {
        let start = Instant::now();
        let key = self.key(channels, split);
        let cached = self.look_up(&key);
        let is_new = cached.is_none();
        let traced = match cached {
            Some(cached) => cached,
            None => transport::assemble_layers(&mut self.tracer(), &self.settings, channels, split)?,
        };
        let observer = &self.observer;
        if is_new {
            report_trace(&traced.summary, observer);
        } else {
            let paths = grouped(traced.summary.paths);
            observer.info(format_args!("traced    {paths} light paths, from the cache"));
        }
        report_matrix(&traced, start, observer);
        match self.cache.as_ref().filter(|_| is_new) {
            Some(_) if traced.is_on_gpu() && start.elapsed() < QUICK => {
                observer
                    .detail(format_args!("cache     not kept: the device assembles the matrix in less time"));
            }
            Some(_) if traced.matrix.processes() > 1 => {
                observer.detail(format_args!(
                    "cache     not kept: {} processes have a part of the matrix each",
                    traced.matrix.processes()
                ));
            }
            Some(cache) => {
                let key = if traced.is_on_gpu() { key.of_device() } else { key };
                traced.matrix.fetch()?;
                store(cache, &key, &traced, observer);
            }
            None => {}
        }
        Ok(traced)
    }

    /// Moves the matrix to the device that computes products, and reports the device.
    fn place(&self, traced: &mut Assembled) -> Result<()> {
        if let Some(why) = traced.place(&self.tracer(), self.backend)? {
            self.observer.note(format_args!("note: products are computed on the processor: {why}"));
        }
        let device = if traced.is_on_gpu() { &self.adapter.name } else { "the processor" };
        self.observer.detail(format_args!("products  on {device}"));
        Ok(())
    }

    /// The region at the centre of each pixel, at this resolution. The label 255 marks a pixel that sees no region.
    pub(in crate::lab) fn labels(&self, resolution: Resolution) -> Result<Vec<u8>> {
        let scene = &self.scene;
        if scene.regions.len() > usize::from(NO_REGION) {
            let fault = format!("its {} regions do not fit a label image", scene.regions.len());
            return Err(Error::scene(&scene.path, fault).help(format!(
                "give at most {NO_REGION} regions by `region` in the extras of nodes or meshes"
            )));
        }
        let regions = self.tracer().regions(resolution)?;
        Ok(regions.into_iter().map(|region| region.map_or(NO_REGION, |region| region as u8)).collect())
    }

    pub(in crate::lab) fn truth(&self, resolution: Resolution) -> Result<Option<Truth>> {
        if !self.scene.regions_are_labels {
            return Ok(None);
        }
        let regions = self.scene.regions.clone();
        Ok(Some(Truth { labels: self.labels(resolution)?, regions }))
    }
}

/// Lets the other processes of a team, if there is one, help to trace the scene.
fn share(tracer: &mut Tracer, scene: &Scene, settings: &Settings, observer: &SharedObserver) -> Result<()> {
    let Some(team) = settings.team.as_ref().filter(|team| team.size() > 1) else { return Ok(()) };
    transport::share_scene(tracer, scene, settings.adapter.as_deref(), team)?;
    observer.detail(format_args!("processes {} trace the scene together", team.size()));
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lab::CacheChoice;

    /// The cache keeps the matrices of a device apart from those of the processor, which alone have the processor's bits.
    #[test]
    fn the_processor_takes_no_matrix_of_a_device_from_the_cache() -> Result<()> {
        let folder = tempfile::tempdir().expect("a temporary folder can be made");
        let settings =
            Settings { cache: CacheChoice::Folder(folder.path().to_path_buf()), ..Settings::default() };
        let trace = TraceSettings::new(Resolution::new(6, 5), 4);
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/scenes/corner/scene.glb");
        let open =
            || SceneSource::open(&path, &View::default(), trace, &settings, &SharedObserver::default());
        let [processor, device] = [open()?, open()?];
        processor.tracer().assemble_on_device(false);
        device.tracer().assemble_on_device(true);
        let key = processor.key(Channels::Luma, false);
        assert!(processor.look_up(&key).is_none() && device.look_up(&key).is_none());
        let direct = |found: Option<Assembled>| found.map(|found| found.matrix.direct);
        let cache = processor.cache.as_ref().expect("it has a folder");
        let [of_processor, of_device] = [4, 8].map(|samples| {
            let other = processor.with_settings(TraceSettings { samples, ..trace });
            transport::assemble_layers(&mut other.tracer(), &other.settings, Channels::Luma, false)
        });
        store(cache, &key.of_device(), &of_device?, &processor.observer);
        assert!(processor.look_up(&key).is_none(), "the processor's is not there");
        let from_device = direct(device.look_up(&key));
        store(cache, &key, &of_processor?, &processor.observer);
        let (from_processor, preferred) = (direct(processor.look_up(&key)), direct(device.look_up(&key)));
        assert!(from_device.is_some() && preferred == from_device && from_processor.is_some());
        assert!(from_processor != from_device);
        Ok(())
    }
}
