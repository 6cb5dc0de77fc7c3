//! The light transport of an open source. It computes every photo, and every product with a part of the matrix.

mod engine;
mod opening;
mod spanned;

use std::path::PathBuf;
use std::sync::Arc;

use super::measured::MeasuredRig;
use super::run_model::open_model;
use super::source::ModelParts;
use super::{
    Log, SharedObserver, layout,
    notes::{self, product_name},
};
use crate::error::{Error, Result};
use crate::image::{Image, Resolution};
use crate::io::sparse::ProductNoise;
use crate::journal::{Journal, Key};
use crate::measure::RigRecord;
use crate::operator::{Adjoint, Direction, Operator, Product, Selection, Symmetry, Vectors};
use crate::transport::{Assembled, Bounces, JournaledOperator, Part, pooled};
use engine::{Engine, Retracing};
pub(super) use opening::{product_noise, require_photo_memory};
use spanned::Spanned;

/// The light transport of a source: the engine that takes photos, and the journal of a scene. A rig keeps its own journal of raw frames.
pub(super) struct LightTransport {
    engine: Engine,
    journal: Option<Journal>,
    /// The finished run whose photos are replayed. A model made from these photos predicts photos that were not taken.
    run: Option<PathBuf>,
    /// The products that follow from these photos by linearity.
    spanned: Vec<Spanned>,
    /// Whether vectors may be on the device. A run that began with vectors on the host goes on with them.
    may_reside: bool,
    shape: Shape,
    observer: SharedObserver,
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Shape {
    pub(super) photos: Resolution,
    pub(super) patterns: Resolution,
    pub(super) symmetry: Symmetry,
    pub(super) channels: usize,
    /// The number of products that, computed together, take about as long as one product.
    pub(super) block_size: usize,
}

impl LightTransport {
    pub(super) fn shape(&mut self) -> Shape {
        let block_size = match &mut self.engine {
            Engine::JournalOnly => 1,
            // An error is ignored here, because the first product encounters it again and returns it.
            engine => engine.with_operator(Part::Full, 0, |operator| Ok(operator.block_size())).unwrap_or(1),
        };
        Shape { block_size, ..self.shape }
    }

    pub(super) fn assembled(&self) -> Option<&Arc<Assembled>> {
        match &self.engine {
            Engine::Replayed(traced) => Some(traced),
            _ => None,
        }
    }

    /// The noise of the matrix. It is known from a traced matrix, from a matrix file, or from a note in the journal of a run.
    pub(super) fn noise(&mut self) -> Result<Option<ProductNoise>> {
        Ok(match (&self.engine, &mut self.journal) {
            (Engine::Replayed(traced), _) => product_noise(traced),
            (Engine::Explicit(parts), _) => parts.noise(),
            (Engine::JournalOnly, Some(journal)) => {
                journal.read_note(notes::NOISE)?.and_then(|text| serde_json::from_slice(&text).ok())
            }
            _ => None,
        })
    }

    /// Works like [`crate::lab::Lab::product_noise`].
    pub(super) fn product_noise(&mut self, part: Part) -> Result<Option<f64>> {
        Ok(self.noise()?.map(|noise| match part {
            Part::Full => noise.full,
            Part::Direct => noise.direct,
            Part::Global => noise.global,
        }))
    }

    pub(super) fn is_model(&self) -> bool {
        matches!(self.engine, Engine::Model(_))
    }

    /// Whether photos cost only computing time.
    pub(super) fn is_simulated(&self) -> bool {
        !matches!(self.engine, Engine::Measured(_))
    }

    /// Whether products cost almost nothing. This holds for products with a matrix, and for products in a journal.
    pub(super) fn is_free(&self) -> bool {
        matches!(self.engine, Engine::Replayed(_) | Engine::Explicit(_) | Engine::JournalOnly)
    }

    pub(super) fn rig(&mut self) -> Option<&mut MeasuredRig> {
        match &mut self.engine {
            Engine::Measured(rig) => Some(rig),
            _ => None,
        }
    }

