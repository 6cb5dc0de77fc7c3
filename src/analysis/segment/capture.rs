//! The photos of a segmentation. They are taken once for any number of groups. A capture can be resumed after an error.

use super::confirm::{Unseen, unseen};
use super::cut_matrix::CutMatrix;
use super::graph::Graph;
use super::low_pass::low_pass;
use super::options::{Coordinates, Cut, SegmentOptions};
use super::regions::KEPT;
use super::segmentation::Segmentation;
use crate::analysis::low_rank::smooth_starts;
use crate::error::{Error, Result};
use crate::image::Resolution;
use crate::krylov::{EigsOptions, Factorization, HistoryRow, Start, Status, Which, search_from};
use crate::observer::{Estimate, Observer, Step};
use crate::operator::{Operator, Relayed, Symmetry, product};

/// The photos of a segmentation and the Krylov process built from them.
///
/// The first photo shows the scene under white (the degree `D = G 1`). If masked pixels have light, the second photo shows the scene under
/// the mask (see [`Graph::measure`]). All further photos are Lanczos steps. If the operator fails, [`Capture::run`] returns its error and
/// keeps all photos. Call it again to continue, or call [`Capture::segmentation`] for the result so far.
#[derive(Clone, Debug)]
pub struct Capture {
    options: SegmentOptions,
    photos_of_degree: usize,
    white: Option<Vec<f64>>,
    graph: Option<Graph>,
    lanczos: Option<Factorization>,
    history: Vec<HistoryRow>,
    status: Option<Status>,
    pub(super) unseen: Unseen,
}

impl Capture {
    /// Makes a capture without photos. Fails with [`Error::Option`] naming the option (see [`SegmentOptions`] for the ranges).
    pub fn new(options: SegmentOptions) -> Result<Self> {
        options.check()?;
        Ok(Self {
            options,
            photos_of_degree: 0,
            white: None,
            graph: None,
            lanczos: None,
            history: Vec::new(),
            status: None,
            unseen: Unseen::default(),
        })
    }

    /// The options of the capture.
    pub fn options(&self) -> &SegmentOptions {
        &self.options
    }

    /// The number of photos taken so far.
    pub fn photos(&self) -> usize {
        self.photos_of_degree + self.lanczos.as_ref().map_or(0, Factorization::products) + self.unseen.photos
    }

    /// Takes photos until the eigenvectors are within the tolerance, the budget is spent, or the observer of `global` stops the capture.
    /// `global` is the symmetric transport matrix (`n × n`) without its direct part. The observer's steps count all photos, including the
    /// photos of the degree. The observer's eigenvalues exclude the known eigenvalue.
    ///
    /// # Errors
    /// [`Error::Numerical`] if `global` is not declared symmetric, sees no light, or yields NaN; [`Error::Option`] naming `--groups` if
    /// fewer pixels have light than there are groups; [`Error::Dimension`] if `global` is not square or differs in size from earlier
    /// photos; any error of `global`.
    pub fn run(&mut self, global: &mut dyn Operator) -> Result<()> {
        self.take_photos(global)?;
        if self.status != Some(Status::Stopped)
            && let (Some(graph), Some(lanczos)) = (&self.graph, &self.lanczos)
        {
            self.unseen = unseen(global, graph, lanczos, &self.options)?;
        }
        Ok(())
    }

