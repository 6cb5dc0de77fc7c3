//! Opens the light transport of an open source.

use std::path::Path;
use std::sync::Arc;

use super::{Engine, LightTransport, Retracing, Shape, direct_diagonal};
use crate::analysis::LowRank;
use crate::analysis::low_rank::SavedModel;
use crate::error::{Error, Result};
use crate::image::Resolution;
use crate::io::sparse::ProductNoise;
use crate::journal::{Identity, Journal};
use crate::lab::folder::RunFolder;
use crate::lab::measured::MeasuredRig;
use crate::lab::notes::{self, Kind};
use crate::lab::settings::{ChannelChoice, OperatorChoice, Settings};
use crate::lab::source::{ExplicitParts, MatrixSource, ModelParts, RunSource, SceneSource, Source};
use crate::lab::text::bytes;
use crate::lab::{Log, SharedObserver, Truth, layout};
use crate::operator::{Operator, Symmetry};
use crate::transport::{Assembled, Backend, Channels, Part, photo_bytes, predict};

impl LightTransport {
    /// Traces the scene, opens the rig or reads the journal. With a run's folder, the journal keeps each photo before the photo is used.
    pub(in crate::lab) fn open(
        source: &Source,
        settings: &Settings,
        channels: Channels,
        run: Option<(&RunFolder, Option<&Truth>)>,
        observer: &SharedObserver,
    ) -> Result<Self> {
        let shape = Shape::new(source.resolution(), source.projector_resolution(), channels);
        let journal = |identity: &dyn Fn() -> Result<Identity>| -> Result<Option<Journal>> {
            let Some((run, truth)) = run else { return Ok(None) };
            let mut journal = layout::open_journal(&run.path, &identity()?, run.resumes, observer)?;
            if let Some(truth) = truth {
                note(&mut journal, notes::TRUTH, truth)?;
            }
            if let Some(about) = source.note(channels) {
                note(&mut journal, notes::SOURCE, &about)?;
            }
            Ok(Some(journal))
        };
        let native = match settings.channels {
            ChannelChoice::Native => None,
            _ => Some(channels),
        };
        match source {
            Source::Scene(scene) => {
                let journal = journal(&|| Ok(scene.identity(Identity::new(), channels)))?;
                let shape = shape.symmetric(scene.is_symmetric());
                let engine = of_scene(scene, settings, channels, observer)?;
                let mut transport = Self { journal, ..Self::new(engine, shape, observer) };
                transport.keep_known()?;
                Ok(transport)
            }
            Source::Rig(rig) => {
                let mut journal = journal(&|| rig.identity())?;
                if let (Some(journal), Some((run, _))) = (&mut journal, run) {
                    rig.keep(&run.path, journal)?;
                }
                Ok(Self::of_rig(rig.measured(native, journal)?, shape, observer))
            }
            Source::Run(run) => Self::of_run(run, channels, native, shape, observer),
            Source::Matrix(matrix) => Self::of_matrix(matrix, shape, observer),
            Source::Model(source) => Self::of_model(source.model.clone(), shape, channels, observer),
        }
    }

    fn new(engine: Engine, shape: Shape, observer: &SharedObserver) -> Self {
        Self {
            engine,
            journal: None,
            run: None,
            spanned: Vec::new(),
            may_reside: true,
            shape,
            observer: observer.clone(),
        }
    }

    fn of_rig(rig: MeasuredRig, shape: Shape, observer: &SharedObserver) -> Self {
        let measurement = &rig.measurement;
        let shape = Shape { symmetry: measurement.symmetry(), channels: measurement.channels(), ..shape };
        Self::new(Engine::Measured(Box::new(rig)), shape, observer)
    }

    fn of_run(
        run: &RunSource,
        channels: Channels,
        native: Option<Channels>,
        shape: Shape,
        observer: &SharedObserver,
    ) -> Result<Self> {
        let folder = Some(run.folder.clone());
        if run.note.kind == Kind::Rig {
            return Ok(Self {
                run: folder,
                ..Self::of_rig(run.measured(native, observer)?, shape, observer)
            });
        }
        require_channels(channels, run.note.channels)?;
        let shape = shape.symmetric(run.note.symmetric);
        let journal = Some(run.journal(observer)?);
        Ok(Self { journal, run: folder, ..Self::new(Engine::JournalOnly, shape, observer) })
    }

