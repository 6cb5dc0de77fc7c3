//! Compensation between two sizes, against dense matrices.

use super::run::{Kept, Run};
use super::two_sizes::solve;
use super::{CompensateOptions, Compensation, Prior, Target, compensate_with};
use crate::error::Result;
use crate::image::{Image, Resolution};
use crate::krylov::{Method, Status, dot, norm};
use crate::sparse::{Csr, SparseOperator};

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
    let entry =
        |row: usize, column: usize| Some((column as u32, value(row, column))).filter(|of| of.1 != 0.0);
    let entry = &entry;
    Csr::of_rows(cols, (0..rows).map(|row| (0..cols).filter_map(move |column| entry(row, column))))
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

    fn compensate(&self, wanted: &Wanted, map: &Csr, method: Method, photos: usize) -> Result<Compensation> {
        self.compensate_by(wanted, map, &self.options(wanted, method, photos))
    }

    fn options(&self, wanted: &Wanted, method: Method, photos: usize) -> CompensateOptions {
        CompensateOptions { method, photos, peak: Some(wanted.peak), baseline: false, ..Default::default() }
    }

    fn compensate_by(&self, wanted: &Wanted, map: &Csr, options: &CompensateOptions) -> Result<Compensation> {
        let image = Image::new(CAMERA, 1, wanted.samples.clone())?;
        let target = Target::new(&image, &Image::filled(CAMERA, 1, 0.0))?.for_projector(PROJECTOR);
        let prior = Prior { map: vec![map.clone()], ..Prior::default() };
        compensate_with(&mut [SparseOperator::new(self.whole.clone())], &target, options, &prior)
    }

    /// `‖b − A x‖ / ‖b‖`.
    fn residual(&self, wanted: &Wanted, pattern: &[f64]) -> f64 {
        let photo = self.photo(pattern);
        let misfit: Vec<f64> = wanted.b.iter().zip(&photo).map(|(b, y)| b - y).collect();
        norm(&misfit) / norm(&wanted.b)
    }

    fn optimum(&self, wanted: &Wanted) -> f64 {
        optimum(&self.whole, &wanted.b)
    }
}

/// The least `‖b − A x‖ / ‖b‖` inside the box, one column after the other.
fn optimum(matrix: &Csr, b: &[f64]) -> f64 {
    let transposed = matrix.transposed();
    let columns: Vec<Vec<f64>> = (0..matrix.cols())
        .map(|column| {
            let mut dense = vec![0.0; matrix.rows()];
            let (rows, weights) = transposed.row(column);
            rows.iter().zip(weights).for_each(|(row, weight)| dense[*row as usize] = *weight);
            dense
        })
        .collect();
    let (mut x, mut misfit) = (vec![0.0; columns.len()], b.to_vec());
    for _ in 0..3000 {
        for (x, column) in x.iter_mut().zip(&columns) {
            let best: f64 = *x + dot(column, &misfit) / dot(column, column);
            let step = best.clamp(0.0, 1.0) - *x;
            *x += step;
            misfit.iter_mut().zip(column).for_each(|(misfit, weight)| *misfit -= step * weight);
        }
    }
    norm(&misfit) / norm(b)
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
        let least = found.least_residual.unwrap_or(f64::NAN);
        assert!((0.98 * optimum..=optimum * (1.0 + 1e-9)).contains(&least), "{seed}: {least} {optimum}");
    }
    Ok(())
}

/// The answer of FISTA for one matrix of either sign.
fn by_fista(matrix: &Csr, b: &[f64], photos: usize) -> Result<Kept> {
    let image = Image::filled(CAMERA, 1, 1.0);
    let target = Target::new(&image, &Image::filled(CAMERA, 1, 0.0))?.for_projector(PROJECTOR);
    let white = [matrix.times(&vec![1.0; matrix.cols()])];
    let options = CompensateOptions { rtol: 0.0, ..CompensateOptions::default() };
    let (b, prior) = ([b.to_vec()], Prior::default());
    let mut run = Run {
        target: &target,
        white: &white,
        b: &b,
        options: &options,
        prior: &prior,
        dear: true,
        preparation: 1,
    };
    solve(&mut run, &mut SparseOperator::new(matrix.clone()), 0, Method::Fista, photos, false)
}

#[test]
fn for_matrices_of_either_sign_fista_and_its_bound_meet_at_the_optimum() -> Result<()> {
    for seed in 0..8 {
        for (rows, cols) in [(30, 12), (12, 30)] {
            // From entries of zero mean, where white says nothing, to entries of which one in five is negative.
            for shift in [-0.5, -0.2, -0.8] {
                let mut random = random(100 + seed);
                let entries: Vec<f64> = (0..rows * cols).map(|_| random() + shift).collect();
                let matrix = matrix(rows, cols, |row, column| entries[row * cols + column])?;
                let b: Vec<f64> = (0..rows).map(|_| 4.0 * random() - 1.0).collect();
                let optimum = optimum(&matrix, &b);
                let case = format!("{rows}×{cols}, {shift}, seed {seed}: {optimum}");
                for (photos, share) in [(300, 0.01), (6000, 1e-6)] {
                    let found = by_fista(&matrix, &b, photos)?;
                    let (residual, least) = (found.solution.residual, found.least);
                    assert!(residual <= (1.0 + share) * optimum, "{case}: {residual} by {photos} photos");
                    // Rounding is far below 1e-9 in sums of thirty terms.
                    assert!(least <= optimum * (1.0 + 1e-9), "{case}: {least} is no bound");
                    assert!(
                        photos == 300 || least >= (1.0 - share) * optimum,
                        "{case}: {least} is not sharp"
                    );
                }
            }
        }
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
fn a_photo_within_the_tolerance_is_converged_however_the_method_ends() -> Result<()> {
    let mut by_rises = 0;
    for seed in 0..5 {
        let scene = Scene::new(seed)?;
        for wanted in [scene.light(0.9, 0.8), scene.light(1.6, 0.8)] {
            let best = |found: &Compensation| found.history.last().map_or(f64::NAN, |row| row.residual);
            let ask = |rtol| {
                let options = CompensateOptions { rtol, ..scene.options(&wanted, Method::KrylovBox, 20) };
                scene.compensate_by(&wanted, &scene.map, &options)
            };
            let strict = ask(0.0)?;
            by_rises += usize::from(strict.status == Status::Stalled);
            // Just within the tolerance, which an earlier photo may be as well, and just outside.
            let rtol = best(&strict) * (1.0 + 1e-9);
            let [within, outside] = [ask(rtol)?, ask(best(&strict) * (1.0 - 1e-9))?];
            assert_eq!(within.status, Status::ReachedTolerance, "{seed}");
            assert!(best(&within) <= rtol, "{seed}: {} {rtol}", best(&within));
            assert_ne!(outside.status, Status::ReachedTolerance, "{seed}");
        }
    }
    assert!(by_rises > 0, "no run ended because its residual rose");
    Ok(())
}

#[test]
fn a_method_that_photographs_directions_answers_with_its_solution() -> Result<()> {
    let scene = Scene::new(1)?;
    let wanted = scene.light(0.9, 0.0);
    let found = scene.compensate(&wanted, &scene.map, Method::Gmres, 20)?;
    // The tolerance, times the little that the map takes away of a misfit.
    assert!(
        found.residual < 3e-3 && found.status == Status::ReachedTolerance,
        "{} {}",
        found.residual,
        found.status
    );
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
        let refused = scene.compensate(&wanted, &scene.map, method, 20).err().map(|error| error.to_string());
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
