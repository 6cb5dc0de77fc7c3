//! Beyond the paper: a measured model of the lens, all methods at once, mixed colours, and another target for a scene that is known.

use krylux::analysis::compensate::{compare_methods, compensate, compensate_with};
use krylux::analysis::{CompensateOptions, Crosstalk, Precondition, Prior, Target};
use krylux::image::{Image, Resolution};
use krylux::krylov::Method;
use krylux::transport::{Channels, MatrixOperator, Part};

use super::bench::{Defocused, options, part, target, wish_for};
use crate::common::{load, settings, trace, tracer};

#[test]
fn a_model_of_the_defocus_speeds_up_methods_without_a_box() {
    let wish = wish_for(&target());
    let with = |precondition, photos| {
        let options =
            CompensateOptions { precondition: Some(precondition), ..options(Method::Minres, photos) };
        compensate(&mut [Defocused::new(1.0, 1.0)], &wish, &options).unwrap()
    };
    let (plain, defocus) = (with(Precondition::Diagonal, 8), with(Precondition::Defocus, 8));
    println!(
        "defocus: white alone {:.4}, with the lens' frequencies {:.4}; {} photos before",
        plain.unclipped_residual, defocus.unclipped_residual, defocus.preparation
    );
    assert_eq!((plain.preparation, defocus.preparation), (1, 2));
    assert!(defocus.unclipped_residual < plain.unclipped_residual);
}

#[test]
fn every_method_is_compared_by_what_is_seen_at_equal_photos() {
    let runs = compare_methods(
        &mut [part(Part::Full)],
        &wish_for(&target()),
        &options(Method::KrylovBox, 6),
        &Prior::default(),
    )
    .unwrap();
    assert_eq!(runs.len(), krylux::krylov::METHODS.len());
    let best = runs.iter().min_by(|a, b| a.residual.total_cmp(&b.residual)).unwrap();
    for run in &runs {
        println!("{:<15} {} photos: seen {:.4}, SSIM {:?}", run.name, run.photos, run.residual, run.ssim);
        assert!(run.photos <= 6 && run.displayed.len() == run.history.len(), "{}", run.name);
        assert!(run.residual >= best.residual && run.ssim.is_some());
    }
    let boxed = runs.iter().find(|run| run.method == Method::KrylovBox).unwrap();
    assert!(boxed.residual <= 1.01 * best.residual, "{} {}", best.name, best.residual);
}

#[test]
fn mixed_colours_are_solved_as_one_system_inside_the_box() {
    let side = 16;
    let size = Resolution::new(side, side);
    let traced = trace(&mut tracer(&load("cornell")), settings(side, 256, 6, 3), Channels::Rgb);
    let crosstalk = Crosstalk::new([[1.0, 0.25, 0.05], [0.15, 1.0, 0.2], [0.05, 0.2, 1.0]]).unwrap();
    let samples = (0..side * side).flat_map(|pixel| {
        let x = (pixel % side) as f32 / side as f32;
        [0.3 + 0.3 * x, 0.4, 0.6 - 0.3 * x]
    });
    let target = Image::new(size, 3, samples.collect()).unwrap();
    let wish = Target::new(&target, &traced.ambient).unwrap();
    let options = CompensateOptions { photos: 30, rtol: 0.0, ..CompensateOptions::default() };
    let solve = |crosstalk: Option<Crosstalk>| {
        let mut channels = [0, 1, 2].map(|channel| MatrixOperator::new(&traced.matrix, Part::Full, channel));
        let prior = Prior { crosstalk, ..Prior::default() };
        compensate_with(&mut channels, &wish, &options, &prior).unwrap()
    };
    let coupled = solve(Some(crosstalk.clone()));
    let mut apart = crosstalk.clone();
    apart.coupled = false;
    let unmixed = solve(Some(apart));
    println!("crosstalk: one system {:.5}, un-mixed {:.5}", coupled.residual, unmixed.residual);
    assert!(coupled.residual <= unmixed.residual * 1.02, "{} {}", coupled.residual, unmixed.residual);
    // Ignoring it: the pattern found without crosstalk, seen through it.
    let ignorant = solve(None);
    let planes: Vec<Vec<f64>> = (0..3).map(|channel| ignorant.pattern.plane(channel)).collect();
    let mut square = 0.0;
    for channel in 0..3 {
        let mixed: Vec<f64> = (0..side * side)
            .map(|pixel| (0..3).map(|p| crosstalk.matrix()[channel][p] * planes[p][pixel]).sum())
            .collect();
        let mut photo = vec![0.0; side * side];
        traced.matrix.apply(Part::Full, channel, &mixed, &mut photo);
        let wished = ignorant.target.plane(channel);
        square += photo.iter().zip(&wished).map(|(y, b)| (y - b).powi(2)).sum::<f64>();
    }
    let all: f64 = ignorant.target.samples().iter().map(|value| f64::from(*value).powi(2)).sum();
    let ignored = (square / all).sqrt();
    println!("crosstalk: ignored {ignored:.5}");
    // A red wall cannot be made blue: most of the residual is not the crosstalk's.
    assert!(coupled.residual < 0.75 * ignored, "{} {ignored}", coupled.residual);
}

#[test]
fn what_makes_no_sense_is_refused() {
    let wish = wish_for(&target());
    let refused = |options: CompensateOptions, prior: &Prior, named: &str| {
        let error = compensate_with(&mut [part(Part::Full)], &wish, &options, prior).unwrap_err();
        assert!(error.to_string().contains(named), "{named}: {error}");
    };
    let default = || options(Method::Minres, 3);
    let none = Prior::default();
    refused(CompensateOptions { lift: 1.0, ..default() }, &none, "--lift");
    refused(CompensateOptions { defocus: Some(-1.0), ..default() }, &none, "--defocus");
    refused(
        CompensateOptions { precondition: Some(Precondition::Geometry), ..default() },
        &none,
        "--precondition",
    );
    refused(default(), &Prior { geometry: vec![1.0; 3], ..Prior::default() }, "known beforehand");
    let crosstalk = Crosstalk::new([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]).ok();
    refused(default(), &Prior { crosstalk, ..Prior::default() }, "crosstalk");
}