    /// Returns when all photos of the journal are on disk.
    pub(super) fn flush(&mut self) -> Result<()> {
        self.journal.as_mut().map_or(Ok(()), Journal::flush)
    }

    /// The costs of a run on a rig so far; see [`MeasuredRig::record`].
    pub(super) fn record(&mut self, is_complete: bool) -> Result<Option<RigRecord>> {
        self.rig().map(|rig| rig.record(is_complete)).transpose()
    }

    /// Calls `ask`. If `ask` needs a photo that was not taken, calls it once more with a model made from the finished run's photos.
    fn or_by_model<T>(&mut self, mut ask: impl FnMut(&mut Self) -> Result<T>) -> Result<T> {
        let missing = match ask(self) {
            Err(error @ Error::NotTaken { .. }) => error,
            found => return found,
        };
        let Some(folder) = self.run.take() else { return Err(missing) };
        self.spanned = Vec::new();
        let model = open_model(&folder, &self.observer)?;
        self.observer.note(format_args!(
            "note: not every photo that this asks for was taken: a model of rank {} of the run's photos answers, and what they leave open counts as its error; to take them, ask the rig or the scene itself",
            model.rank()
        ));
        self.engine = Engine::Model(Box::new(ModelParts::new(model)?));
        self.journal = None;
        ask(self)
    }

    /// Products of one part and channel with several vectors, and their standard errors if the source knows them. The journal does not keep
    /// products that only confirm an answer ([`Self::keep_claim`]), and no model estimates them.
    pub(super) fn products(
        &mut self,
        (of, is_confirming): ((Part, usize), bool),
        direction: Direction,
        xs: &[&[f64]],
        ys: &mut [&mut [f64]],
    ) -> Result<Vec<f64>> {
        match (&self.engine, is_confirming) {
            (Engine::JournalOnly, true) => self.products_taken(of, direction, xs, ys),
            (_, true) => self.engine.products(of, direction, xs, ys),
            (_, false) => self.or_by_model(|transport| transport.products_taken(of, direction, xs, ys)),
        }
    }

    /// The claim about the products of one part and channel that the run keeps for this question ([`Operator::claim`]).
    pub(super) fn claim(&mut self, of: (Part, usize), question: &str) -> Result<Option<Vec<u8>>> {
        let Some(journal) = &mut self.journal else { return Ok(None) };
        let known = journal.damages().len();
        let claim = journal.read_note(&claim_name(of, question));
        warn_of_new_damages(journal, known, &self.observer);
        claim
    }

    /// Keeps a claim with the run, if there is one ([`Operator::keep_claim`]).
    pub(super) fn keep_claim(&mut self, of: (Part, usize), question: &str, claim: &[u8]) -> Result<()> {
        match self.journal.as_mut().filter(|journal| journal.is_writable()) {
            Some(journal) => journal.note(&claim_name(of, question), claim),
            None => Ok(()),
        }
    }

    /// Vectors where the products of one part and channel are computed ([`Operator::vectors`]). A run that began with vectors in the host's
    /// memory goes on with them, so that its patterns are those in its journal.
    pub(super) fn vectors(
        &mut self,
        (part, channel): (Part, usize),
        columns: usize,
        selection: Option<Selection<'_>>,
    ) -> Result<Option<Box<dyn Vectors>>> {
        match &self.engine {
            Engine::Replayed(traced) if self.may_reside => {
                let made = traced.operator(part, channel).vectors(columns, selection)?;
                self.may_reside = made.is_some();
                if made.is_none() && traced.is_on_gpu() && self.shape.photos == self.shape.patterns {
                    self.observer.note(format_args!(
                        "note: the device has no room for {columns} vectors, which stay in the memory of the processor"
                    ));
                }
                Ok(made)
            }
            _ => Ok(None),
        }
    }

