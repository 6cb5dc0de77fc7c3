//! Compensation where photos and patterns have different sizes. Each method solves a square system in place of the rectangular one.

use std::cell::RefCell;
use std::ops::ControlFlow;

use super::run::{Kept, Run, kept};
use crate::error::{Error, Result};
use crate::krylov::{Constraint, ForwardOnly, Method, SolveOptions, SolveRow, Status, norm};
use crate::observer::{Observer, Step};
use crate::operator::{Adjoint, Operator, Relayed, Symmetry, delegate};
use crate::sparse::Mapped;

/// The number of photos of patterns, one after the other, that leave a larger residual than the best one before. The method then ends.
const RISES: usize = 2;

/// Solves `A x = b` for one channel, with `A` of `m × n`, inside the box. A method that takes products with `Aᵀ` solves the least-squares
/// problem itself. Any other method solves `W A x = W b` with the map `W` from camera to projector. That solution is not the least-squares
/// optimum, so the method ends when `‖b − A x‖` rises, and the best pattern of all that were photographed is returned.
pub(super) fn solve(
    run: &mut Run<'_>,
    operator: &mut dyn Adjoint,
    channel: usize,
    method: Method,
    photos: usize,
    keep: bool,
) -> Result<Kept> {
    let facts = method.facts();
    if facts.needs_symmetry || matches!(method, Method::Mrnsd | Method::Multiplicative) {
        let fault = format!(
            "{} is for photos and patterns of one size, and these have {} and {} pixels",
            facts.name,
            operator.rows(),
            operator.cols()
        );
        return Err(
            Error::option("--method", fault).help("use fista, or krylov-box, which takes no transpose")
        );
    }
    let options = SolveOptions {
        products: photos,
        rtol: run.options.rtol,
        lower: run.options.floor,
        upper: 1.0,
        ..SolveOptions::default()
    };
    match facts.needs_transpose {
        true => by_transpose(run, operator, channel, method, options, keep),
        false => by_map(run, operator, channel, method, options, keep),
    }
}

/// The least-squares problem itself, padded with zeros to a square one.
fn by_transpose(
    run: &mut Run<'_>,
    operator: &mut dyn Adjoint,
    channel: usize,
    method: Method,
    mut options: SolveOptions,
    keep: bool,
) -> Result<Kept> {
    let (columns, size) = (operator.cols(), operator.rows().max(operator.cols()));
    let b = padded(&run.b[channel], size);
    let mut square = Padded { operator, size };
    if method == Method::Fista {
        // For A ≥ 0, AᵀA ≤ diag(AᵀA 1). FISTA bounds the curvature by the largest entry L of a diagonal D, with AᵀA ≤ L D. Both hold for
        // this D, whose largest entry is the root of that of AᵀA 1.
        let [mut sums, mut start] = [vec![0.0; size], vec![0.0; size]];
        square
            .apply_adjoint_block(&[&padded(&run.white[channel], size), &b], &mut [&mut sums, &mut start])?;
        run.preparation = 3;
        let root = sums.iter().copied().fold(0.0, f64::max).sqrt();
        if root > 0.0 {
            start.iter_mut().zip(&sums).for_each(|(x, sum)| *x = if *sum > 0.0 { *x / sum } else { 0.0 });
            sums.iter_mut().for_each(|sum| *sum /= root);
            options.diagonal = Some(sums);
            options.x0 = Some(start);
        }
    }
    let mut found = kept(method, &mut square, &b, &options, keep)?;
    found.0.x.truncate(columns);
    found.1.iter_mut().for_each(|answer| answer.truncate(columns));
    Ok(found)
}

