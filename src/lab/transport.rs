//! The light transport of an open source: every product with a part of its matrix, and every photo, goes through here.

use std::path::Path;
use std::sync::Arc;

use super::journal;
use super::matrix::{ExplicitParts, MatrixSource};
use super::measured::MeasuredRig;
use super::model::ModelParts;
use super::notes::{self, Kind};
use super::run::RunSource;
use super::scene::SceneSource;
use super::settings::{OperatorChoice, Settings};
use super::source::Source;
use super::text::bytes;
use super::{Log, SharedObserver, Truth, folder::RunFolder};
use crate::analysis::LowRank;
use crate::analysis::low_rank::SavedModel;
use crate::error::{Error, Result};
use crate::image::{Image, Resolution};
use crate::journal::{Identity, Journal, Key};
use crate::measure::RigRecord;
use crate::operator::{Adjoint, Operator, Symmetry};
use crate::transport::{
    Assembled, Backend, Bounces, Channels, JournaledOperator, MatrixOperator, Part, Retraced,
    RetracedOperator, Transport, predict,
};

/// What computes or takes photos.
enum Engine {
    /// Products with a traced matrix.
    Replayed(Arc<Assembled>),
    /// A scene that is traced for each photo. The photos equal those of `Replayed`, to rounding.
    Retraced(Box<SceneSource>, Channels),
    /// A rig, or the photos that a run took of one.
    Measured(Box<MeasuredRig>),
    /// An explicit matrix.
    Explicit(Box<ExplicitParts>),
    /// A low-rank model.
    Model(Box<ModelParts>),
    /// Nothing: every photo is in the journal.
    JournalOnly,
}

/// The light transport of a source: what takes photos, and the journal that keeps those of a scene. The journal of a rig is behind its
/// frames.
pub(super) struct LightTransport {
    engine: Engine,
    journal: Option<Journal>,
    shape: Shape,
    observer: SharedObserver,
}

/// Sizes, symmetry and channels of the matrix.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shape {
    pub(super) photos: Resolution,
    pub(super) patterns: Resolution,
    pub(super) symmetry: Symmetry,
    pub(super) channels: usize,
    /// Products that take about as long together as one.
    pub(super) block_size: usize,
}

/// The direction of a product: from the projector to the camera, or back with the transpose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Direction {
    Forward,
    Adjoint,
}

impl LightTransport {
    /// Traces the scene, opens the rig or reads the journal. With a run's folder each photo is in its journal before it is used, and none
    /// is taken twice.
    pub(super) fn open(
        source: &Source,
        settings: &Settings,
        channels: Channels,
        run: Option<(&RunFolder, Option<&Truth>)>,
        observer: &SharedObserver,
    ) -> Result<Self> {
        let shape = Shape {
            photos: source.resolution(),
            patterns: source.projector_resolution(),
            symmetry: Symmetry::General,
            channels: channels.count(),
            block_size: 1,
        };
        let journal = |identity: &Identity| -> Result<Option<Journal>> {
            let Some((run, truth)) = run else { return Ok(None) };
            let mut journal = journal::open(&run.path, identity, run.resumes, observer)?;
            if let Some(truth) = truth {
                note(&mut journal, notes::TRUTH, truth)?;
            }
            if let Some(about) = source.note(channels) {
                note(&mut journal, notes::SOURCE, &about)?;
            }
            Ok(Some(journal))
        };
        let native = match settings.channels {
            super::ChannelChoice::Native => None,
            _ => Some(channels),
        };
        match source {
            Source::Scene(scene) => {
                let journal = match run {
                    Some(_) => journal(&scene.identity(Identity::new(), channels))?,
                    None => None,
                };
                let symmetry = symmetry(scene.is_symmetric());
                let engine = of_scene(scene, settings, channels, observer)?;
                let shape = Shape { symmetry, ..shape };
                let mut transport = Self { engine, journal, shape, observer: observer.clone() };
                transport.keep_known()?;
                Ok(transport)
            }
            Source::Rig(rig) => {
                let mut journal = match run {
                    Some(_) => journal(&rig.identity()?)?,
                    None => None,
                };
                if let (Some(journal), Some((run, _))) = (&mut journal, run) {
                    rig.keep(&run.path, journal)?;
                }
                Ok(Self::of_rig(rig.measured(native, journal)?, shape, observer))
            }
            Source::Run(run) => Self::of_run(run, channels, native, shape, observer),
            Source::Matrix(matrix) => Ok(Self::of_matrix(matrix, shape, observer)),
            Source::Model(source) => Self::of_model(source.model.clone(), shape, channels, observer),
        }
    }

    fn of_rig(rig: MeasuredRig, shape: Shape, observer: &SharedObserver) -> Self {
        let measurement = &rig.measurement;
        let shape = Shape { symmetry: measurement.symmetry(), channels: measurement.channels(), ..shape };
        Self { engine: Engine::Measured(Box::new(rig)), journal: None, shape, observer: observer.clone() }
    }