    /// A product with such vectors ([`Operator::apply_within`]). Unless it only confirms an answer, it is in the journal before it is
    /// returned. Returns `None` if the journal does not keep it and it need not be `seen`.
    pub(super) fn product_within(
        &mut self,
        ((part, channel), is_confirming): ((Part, usize), bool),
        vectors: &mut dyn Vectors,
        (column, direction): (usize, Direction),
        seen: bool,
    ) -> Result<Option<Product>> {
        let Self { engine, journal, observer, .. } = self;
        engine.with_operator(part, channel, |operator| operator.apply_within(vectors, column, direction))?;
        let journal = journal.as_mut().filter(|_| !is_confirming);
        if !seen && journal.is_none() {
            return Ok(None);
        }
        let product = vectors.product()?;
        if let Some(journal) = journal {
            let known = journal.damages().len();
            JournaledOperator::keep(journal, product_name(part, channel), direction, &product)?;
            warn_of_new_damages(journal, known, observer);
        }
        Ok(Some(product))
    }

    /// Products, from the journal if it keeps them.
    fn products_taken(
        &mut self,
        (part, channel): (Part, usize),
        direction: Direction,
        xs: &[&[f64]],
        ys: &mut [&mut [f64]],
    ) -> Result<Vec<f64>> {
        let Self { engine, journal, spanned, shape, observer, .. } = self;
        let name = product_name(part, channel);
        let Some(journal) = journal else {
            let errors = engine.products((part, channel), direction, xs, ys)?;
            if let (Engine::Measured(rig), Direction::Forward) = (engine, direction) {
                rig.products.keep((part, channel), xs, ys, &errors);
            }
            return Ok(errors);
        };
        if let Engine::JournalOnly = engine {
            let size = [shape.photos, shape.patterns].map(Resolution::pixels);
            for (x, y) in xs.iter().zip(ys) {
                let mut operator = JournaledOperator::replay(journal, &name, size, shape.symmetry);
                let replayed = operator.products(direction, &[x], &mut [y]);
                let is_missing = matches!(replayed, Err(Error::NotTaken { .. }));
                let follows =
                    is_missing && Spanned::of(spanned, journal, ((part, channel), direction))?.product(x, y);
                if !follows {
                    replayed?;
                }
            }
            return Ok(Vec::new());
        }
        let known = journal.damages().len();
        let taken = engine.with_operator(part, channel, |inner| {
            JournaledOperator::new(journal, name, inner).products(direction, xs, ys)
        });
        warn_of_new_damages(journal, known, observer);
        taken.map(|()| Vec::new())
    }

    pub(super) fn common_error(&mut self, (part, channel): (Part, usize), x: &[f64]) -> Result<f64> {
        if let Engine::Measured(_) = self.engine {
            self.engine.with_operator(part, channel, |operator| operator.common_error(x))
        } else {
            Ok(0.0)
        }
    }

    pub(super) fn ambient(&mut self) -> Result<Image> {
        let patterns = self.shape.patterns;
        self.journaled_image("ambient", |engine| match engine {
            Engine::Replayed(traced) => Ok(traced.ambient.clone()),
            Engine::Measured(rig) => rig.measurement.ambient()?.to_image(),
            Engine::Model(parts) => Ok(parts.model.ambient.clone()),
            engine => engine.photograph(&Image::filled(patterns, 1, 0.0)),
        })
    }

    pub(super) fn white(&mut self) -> Result<Image> {
        let white = Image::filled(self.shape.patterns, 1, 1.0);
        self.journaled_image("white", |engine| engine.photograph(&white))
    }

    /// A photo, including the ambient light. For a rig, the ambient light is included only if the rig's file says so.
    pub(super) fn photograph(&mut self, pattern: &Image) -> Result<Image> {
        self.or_by_model(|transport| transport.photograph_taken(pattern))
    }

    fn photograph_taken(&mut self, pattern: &Image) -> Result<Image> {
        let shown: Vec<u8> = pattern.samples().iter().flat_map(|sample| sample.to_le_bytes()).collect();
        let name = format!("photo of {}", Key::of(&[&shown]));
        self.image_taken(&name, |engine| engine.photograph(pattern))
    }

