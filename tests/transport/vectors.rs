//! Krylov processes whose vectors are in the device's memory, compared with the same processes on the host.

use std::any::Any;
use std::borrow::Cow;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};

use crate::common::{load, settings, trace, tracer};
use krylux::analysis::{Capture, CompensateOptions, SegmentOptions, Target, compensate};
use krylux::image::{Image, Resolution};
use krylux::journal::{Journal, Kind};
use krylux::krylov::{
    Completeness, Confirm, Diagonal, Eigs, EigsMethod, EigsOptions, Factorization, ForwardOnly, METHODS,
    Method, MethodFacts, PairStatus, SingularOptions, Solution, SolveOptions, SolveRow, Start, Status,
    confirm, dot, eigs, eigs_from, norm, singular, solve, solve_adjoint, solve_from,
};
use krylux::lab::{Lab, RunOptions, Settings, SharedObserver};
use krylux::observer::{Level, Observer, OnStep, PhotoTaken, Step};
use krylux::operator::{
    Adjoint, Closure, Direction, Observed, Operator, Product, Selection, Settling, Sums, Symmetry, Vectors,
};
use krylux::render::{TraceSettings, Tracer};
use krylux::transport::{Assembled, Backend, Channels, MatrixOperator, Part};
use krylux::{Error, Result};

fn scene(name: &str, size: usize) -> (Tracer, Assembled) {
    let mut tracer = tracer(&load(name));
    let assembled = trace(&mut tracer, settings(size, 24, 6, 7), Channels::Luma);
    (tracer, assembled)
}

fn asked(method: EigsMethod, products: usize) -> EigsOptions {
    EigsOptions { count: 4, products, tolerance: 1e-9, method, ..EigsOptions::default() }
}

fn found(assembled: &Assembled, part: Part, options: &EigsOptions) -> Eigs {
    eigs(&mut assembled.operator(part, 0), options).expect("the process finds pairs")
}

/// As [`found`], with all products within the device.
fn found_within(assembled: &Assembled, part: Part, options: &EigsOptions) -> Eigs {
    let mut operator = Watched::new(assembled.operator(part, 0));
    let found = eigs(&mut operator, options).expect("the process finds pairs");
    assert_eq!(
        (operator.within, operator.with_host),
        (found.stats.products + found.confirming, 0),
        "the vectors stay on the device"
    );
    // A restart reads the basis.
    if options.max_basis.is_none() {
        let read = operator.read.load(Ordering::Relaxed);
        assert_eq!(read, found.vectors.len(), "only the vectors of the answer come back");
    }
    found
}

/// Every number of an answer that the process computes.
fn bits(found: &Eigs) -> Vec<u64> {
    let numbers = [&found.values, &found.residuals, &found.bounds].into_iter().chain(&found.vectors);
    let history = found.history.iter().flat_map(|row| [&row.values, &row.residuals]);
    numbers.chain(history).flatten().map(|value| value.to_bits()).collect()
}

/// The converged pairs of two runs are those of one matrix: each value is within its bound of an eigenvalue.
fn assert_same(host: &Eigs, device: &Eigs, what: &str) {
    assert_eq!(
        (host.stats.status, host.statuses.len()),
        (device.stats.status, device.statuses.len()),
        "{what}"
    );
    let mut compared = 0;
    for pair in 0..host.values.len() {
        if [host, device].iter().any(|found| found.statuses[pair] != PairStatus::Converged) {
            continue;
        }
        let apart = (host.values[pair] - device.values[pair]).abs();
        let rounding = 100.0 * f64::EPSILON * host.values[0].abs();
        let bound = host.bounds[pair] + device.bounds[pair] + rounding;
        assert!(apart <= bound, "{what}, pair {pair}: {apart:e} apart, above {bound:e}");
        compared += 1;
    }
    assert!(compared > 0, "{what}: no pair converged");
    // A residual of 1e-6 of the norm, and a gap of at least a hundredth of it: the angle is below 1e-4, and there are two of them.
    let cosine = dot(&host.vectors[0], &device.vectors[0]);
    assert!((cosine - 1.0).abs() < 2e-8, "{what}: {cosine}");
}

#[test]
fn every_process_finds_on_the_device_what_it_finds_on_the_host() {
    for (name, size) in [("corner", 16), ("cornell", 32), ("zigzag", 48)] {
        let part = Part::Global;
        let (tracer, mut assembled) = scene(name, size);
        let cases = [
            asked(EigsMethod::Lanczos, 60),
            asked(EigsMethod::Arnoldi, 60),
            EigsOptions { tolerance: 1e-6, ..asked(EigsMethod::BlockLanczos { block: 2 }, 120) },
            EigsOptions { tolerance: 1e-6, max_basis: Some(30), ..asked(EigsMethod::Lanczos, 120) },
        ];
        let on_host: Vec<Eigs> = cases.iter().map(|options| found(&assembled, part, options)).collect();
        // A known pair that is projected out, and the first one of the others.
        let deflate = vec![on_host[0].vectors[0].clone()];
        let others = EigsOptions { deflate, ..asked(EigsMethod::Lanczos, 60) };
        let others_on_host = found(&assembled, part, &others);

        assembled.place(&tracer, Backend::Gpu).expect("software Vulkan has f64");
        let room = assembled.operator(part, 0).vectors(8, None).expect("the device works");
        assert!(room.is_some_and(|vectors| vectors.rows() == size * size), "vectors are on the device");
        for (options, host) in cases.iter().zip(&on_host) {
            let what = format!("{name}, {:?}", options.method);
            let device = found_within(&assembled, part, options);
            assert_same(host, &device, &what);
            assert_eq!(bits(&device), bits(&found(&assembled, part, options)), "{what}: the same bits again");
        }
        assert_same(&others_on_host, &found_within(&assembled, part, &others), "without a known pair");
    }
}