    fn of_run(
        run: &RunSource,
        channels: Channels,
        native: Option<Channels>,
        shape: Shape,
        observer: &SharedObserver,
    ) -> Result<Self> {
        if run.note.kind == Kind::Rig {
            return Ok(Self::of_rig(run.measured(native, observer)?, shape, observer));
        }
        require_channels(channels, run.note.channels)?;
        let shape = Shape { symmetry: run.note.symmetry(), ..shape };
        let journal = Some(run.journal(observer)?);
        Ok(Self { engine: Engine::JournalOnly, journal, shape, observer: observer.clone() })
    }

    fn of_matrix(source: &MatrixSource, shape: Shape, observer: &SharedObserver) -> Self {
        let parts = ExplicitParts::new(source.matrix.clone());
        let shape = Shape { symmetry: parts.full.symmetry(), channels: 1, ..shape };
        Self { engine: Engine::Explicit(Box::new(parts)), journal: None, shape, observer: observer.clone() }
    }

    fn of_model(
        model: SavedModel,
        shape: Shape,
        channels: Channels,
        observer: &SharedObserver,
    ) -> Result<Self> {
        require_channels(channels, model.channels.len())?;
        let symmetric = model.channels.iter().all(LowRank::is_symmetric);
        let shape = Shape { symmetry: symmetry(symmetric), ..shape };
        let engine = Engine::Model(Box::new(ModelParts::new(model)?));
        Ok(Self { engine, journal: None, shape, observer: observer.clone() })
    }

    /// Products with this matrix.
    pub(super) fn of_assembled(traced: Arc<Assembled>, observer: &SharedObserver) -> Self {
        let matrix = &traced.matrix;
        let shape = Shape {
            photos: matrix.resolution(),
            patterns: matrix.projector_resolution(),
            symmetry: symmetry(matrix.is_symmetric()),
            channels: matrix.channels().count(),
            block_size: 1,
        };
        Self { engine: Engine::Replayed(traced), journal: None, shape, observer: observer.clone() }
    }

    /// A scene that is traced for each photo.
    pub(super) fn of_retraced(scene: &SceneSource, channels: Channels, observer: &SharedObserver) -> Self {
        let shape = Shape {
            photos: scene.settings.resolution,
            patterns: scene.settings.projector.unwrap_or(scene.settings.resolution),
            symmetry: symmetry(scene.is_symmetric()),
            channels: channels.count(),
            block_size: 1,
        };
        let engine = Engine::Retraced(Box::new(scene.clone()), channels);
        Self { engine, journal: None, shape, observer: observer.clone() }
    }

    pub(super) fn shape(&mut self) -> Shape {
        let block_size = match &mut self.engine {
            Engine::JournalOnly => 1,
            // What fails here fails again, with its error, at the first product.
            engine => engine.with_operator(Part::Full, 0, |operator| Ok(operator.block_size())).unwrap_or(1),
        };
        Shape { block_size, ..self.shape }
    }

    /// The traced matrix, where there is one.
    pub(super) fn assembled(&self) -> Option<&Arc<Assembled>> {
        match &self.engine {
            Engine::Replayed(traced) => Some(traced),
            _ => None,
        }
    }

    /// Whether photos cost nothing but computing.
    pub(super) fn is_simulated(&self) -> bool {
        !matches!(self.engine, Engine::Measured(_))
    }

    /// The rig, where photos are of one.
    pub(super) fn rig(&mut self) -> Option<&mut MeasuredRig> {
        match &mut self.engine {
            Engine::Measured(rig) => Some(rig),
            _ => None,
        }
    }

    /// What a run on a rig has cost so far; see [`MeasuredRig::record`].
    pub(super) fn record(&mut self, is_complete: bool) -> Result<Option<RigRecord>> {
        self.rig().map(|rig| rig.record(is_complete)).transpose()
    }

    /// Products of one part and channel with several vectors.
    pub(super) fn products(
        &mut self,
        (part, channel): (Part, usize),
        direction: Direction,
        xs: &[&[f64]],
        ys: &mut [&mut [f64]],
    ) -> Result<()> {
        let Self { engine, journal, shape, observer } = self;
        let apply = |operator: &mut dyn Adjoint, ys: &mut [&mut [f64]]| match direction {
            Direction::Forward => operator.apply_block(xs, ys),
            Direction::Adjoint => operator.apply_adjoint_block(xs, ys),
        };
        let Some(journal) = journal else {
            return engine.with_operator(part, channel, |operator| apply(operator, ys));
        };
        let name = product_name(part, channel);
        if let Engine::JournalOnly = engine {
            let size = [shape.photos, shape.patterns].map(Resolution::pixels);
            return apply(&mut JournaledOperator::replay(journal, name, size, shape.symmetry), ys);
        }
        let known = journal.damages().len();
        let taken = engine.with_operator(part, channel, |inner| {
            apply(&mut JournaledOperator::new(journal, name, inner), ys)
        });
        let mut warn = journal::warning(journal, observer);
        journal.damages()[known..].iter().for_each(&mut warn);
        taken
    }