    /// A photo as [`Self::photograph`], with the standard error of each sample if these errors are known.
    pub(super) fn photograph_with_error(&mut self, pattern: &Image) -> Result<(Image, Option<Image>)> {
        self.or_by_model(|transport| transport.photograph_with_error_taken(pattern))
    }

    fn photograph_with_error_taken(&mut self, pattern: &Image) -> Result<(Image, Option<Image>)> {
        match &mut self.engine {
            Engine::Retraced(scene) => {
                let (photo, error) = scene.with(|mut retraced| retraced.photograph_with_error(pattern))?;
                let error = if scene.scene.settings.samples > 1 { Some(pooled(&error)?) } else { None };
                Ok((photo, error))
            }
            Engine::Measured(rig) => {
                let photo = rig.measurement.photograph(pattern)?;
                Ok((photo.to_image()?, Some(photo.errors_to_image()?)))
            }
            Engine::Model(parts) => {
                let errors = parts.errors(pattern)?;
                Ok((self.engine.photograph(pattern)?, Some(errors)))
            }
            _ => Ok((self.photograph_taken(pattern)?, None)),
        }
    }

    /// Photos of red, green and blue patterns, each in all channels of the camera, without ambient light.
    pub(super) fn primaries(&mut self) -> Result<[[Vec<f64>; 3]; 3]> {
        if let Engine::Measured(rig) = &mut self.engine {
            return rig.measurement.primaries()?.ok_or_else(|| {
                let fault =
                    "a projector and a camera of three channels each mix colours, and one of these is gray";
                Error::option("--crosstalk", fault).help("leave it out")
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

    /// The image with this name. It is read from the journal, or else taken and stored in the journal.
    fn journaled_image(&mut self, name: &str, take: impl Fn(&mut Engine) -> Result<Image>) -> Result<Image> {
        self.or_by_model(|transport| transport.image_taken(name, &take))
    }

    fn image_taken(&mut self, name: &str, take: impl FnOnce(&mut Engine) -> Result<Image>) -> Result<Image> {
        let Some(journal) = &mut self.journal else { return take(&mut self.engine) };
        let resolution = self.shape.photos;
        if let Some(bytes) = journal.read_note(name)? {
            let samples: Vec<f32> = bytes.as_chunks::<4>().0.iter().map(|&b| f32::from_le_bytes(b)).collect();
            return Image::new(resolution, samples.len() / resolution.pixels().max(1), samples);
        }
        if let Engine::JournalOnly = self.engine {
            let fault =
                format!("the photo `{name}` is not among its {}, and there is no scene", journal.photos());
            return Err(Error::not_taken(journal.path(), fault).help("give the scene, with -o and --resume"));
        }
        let image = take(&mut self.engine)?;
        let bytes: Vec<u8> = image.samples().iter().flat_map(|sample| sample.to_le_bytes()).collect();
        journal.note(name, &bytes)?;
        Ok(image)
    }
}

/// Reports the damages that were found after the first `known` ones.
fn warn_of_new_damages(journal: &Journal, known: usize, observer: &SharedObserver) {
    let mut warn = layout::warn_of_damage(journal, observer);
    journal.damages()[known..].iter().for_each(&mut warn);
}

fn claim_name((part, channel): (Part, usize), question: &str) -> String {
    format!("claim of {}: {question}", product_name(part, channel))
}

/// The direct light of each channel, if its matrix is diagonal.
pub(super) fn direct_diagonal(traced: &Assembled) -> Option<Vec<Vec<f64>>> {
    let matrix = &traced.matrix;
    if matrix.bounces().any(|bounces| bounces == Bounces::One) {
        return None;
    }
    let planes = (0..matrix.channels().count()).map(|channel| {
        let diagonal = matrix.direct(channel);
        (!diagonal.is_empty()).then(|| diagonal.iter().map(|&value| f64::from(value)).collect())
    });
    planes.collect()
}