#[test]
fn a_confirmation_on_the_device_finds_what_the_search_has_missed() {
    let (tracer, mut assembled) = scene("cornell", 32);
    let part = Part::Global;
    let all = found(&assembled, part, &asked(EigsMethod::Lanczos, 60));
    let mut incomplete = all.clone();
    incomplete.completeness = Completeness::NotExcluded;
    let numbers = [&mut incomplete.values, &mut incomplete.imaginary_values, &mut incomplete.residuals];
    let errors = [&mut incomplete.standard_errors, &mut incomplete.bounds, &mut incomplete.gap_bounds];
    for numbers in numbers.into_iter().chain(errors) {
        numbers.remove(1);
    }
    drop((
        incomplete.vectors.remove(1),
        incomplete.imaginary_vectors.remove(1),
        incomplete.statuses.remove(1),
    ));
    assembled.place(&tracer, Backend::Gpu).expect("software Vulkan has f64");
    let options = EigsOptions { count: 3, ..asked(EigsMethod::Lanczos, 60) };
    // The few steps of a large share do not resolve the missed pair. More steps follow, for which the memory has no room.
    for (share, leaves) in [(0.01, false), (0.4, true)] {
        let mut operator = Watched::new(assembled.operator(part, 0));
        let mut found = incomplete.clone();
        confirm(&mut operator, &mut found, &options, &Confirm { share, ..Confirm::default() })
            .expect("products are free");
        assert!(operator.within > 8 && (operator.with_host > 0) == leaves, "{share}: {}", operator.with_host);
        assert_eq!(found.confirming - all.confirming, operator.within + operator.with_host);
        assert!(matches!(found.completeness, Completeness::Confirmed(_)), "{:?}", found.completeness);
        for pair in 0..3 {
            let apart = (found.values[pair] - all.values[pair]).abs();
            assert!(apart <= found.bounds[pair] + all.bounds[pair], "{share}: {apart:e}");
            let cosine = dot(&found.vectors[pair], &all.vectors[pair]);
            assert!((cosine - 1.0).abs() < 1e-8, "{share}, pair {pair}: {cosine}");
        }
    }
}

#[test]
fn a_stopped_process_goes_on_with_the_same_bits() {
    let (tracer, mut assembled) = scene("cornell", 24);
    assembled.place(&tracer, Backend::Gpu).expect("software Vulkan has f64");
    let options = EigsOptions { tolerance: 0.0, ..asked(EigsMethod::Lanczos, 30) };
    let start = Start::default().vector(24 * 24);
    let mut whole = Factorization::lanczos(&start, &[]).expect("a start vector");
    let at_once =
        eigs_from(&mut whole, &mut assembled.operator(Part::Full, 0), &options).expect("30 products");

    let mut stopped = Factorization::lanczos(&start, &[]).expect("a start vector");
    let observer =
        OnStep::new(
            |step: &Step<'_>| {
                if step.done < 11 { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
            },
        );
    let mut operator = assembled.operator(Part::Full, 0);
    let first =
        eigs_from(&mut stopped, &mut Observed::new(&mut operator, &observer), &options).expect("11 products");
    assert_eq!((first.stats.status, first.stats.products), (Status::Stopped, 11));
    let mut saved = Vec::new();
    stopped.save(&mut saved).expect("memory can be written");
    let mut resumed =
        Factorization::load(krylux::krylov::ProcessKind::Lanczos, &saved[..]).expect("undamaged");
    let last = eigs_from(&mut resumed, &mut operator, &options).expect("30 products");
    assert_eq!((&last.values, &last.vectors), (&at_once.values, &at_once.vectors));
    assert_eq!(resumed.basis(), whole.basis());
}

#[test]
fn complex_pairs_are_combined_on_the_device() {
    // As many pixels of the projector as of the camera, and a matrix that is not symmetric.
    let mut tracer = tracer(&load("cornell"));
    let projector = Some(Resolution::new(32, 8));
    let settings = TraceSettings { projector, ..settings(16, 24, 6, 7) };
    let mut assembled = trace(&mut tracer, settings, Channels::Luma);
    assembled.place(&tracer, Backend::Gpu).expect("software Vulkan has f64");
    let options = EigsOptions { count: 12, ..asked(EigsMethod::Arnoldi, 40) };
    let mut operator = Watched::new(assembled.operator(Part::Full, 0));
    let found = eigs(&mut operator, &options).expect("the process finds pairs");
    assert_eq!((operator.within, operator.with_host), (40, 0));
    let product = |x: &[f64]| {
        let mut y = vec![0.0; x.len()];
        assembled.operator(Part::Full, 0).apply(x, &mut y).expect("a product");
        y
    };
    let mut complex = 0;
    for (pair, imaginary) in found.imaginary_vectors.iter().enumerate() {
        let (real, a, b) = (&found.vectors[pair], found.values[pair], found.imaginary_values[pair]);
        let zeros = vec![0.0; real.len()];
        let imaginary = if imaginary.is_empty() { &zeros } else { imaginary };
        complex += usize::from(b != 0.0);
        // A (x + iy) − (a + ib)(x + iy)
        let [ax, ay] = [product(real), product(imaginary)];
        let left = (0..real.len())
            .flat_map(|i| [ax[i] - a * real[i] + b * imaginary[i], ay[i] - a * imaginary[i] - b * real[i]]);
        let residual = norm(&left.collect::<Vec<f64>>());
        let apart = (residual - found.residuals[pair]).abs();
        // Rounding of 40 coefficients and of sums over 256 pixels.
        assert!(apart < 1e-12 * found.values[0], "pair {pair}: {residual:e} {:e}", found.residuals[pair]);
    }
    assert!(complex >= 2, "{:?}", found.imaginary_values);
    assert_eq!(
        operator.read.load(Ordering::Relaxed),
        12 + complex,
        "only the vectors of the answer come back"
    );
}

#[test]
fn a_factorization_is_whole_after_refused_options_and_after_a_panic() {
    let (_, assembled) = scene("corner", 8);
    let mut operator = assembled.operator(Part::Full, 0);
    let mut process = Factorization::lanczos(&Start::default().vector(64), &[]).expect("a start vector");
    eigs_from(&mut process, &mut operator, &asked(EigsMethod::Lanczos, 5)).expect("5 products");
    let before = saved(&process);
    let none = EigsOptions { count: 0, ..asked(EigsMethod::Lanczos, 12) };
    assert!(eigs_from(&mut process, &mut operator, &none).is_err());
    assert_eq!(saved(&process), before);
    let observer = OnStep::new(|_: &Step<'_>| unreachable!("an observer of a user panics"));
    let mut observed = Observed::new(&mut operator, &observer);
    let options = asked(EigsMethod::Lanczos, 12);
    let work = || eigs_from(&mut process, &mut observed, &options);
    let panicked = std::panic::catch_unwind(std::panic::AssertUnwindSafe(work));
    assert!(panicked.is_err());
    assert_eq!(
        (process.steps(), process.basis().len()),
        (6, 6),
        "with the step of the observer that panicked"
    );
    eigs_from(&mut process, &mut operator, &options).expect("12 products");
}

#[test]
fn a_whole_space_is_spanned_on_the_device() {
    let (tracer, mut assembled) = scene("corner", 4);
    assembled.place(&tracer, Backend::Gpu).expect("software Vulkan has f64");
    for method in [EigsMethod::Lanczos, EigsMethod::BlockLanczos { block: 2 }] {
        let options = EigsOptions { count: 16, tolerance: 0.0, ..asked(method, 30) };
        let device = found_within(&assembled, Part::Full, &options);
        assert_eq!(device.stats.status, Status::SpaceExhausted);
        assert!(device.vectors.len() == 16 && device.residuals.iter().all(|residual| *residual < 1e-13));
    }
}

/// A matrix that counts its products, and whose vectors fail when their calls are used up.
struct Watched<'a> {
    inner: MatrixOperator<'a>,
    within: usize,
    with_host: usize,
    /// The product within the device that ends with an interruption.
    interrupted: Option<usize>,
    calls: Arc<AtomicUsize>,
    /// The number of vectors that came back to the host.
    read: Arc<AtomicUsize>,
}