    fn take_photos(&mut self, global: &mut dyn Operator) -> Result<()> {
        self.status = None;
        self.measure_graph(global)?;
        let Some(graph) = &self.graph else { return Ok(()) };
        if self.lanczos.is_none() {
            let starts = starts(&self.options, graph, 0);
            let known = self.options.cut.known_vector(graph);
            let mut lanczos = Factorization::block_lanczos(&starts, std::slice::from_ref(&known))?;
            if let Some(resolution) = known_pixels(&self.options, graph) {
                lanczos = lanczos.filtered(low_pass(graph, &known, resolution));
            }
            self.lanczos = Some(lanczos);
        }
        loop {
            let block = self.lanczos.as_ref().map_or(0, Factorization::block);
            let photos = self.options.photos - self.photos_of_degree;
            // After `ROUNDS` photos per start, the capture may add further starts, if photos are left for them. A capture with a single start
            // never adds any.
            let may_widen = block > 1 && photos >= ROUNDS * (block + self.options.start_count());
            let stage = if may_widen { ROUNDS * block } else { photos };
            let status = self.take(global, stage)?;
            let (Some(graph), Some(lanczos)) = (&self.graph, &mut self.lanczos) else { return Ok(()) };
            let is_over = matches!(status, Status::Stopped | Status::SpaceExhausted);
            if is_over || lanczos.products() >= photos || lanczos.products() < stage {
                self.status = Some(status);
                return Ok(());
            }
            let is_decided = lanczos.products() > stage;
            if is_decided || !is_saturated(lanczos, self.options.cut)? {
                break;
            }
            lanczos.widen(&starts(&self.options, graph, block))?;
        }
        let status = self.take(global, self.options.photos - self.photos_of_degree)?;
        self.status = Some(status);
        Ok(())
    }

    /// Takes photos until the Krylov process has `most` products, or needs no more.
    fn take(&mut self, global: &mut dyn Operator, most: usize) -> Result<Status> {
        let (Some(graph), Some(lanczos)) = (&self.graph, &mut self.lanczos) else {
            return Err(too_early());
        };
        let degree_photos = self.photos_of_degree;
        let options = EigsOptions {
            count: self.options.eigenvectors - 1,
            which: Which::LargestAlgebraic,
            products: most,
            tolerance: self.options.tolerance,
            ..EigsOptions::default()
        };
        let budget = self.options.photos;
        let sign = self.options.cut.sign();
        let history = &mut self.history;
        // The history is stored here and not in the eigensolver, so that it survives an error.
        let relay = |observer: &dyn Observer, step: &Step<'_>| {
            let Estimate::Eigenpairs { values, residuals } = step.estimate else {
                return observer.step(step);
            };
            let row = HistoryRow {
                products: step.done as usize + degree_photos,
                values: values.iter().map(|value| sign * value).collect(),
                residuals: residuals.to_vec(),
            };
            let flow = observer.step(&Step {
                done: row.products as u64,
                total: budget as u64,
                estimate: Estimate::Eigenpairs { values: &row.values, residuals: &row.residuals },
                ..*step
            });
            history.push(row);
            flow
        };
        let mut operator = CutMatrix::new(global, graph, self.options.cut);
        search_from(lanczos, &mut Relayed::new(&mut operator, relay), &options)
    }

    /// The segmentation from the photos taken so far. The call takes no photo and does not change the capture. An observer may stop a
    /// capture that continues later. At each stop, the result equals the result of a capture with that number of photos. Fails with
    /// [`Error::Numerical`] if there is no eigenvector yet (fewer than three photos, or a scene of one pixel).
    pub fn segmentation(&self) -> Result<Segmentation> {
        self.answer(&self.options)
    }

    /// The segmentation for other numbers of groups and by other coordinates. Fails as [`Capture::segmentation`] does, and with
    /// [`Error::Option`] naming `--groups`.
    pub fn regrouped(&self, groups: &[usize], coordinates: Coordinates) -> Result<Segmentation> {
        let options = SegmentOptions { groups: groups.to_vec(), coordinates, ..self.options.clone() };
        options.check()?;
        if let Some(graph) = &self.graph {
            check_enough(graph, groups)?;
        }
        self.answer(&options)
    }

    fn answer(&self, options: &SegmentOptions) -> Result<Segmentation> {
        let graph = self.graph.as_ref().ok_or_else(too_early)?;
        let lanczos = self.lanczos.as_ref().ok_or_else(too_early)?;
        if lanczos.steps() == 0 {
            return Err(too_early());
        }
        Segmentation::of(self, options, graph, lanczos)
    }

    /// The history of the eigenvalues, one row per Lanczos photo.
    pub fn history(&self) -> &[HistoryRow] {
        &self.history
    }

    /// The reason why the capture ended; `None` before [`Capture::run`] has finished.
    pub fn status(&self) -> Option<Status> {
        self.status
    }

    fn measure_graph(&mut self, global: &mut dyn Operator) -> Result<()> {
        let n = global.cols();
        if global.rows() != n || self.graph.as_ref().is_some_and(|graph| graph.n() != n) {
            return Err(Error::dimension(
                "the transport operator of a segmentation",
                format!("{n}x{n}, the same in all photos"),
                format!("{}x{n}", global.rows()),
            ));
        }
        if global.symmetry() != Symmetry::Symmetric {
            return Err(Error::Numerical(
                "segmentation needs a symmetric transport matrix (a coaxial rig's), \
                 and this one is not declared symmetric"
                    .into(),
            ));
        }
        if self.graph.is_some() {
            return Ok(());
        }
        if self.white.is_none() {
            self.white = Some(product(global, &vec![1.0; n])?);
            self.photos_of_degree = 1;
        }
        let Some(white) = &self.white else { return Ok(()) };
        let photos = &mut self.photos_of_degree;
        let graph = Graph::measure(white, self.options.mask_below, self.options.mu, |pattern| {
            let photo = product(global, pattern)?;
            *photos += 1;
            Ok(photo)
        })?;
        check_enough(&graph, &self.options.groups)?;
        self.graph = Some(graph);
        Ok(())
    }
}

