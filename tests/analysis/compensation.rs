//! Compensation of traced scenes: near the true optimum at a stated number of photos, in focus and out of it, and honest
//! about what clipping does.
#![allow(clippy::unwrap_used, clippy::panic, reason = "in a test a panic is the report")]

use std::sync::Arc;

use crate::common::{load, reference, settings, trace, traced, tracer};
use krylux::Result;
use krylux::analysis::compensate::compensate;
use krylux::analysis::{CompensateOptions, Compensation, CompensationRow, Precondition, Target};
use krylux::image::{Image, Resolution};
use krylux::krylov::{METHODS, Method, SolveOptions, Status, dot, norm, solve_adjoint};
use krylux::operator::{Adjoint, Operator, Symmetry};
use krylux::sparse::{Csr, SparseOperator};
use krylux::transport::{Assembled, Channels, MatrixOperator, Part, Transport};

const SIDE: usize = 64;

/// The corner of two white walls at 90°.
fn corner() -> &'static Assembled {
    traced("corner", settings(SIDE, 256, 6, 0), Channels::Luma)
}

fn gray(values: &[f64], side: usize) -> Image {
    let samples = values.iter().map(|&value| value as f32).collect();
    Image::new(Resolution::new(side, side), 1, samples).unwrap()
}

/// `b = ½ target / π`, as the reference figures have it; there is no ambient light.
fn wish() -> Target {
    Target::new(&gray(&reference("target_64.npy"), SIDE), &Image::filled(Resolution::new(SIDE, SIDE), 1, 0.0))
        .unwrap()
}

fn options(method: Method, photos: usize) -> CompensateOptions {
    let peak = Some(0.5 / std::f64::consts::PI);
    CompensateOptions { method, photos, peak, rtol: 0.0, ..CompensateOptions::default() }
}

/// The corner, photographed through a lens out of focus by `projector` and `camera` pixels (standard deviations of a
/// Gaussian without borders: light blurred beyond the image is lost).
struct Defocused {
    kernels: [Vec<f64>; 2],
}

impl Defocused {
    fn new(projector: f64, camera: f64) -> Self {
        let kernel = |sigma: f64| {
            let weights: Vec<f64> =
                (-20..=20).map(|k| (-f64::from(k * k) / (2.0 * sigma * sigma).max(1e-9)).exp()).collect();
            let sum: f64 = weights.iter().sum();
            weights.into_iter().map(|weight| weight / sum).collect()
        };
        Self { kernels: [kernel(projector), kernel(camera)] }
    }

    /// Symmetric, as the kernel is.
    fn blur(kernel: &[f64], image: &[f64]) -> Vec<f64> {
        let reach = kernel.len() as isize / 2;
        let along = |image: &[f64], step: usize, place: &dyn Fn(usize) -> usize| -> Vec<f64> {
            (0..image.len())
                .map(|pixel| {
                    let at = place(pixel) as isize;
                    (-reach..=reach)
                        .filter(|offset| (0..SIDE as isize).contains(&(at + offset)))
                        .map(|offset| {
                            kernel[(offset + reach) as usize]
                                * image[(pixel as isize + offset * step as isize) as usize]
                        })
                        .sum()
                })
                .collect()
        };
        along(&along(image, 1, &|pixel| pixel % SIDE), SIDE, &|pixel| pixel / SIDE)
    }

    fn product(&self, first: usize, x: &[f64], y: &mut [f64]) {
        let mut sharp = vec![0.0; x.len()];
        corner().matrix.apply(Part::Full, 0, &Self::blur(&self.kernels[first], x), &mut sharp);
        y.copy_from_slice(&Self::blur(&self.kernels[1 - first], &sharp));
    }
}

impl Operator for Defocused {
    fn rows(&self) -> usize {
        SIDE * SIDE
    }
    fn cols(&self) -> usize {
        SIDE * SIDE
    }
    fn symmetry(&self) -> Symmetry {
        if self.kernels[0] == self.kernels[1] { Symmetry::Symmetric } else { Symmetry::General }
    }
    fn apply(&mut self, x: &[f64], y: &mut [f64]) -> Result<()> {
        self.product(0, x, y);
        Ok(())
    }
}

impl Adjoint for Defocused {
    fn apply_adjoint(&mut self, y: &[f64], x: &mut [f64]) -> Result<()> {
        self.product(1, y, x);
        Ok(())
    }
}