impl<'a> Watched<'a> {
    fn new(inner: MatrixOperator<'a>) -> Self {
        Self {
            inner,
            within: 0,
            with_host: 0,
            interrupted: None,
            calls: Arc::new(AtomicUsize::new(usize::MAX)),
            read: Arc::default(),
        }
    }
}

impl Operator for Watched<'_> {
    fn rows(&self) -> usize {
        self.inner.rows()
    }

    fn cols(&self) -> usize {
        self.inner.cols()
    }

    fn symmetry(&self) -> Symmetry {
        self.inner.symmetry()
    }

    fn apply(&mut self, x: &[f64], y: &mut [f64]) -> Result<()> {
        self.with_host += 1;
        self.inner.apply(x, y)
    }

    fn confirming(&mut self, on: bool) -> bool {
        self.inner.confirming(on)
    }

    fn vectors(&self, columns: usize, selection: Option<Selection<'_>>) -> Result<Option<Box<dyn Vectors>>> {
        let inner = self.inner.vectors(columns, selection)?;
        let limited = |inner| Limited { inner, calls: self.calls.clone(), read: self.read.clone() };
        Ok(inner.map(|inner| Box::new(limited(inner)) as Box<dyn Vectors>))
    }

    fn apply_within(&mut self, vectors: &mut dyn Vectors, column: usize, direction: Direction) -> Result<()> {
        self.within += 1;
        let limited =
            (vectors as &mut dyn Any).downcast_mut::<Limited>().expect("the vectors that were made");
        limited.call()?;
        self.inner.apply_within(&mut *limited.inner, column, direction)?;
        if self.interrupted == Some(self.within) { Err(Error::Interrupted) } else { Ok(()) }
    }
}

impl Adjoint for Watched<'_> {
    fn apply_adjoint(&mut self, y: &[f64], x: &mut [f64]) -> Result<()> {
        self.with_host += 1;
        self.inner.apply_adjoint(y, x)
    }
}

struct Limited {
    inner: Box<dyn Vectors>,
    calls: Arc<AtomicUsize>,
    read: Arc<AtomicUsize>,
}

impl Limited {
    fn call(&self) -> Result<()> {
        let left = self.calls.load(Ordering::Relaxed);
        self.calls.store(left.saturating_sub(1), Ordering::Relaxed);
        if left == 0 { Err(Error::device("the device was lost")) } else { Ok(()) }
    }
}

impl Vectors for Limited {
    fn rows(&self) -> usize {
        self.inner.rows()
    }

    fn columns(&self) -> usize {
        self.inner.columns()
    }

    fn column(&self, index: usize) -> Result<Cow<'_, [f64]>> {
        self.call()?;
        self.read.fetch_add(1, Ordering::Relaxed);
        self.inner.column(index)
    }

    fn work(&self) -> Result<Cow<'_, [f64]>> {
        self.call()?;
        self.read.fetch_add(1, Ordering::Relaxed);
        self.inner.work()
    }

    fn load(&mut self, x: &[f64]) -> Result<()> {
        self.call()?;
        self.inner.load(x)
    }

    fn clear(&mut self) {
        self.inner.clear();
    }

    fn push(&mut self, divisor: f64) -> Result<()> {
        self.call()?;
        self.inner.push(divisor)
    }

    fn remove(&mut self, h: &[f64]) -> Result<()> {
        self.call()?;
        self.inner.remove(h)
    }

    fn combine(&mut self, to: Option<usize>, terms: &[(f64, Option<usize>)], divisor: f64) -> Result<()> {
        self.call()?;
        self.inner.combine(to, terms, divisor)
    }

    fn keep(&mut self, index: usize) -> Result<()> {
        self.call()?;
        self.inner.keep(index)
    }

    fn scale_by(&mut self, index: usize) -> Result<()> {
        self.call()?;
        self.inner.scale_by(index)
    }

    fn clip_by(&mut self, index: usize, bounds: (f64, f64)) -> Result<()> {
        self.call()?;
        self.inner.clip_by(index, bounds)
    }

    fn dots_and_norm(&mut self, first: usize) -> Result<Sums> {
        self.call()?;
        self.inner.dots_and_norm(first)
    }

    fn remove_and_dot(&mut self, h: &[f64]) -> Result<Sums> {
        self.call()?;
        self.inner.remove_and_dot(h)
    }

    fn settle_and_dot(&mut self, settling: &Settling<'_>) -> Result<Sums> {
        self.call()?;
        self.inner.settle_and_dot(settling)
    }

    fn product(&self) -> Result<Product> {
        self.call()?;
        self.inner.product()
    }
}

fn saved(process: &Factorization) -> Vec<u8> {
    let mut saved = Vec::new();
    process.save(&mut saved).expect("memory can be written");
    saved
}

#[test]
fn a_device_that_fails_at_any_call_leaves_the_last_state_that_is_whole() {
    let (tracer, mut assembled) = scene("corner", 8);
    assembled.place(&tracer, Backend::Gpu).expect("software Vulkan has f64");
    let mut operator = assembled.operator(Part::Full, 0);
    let options = EigsOptions { tolerance: 0.0, ..asked(EigsMethod::Lanczos, 5) };
    let mut process = Factorization::lanczos(&Start::default().vector(64), &[]).expect("a start vector");
    eigs_from(&mut process, &mut operator, &options).expect("5 products");
    let before = saved(&process);
    let options = EigsOptions { products: 12, ..options };
    let mut whole = process.clone();
    eigs_from(&mut whole, &mut operator, &options).expect("12 products");
    let mut failures = 0;
    for calls in 0.. {
        let mut watched = Watched::new(assembled.operator(Part::Full, 0));
        watched.calls.store(calls, Ordering::Relaxed);
        let mut failing = process.clone();
        match eigs_from(&mut failing, &mut watched, &options) {
            Ok(_) => {
                assert!(saved(&failing) == saved(&whole), "enough calls give the whole process");
                break;
            }
            Err(error) => assert!(error.to_string().contains("the device was lost"), "{error}"),
        }
        assert!(saved(&failing) == before, "failure of call {calls}");
        failures += 1;
    }
    // Seven steps of at least four calls, and the copies there and back.
    assert!(failures > 28 + 12, "{failures}");
    eigs_from(&mut process, &mut operator, &options).expect("the device works again");
    assert!(saved(&process) == saved(&whole));
}

/// An observer that ends a run at a photo, or never.
struct Until(usize, AtomicUsize);