fn check_enough(graph: &Graph, groups: &[usize]) -> Result<()> {
    let most = groups.iter().copied().max().unwrap_or(0);
    if graph.pixels().len() < most.max(2) {
        return Err(Error::option(
            "--groups",
            format!("{most} groups, but only {} pixels exchange light", graph.pixels().len()),
        )
        .help("ask for fewer groups, or lower --mask-below"));
    }
    Ok(())
}

fn too_early() -> Error {
    Error::Numerical("the capture ended before a first eigenvector could be computed".into())
}

/// The number of photos per starting pattern after which the capture decides whether there are enough starting patterns.
const ROUNDS: usize = 4;

/// Returns true if as many eigenvalues may belong to regions as there are starting patterns. Further regions may then have been missed. For
/// the average cut the result is false, because its eigenvalues have no scale for this decision.
fn is_saturated(lanczos: &Factorization, cut: Cut) -> Result<bool> {
    let pairs = lanczos.ritz(Which::LargestAlgebraic, lanczos.block())?;
    Ok(cut == Cut::Normalized && pairs.iter().all(|pair| pair.value >= KEPT))
}

fn known_pixels(options: &SegmentOptions, graph: &Graph) -> Option<Resolution> {
    options.resolution.filter(|resolution| resolution.pixels() == graph.n())
}

/// The next starting patterns, after `before` earlier patterns. They are random, because patterns of ones would give the scene's symmetry
/// to the whole Krylov space. An eigenvector of regions is the known vector times a constant on each region. If the resolution is known,
/// several patterns are therefore smooth patterns times the known vector.
fn starts(options: &SegmentOptions, graph: &Graph, before: usize) -> Vec<Vec<f64>> {
    let (m, count) = (graph.pixels().len(), options.start_count());
    let known = options.cut.known_vector(graph);
    match known_pixels(options, graph).filter(|_| count > 1) {
        None => {
            let seed = options.seed.wrapping_add(before as u64);
            Start::Random { seed }.block(m, count)
        }
        Some(resolution) => {
            let patterns = smooth_starts(resolution, before..before + count, options.seed);
            let nodes = |pattern: &Vec<f64>| {
                graph.pixels().iter().zip(&known).map(|(&pixel, known)| pattern[pixel] * known).collect()
            };
            patterns.iter().map(nodes).collect()
        }
    }
}