    /// Keeps what a simulator knows beside its photos, so that the run's folder alone can be relit.
    fn keep_known(&mut self) -> Result<()> {
        let Self { engine: Engine::Replayed(traced), journal: Some(journal), .. } = self else {
            return Ok(());
        };
        if let Some(direct) = direct_diagonal(traced) {
            let bytes: Vec<u8> = direct.iter().flatten().flat_map(|value| value.to_le_bytes()).collect();
            journal.note(notes::DIRECT, &bytes)?;
        }
        self.ambient().map(drop)
    }

    /// The photo without projector.
    pub(super) fn ambient(&mut self) -> Result<Image> {
        let patterns = self.shape.patterns;
        self.journaled_image("ambient", |engine| match engine {
            Engine::Replayed(traced) => Ok(traced.ambient.clone()),
            Engine::Measured(rig) => rig.measurement.ambient()?.to_image(),
            Engine::Model(parts) => Ok(parts.model.ambient.clone()),
            engine => engine.photograph(&Image::filled(patterns, 1, 0.0)),
        })
    }

    /// The photo under an all-ones pattern.
    pub(super) fn white(&mut self) -> Result<Image> {
        let white = Image::filled(self.shape.patterns, 1, 1.0);
        self.journaled_image("white", |engine| engine.photograph(&white))
    }

    /// A photo, with the ambient light; on a rig without it, unless its file says otherwise.
    pub(super) fn photograph(&mut self, pattern: &Image) -> Result<Image> {
        let shown: Vec<u8> = pattern.samples().iter().flat_map(|sample| sample.to_le_bytes()).collect();
        let name = format!("photo of {}", Key::of(&[&shown]));
        self.journaled_image(&name, |engine| engine.photograph(pattern))
    }

    /// As [`Self::photograph`], with the standard error of each sample where it is known.
    pub(super) fn photograph_with_error(&mut self, pattern: &Image) -> Result<(Image, Option<Image>)> {
        match &mut self.engine {
            Engine::Retraced(scene, channels) => {
                let mut tracer = scene.tracer();
                let settings = scene.settings;
                let mut retraced = Retraced { tracer: &mut tracer, settings, channels: *channels };
                let (photo, error) = retraced.photograph_with_error(pattern)?;
                Ok((photo, (settings.samples > 1).then_some(error)))
            }
            Engine::Measured(rig) => {
                let photo = rig.measurement.photograph(pattern)?;
                Ok((photo.to_image()?, Some(photo.errors_to_image()?)))
            }
            _ => Ok((self.photograph(pattern)?, None)),
        }
    }

    /// Photos of red, green and blue alone, in each of the camera's channels, without ambient light.
    pub(super) fn primaries(&mut self) -> Result<[[Vec<f64>; 3]; 3]> {
        if let Engine::Measured(rig) = &mut self.engine {
            return rig.measurement.primaries()?.ok_or_else(|| Error::Option {
                option: "--crosstalk".into(),
                fault:
                    "a projector and a camera of three channels each mix colours, and one of these is gray"
                        .into(),
                help: "leave it out".into(),
            });
        }
        let (resolution, ambient) = (self.shape.patterns, self.ambient()?);
        let mut photos: [[Vec<f64>; 3]; 3] = Default::default();
        for (primary, photo) in photos.iter_mut().enumerate() {
            let color = (0..3).map(|channel| f32::from(u8::from(channel == primary)));
            let samples = color.collect::<Vec<f32>>().repeat(resolution.pixels());
            let seen = self.photograph(&Image::new(resolution, 3, samples)?)?;
            for (channel, plane) in photo.iter_mut().enumerate() {
                let own = seen.plane(channel).into_iter().zip(ambient.plane(channel));
                *plane = own.map(|(seen, ambient)| seen - ambient).collect();
            }
        }
        Ok(photos)
    }