impl Observer for Until {
    fn photo(&self, _: &PhotoTaken<'_>) -> ControlFlow<()> {
        let seen = self.1.fetch_add(1, Ordering::Relaxed) + 1;
        if seen == self.0 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}

#[test]
fn a_laboratory_shows_and_counts_the_photos_within_the_device() {
    let open = |backend: Backend, until: usize| {
        let seen = Arc::new(Until(until, AtomicUsize::new(0)));
        let mut settings = Settings::default();
        settings.operator.backend = backend;
        let builder =
            Lab::builder("assets/scenes/corner/scene.glb").settings(settings).size(16, 16).samples(24);
        (builder.observer(seen.clone()).open().expect("the scene is there"), seen)
    };
    let options = asked(EigsMethod::Lanczos, 40);
    let [(on_host, _), (on_device, seen)] = [Backend::Cpu, Backend::Gpu].map(|backend| {
        let (mut lab, seen) = open(backend, usize::MAX);
        let mut operator = lab.operator(Part::Global).expect("the scene is traced");
        assert_eq!(operator.vectors(2, None).expect("the device works").is_some(), backend == Backend::Gpu);
        let found = eigs(&mut operator, &options).expect("the process finds pairs");
        assert_eq!(operator.photos(), found.stats.products);
        (found, seen)
    });
    assert_same(&on_host, &on_device, "a laboratory");
    assert_eq!(seen.1.load(Ordering::Relaxed), on_device.stats.products);
    let (mut lab, _) = open(Backend::Gpu, 3);
    let mut operator = lab.operator(Part::Global).expect("the scene is traced");
    let stopped = eigs(&mut operator, &options).expect_err("the third photo ends the run");
    assert!(matches!(stopped, Error::Interrupted) && operator.photos() == 3, "{stopped}");
}

#[test]
fn a_segmentation_keeps_its_vectors_on_the_device() {
    for (name, size, groups, mask_below) in
        [("corner", 16, 2, 0.0), ("zigzag", 32, 2, 0.3), ("nine-cells", 48, 9, 0.01)]
    {
        let (tracer, mut assembled) = scene(name, size);
        let resolution = Some(Resolution::new(size, size));
        let options =
            SegmentOptions { groups: vec![groups], mask_below, resolution, ..SegmentOptions::default() };
        let segmented = |operator: &mut dyn Operator| {
            let mut capture = Capture::new(options.clone()).expect("good options");
            capture.run(operator).expect("the photos are taken");
            (capture.photos(), capture.segmentation().expect("there are eigenvectors"))
        };
        let (photos, host) = segmented(&mut assembled.operator(Part::Global, 0));
        assembled.place(&tracer, Backend::Gpu).expect("software Vulkan has f64");
        let mut watched = Watched::new(assembled.operator(Part::Global, 0));
        let (photos_within, device) = segmented(&mut watched);
        // White, and the pattern of the mask if it hides light.
        assert!(watched.with_host <= 2 && watched.within > 8, "{name}: {}", watched.with_host);
        assert_eq!(photos, photos_within, "{name}");
        let [labels, others] = [&host, &device].map(|found| &found.labels[0].1);
        let apart = labels.iter().zip(others).filter(|(host, device)| host != device).count();
        assert!(apart <= labels.len() / 500, "{name}: {apart} pixels are in other groups");
        for (host, device) in host.eigenvalues.iter().zip(&device.eigenvalues) {
            // The tolerance of a segmentation's eigenvalues.
            assert!((host - device).abs() < 1e-3 * host.abs(), "{name}: {host} {device}");
        }
        let (_, again) = segmented(&mut assembled.operator(Part::Global, 0));
        assert_eq!(device.eigenvalues, again.eigenvalues, "{name}: the same bits again");
    }
}

/// A laboratory with a run's folder.
fn lab_in(folder: &Path, backend: Backend, resume: bool, observer: impl Into<SharedObserver>) -> Lab {
    let mut settings = Settings::default();
    settings.operator.backend = backend;
    let builder = Lab::builder("assets/scenes/cornell/scene.glb").settings(settings).size(24, 24).samples(24);
    builder.run(run_options(folder, resume)).observer(observer).open().expect("the scene is there")
}

fn run_options(folder: &Path, resume: bool) -> RunOptions {
    RunOptions { folder: Some(folder.to_path_buf()), resume, ..RunOptions::default() }
}

/// Keeps what a laboratory says.
#[derive(Default)]
struct Listener(Mutex<String>);

impl Observer for Listener {
    fn log(&self, _: Level, message: &str) {
        self.0.lock().expect("no test fails while it listens").push_str(message);
    }
}

#[test]
fn the_photos_of_a_run_on_the_device_answer_a_machine_without_it() {
    let folder = tempfile::tempdir().expect("a temporary folder can be made");
    let run = folder.path().join("run");
    let mut options = asked(EigsMethod::Lanczos, 40);
    let on_device = {
        let mut lab = lab_in(&run, Backend::Gpu, false, Arc::new(Listener::default()));
        let mut operator = lab.operator(Part::Global).expect("the scene is traced");
        assert!(operator.vectors(2, None).expect("the device works").is_some());
        eigs(&mut operator, &options).expect("the process finds pairs")
    };
    let asked_again = |options: &EigsOptions| {
        let heard = Arc::new(Listener::default());
        let mut lab = Lab::builder(&run).observer(heard.clone()).open().expect("the run is whole");
        let mut operator = lab.operator(Part::Global).expect("the photos are there");
        let found = eigs(&mut operator, options).expect("the photos answer");
        let said = heard.0.lock().expect("no other thread").clone();
        (found, said)
    };
    let (again, said) = asked_again(&options);
    assert!(!said.contains("model"), "{said}");
    assert_same(&on_device, &again, "without the scene");
    assert!(matches!(on_device.completeness, Completeness::Confirmed(_)), "{}", on_device.completeness);
    assert_eq!((on_device.completeness, on_device.confirming), (again.completeness, again.confirming));
    for (device, again) in on_device.vectors.iter().zip(&again.vectors) {
        // Both are pairs of the same photos, so they differ by rounding and not by their residuals.
        assert!(device.iter().zip(again).all(|(a, b)| (a - b).abs() < 1e-9), "the same vectors");
    }
    // Another start leaves the span of the photos, and a model answers.
    options.start = Start::Random { seed: 77 };
    assert!(asked_again(&options).1.contains("model"));
}

#[test]
fn a_segmentation_on_the_device_answers_a_machine_without_it() {
    let folder = tempfile::tempdir().expect("a temporary folder can be made");
    let run = folder.path().join("run");
    let segmented = |lab: &mut Lab| {
        let resolution = Some(Resolution::new(24, 24));
        let options = SegmentOptions { groups: vec![2], photos: 24, resolution, ..SegmentOptions::default() };
        let mut capture = Capture::new(options).expect("good options");
        let mut operator = lab.operator(Part::Global).expect("there is light");
        capture.run(&mut operator).expect("the photos are taken");
        capture.segmentation().expect("there are eigenvectors")
    };
    let on_device = segmented(&mut lab_in(&run, Backend::Gpu, false, Arc::new(Listener::default())));
    assert!(on_device.regions.unseen.completeness.is_known(), "{:?}", on_device.regions.unseen);
    let heard = Arc::new(Listener::default());
    let again = segmented(&mut Lab::builder(&run).observer(heard.clone()).open().expect("the run is whole"));
    let said = heard.0.lock().expect("no other thread").clone();
    assert!(!said.contains("model"), "{said}");
    assert_eq!(on_device.regions.unseen, again.regions.unseen);
    assert_eq!(on_device.labels, again.labels);
}

#[test]
fn the_photos_of_a_solver_on_the_device_answer_a_machine_without_it() {
    let b: Vec<f64> = (0..24 * 24).map(|i| 0.2 + (i as f64 * 0.37).sin().abs()).collect();
    let options = SolveOptions { products: 25, rtol: 1e-3, ..SolveOptions::default() };
    for method in RESIDENT.into_iter().chain(BOXED) {
        let folder = tempfile::tempdir().expect("a temporary folder can be made");
        let run = folder.path().join("run");
        let on_device = {
            let mut lab = lab_in(&run, Backend::Gpu, false, Arc::new(Listener::default()));
            let mut operator = lab.operator(Part::Full).expect("the scene is traced");
            solve(method, &mut operator, &b, &options).expect("the photos are taken")
        };
        let heard = Arc::new(Listener::default());
        let mut lab = Lab::builder(&run).observer(heard.clone()).open().expect("the run is whole");
        let mut operator = lab.operator(Part::Full).expect("the photos are there");
        let again = solve(method, &mut operator, &b, &options).expect("the photos answer");
        let said = heard.0.lock().expect("no other thread").clone();
        assert!(!said.contains("model"), "{method:?}: {said}");
        assert_eq!(on_device.stats, again.stats, "{method:?}");
        assert!((on_device.residual - again.residual).abs() < 1e-12, "{method:?}");
    }
}

#[test]
fn singular_values_of_a_run_on_the_device_answer_a_machine_without_it() {
    let folder = tempfile::tempdir().expect("a temporary folder can be made");
    let run = folder.path().join("run");
    let options = SingularOptions { count: 1, products: 60, tolerance: 1e-4, ..SingularOptions::default() };
    let on_device = {
        let mut lab = lab_in(&run, Backend::Gpu, false, Arc::new(Listener::default()));
        let mut operator = lab.operator(Part::Global).expect("the scene is traced");
        singular(&mut operator, &options).expect("the photos are taken")
    };
    let heard = Arc::new(Listener::default());
    let mut lab = Lab::builder(&run).observer(heard.clone()).open().expect("the run is whole");
    let mut operator = lab.operator(Part::Global).expect("the photos are there");
    let again = singular(&mut operator, &options).expect("the photos answer");
    let said = heard.0.lock().expect("no other thread").clone();
    assert!(!said.contains("model"), "{said}");
    assert_eq!(on_device.stats, again.stats);
    assert!(on_device.confirming > 0 && on_device.completeness.is_known(), "{}", on_device.completeness);
    assert_eq!((on_device.completeness, on_device.confirming), (again.completeness, again.confirming));
    for (device, again) in on_device.values.iter().zip(&again.values) {
        assert!((device - again).abs() < 1e-12 * device, "rounding of the same photos: {device} {again}");
    }
}

#[test]
fn a_run_on_the_device_that_was_stopped_goes_on_to_the_same_bits() {
    let folder = tempfile::tempdir().expect("a temporary folder can be made");
    let options = asked(EigsMethod::Lanczos, 30);
    let take = |name: &str, backend: Backend, resume: bool, until: usize| {
        let observer = Arc::new(Until(until, AtomicUsize::new(0)));
        let mut lab = lab_in(&folder.path().join(name), backend, resume, observer);
        let mut operator = lab.operator(Part::Global).expect("the scene is traced");
        let is_within = operator.vectors(2, None).expect("the device works").is_some();
        eigs(&mut operator, &options).map(|found| (found, is_within))
    };
    let (whole, is_within) = take("whole", Backend::Gpu, false, usize::MAX).expect("30 photos");
    assert!(is_within);
    for (name, begins, goes_on_within) in
        [("stopped", Backend::Gpu, true), ("begun on the host", Backend::Cpu, false)]
    {
        assert!(matches!(take(name, begins, false, 9), Err(Error::Interrupted)));
        let (resumed, is_within) = take(name, Backend::Gpu, true, usize::MAX).expect("the other photos");
        assert_eq!(is_within, goes_on_within, "{name}");
        assert!(!goes_on_within || bits(&whole) == bits(&resumed), "{name}: the same bits");
        assert_same(&whole, &resumed, name);
    }
    let photos = |name: &str| {
        let journal = Journal::read_only(&folder.path().join(name).join("journal")).expect("a journal");
        let keys: Vec<_> = journal
            .entries()
            .iter()
            .filter(|entry| entry.kind == Kind::Photo)
            .map(|entry| entry.key)
            .collect();
        keys
    };
    assert_eq!(photos("whole"), photos("stopped"), "no photo is kept twice");
    assert_eq!(photos("whole").len(), photos("begun on the host").len());
}

/// A right-hand side with a solution, the photo of a ramp.
fn photo_of_a_ramp(assembled: &Assembled) -> Vec<f64> {
    let n = assembled.matrix.resolution().pixels();
    let ramp: Vec<f64> = (0..n).map(|i| 0.2 + (i as f64 * 0.37).sin().abs()).collect();
    let mut b = vec![0.0; n];
    assembled.matrix.apply(Part::Full, 0, &ramp, &mut b);
    b
}

/// `‖b − A x‖ / ‖b‖`, by a product on the processor.
fn true_residual(assembled: &Assembled, x: &[f64], b: &[f64]) -> f64 {
    let mut photo = vec![0.0; b.len()];
    assembled.matrix.apply(Part::Full, 0, x, &mut photo);
    let misfit: Vec<f64> = b.iter().zip(&photo).map(|(b, y)| b - y).collect();
    norm(&misfit) / norm(b)
}

/// The methods whose vectors may be on the device.
const RESIDENT: [Method; 7] =
    [Method::Gmres, Method::Minres, Method::Cg, Method::Cgs, Method::BiCgStab, Method::Lsqr, Method::Lsmr];

/// The methods with bounds whose vectors may be on the device.
const BOXED: [Method; 2] = [Method::Jacobi, Method::Fista];

/// The number of products that a method takes with the host: the white photo, and the residual of a first iterate.
fn products_with_the_host(method: Method, options: &SolveOptions) -> usize {
    if BOXED.contains(&method) {
        1 + usize::from(options.diagonal.is_none())
    } else {
        usize::from(options.x0.is_some())
    }
}

#[test]
fn every_solver_finds_on_the_device_what_it_finds_on_the_host() {
    for (name, size) in [("corner", 16), ("cornell", 32), ("zigzag", 48)] {
        let (tracer, mut assembled) = scene(name, size);
        let b = photo_of_a_ramp(&assembled);
        let whole = SolveOptions { products: 24, rtol: 1e-7, ..SolveOptions::default() };
        let begun = SolveOptions { x0: Some(vec![0.5; b.len()]), ..whole.clone() };
        let mut cases = vec![(Method::Gmres, SolveOptions { restart: Some(7), ..whole.clone() })];
        cases.extend(METHODS.map(|MethodFacts { method, .. }| (method, whole.clone())));
        cases.extend(RESIDENT.into_iter().chain(BOXED).map(|method| (method, begun.clone())));
        let given = SolveOptions { diagonal: Some(vec![0.7; b.len()]), upper: 0.9, ..whole.clone() };
        cases.extend(BOXED.map(|method| (method, given.clone())));
        let entries = (0..b.len()).map(|i| 1.5 + (i as f64 * 0.2).cos()).collect();
        let diagonal = Arc::new(Diagonal::new(entries).expect("positive entries"));
        let preconditioned = SolveOptions { preconditioner: Some(diagonal), ..whole };
        cases.extend(RESIDENT.map(|method| (method, preconditioned.clone())));
        let solved = |operator: &mut dyn Operator, method, options: &SolveOptions| {
            solve(method, operator, &b, options).expect("the products are taken")
        };
        let on_host = |(method, options): &(Method, SolveOptions)| {
            solved(&mut assembled.operator(Part::Full, 0), *method, options)
        };
        let on_host: Vec<Solution> = cases.iter().map(on_host).collect();
        assembled.place(&tracer, Backend::Gpu).expect("software Vulkan has f64");
        for ((method, options), host) in cases.iter().zip(&on_host) {
            let what = format!("{name}, {method:?}");
            let mut watched = Watched::new(assembled.operator(Part::Full, 0));
            let device = solved(&mut watched, *method, options);
            if RESIDENT.contains(method) || BOXED.contains(method) {
                assert_eq!(watched.with_host, products_with_the_host(*method, options), "{what}");
            }
            assert_eq!(watched.within + watched.with_host, device.stats.products, "{what}");
            assert_eq!(
                (device.stats.status, device.stats.products),
                (host.stats.status, host.stats.products),
                "{what}"
            );
            // Rounding of products and sums, relative to 1. The iteration of a box problem ends at steps of 1e-6.
            assert!((true_residual(&assembled, &device.x, &b) - device.residual).abs() < 1e-12, "{what}");
            let bound = if *method == Method::KrylovBox { 1e-6 } else { 1e-12 };
            assert!((device.residual - host.residual).abs() < bound, "{what}");
            if size > 32 {
                continue;
            }
            let again = solved(&mut assembled.operator(Part::Full, 0), *method, options);
            assert_eq!(
                (&device.x, &device.history),
                (&again.x, &again.history),
                "{what}: the same bits again"
            );
        }
    }
}

#[test]
fn methods_with_the_transpose_find_on_the_device_what_they_find_on_the_host() {
    // As many pixels of the projector as of the camera, and a matrix that is not symmetric.
    let mut tracer = tracer(&load("cornell"));
    let projector = Some(Resolution::new(32, 8));
    let settings = TraceSettings { projector, ..settings(16, 24, 6, 7) };
    let mut assembled = trace(&mut tracer, settings, Channels::Luma);
    let b: Vec<f64> = (0..256).map(|i| 0.2 + (i as f64 * 0.37).sin().abs()).collect();
    let options = SolveOptions { products: 9, rtol: 0.0, upper: 1e3, ..SolveOptions::default() };
    let of = SingularOptions { count: 2, tolerance: 1e-6, products: 60, ..SingularOptions::default() };
    let methods = [Method::Lsqr, Method::Lsmr, Method::Fista];
    let solved = |operator: &mut dyn Adjoint, method| solve_adjoint(method, operator, &b, &options);
    let on_host =
        methods.map(|method| solved(&mut assembled.operator(Part::Full, 0), method).expect("9 products"));
    let host = singular(&mut assembled.operator(Part::Full, 0), &of).expect("the products are taken");
    assembled.place(&tracer, Backend::Gpu).expect("software Vulkan has f64");
    for (method, host) in methods.into_iter().zip(&on_host) {
        let mut watched = Watched::new(assembled.operator(Part::Full, 0));
        let device = solved(&mut watched, method).expect("9 products");
        let with_host = products_with_the_host(method, &options);
        assert_eq!((watched.within, watched.with_host), (9 - with_host, with_host), "{method:?}");
        // Before the residual of a first iterate is known, it is infinite.
        let known = |(host, _): &(&SolveRow, &SolveRow)| host.residual.is_finite();
        for (host, device) in host.history.iter().zip(&device.history).filter(known) {
            // Rounding of products and sums, relative to 1. Later steps multiply it, because both methods lose orthogonality.
            let apart = (host.residual - device.residual).abs();
            assert!(apart < 1e-12, "{method:?}, product {}: {apart:e}", host.products);
        }
        assert!(device.residual < 0.9, "{method:?}: {}", device.residual);
    }
    let found = || {
        let mut watched = Watched::new(assembled.operator(Part::Full, 0));
        let found = singular(&mut watched, &of).expect("the products are taken");
        let products = found.stats.products + found.confirming;
        assert_eq!((watched.within, watched.with_host), (products, 0));
        let read = watched.read.load(Ordering::Relaxed);
        assert_eq!(read, found.left.len() + found.right.len(), "only the vectors of the answer come back");
        found
    };
    let device = found();
    assert_eq!((host.stats, host.confirming), (device.stats, device.confirming));
    assert_eq!(device.stats.status, Status::ReachedTolerance);
    assert!(device.confirming > 0 && device.disagreement < 1e-14, "{:e}", device.disagreement);
    for pair in 0..2 {
        let apart = (host.values[pair] - device.values[pair]).abs();
        let rounding = 100.0 * f64::EPSILON * host.values[0];
        assert!(apart <= host.residuals[pair] + device.residuals[pair] + rounding, "pair {pair}: {apart:e}");
        // `A v = σ u` to the stated residual, by a product on the processor.
        let mut photo = vec![0.0; b.len()];
        assembled.matrix.apply(Part::Full, 0, &device.right[pair], &mut photo);
        photo.iter_mut().zip(&device.left[pair]).for_each(|(y, u)| *y -= device.values[pair] * u);
        let stated = std::f64::consts::SQRT_2 * device.residuals[pair];
        assert!(norm(&photo) <= stated + 1e-12 * device.values[0], "pair {pair}: {:e}", norm(&photo));
    }
    let again = found();
    assert!(again.right == device.right && again.left == device.left, "the same bits again");
}

#[test]
fn the_left_vectors_of_a_dark_operator_need_no_room_on_the_device() {
    let (tracer, mut assembled) = scene("corner", 4);
    assembled.place(&tracer, Backend::Gpu).expect("software Vulkan has f64");
    // The right vectors span the space, and as many left vectors follow.
    for products in [20, usize::MAX] {
        let options = SingularOptions { count: 3, products, ..SingularOptions::default() };
        let mut dark = Times(assembled.operator(Part::Full, 0), 0.0);
        let found = singular(&mut ForwardOnly(&mut dark), &options).expect("there is room");
        assert_eq!((found.stats.status, found.values), (Status::SpaceExhausted, vec![0.0; 3]));
        assert!(found.left.iter().all(|left| (norm(left) - 1.0).abs() < 1e-14));
    }
}

#[test]
fn solvers_go_on_after_more_products_are_allowed_and_after_their_device_failed() {
    let (tracer, mut assembled) = scene("cornell", 16);
    let b = photo_of_a_ramp(&assembled);
    assembled.place(&tracer, Backend::Gpu).expect("software Vulkan has f64");
    let with = |products| SolveOptions { products, rtol: 1e-9, restart: Some(9), ..SolveOptions::default() };
    // GMRES that has room only for its first products moves its basis to the host.
    let mut cases = vec![(Method::Gmres, 6, [6, 40], 3), (Method::Gmres, 40, [6, 40], 30)];
    cases.extend(RESIDENT[1..].iter().map(|&method| (method, 9, [3, 9], 40)));
    cases.extend(BOXED.map(|method| (method, 12, [5, 12], 40)));
    // During the upload.
    cases.extend(BOXED.map(|method| (method, 5, [2, 5], 15)));
    // Without a product before the failure.
    cases.extend(RESIDENT.map(|method| (method, 3, [0, 3], 15)));
    for (method, room, products, fewest) in cases {
        let [options, more] = products.map(with);
        let at_once = solve(method, &mut assembled.operator(Part::Full, 0), &b, &more).expect("the products");
        let mut failures = 0;
        for calls in 0.. {
            let mut watched = Watched::new(assembled.operator(Part::Full, 0));
            let mut solver = method.solver(b.len(), &b, &with(room)).expect("good options");
            if options.products > 0 {
                solve_from(&mut solver, &mut ForwardOnly(&mut watched), &options)
                    .expect("the first products");
            }
            watched.calls.store(calls, Ordering::Relaxed);
            let went_on = solve_from(&mut solver, &mut ForwardOnly(&mut watched), &more);
            watched.calls.store(usize::MAX, Ordering::Relaxed);
            let best = solver.tally().relative(solver.tally().best);
            let found = true_residual(&assembled, &solver.solution(), &b);
            assert!((found - best).abs() < 1e-12, "{method:?}, failure of call {calls}: {found:e} {best:e}");
            match went_on {
                Ok(went_on) => {
                    assert!((went_on.residual - at_once.residual).abs() < 1e-12);
                    assert_eq!(went_on.stats.status, at_once.stats.status);
                    break;
                }
                Err(error) => assert!(error.to_string().contains("the device was lost"), "{error}"),
            }
            let twice = with(2 * more.products);
            let found =
                solve_from(&mut solver, &mut ForwardOnly(&mut watched), &twice).expect("the device is left");
            assert!(
                watched.with_host > 0 && found.residual < 1.01 * at_once.residual.max(more.rtol),
                "{}",
                found.residual
            );
            failures += 1;
        }
        assert!(failures >= fewest, "{method:?}: {failures}");
    }
}

#[test]
fn a_solver_that_was_interrupted_on_the_device_goes_on_to_the_same_bits() {
    let (tracer, mut assembled) = scene("cornell", 16);
    let b = photo_of_a_ramp(&assembled);
    assembled.place(&tracer, Backend::Gpu).expect("software Vulkan has f64");
    let options = SolveOptions { products: 12, rtol: 0.0, ..SolveOptions::default() };
    let diagonal = Arc::new(Diagonal::new(vec![2.0; b.len()]).expect("positive entries"));
    let preconditioned = SolveOptions { preconditioner: Some(diagonal), ..options.clone() };
    let cases = RESIDENT.into_iter().chain(BOXED).map(|method| (method, options.clone()));
    for (method, options) in cases.chain([(Method::Minres, preconditioned)]) {
        let whole = solve(method, &mut assembled.operator(Part::Full, 0), &b, &options).expect("12 products");
        let with_host = products_with_the_host(method, &options);
        for within in [1, 4, 5, 12 - with_host] {
            let product = within + with_host;
            let mut watched = Watched::new(assembled.operator(Part::Full, 0));
            watched.interrupted = Some(within);
            let mut solver = method.solver(b.len(), &b, &options).expect("good options");
            let stopped = solve_from(&mut solver, &mut ForwardOnly(&mut watched), &options);
            assert!(matches!(stopped, Err(Error::Interrupted)), "{method:?}");
            assert_eq!(solver.tally().products, product - 1, "{method:?}");
            let rest = solve_from(&mut solver, &mut ForwardOnly(&mut watched), &options).expect("the others");
            assert_eq!(rest.x, whole.x, "{method:?}, product {product}");
            assert_eq!(rest.history, whole.history[product - 1..], "{method:?}, product {product}");
            assert_eq!(watched.with_host, with_host, "{method:?}");
        }
    }
}

#[test]
fn a_compensation_uses_the_memory_of_the_device() {
    let (tracer, mut assembled) = scene("cornell", 16);
    assembled.place(&tracer, Backend::Gpu).expect("software Vulkan has f64");
    let resolution = Resolution::new(16, 16);
    // No pattern below 1 makes a photo this bright.
    let [target, dark] = [100.0, 0.0].map(|value| Image::filled(resolution, 1, value));
    let target = Target::new(&target, &dark).expect("images of one size");
    let on_host = |method| {
        let options = CompensateOptions { method, photos: 8, ..CompensateOptions::default() };
        let operator = MatrixOperator::new(&assembled.matrix, Part::Full, 0);
        compensate::compensate(&mut [operator], &target, &options).expect("a pattern").least_residual
    };
    for method in [Method::Minres, Method::KrylovBox, Method::Lsqr, Method::Fista] {
        let options = CompensateOptions { method, photos: 8, ..CompensateOptions::default() };
        let mut watched = Watched::new(assembled.operator(Part::Full, 0));
        let found =
            compensate::compensate(&mut [ForwardOnly(&mut watched)], &target, &options).expect("a pattern");
        // The bound comes from products with the transpose.
        let least = [on_host(method), found.least_residual];
        let has_bound = matches!(method, Method::Lsqr | Method::Fista);
        assert_eq!([least[0].is_some(), least[1].is_some()], [has_bound; 2], "{method:?}");
        assert!((least[0].unwrap_or(0.0) - least[1].unwrap_or(0.0)).abs() < 1e-12, "{method:?}: {least:?}");
        let calls = usize::MAX - watched.calls.load(Ordering::Relaxed);
        assert_eq!(watched.within > 0, method != Method::KrylovBox);
        assert!(calls > 50, "{method:?}: {calls} calls of the memory of the device");
    }
}

#[test]
fn krylov_box_solves_its_box_problems_on_the_device_and_goes_on_without_it() {
    for (name, size) in [("corner", 16), ("cornell", 32), ("zigzag", 48)] {
        let (tracer, mut assembled) = scene(name, size);
        // Twice the photo of a ramp is too bright for a pattern below 1 in some pixels, and the dark ones need light below 0.1.
        let b: Vec<f64> = photo_of_a_ramp(&assembled).iter().map(|value| 2.0 * value).collect();
        let mut white = vec![0.0; b.len()];
        assembled.matrix.apply(Part::Full, 0, &vec![1.0; b.len()], &mut white);
        let whole = SolveOptions { products: 14, rtol: 1e-6, ..SolveOptions::default() };
        let cases = [
            SolveOptions { lower: 0.1, ..whole.clone() },
            SolveOptions { upper: f64::INFINITY, x0: Some(vec![0.5; b.len()]), ..whole.clone() },
            SolveOptions { diagonal: Some(white), ..whole },
        ];
        let solved = |operator: &mut dyn Operator, options: &SolveOptions| {
            solve(Method::KrylovBox, operator, &b, options).expect("the products are taken")
        };
        let on_host: Vec<Solution> =
            cases.iter().map(|options| solved(&mut assembled.operator(Part::Full, 0), options)).collect();
        assembled.place(&tracer, Backend::Gpu).expect("software Vulkan has f64");
        for (options, host) in cases.iter().zip(&on_host) {
            let mut watched = Watched::new(assembled.operator(Part::Full, 0));
            let device = solved(&mut watched, options);
            let calls = usize::MAX - watched.calls.load(Ordering::Relaxed);
            assert!(calls > 500, "{name}: {calls} calls of the device's memory");
            assert_eq!(device.stats, host.stats, "{name}");
            let again = solved(&mut assembled.operator(Part::Full, 0), options);
            assert_eq!(
                (&device.x, &device.history),
                (&again.x, &again.history),
                "{name}: the same bits again"
            );
            // The iteration of a box problem ends at steps of 1e-6.
            assert!((device.residual - host.residual).abs() < 1e-6, "{name}");
            for failing in if size == 16 { vec![0, 10, calls / 2, calls - 1] } else { vec![] } {
                let mut watched = Watched::new(assembled.operator(Part::Full, 0));
                watched.calls.store(failing, Ordering::Relaxed);
                let found = solved(&mut watched, options);
                assert_eq!(found.stats, host.stats, "{name}, failure of call {failing}");
                assert!((found.residual - host.residual).abs() < 1e-6, "{name}, failure of call {failing}");
            }
        }
    }
}

/// `2^200 A`, which methods divide by a power of two.
const HUGE: f64 = (1_u128 << 100) as f64 * (1_u128 << 100) as f64;

/// A matrix times a number.
struct Times<'a>(MatrixOperator<'a>, f64);

