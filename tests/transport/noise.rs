//! The noise that a run states, against the spread of independent runs; and what the sampler saves of it.

use crate::common::{csr, load, settings, trace, tracer};
use krylux::image::{Image, Resolution};
use krylux::render::{Sampler, TraceSettings};
use krylux::transport::{Assembled, Channels, Noise, Part, Retraced};

const SIDE: usize = 12;
const SEEDS: u32 = 32;

fn runs(scene: &str, sampler: Sampler, samples: u32, projector: Option<usize>) -> Vec<Assembled> {
    let mut tracer = tracer(&load(scene));
    let projector = projector.map(|side| Resolution::new(side, side));
    let run = |seed| {
        let settings = TraceSettings { sampler, projector, ..settings(SIDE, samples, 6, seed) };
        trace(&mut tracer, settings, Channels::Luma)
    };
    (0..SEEDS).map(run).collect()
}

fn noise(run: &Assembled) -> &Noise {
    run.noise.as_ref().expect("there are two samples and more")
}

/// Mean of `values` and its standard error.
fn mean_and_error(values: &[f64]) -> (f64, f64) {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let variance = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (count - 1.0);
    (mean, (variance / count).sqrt())
}

/// z of the predicted squared error, run by run, against the squared distance of independent results from their mean.
fn z(predicted: &[f64], results: &[Vec<f64>]) -> f64 {
    let count = results.len() as f64;
    let mean: Vec<f64> =
        (0..results[0].len()).map(|i| results.iter().map(|result| result[i]).sum::<f64>() / count).collect();
    // With this factor, the mean over the runs is the unbiased variance.
    let squares = |result: &Vec<f64>| {
        let squares = result.iter().zip(&mean).map(|(value, mean)| (value - mean).powi(2));
        count / (count - 1.0) * squares.sum::<f64>()
    };
    let (predicted, prediction_error) = mean_and_error(predicted);
    let (spread, spread_error) = mean_and_error(&results.iter().map(squares).collect::<Vec<_>>());
    let error = prediction_error.hypot(spread_error);
    println!("predicted {predicted:.3e}, found {spread:.3e}, ± {error:.1e}");
    assert!(error < 0.1 * spread, "too few runs to show anything");
    (predicted - spread) / error
}

#[test]
fn stated_noise_is_the_spread_of_independent_runs() {
    for (scene, sampler, projector) in [
        ("corner", Sampler::Sobol, None),
        ("zigzag", Sampler::Sobol, None),
        ("corner", Sampler::Independent, None),
        // Paths from both ends, 57 of them from each projector pixel.
        ("corner", Sampler::Independent, Some(9)),
    ] {
        let runs = runs(scene, sampler, 32, projector);
        let squares = |values: &mut dyn Iterator<Item = f64>| values.map(|value| value * value).sum::<f64>();
        let dense = |run: &Assembled, part| {
            let csr = csr(&run.matrix, part, 0);
            let mut dense = vec![0.0; csr.rows() * csr.cols()];
            csr.entries().for_each(|(row, column, value)| dense[row * csr.cols() + column] = value);
            dense
        };
        // The photo of ones: each row's sum.
        let white = runs.iter().map(|run| squares(&mut noise(run).white.plane(0).into_iter()));
        let photos = runs.iter().map(|run| {
            let mut photo = vec![0.0; SIDE * SIDE];
            let white = vec![1.0; run.matrix.projector_resolution().pixels()];
            run.matrix.apply(Part::Full, 0, &white, &mut photo);
            assert!(noise(run).white_relative > 0.0);
            photo
        });
        let mut worst = vec![z(&white.collect::<Vec<_>>(), &photos.collect::<Vec<_>>())];
        for part in [Part::Full, Part::Global] {
            let matrices: Vec<Vec<f64>> = runs.iter().map(|run| dense(run, part)).collect();
            let relative = |run| if part == Part::Full { noise(run).operator } else { noise(run).global };
            let predicted = runs.iter().zip(&matrices);
            let predicted =
                predicted.map(|(run, dense)| relative(run).powi(2) * squares(&mut dense.iter().copied()));
            worst.push(z(&predicted.collect::<Vec<_>>(), &matrices));
        }
        // Twelve comparisons; 4.5 standard errors of 31 degrees of freedom are exceeded by chance once in a thousand times.
        assert!(worst.iter().all(|z| z.abs() < 4.5), "{scene}, {sampler:?}, {projector:?}: {worst:?}");
    }
}

#[test]
fn a_retraced_photo_states_the_same_error() {
    let mut tracer = tracer(&load("cornell"));
    let settings = settings(SIDE, 16, 6, 1);
    let traced = trace(&mut tracer, settings, Channels::Rgb);
    let mut rig = Retraced { tracer: &mut tracer, settings, channels: Channels::Rgb };
    let white = Image::filled(settings.resolution, 1, 1.0);
    let (photo, error) = rig.photograph_with_error(&white).expect("the pattern fits");
    let stated = &noise(&traced).white;
    for ((seen, stated), photo) in error.samples().iter().zip(stated.samples()).zip(photo.samples()) {
        // Rounded to f32 pixel by pixel there; a difference of two halves about as large as the photo.
        assert!((seen - stated).abs() <= 1e-6 * photo, "{seen} and {stated}");
    }
    assert!(error.samples().iter().any(|&error| error > 0.0));
}

#[test]
fn one_sample_per_pixel_tells_no_noise() {
    let mut tracer = tracer(&load("corner"));
    assert!(trace(&mut tracer, settings(8, 1, 6, 0), Channels::Luma).noise.is_none());
    assert!(trace(&mut tracer, settings(8, 2, 6, 0), Channels::Luma).noise.is_some());
}

#[test]
fn sobol_points_leave_less_noise_than_independent_ones() {
    for scene in ["corner", "zigzag"] {
        let mean = |sampler| {
            let squares: Vec<f64> =
                runs(scene, sampler, 64, None).iter().map(|run| noise(run).white_relative.powi(2)).collect();
            mean_and_error(&squares)
        };
        let (sobol, independent) = (mean(Sampler::Sobol), mean(Sampler::Independent));
        println!(
            "{scene}: variance of the white photo {:.3} of the independent one",
            sobol.0 / independent.0
        );
        let z = (independent.0 - sobol.0) / sobol.1.hypot(independent.1);
        assert!(z > 4.0, "{scene}: {sobol:?} against {independent:?}");
    }
}