/// `W A x = W b`.
fn by_map(
    run: &Run<'_>,
    operator: &mut dyn Adjoint,
    channel: usize,
    method: Method,
    mut options: SolveOptions,
    keep: bool,
) -> Result<Kept> {
    let Some(map) = run.prior.map.get(channel) else {
        let fault = format!(
            "{} takes no transpose, and for photos and patterns of different sizes it needs the map from camera to projector, which is not known",
            method.facts().name
        );
        return Err(Error::option("--method", fault)
            .help("use fista, or give a scene, or a matrix that holds its direct light separately"));
    };
    if method.facts().constraint != Constraint::None {
        options.diagonal = Some(map.times(&run.white[channel]));
    }
    let target = &run.b[channel];
    let [lower, upper] = [options.lower, options.upper];
    let seen = RefCell::new(Seen { target, lower, upper, best: None, rises: 0, rows: Vec::new() });
    let mut square = Mapped { operator: &mut LookedAt { operator, seen: &seen }, map };
    let b = map.times(target);
    let mut forward = ForwardOnly(&mut square);
    let mut watched = Relayed::new(&mut forward, |observer: &dyn Observer, step: &Step<'_>| {
        let flow = observer.step(step);
        if seen.borrow().rises < RISES { flow } else { ControlFlow::Break(()) }
    });
    let mut found = kept(method, &mut watched, &b, &options, keep)?;
    let seen = seen.into_inner();
    let solution = &mut found.0;
    if solution.stats.status == Status::ConstrainedOptimum || seen.rises >= RISES {
        solution.stats.status = Status::Stalled;
    }
    solution.history = seen.rows;
    if let Some((residual, pattern)) = seen.best {
        (solution.residual, solution.x) = (residual, pattern);
    }
    // The method has compared what the map makes of the light with the tolerance.
    if solution.stats.status == Status::ReachedTolerance && solution.residual > options.rtol {
        solution.stats.status = Status::Stalled;
    }
    Ok(found)
}

/// A vector of `size` entries: the given ones, and zeros.
fn padded(values: &[f64], size: usize) -> Vec<f64> {
    let mut padded = values.to_vec();
    padded.resize(size, 0.0);
    padded
}

/// A rectangular operator with rows or columns of zeros, so that it is square.
struct Padded<'a> {
    operator: &'a mut dyn Adjoint,
    size: usize,
}

/// A block of products in one direction.
type Products = fn(&mut dyn Adjoint, &[&[f64]], &mut [&mut [f64]]) -> Result<()>;

impl Padded<'_> {
    fn products(
        &mut self,
        from: &[&[f64]],
        to: &mut [&mut [f64]],
        [cols, rows]: [usize; 2],
        apply: Products,
    ) -> Result<()> {
        let from: Vec<&[f64]> = from.iter().map(|x| &x[..cols]).collect();
        let (mut heads, mut tails): (Vec<_>, Vec<_>) = to.iter_mut().map(|y| y.split_at_mut(rows)).unzip();
        tails.iter_mut().for_each(|tail| tail.fill(0.0));
        apply(self.operator, &from, &mut heads)
    }
}

impl Operator for Padded<'_> {
    delegate!(operator: block_size, observer, standard_errors, common_error, frames, confirming);

    fn rows(&self) -> usize {
        self.size
    }

    fn cols(&self) -> usize {
        self.size
    }

    fn symmetry(&self) -> Symmetry {
        Symmetry::General
    }

    fn apply_block(&mut self, xs: &[&[f64]], ys: &mut [&mut [f64]]) -> Result<()> {
        let shape = [self.operator.cols(), self.operator.rows()];
        self.products(xs, ys, shape, |operator, xs, ys| operator.apply_block(xs, ys))
    }
}

impl Adjoint for Padded<'_> {
    fn apply_adjoint_block(&mut self, ys: &[&[f64]], xs: &mut [&mut [f64]]) -> Result<()> {
        let shape = [self.operator.rows(), self.operator.cols()];
        self.products(ys, xs, shape, |operator, ys, xs| operator.apply_adjoint_block(ys, xs))
    }
}

/// The patterns inside the box that were photographed.
struct Seen<'a> {
    target: &'a [f64],
    lower: f64,
    upper: f64,
    /// The smallest residual `‖b − A x‖ / ‖b‖`, and its pattern.
    best: Option<(f64, Vec<f64>)>,
    /// The number of photos since the best one.
    rises: usize,
    rows: Vec<SolveRow>,
}