/// No pattern in [0, 1] has a smaller relative residual than this. By convexity
/// `½‖b − A z‖² ≥ ½‖r‖² + (Aᵀr)ᵀ(x − z)`, of which the least over the box is a sum over pixels (the gap of Frank and
/// Wolfe); `x` comes from accelerated gradients, and how good it is matters only to how sharp the bound is.
fn lower_bound(operator: &mut dyn Adjoint, b: &[f64]) -> f64 {
    let n = b.len();
    let sharp = SolveOptions { products: 1500, rtol: 0.0, ..SolveOptions::default() };
    let x = solve_adjoint(Method::Fista, operator, b, &sharp).unwrap().x;
    let (mut y, mut gradient) = (vec![0.0; n], vec![0.0; n]);
    operator.apply(&x, &mut y).unwrap();
    let r: Vec<f64> = b.iter().zip(&y).map(|(b, y)| b - y).collect();
    operator.apply_adjoint(&r, &mut gradient).unwrap();
    let gap: f64 = x.iter().zip(&gradient).map(|(x, g)| if *g > 0.0 { g * (1.0 - x) } else { -g * x }).sum();
    let square = dot(&r, &r) - 2.0 * gap;
    assert!(square > 0.99 * dot(&r, &r), "the bound is too weak to test anything: {gap:e}");
    square.sqrt() / norm(b)
}

fn light() -> Vec<f64> {
    reference("target_64.npy").iter().map(|value| 0.5 / std::f64::consts::PI * value).collect()
}

/// The residual after this number of photos.
fn at(history: &[CompensationRow], photos: usize) -> f64 {
    history[photos.min(history.len()) - 1].residual
}

fn in_focus(options: &CompensateOptions) -> Compensation {
    let mut channels = [MatrixOperator::new(&corner().matrix, Part::Full, 0)];
    compensate(&mut channels, &wish(), options).unwrap()
}

#[test]
fn without_a_box_three_photos_are_enough_and_clipping_spoils_them() {
    let found = in_focus(&options(Method::Minres, 3));
    println!("MINRES scaled by D: {:?}", found.history);
    assert_eq!((found.photos, found.preparation), (3, 1));
    assert!(found.unclipped_residual <= 0.004, "{}", found.unclipped_residual);
    assert!(found.unclipped.is_some(), "bright parts of the target need more than the projector has");
    // Clipped, it is worse by far, and worse than what has been best inside the box from the second photo on.
    let boxed = in_focus(&options(Method::KrylovBox, 3));
    assert!(found.residual > 10.0 * found.unclipped_residual, "{}", found.residual);
    assert!(found.residual > boxed.residual, "{} {}", found.residual, boxed.residual);
    assert!(found.good, "better than nothing, by all the photos that were allowed");
    let strict = CompensateOptions { must_reach: true, ..options(Method::Minres, 3) };
    assert!(!in_focus(&strict).good, "the residual that counts is that of what is projected");
}

#[test]
fn inside_the_box_three_photos_are_within_two_per_cent_of_the_optimum() {
    let mut dense = Defocused::new(0.0, 0.0);
    let bound = lower_bound(&mut dense, &light());
    let found = in_focus(&options(Method::KrylovBox, 15));
    let (three, all) = (at(&found.history, 3) / bound, found.residual / bound);
    println!("optimum {bound:.5}; at 3 photos {three:.4} of it, at {} {all:.5}", found.photos);
    assert!(three <= 1.02, "{three}");
    assert!(all <= 1.005 && found.photos <= 15, "{all} at {}", found.photos);
    // The baseline had as many photos, and was no better at any of them after the first, where both are alike.
    for (ours, theirs) in found.history.iter().zip(&found.baseline) {
        assert!(ours.residual <= theirs.residual * (1.0 + 1e-12), "{ours:?} {theirs:?}");
    }
    assert!(found.residual < 0.3 * found.uncompensated_residual);
}

#[test]
fn out_of_focus_it_is_near_the_optimum_and_never_worse_than_nothing() {
    // Both lenses (a symmetric operator), and the projector's alone (a general one).
    for (name, projector, camera) in [("both lenses", 3.0, 3.0), ("the projector's lens", 4.0, 0.0)] {
        let bound = lower_bound(&mut Defocused::new(projector, camera), &light());
        for photos in [1, 2, 4, 8, 12] {
            let mut channels = [Defocused::new(projector, camera)];
            let found = compensate(&mut channels, &wish(), &options(Method::KrylovBox, photos)).unwrap();
            println!(
                "{name}: optimum {bound:.4}, uncompensated {:.4}, {photos} photos {:.4}, Jacobi {:.4}",
                found.uncompensated_residual,
                found.residual,
                at(&found.baseline, photos)
            );
            assert!(found.residual <= found.uncompensated_residual, "{name}, {photos} photos");
            if photos == 12 {
                assert!(found.residual <= 1.05 * bound, "{name}: {}", found.residual / bound);
            }
        }
    }
}