    fn of_matrix(source: &MatrixSource, shape: Shape, observer: &SharedObserver) -> Result<Self> {
        let mut parts = ExplicitParts::new(source);
        let is_symmetric = shape.photos == shape.patterns
            && (0..source.channels()).try_fold(true, |all, channel| {
                Ok(all && parts.operator(Part::Full, channel)?.symmetry() == Symmetry::Symmetric)
            })?;
        let shape = Shape { channels: source.channels(), ..shape.symmetric(is_symmetric) };
        Ok(Self::new(Engine::Explicit(Box::new(parts)), shape, observer))
    }

    fn of_model(
        model: SavedModel,
        shape: Shape,
        channels: Channels,
        observer: &SharedObserver,
    ) -> Result<Self> {
        require_channels(channels, model.channels.len())?;
        let symmetric = model.channels.iter().all(LowRank::is_symmetric);
        let engine = Engine::Model(Box::new(ModelParts::new(model)?));
        Ok(Self::new(engine, shape.symmetric(symmetric), observer))
    }

    pub(in crate::lab) fn of_assembled(traced: Arc<Assembled>, observer: &SharedObserver) -> Self {
        let matrix = &traced.matrix;
        let shape = Shape::new(matrix.resolution(), matrix.projector_resolution(), matrix.channels());
        let shape = shape.symmetric(matrix.is_symmetric());
        Self::new(Engine::Replayed(traced), shape, observer)
    }

    /// A scene that is traced for each photo. Errors: [`Error::Option`] if a photo takes more memory than `settings` allow.
    pub(in crate::lab) fn of_retraced(
        scene: &SceneSource,
        settings: &Settings,
        channels: Channels,
        observer: &SharedObserver,
    ) -> Result<Self> {
        require_photo_memory(scene, without_matrix(settings), channels)?;
        let photos = scene.settings.resolution;
        let patterns = scene.settings.projector.unwrap_or(photos);
        let shape = Shape::new(photos, patterns, channels).symmetric(scene.is_symmetric());
        Ok(Self::new(retracing(scene, channels, false), shape, observer))
    }

    /// A scene that is traced for each product. The errors of the products are known. Fails as [`Self::of_retraced`].
    pub(in crate::lab) fn of_estimated(
        scene: &SceneSource,
        settings: &Settings,
        channels: Channels,
        observer: &SharedObserver,
    ) -> Result<Self> {
        let retraced = Self::of_retraced(scene, settings, channels, observer)?;
        Ok(Self { engine: retracing(scene, channels, true), ..retraced })
    }

    /// Stores the direct light, the noise and the ambient light of a traced scene in the journal. The run's folder then suffices to relight
    /// the scene.
    fn keep_known(&mut self) -> Result<()> {
        let Self { engine: Engine::Replayed(traced), journal: Some(journal), may_reside, .. } = self else {
            return Ok(());
        };
        if journal.photos() == 0 && traced.is_on_gpu() {
            journal.note(notes::ON_DEVICE, &[])?;
        }
        *may_reside = journal.read_note(notes::ON_DEVICE)?.is_some();
        if let Some(direct) = direct_diagonal(traced) {
            let bytes: Vec<u8> = direct.iter().flatten().flat_map(|value| value.to_le_bytes()).collect();
            journal.note(notes::DIRECT, &bytes)?;
        }
        if let Some(noise) = product_noise(traced) {
            note(journal, notes::NOISE, &noise)?;
        }
        self.ambient().map(drop)
    }
}

/// The noise `‖E‖_F / √n` of each part, in the first channel. Direct light is assumed to have the relative noise of the whole matrix.
pub(in crate::lab) fn product_noise(traced: &Assembled) -> Option<ProductNoise> {
    let noise = traced.noise.as_ref()?;
    let columns = traced.matrix.projector_resolution().pixels() as f64;
    let of = |part, relative: f64| relative * traced.matrix.frobenius_norm(part, 0) / columns.sqrt();
    Some(ProductNoise {
        full: of(Part::Full, noise.operator),
        direct: of(Part::Direct, noise.operator),
        global: of(Part::Global, noise.global),
    })
}