impl Seen<'_> {
    fn look(&mut self, pattern: &[f64], photo: &[f64]) {
        let is_inside = pattern.iter().all(|value| (self.lower..=self.upper).contains(value));
        let misfit: Vec<f64> = self.target.iter().zip(photo).map(|(b, y)| b - y).collect();
        let residual = if is_inside { norm(&misfit) / norm(self.target) } else { f64::INFINITY };
        if is_inside && self.best.as_ref().is_none_or(|(best, _)| residual < *best) {
            self.best = Some((residual, pattern.to_vec()));
            self.rises = 0;
        } else if is_inside {
            self.rises += 1;
        }
        let best = self.best.as_ref().map_or(f64::INFINITY, |(best, _)| *best);
        self.rows.push(SolveRow { products: self.rows.len() + 1, residual, best });
    }
}

/// An operator whose photos are looked at.
struct LookedAt<'a, 'b> {
    operator: &'a mut dyn Adjoint,
    seen: &'a RefCell<Seen<'b>>,
}

impl Operator for LookedAt<'_, '_> {
    delegate!(operator: rows, cols, symmetry, observer, frames, confirming);

    fn apply(&mut self, x: &[f64], y: &mut [f64]) -> Result<()> {
        self.operator.apply(x, y)?;
        self.seen.borrow_mut().look(x, y);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::super::{CompensateOptions, Compensation, Prior, Target, compensate_with};
    use super::*;
    use crate::image::{Image, Resolution};
    use crate::sparse::Csr;
    use crate::sparse::SparseOperator;

    const CAMERA: Resolution = Resolution { width: 6, height: 5 };
    const PROJECTOR: Resolution = Resolution { width: 4, height: 3 };

    /// Numbers in [0, 1), by a linear congruence.
    fn random(seed: u64) -> impl FnMut() -> f64 {
        let mut state = seed;
        move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        }
    }

    fn matrix(rows: usize, cols: usize, value: impl Fn(usize, usize) -> f64) -> Result<Csr> {
        let (mut starts, mut columns, mut weights) = (vec![0], Vec::new(), Vec::new());
        for row in 0..rows {
            for column in 0..cols {
                if value(row, column) != 0.0 {
                    columns.push(column as u32);
                    weights.push(value(row, column));
                }
            }
            starts.push(columns.len());
        }
        Csr::new(cols, starts, columns, weights)
    }

    /// A scene: each camera pixel sees one projector pixel directly, and the light of half of the others weakly.
    struct Scene {
        whole: Csr,
        map: Csr,
    }

    impl Scene {
        fn new(seed: u64) -> Result<Self> {
            let (rows, cols) = (CAMERA.pixels(), PROJECTOR.pixels());
            let mut random = random(seed);
            let direct: Vec<f64> = (0..rows).map(|_| 1.0 + 0.5 * random()).collect();
            let weak: Vec<f64> = (0..rows * cols).map(|_| 0.08 * (random() - 0.5).max(0.0)).collect();
            let seen = |row: usize| {
                let (x, y) = (row % CAMERA.width, row / CAMERA.width);
                let column = x * PROJECTOR.width / CAMERA.width;
                y * PROJECTOR.height / CAMERA.height * PROJECTOR.width + column
            };
            let own = |row: usize, column: usize| if seen(row) == column { direct[row] } else { 0.0 };
            let whole = matrix(rows, cols, |row, column| own(row, column) + weak[row * cols + column])?;
            let map = matrix(rows, cols, own)?.transposed().with_row_sums_of_one();
            Ok(Self { whole, map })
        }

        fn photo(&self, pattern: &[f64]) -> Vec<f64> {
            self.whole.times(pattern)
        }