    /// The image of this name: from the journal, or taken and kept there.
    fn journaled_image(
        &mut self,
        name: &str,
        take: impl FnOnce(&mut Engine) -> Result<Image>,
    ) -> Result<Image> {
        let Some(journal) = &mut self.journal else { return take(&mut self.engine) };
        let resolution = self.shape.photos;
        if let Some(bytes) = journal.read_note(name)? {
            let samples: Vec<f32> = bytes.as_chunks::<4>().0.iter().map(|&b| f32::from_le_bytes(b)).collect();
            return Image::new(resolution, samples.len() / resolution.pixels().max(1), samples);
        }
        if let Engine::JournalOnly = self.engine {
            return Err(Error::Journal {
                path: journal.path().into(),
                fault: format!(
                    "the photo `{name}` is not among its {}, and there is no scene",
                    journal.photos()
                ),
                help: "give the scene, with -o and --resume".into(),
            });
        }
        let image = take(&mut self.engine)?;
        let bytes: Vec<u8> = image.samples().iter().flat_map(|sample| sample.to_le_bytes()).collect();
        journal.note(name, &bytes)?;
        Ok(image)
    }
}

impl Engine {
    /// Lets `work` multiply with one part and channel.
    fn with_operator<T>(
        &mut self,
        part: Part,
        channel: usize,
        work: impl FnOnce(&mut dyn Adjoint) -> Result<T>,
    ) -> Result<T> {
        match self {
            Self::Replayed(traced) => work(&mut MatrixOperator::new(&**traced, part, channel)),
            Self::Retraced(scene, channels) => {
                let mut tracer = scene.tracer();
                let retraced =
                    Retraced { tracer: &mut tracer, settings: scene.settings, channels: *channels };
                work(&mut RetracedOperator { retraced, part, channel })
            }
            Self::Measured(rig) => work(&mut rig.measurement.operator(part, channel)),
            Self::Explicit(parts) => work(parts.operator(part)?),
            Self::Model(parts) => work(parts.operator(part, channel)),
            Self::JournalOnly => Err(Error::Interrupted),
        }
    }

    fn photograph(&mut self, pattern: &Image) -> Result<Image> {
        match self {
            Self::Replayed(traced) => traced.photograph(pattern),
            Self::Retraced(scene, channels) => {
                let mut tracer = scene.tracer();
                Retraced { tracer: &mut tracer, settings: scene.settings, channels: *channels }
                    .photograph(pattern)
            }
            Self::Measured(rig) => rig.measurement.photograph(pattern)?.to_image(),
            Self::Explicit(parts) => parts.photograph(pattern),
            Self::Model(parts) => {
                let none: Option<&mut [LowRank]> = None;
                Ok(parts.model.relight("", pattern.clone(), none)?.relit)
            }
            Self::JournalOnly => Err(Error::Interrupted),
        }
    }
}

/// Photos that are there already have the channels that they have.
fn require_channels(channels: Channels, found: usize) -> Result<()> {
    if channels.count() == found {
        return Ok(());
    }
    Err(Error::Option {
        option: "--channels".into(),
        fault: format!("the run's photos have {found} channels, not {}", channels.count()),
        help: "give the channels of that run".into(),
    })
}

/// The operator that the settings ask for: for `Auto` the matrix, unless it would exceed the memory.
fn of_scene(
    scene: &SceneSource,
    settings: &Settings,
    channels: Channels,
    observer: &SharedObserver,
) -> Result<Engine> {
    let retrace = match settings.operator {
        OperatorChoice::Replay => false,
        OperatorChoice::Retrace if settings.backend != Backend::Auto => {
            return Err(Error::Option {
                option: "--products".into(),
                fault: "photos that are traced anew are not products with a matrix".into(),
                help: "leave it out, or give --operator replay".into(),
            });
        }
        OperatorChoice::Retrace => true,
        OperatorChoice::Auto => {
            let limit = settings.memory_limit();
            let needed = predict(&mut scene.tracer(), &scene.settings, channels, limit)?.bytes;
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
        return Ok(Engine::Retraced(Box::new(scene.clone()), channels));
    }
    Ok(Engine::Replayed(scene.assemble(channels, settings.split_bounces)?))
}

fn symmetry(is_symmetric: bool) -> Symmetry {
    if is_symmetric { Symmetry::Symmetric } else { Symmetry::General }
}

fn note(journal: &mut Journal, name: &str, value: &impl serde::Serialize) -> Result<()> {
    let text =
        serde_json::to_vec(value).map_err(|error| Error::writing(Path::new(journal.path()))(error.into()))?;
    journal.note(name, &text)
}

/// The name of the products of a part and channel in a journal.
pub(super) fn product_name(part: Part, channel: usize) -> String {
    format!("{part:?}, channel {channel}")
}

/// The direct light of each channel, where it is a diagonal.
pub(super) fn direct_diagonal(traced: &Assembled) -> Option<Vec<Vec<f64>>> {
    let matrix = &traced.matrix;
    if matrix.layers().iter().any(|layer| layer.bounces() == Bounces::One) {
        return None;
    }
    let planes = (0..matrix.channels().count()).map(|channel| {
        let diagonal = matrix.direct(channel);
        (!diagonal.is_empty()).then(|| diagonal.iter().map(|&value| f64::from(value)).collect())
    });
    planes.collect()
}