impl Operator for Times<'_> {
    fn rows(&self) -> usize {
        self.0.rows()
    }

    fn cols(&self) -> usize {
        self.0.cols()
    }

    fn symmetry(&self) -> Symmetry {
        self.0.symmetry()
    }

    fn apply(&mut self, x: &[f64], y: &mut [f64]) -> Result<()> {
        self.0.apply(x, y)?;
        y.iter_mut().for_each(|y| *y *= self.1);
        Ok(())
    }

    fn vectors(&self, columns: usize, selection: Option<Selection<'_>>) -> Result<Option<Box<dyn Vectors>>> {
        self.0.vectors(columns, selection)
    }

    fn apply_within(&mut self, vectors: &mut dyn Vectors, column: usize, direction: Direction) -> Result<()> {
        self.0.apply_within(vectors, column, direction)?;
        let scaled: Vec<f64> = vectors.work()?.iter().map(|w| w * self.1).collect();
        vectors.load(&scaled)
    }
}

#[test]
fn products_beyond_ordinary_size_are_taken_with_the_host() {
    let (tracer, mut assembled) = scene("corner", 16);
    let options = asked(EigsMethod::Lanczos, 40);
    let ordinary = found(&assembled, Part::Global, &options);
    assembled.place(&tracer, Backend::Gpu).expect("software Vulkan has f64");
    let b = photo_of_a_ramp(&assembled);
    let whole = SolveOptions { products: 12, ..SolveOptions::default() };
    for method in RESIDENT {
        let of_ordinary =
            solve(method, &mut assembled.operator(Part::Full, 0), &b, &whole).expect("12 products");
        let mut huge = Times(assembled.operator(Part::Full, 0), HUGE);
        // One product within the device shows that the operator is huge.
        let more = SolveOptions { products: 13, ..whole.clone() };
        let of_huge = solve(method, &mut huge, &b, &more).expect("13 products");
        assert_eq!(of_huge.stats.products, of_ordinary.stats.products + 1, "{method:?}");
        assert!((of_huge.residual - of_ordinary.residual).abs() < 1e-12, "{method:?}");
        let one = SolveOptions { products: 1, ..whole.clone() };
        let of_one = solve(method, &mut huge, &b, &one).expect("one product");
        assert_eq!((of_one.stats.products, of_one.history.len()), (1, 1), "{method:?}");
    }
    let huge = eigs(&mut Times(assembled.operator(Part::Global, 0), HUGE), &options)
        .expect("the process finds pairs");
    for (huge, ordinary) in huge.values.iter().zip(&ordinary.values) {
        assert!((huge / HUGE / ordinary - 1.0).abs() < 1e-9, "{huge:e} {ordinary:e}");
    }
}

#[test]
fn vectors_of_another_operator_are_refused() {
    let (tracer, mut assembled) = scene("corner", 8);
    assembled.place(&tracer, Backend::Gpu).expect("software Vulkan has f64");
    let mut vectors =
        assembled.operator(Part::Full, 0).vectors(2, None).expect("the device works").expect("room");
    let mut closure = Closure::new(64, 64, Symmetry::Symmetric, |x: &[f64], y: &mut [f64]| {
        y.copy_from_slice(x);
        Ok(())
    });
    let error = closure
        .apply_within(&mut *vectors, 0, Direction::Forward)
        .expect_err("a function has no vectors")
        .to_string();
    assert!(error.contains("another operator"), "{error}");
}