        /// The light of a pattern with values up to `most`, and further light of up to `more` that no pattern gives.
        fn light(&self, most: f64, more: f64) -> Wanted {
            let mut random = random(99);
            let pattern: Vec<f64> = (0..PROJECTOR.pixels()).map(|_| most * random()).collect();
            let light: Vec<f64> = self.photo(&pattern).iter().map(|light| light + more * random()).collect();
            let peak = light.iter().copied().fold(0.0, f64::max);
            let samples: Vec<f32> = light.iter().map(|light| (light / peak) as f32).collect();
            let b = samples.iter().map(|&sample| peak * f64::from(sample)).collect();
            Wanted { samples, peak, b }
        }

        fn compensate(
            &self,
            wanted: &Wanted,
            map: &Csr,
            method: Method,
            photos: usize,
        ) -> Result<Compensation> {
            let image = Image::new(CAMERA, 1, wanted.samples.clone())?;
            let target = Target::new(&image, &Image::filled(CAMERA, 1, 0.0))?.for_projector(PROJECTOR);
            let peak = Some(wanted.peak);
            let options = CompensateOptions { method, photos, peak, baseline: false, ..Default::default() };
            let prior = Prior { map: vec![map.clone()], ..Prior::default() };
            compensate_with(&mut [SparseOperator::new(self.whole.clone())], &target, &options, &prior)
        }

        /// `‖b − A x‖ / ‖b‖`.
        fn residual(&self, wanted: &Wanted, pattern: &[f64]) -> f64 {
            let photo = self.photo(pattern);
            let misfit: Vec<f64> = wanted.b.iter().zip(&photo).map(|(b, y)| b - y).collect();
            norm(&misfit) / norm(&wanted.b)
        }

        /// The least residual inside the box, by projected gradients of the normal equations.
        fn optimum(&self, wanted: &Wanted) -> f64 {
            let transpose = self.whole.transposed();
            let rhs = transpose.times(&wanted.b);
            let ones = vec![1.0; PROJECTOR.pixels()];
            // The matrix is not negative, so the largest row sum of AᵀA bounds its norm.
            let bound = transpose.times(&self.photo(&ones)).into_iter().fold(0.0, f64::max);
            let mut x = vec![0.5; PROJECTOR.pixels()];
            for _ in 0..20_000 {
                let product = transpose.times(&self.photo(&x));
                for (x, (rhs, product)) in x.iter_mut().zip(rhs.iter().zip(&product)) {
                    *x = (*x + (rhs - product) / bound).clamp(0.0, 1.0);
                }
            }
            self.residual(wanted, &x)
        }
    }

    /// A target: its samples, the radiance of 1, and the light.
    struct Wanted {
        samples: Vec<f32>,
        peak: f64,
        b: Vec<f64>,
    }

    #[test]
    fn fista_finds_the_optimum_inside_the_box() -> Result<()> {
        for seed in 0..5 {
            let scene = Scene::new(seed)?;
            let reachable = scene.light(0.9, 0.0);
            let found = scene.compensate(&reachable, &scene.map, Method::Fista, 300)?;
            // The default tolerance.
            assert!(found.residual <= 1e-3 && found.good, "{seed}: {}", found.residual);

            // A pattern beyond the box, with light that no pattern gives.
            let wanted = scene.light(1.6, 0.8);
            let found = scene.compensate(&wanted, &scene.map, Method::Fista, 300)?;
            let optimum = scene.optimum(&wanted);
            assert!(optimum > 0.05, "{seed}: the target is reachable: {optimum}");
            // One percent is left for the iterations beyond these photos. Sums of thirty terms are rounded by far less than 1e-9.
            assert!(
                (optimum * (1.0 - 1e-9)..1.01 * optimum).contains(&found.residual),
                "{seed}: {} {optimum}",
                found.residual
            );
            assert_eq!(found.pattern.resolution(), PROJECTOR);
        }
        Ok(())
    }