/// Checks that the requested channels are those of photos that already exist.
fn require_channels(channels: Channels, found: usize) -> Result<()> {
    if channels.count() == found {
        return Ok(());
    }
    let fault = format!("the run's photos have {found} channels, not {}", channels.count());
    Err(Error::option("--channels", fault).help("give the channels of that run"))
}

/// The engine that the settings choose. `Auto` chooses the matrix unless its size exceeds the memory limit.
fn of_scene(
    scene: &SceneSource,
    settings: &Settings,
    channels: Channels,
    observer: &SharedObserver,
) -> Result<Engine> {
    let retrace = match settings.operator.choice {
        OperatorChoice::Replay => false,
        OperatorChoice::Retrace if settings.operator.backend != Backend::Auto => {
            let fault = "photos that are traced anew are not products with a matrix";
            return Err(Error::option("--products", fault).help("leave it out, or give --operator replay"));
        }
        OperatorChoice::Retrace => true,
        OperatorChoice::Auto => {
            let limit = settings.memory_limit();
            // Each process holds about the same fraction of the matrix, and the limit applies to each process.
            let processes = settings.team.as_ref().map_or(1, |team| team.size());
            let whole = limit.saturating_mul(processes as u64);
            let needed =
                predict(&mut scene.tracer(), &scene.settings, channels, whole)?.bytes / processes as f64;
            let exceeds = needed > limit as f64;
            if exceeds {
                observer.note(format_args!(
                    "note: the matrix would take about {}, more than --memory {}: every photo is traced anew",
                    bytes(needed as u64),
                    bytes(limit)
                ));
            }
            exceeds
        }
    };
    if retrace {
        require_photo_memory(scene, without_matrix(settings), channels)?;
        return Ok(retracing(scene, channels, false));
    }
    Ok(Engine::Replayed(scene.assemble(channels, settings.split_bounces)?))
}

fn retracing(scene: &SceneSource, channels: Channels, states_errors: bool) -> Engine {
    Engine::Retraced(Retracing { scene: Box::new(scene.clone()), channels, states_errors })
}

/// The memory limit in bytes for photos that are traced without a matrix. If `--memory` sets a lower limit, it applies only to matrices.
fn without_matrix(settings: &Settings) -> u64 {
    settings.memory_limit().max(Settings::default().memory_limit())
}

/// Checks that a photo traced without a matrix takes at most `limit` bytes of memory.
pub(in crate::lab) fn require_photo_memory(
    scene: &SceneSource,
    limit: u64,
    channels: Channels,
) -> Result<()> {
    let needed = photo_bytes(&scene.settings, channels);
    if needed <= limit {
        return Ok(());
    }
    let fault = format!(
        "a photo of {} pixels takes about {}, more than the {} of --memory",
        scene.settings.resolution,
        bytes(needed),
        bytes(limit)
    );
    Err(Error::option("--size", fault)
        .help("use a smaller --size, or allow more --memory where the machine has it"))
}

impl Shape {
    /// The shape of a matrix whose symmetry is not known, and whose products take as long together as one by one.
    fn new(photos: Resolution, patterns: Resolution, channels: Channels) -> Self {
        let (symmetry, channels) = (Symmetry::General, channels.count());
        Self { photos, patterns, symmetry, channels, block_size: 1 }
    }

    fn symmetric(self, is_symmetric: bool) -> Self {
        let symmetry = if is_symmetric { Symmetry::Symmetric } else { Symmetry::General };
        Self { symmetry, ..self }
    }
}

fn note(journal: &mut Journal, name: &str, value: &impl serde::Serialize) -> Result<()> {
    let text =
        serde_json::to_vec(value).map_err(|error| Error::writing(Path::new(journal.path()))(error.into()))?;
    journal.note(name, &text)
}