#[test]
fn every_method_is_reached_and_says_what_is_true() {
    let matrix = &corner().matrix;
    for facts in METHODS {
        let found = in_focus(&options(facts.method, 8));
        let what = format!("{}: {:?}", facts.name, found.status);
        assert!(found.photos <= 8 && !found.history.is_empty(), "{what}");
        let (low, high) = found
            .pattern
            .samples()
            .iter()
            .fold((1.0_f32, 0.0_f32), |(low, high), &value| (low.min(value), high.max(value)));
        assert!(low >= 0.0 && high <= 1.0, "{what}: {low} to {high}");
        let mut photo = vec![0.0; SIDE * SIDE];
        matrix.apply(Part::Full, 0, &found.pattern.plane(0), &mut photo);
        let misfit = |seen: &[f64]| {
            let difference: Vec<f64> = seen.iter().zip(light()).map(|(y, b)| y - b).collect();
            norm(&difference) / norm(&light())
        };
        // The pattern that is handed out is rounded to f32, 6e-8.
        assert!((misfit(&photo) - found.residual).abs() < 1e-6, "{what}: {}", found.residual);
        assert!((misfit(&found.observed.plane(0)) - found.residual).abs() < 1e-6, "{what}");
        if let Some(unclipped) = &found.unclipped {
            matrix.apply(Part::Full, 0, &unclipped.plane(0), &mut photo);
            assert!((misfit(&photo) - found.unclipped_residual).abs() < 1e-6, "{what}");
        } else {
            assert!((found.unclipped_residual - found.residual).abs() < 1e-9, "{what}");
        }
        assert!(found.residual < found.uncompensated_residual, "{what}: {}", found.residual);
    }
}

#[test]
fn preconditioners_cost_what_is_said_and_are_worth_it() {
    let reached = |precondition| {
        let options = CompensateOptions {
            precondition: Some(precondition),
            rtol: 1e-5,
            photos: 30,
            ..options(Method::Cg, 30)
        };
        let found = in_focus(&options);
        assert_eq!(found.status, Status::ReachedTolerance, "{precondition:?}");
        println!("CG, {precondition:?}: {} photos and {} before", found.photos, found.preparation);
        (found.photos, found.preparation)
    };
    let [none, diagonal, multiscale] =
        [Precondition::None, Precondition::Diagonal, Precondition::Multiscale].map(reached);
    assert_eq!([none.1, diagonal.1, multiscale.1], [1, 1, 2]);
    assert!(diagonal.0 < none.0 && multiscale.0 <= diagonal.0, "{none:?} {diagonal:?} {multiscale:?}");
}

#[test]
fn floor_of_the_box_is_kept_by_every_method() {
    for method in [Method::KrylovBox, Method::Minres, Method::Mrnsd] {
        let found = in_focus(&CompensateOptions { floor: 0.1, ..options(method, 6) });
        assert!(found.pattern.samples().iter().all(|value| (0.1..=1.0).contains(value)), "{method:?}");
    }
}

#[test]
fn three_colours_are_three_systems_seen_in_one_photo() {
    let side = 24;
    let mut simulated =
        Arc::new(trace(&mut tracer(&load("cornell")), settings(side, 256, 6, 3), Channels::Rgb));
    let resolution = Resolution::new(side, side);
    let samples = (0..side * side).flat_map(|pixel| {
        let x = (pixel % side) as f32 / side as f32;
        [0.4 + 0.4 * x, 0.5, 0.8 - 0.4 * x]
    });
    let target = Image::new(resolution, 3, samples.collect()).unwrap();
    let wish = Target::new(&target, &simulated.ambient).unwrap();
    let options = CompensateOptions { photos: 10, ..CompensateOptions::default() };
    let operator = |channel| MatrixOperator::new(&simulated.matrix, Part::Full, channel);
    let found = compensate(&mut [0, 1, 2].map(operator), &wish, &options).unwrap();
    assert!(found.photos <= 10 && found.history.len() == found.photos);
    let photo = simulated.photograph(&found.pattern).unwrap();
    for (a, b) in photo.samples().iter().zip(found.observed.samples()) {
        // Both are sums in f64 of weights in f32, of a pattern in f32 here and in f64 there.
        assert!((a - b).abs() <= 1e-6 * b.abs(), "{a} {b}");
    }
    let of = |image: &Image| -> f64 {
        let square = |(a, b): (&f32, &f32)| f64::from(a - b).powi(2);
        image.samples().iter().zip(found.target.samples()).map(square).sum::<f64>().sqrt()
    };
    let wished: f64 = found
        .target
        .samples()
        .iter()
        .zip(simulated.ambient.samples())
        .map(|(t, a)| f64::from(t - a).powi(2))
        .sum::<f64>()
        .sqrt();
    assert!((of(&found.observed) / wished - found.residual).abs() < 1e-5);
    assert!((of(&found.uncompensated) / wished - found.uncompensated_residual).abs() < 1e-5);
    assert!((found.history.last().unwrap().residual - found.residual).abs() < 1e-6);
    assert!(found.residual < 0.7 * found.uncompensated_residual, "{found:?}");
}