    /// The map of another scene: its rows in reverse order.
    fn reversed(map: &Csr) -> Result<Csr> {
        let rows = map.rows();
        let mut dense = vec![0.0; rows * map.cols()];
        for (row, column, value) in map.entries() {
            dense[(rows - 1 - row) * map.cols() + column] = value;
        }
        matrix(rows, map.cols(), |row, column| dense[row * map.cols() + column])
    }

    #[test]
    fn by_any_map_the_stated_residual_is_that_of_the_pattern_and_no_worse_than_the_first() -> Result<()> {
        for seed in 0..5 {
            let scene = Scene::new(seed)?;
            for map in [scene.map.clone(), reversed(&scene.map)?] {
                for wanted in [scene.light(0.9, 0.0), scene.light(0.9, 0.8), scene.light(1.6, 0.8)] {
                    let found = scene.compensate(&wanted, &map, Method::KrylovBox, 20)?;
                    let pattern = found.pattern.plane(0);
                    assert!(pattern.iter().all(|value| (0.0..=1.0).contains(value)), "{seed}: {pattern:?}");
                    // Patterns are stored in single precision, with an error of 6e-8 of each value.
                    let truth = scene.residual(&wanted, &pattern);
                    assert!((found.residual - truth).abs() < 1e-6, "{seed}: {} {truth}", found.residual);
                    assert!((found.unclipped_residual - found.residual).abs() < 1e-6, "{seed}");

                    let white = map.times(&scene.photo(&vec![1.0; PROJECTOR.pixels()]));
                    let start = map.times(&wanted.b);
                    let start = start.iter().zip(white).map(|(b, white)| (b / white).clamp(0.0, 1.0));
                    let first = scene.residual(&wanted, &start.collect::<Vec<f64>>());
                    // The same sums in another order.
                    assert!((found.history[0].residual - first).abs() < 1e-9, "{seed}");
                    assert!(found.residual <= first + 1e-9, "{seed}: {} {first}", found.residual);
                    // The tolerance is one of the photo, not of what the map makes of it.
                    let has_reached = found.residual <= 1e-3;
                    assert!(
                        has_reached || found.status != Status::ReachedTolerance,
                        "{seed}: {}",
                        found.residual
                    );
                    assert_ne!(found.status, Status::ConstrainedOptimum, "{seed}");
                }
            }
        }
        Ok(())
    }

    #[test]
    fn by_the_true_map_a_reachable_target_is_approached() -> Result<()> {
        for seed in 0..5 {
            let scene = Scene::new(seed)?;
            let wanted = scene.light(0.9, 0.0);
            let found = scene.compensate(&wanted, &scene.map, Method::KrylovBox, 20)?;
            let first = found.history[0].residual;
            // The weak light is a few percent of all light, and the first pattern ignores where it falls.
            assert!(found.residual < 0.5 * first, "{seed}: {} {first}", found.residual);
        }
        Ok(())
    }

    #[test]
    fn methods_that_cannot_work_between_two_sizes_are_refused() -> Result<()> {
        let scene = Scene::new(1)?;
        let wanted = scene.light(0.9, 0.0);
        for (method, fault) in [
            (Method::Minres, "is for photos and patterns of one size, and these have 30 and 12 pixels"),
            (Method::Mrnsd, "is for photos and patterns of one size"),
        ] {
            let refused =
                scene.compensate(&wanted, &scene.map, method, 20).err().map(|error| error.to_string());
            let why = refused.unwrap_or_default();
            assert!(why.starts_with("--method: ") && why.contains(fault), "{why}");
        }
        let image = Image::new(CAMERA, 1, wanted.samples.clone())?;
        let target = Target::new(&image, &Image::filled(CAMERA, 1, 0.0))?.for_projector(PROJECTOR);
        let mut channels = [SparseOperator::new(scene.whole.clone())];
        let found = compensate_with(&mut channels, &target, &CompensateOptions::default(), &Prior::default());
        let why = found.err().map(|error| error.to_string()).unwrap_or_default();
        assert!(why.starts_with("--method: ") && why.contains("the map from camera to projector"), "{why}");
        Ok(())
    }
}