#[test]
fn ambient_light_is_taken_out_of_the_wish_and_its_excess_is_not_hidden() {
    let n = SIDE * SIDE;
    let resolution = Resolution::new(SIDE, SIDE);
    let target = Image::filled(resolution, 1, 1.0);
    let peak = 0.1;
    let mut channels = [MatrixOperator::new(&corner().matrix, Part::Full, 0)];
    let options =
        CompensateOptions { peak: Some(peak), rtol: 1e-6, photos: 60, ..CompensateOptions::default() };
    // A tenth of the wish is there already: together they are the target.
    let dim = Target::new(&target, &Image::filled(resolution, 1, 0.01)).unwrap();
    let found = compensate(&mut channels, &dim, &options).unwrap();
    assert!(found.good, "{:?} {}", found.status, found.residual);
    for value in found.observed.plane(0) {
        // The residual is at most 1e-6 of ‖b‖ = 0.09 √n, all of it in one pixel at worst; f32 adds 1e-8.
        assert!((value - peak).abs() < 1e-6 * 0.09 * (n as f64).sqrt() + 2e-8, "{value}");
    }
    // Twice as much is there: the best is darkness, and 1 is what remains.
    let bright = Target::new(&target, &Image::filled(resolution, 1, 0.2)).unwrap();
    let found = compensate(&mut channels, &bright, &options).unwrap();
    assert!(found.pattern.samples().iter().all(|&value| value == 0.0), "{:?}", found.status);
    assert!((found.residual - 1.0).abs() < 1e-6, "no light can be taken away: {}", found.residual);
    assert_eq!(found.status, Status::ConstrainedOptimum);
}

#[test]
fn wishes_that_make_no_sense_are_refused() {
    let mut channels = [MatrixOperator::new(&corner().matrix, Part::Full, 0)];
    let mut refused = |options: CompensateOptions, named: &str| {
        let error = compensate(&mut channels, &wish(), &options).unwrap_err();
        assert!(error.to_string().contains(named), "{named}: {error}");
    };
    let default = || options(Method::KrylovBox, 5);
    refused(CompensateOptions { photos: 0, ..default() }, "--photos");
    refused(CompensateOptions { floor: 1.0, ..default() }, "--floor");
    refused(CompensateOptions { rtol: f64::NAN, ..default() }, "--rtol");
    refused(CompensateOptions { peak: Some(-1.0), ..default() }, "--peak");
    refused(CompensateOptions { precondition: Some(Precondition::Diagonal), ..default() }, "--precondition");
    let small = Image::filled(Resolution::new(8, 8), 1, 0.0);
    assert!(Target::new(&small, &Image::filled(Resolution::new(9, 8), 1, 0.0)).is_err());
    assert!(Target::new(&Image::filled(Resolution::new(8, 8), 3, 0.0), &small).is_err());
    let other = Target::new(&small, &small).unwrap();
    assert!(compensate(&mut channels, &other, &default()).is_err(), "8×8 on 64×64");
    let black = Target::new(
        &Image::filled(Resolution::new(SIDE, SIDE), 1, 0.0),
        &Image::filled(Resolution::new(SIDE, SIDE), 1, 0.0),
    );
    let error = compensate(&mut channels, &black.unwrap(), &default()).unwrap_err();
    assert!(error.to_string().contains("nothing to do"), "{error}");
}

/// Walls that send no light to themselves, of every brightness: the target itself is the answer, and no method is blamed for being no better.
#[test]
fn flat_walls_are_compensated_by_every_method_and_need_none() -> Result<()> {
    let side = 8;
    let dark = Image::filled(Resolution::new(side, side), 1, 0.0);
    for (seed, level) in [1e-6, 0.3, 1.0, 4e5].into_iter().enumerate() {
        let wish = 0.1 + 0.4 * ((seed * 7 % 5) as f64 / 5.0);
        let target = Target::new(&gray(&vec![wish; side * side], side), &dark)?;
        for facts in METHODS {
            let pixels = side * side;
            let diagonal =
                Csr::new(pixels, (0..=pixels).collect(), (0..pixels as u32).collect(), vec![level; pixels])?;
            let options = CompensateOptions {
                method: facts.method,
                photos: 60,
                rtol: 1e-4,
                ..CompensateOptions::default()
            };
            let found = compensate(&mut [SparseOperator::new(diagonal)], &target, &options)?;
            assert!(
                found.good && found.residual < 1e-3,
                "{} {level}: {} {}",
                facts.name,
                found.residual,
                found.status
            );
            let warning = found.clamping.as_ref().and_then(krylux::analysis::Clamping::warning);
            assert!(
                found.is_needless() == (found.residual + 1e-6 >= found.uncompensated_residual),
                "{}",
                facts.name
            );
            assert_eq!(warning, None, "{}", facts.name);
        }
    }
    Ok(())
}
