use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use super::basis::Covariance;
use super::*;
use crate::analysis::low_rank::SavedModel;
use crate::image::Image;

/// A light transport matrix of a projector of 12×9 pixels and a camera of 15×10: direct light from places that are shifted, and smooth
/// global light.
struct Bench {
    matrix: Vec<Vec<f64>>,
    projector: Resolution,
    places: Vec<[f64; 2]>,
    random: Pcg64,
}

impl Bench {
    fn new(seed: u64) -> Self {
        let (projector, camera) = (Resolution::new(12, 9), Resolution::new(15, 10));
        let mut random = Pcg64::seed_from_u64(seed);
        let [a, b, c] = [(); 3].map(|()| random.random::<f64>());
        let mut places = Vec::new();
        let row = |j: usize, places: &mut Vec<[f64; 2]>| -> Vec<f64> {
            let [x, y] = [(j % camera.width) as f64, (j / camera.width) as f64];
            let place = [0.7 * x + 0.6 + 0.3 * a, 0.8 * y + 0.3 + 0.3 * b];
            places.push(place);
            let entry = |i: usize| {
                let [u, v] = [(i % projector.width) as f64, (i / projector.width) as f64];
                let square = (u - place[0]).powi(2) + (v - place[1]).powi(2);
                let direct = (0.6 + 0.4 * (x + y * c).sin()) * (-square / 0.5).exp();
                let global = 0.01 * (1.0 + (0.4 * u + a).sin() * (0.3 * v + 0.2 * x + b).cos());
                direct + global
            };
            (0..projector.pixels()).map(entry).collect()
        };
        let matrix = (0..camera.pixels()).map(|j| row(j, &mut places)).collect();
        Self { matrix, projector, places, random }
    }

    fn photo(&self, pattern: &[f64]) -> Vec<f64> {
        self.matrix.iter().map(|row| crate::krylov::dot(row, pattern)).collect()
    }

    /// Random patterns of zeros and ones, and their photos with noise of this standard deviation.
    fn pairs(&mut self, count: usize, noise: f64) -> Pairs {
        let n = self.projector.pixels();
        let mut pattern = || (0..n).map(|_| f64::from(u8::from(self.random.random::<bool>()))).collect();
        let patterns: Vec<Vec<f64>> = (0..count).map(|_| pattern()).collect();
        let photos = patterns.iter().map(|x| self.photo(x)).collect::<Vec<_>>();
        let photos = photos.into_iter().map(|photo| self.noisy(photo, noise)).collect();
        let homes = self.places.iter().map(|place| Some(*place)).collect();
        Pairs {
            patterns,
            photos,
            projector: self.projector,
            homes,
            noise: Some(vec![noise; self.matrix.len()]),
        }
    }

    fn noisy(&mut self, mut photo: Vec<f64>, noise: f64) -> Vec<f64> {
        for value in &mut photo {
            let sum: f64 = (0..12).map(|_| self.random.random::<f64>()).sum();
            *value += noise * (sum - 6.0);
        }
        photo
    }
}

fn prior(pairs: &Pairs) -> Prior {
    Prior { width: 0.5, ..Prior::start(pairs.projector, true) }
}

#[test]
fn a_covariance_is_solved_as_the_dense_one() -> Result<()> {
    let columns = vec![vec![1.0, 2.0, 0.5], vec![-0.3, 0.1, 0.8]];
    let variances = [0.5, 2.0, 1.5];
    let covariance = Covariance::new(variances.into_iter(), columns.clone())?;
    let y = [0.3, -1.0, 2.0];
    let solved = covariance.solve(&y);
    for (i, expected) in y.iter().enumerate() {
        let low_rank: f64 = columns.iter().map(|b| b[i] * crate::krylov::dot(b, &solved)).sum();
        assert!((variances[i] * solved[i] + low_rank - expected).abs() < 1e-12);
    }
    assert!((covariance.quadratic(&y) - crate::krylov::dot(&y, &solved)).abs() < 1e-12);
    Ok(())
}

#[test]
fn photos_that_are_left_out_are_predicted_as_by_a_fit_without_them() -> Result<()> {
    let mut bench = Bench::new(1);
    let pairs = bench.pairs(12, 0.02);
    let prior = prior(&pairs);
    let whole = Posterior::new(&pairs, prior)?;
    let kept: Vec<usize> = (0..12).filter(|k| *k != 4).collect();
    let mut without = whole.state().clone();
    without.patterns.remove(4);
    // The levels and the noise stay those of all photos, so that both fits have one prior.
    let rest = Posterior::of(without)?;
    let predicted = rest.model(&pairs.only(&kept))?.relight(&pairs.patterns[4]);
    let errors = rest.errors(&pairs.patterns[4]);
    for pixel in [0, 40, 149] {
        let [difference, error] = whole.left_out(&pairs.photos, pixel)?[4];
        assert!((pairs.photos[4][pixel] - predicted[pixel] - difference).abs() < 1e-9);
        assert!((error - errors[pixel].hypot(whole.noise()[pixel])).abs() < 1e-9);
    }
    Ok(())
}

#[test]
fn a_saturated_sample_counts_as_a_photo_that_is_missing_for_its_pixel() -> Result<()> {
    let mut bench = Bench::new(2);
    let mut pairs = bench.pairs(10, 0.02);
    let prior = prior(&pairs);
    let whole = Posterior::new(&pairs, prior)?;
    pairs.photos[3][60] = f64::NAN;
    let mut state = whole.state().clone();
    state.missing = vec![[3, 60]];
    let gap = Posterior::of(state)?;
    let kept: Vec<usize> = (0..10).filter(|k| *k != 3).collect();
    let mut state = whole.state().clone();
    state.patterns.remove(3);
    let rest = Posterior::of(state)?;
    let pattern = bench.pairs(1, 0.0).patterns.remove(0);
    let [with_gap, without] = [gap.model(&pairs)?, rest.model(&pairs.only(&kept))?];
    let [with_gap, without] = [with_gap, without].map(|model| model.relight(&pattern)[60]);
    // The missing sample has a variance of 1e6 in place of an infinite one.
    assert!((with_gap / without - 1.0).abs() < 1e-4, "{with_gap} {without}");
    Ok(())
}

#[test]
fn stated_errors_are_true_for_patterns_that_were_not_captured() -> Result<()> {
    let mut squares = Vec::new();
    for seed in 0..3 {
        let mut bench = Bench::new(seed);
        for count in [10, 30] {
            let pairs = bench.pairs(count, 0.05);
            let fitted = fit(&pairs)?;
            let z = fitted.left_out.z;
            assert!((0.6..1.6).contains(&z), "left out, seed {seed}, {count} photos: {z}");
            for pattern in bench.pairs(3, 0.0).patterns {
                let [found, truth, errors] =
                    [fitted.model.relight(&pattern), bench.photo(&pattern), fitted.model.errors(&pattern)];
                let each = found.iter().zip(&truth).zip(&errors);
                let z: f64 = each.map(|((a, b), error)| ((a - b) / error).powi(2)).sum();
                squares.push(z / truth.len() as f64);
            }
        }
    }
    let z = (squares.iter().sum::<f64>() / squares.len() as f64).sqrt();
    assert!((0.8..1.3).contains(&z), "{z}");
    // Errors that were half as large would be refused.
    assert!(!(0.8..1.3).contains(&(2.0 * z)));
    Ok(())
}

#[test]
fn a_saved_fit_answers_as_before_it_was_written() -> Result<()> {
    for seed in 0..8 {
        let mut bench = Bench::new(seed);
        let camera = Resolution::new(15, 10);
        let mut pairs = bench.pairs(8, 0.05);
        pairs.photos[2][seed as usize] = f64::NAN;
        let fitted = fit(&pairs)?;
        let saved = SavedModel {
            channels: vec![fitted.model],
            ambient: Image::filled(camera, 1, 0.0),
            resolution: camera,
            projector: bench.projector,
            unit: "of the range".into(),
            source: "test".into(),
        };
        let folder = tempfile::tempdir().map_err(Error::writing("a temporary folder"))?;
        saved.write(folder.path())?;
        let read = SavedModel::read(folder.path())?;
        let pattern = bench.pairs(1, 0.0).patterns.remove(0);
        for (before, after) in saved.channels.iter().zip(&read.channels) {
            assert_eq!(before.relight(&pattern), after.relight(&pattern));
            assert_eq!(before.errors(&pattern), after.errors(&pattern));
        }
    }
    Ok(())
}

#[test]
fn the_error_of_a_dual_photograph_is_not_above_what_is_stated() -> Result<()> {
    let mut bench = Bench::new(5);
    let fitted = fit(&bench.pairs(25, 0.05))?;
    let pattern: Vec<f64> = (0..150).map(|j| f64::from(u8::from(j % 3 == 0))).collect();
    let mut truth = vec![0.0; 108];
    for (row, y) in bench.matrix.iter().zip(&pattern) {
        truth.iter_mut().zip(row).for_each(|(sum, entry)| *sum += entry * y);
    }
    let found = fitted.model.dual(&pattern);
    let error = found.iter().zip(&truth).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
    let z = error / fitted.model.dual_error(&pattern);
    // Errors that were stated too small would be above one.
    assert!(z < 1.0 && z > 0.01, "{z}");
    Ok(())
}

#[test]
fn a_fit_predicts_far_better_than_least_squares_alone() -> Result<()> {
    let mut bench = Bench::new(9);
    let pairs = bench.pairs(30, 0.02);
    let fitted = fit(&pairs)?;
    let products = pairs.patterns.iter().zip(&pairs.photos);
    let products = products.map(|(x, y)| crate::operator::Product { from: x.clone(), to: y.clone() });
    let plain = crate::analysis::low_rank::from_products(products.collect(), Vec::new(), false)?;
    let pattern = bench.pairs(1, 0.0).patterns.remove(0);
    let truth = bench.photo(&pattern);
    let error = |found: Vec<f64>| -> f64 {
        found.iter().zip(&truth).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
    };
    let [fitted, plain] = [error(fitted.model.relight(&pattern)), error(plain.relight(&pattern))];
    assert!(fitted < 0.2 * plain, "{fitted} {plain}");
    Ok(())
}

#[test]
fn homes_are_found_from_codes_and_not_invented_from_smooth_patterns() {
    let mut bench = Bench::new(3);
    let mut codes = Vec::new();
    for (along, length) in [(0, 12), (1, 9)] {
        for bit in 0..4 {
            let lit = |i: usize| {
                let at = [i % 12, i / 12][along];
                ((at ^ (at >> 1)) >> bit) & 1 == 1 && at < length
            };
            let pattern: Vec<f64> = (0..108).map(|i| f64::from(u8::from(lit(i)))).collect();
            codes.push(pattern.iter().map(|value| 1.0 - value).collect());
            codes.push(pattern);
        }
    }
    let photos = codes.iter().map(|x| bench.photo(x)).collect::<Vec<_>>();
    let photos = photos.into_iter().map(|photo| bench.noisy(photo, 0.01)).collect();
    let pairs = Pairs { patterns: codes, photos, projector: bench.projector, homes: Vec::new(), noise: None };
    let found = find_homes(&pairs);
    let known: Vec<f64> = found
        .homes
        .iter()
        .zip(&bench.places)
        .filter_map(|(home, place)| home.map(|[x, y]| (x - place[0]).hypot(y - place[1])))
        .collect();
    // The others have neighbours that explain them nearly as well.
    assert!(known.len() > 90, "{} homes", known.len());
    // A home counts together with its neighbours.
    assert!(known.iter().all(|distance| *distance < 1.5), "{known:?}");
    let smooth = |k: usize| {
        let value =
            |i: usize| 0.5 + 0.5 * ((i % 12) as f64 * 0.1 * k as f64).sin() * ((i / 12) as f64 * 0.2).cos();
        (0..108).map(value).collect::<Vec<f64>>()
    };
    let patterns: Vec<Vec<f64>> = (0..6).map(smooth).collect();
    let photos = patterns.iter().map(|x| bench.photo(x)).collect::<Vec<_>>();
    let photos = photos.into_iter().map(|photo| bench.noisy(photo, 0.05)).collect();
    let pairs = Pairs { patterns, photos, ..pairs };
    let found = find_homes(&pairs).homes;
    let wrong = found
        .iter()
        .zip(&bench.places)
        .filter(|(home, place)| home.is_some_and(|[x, y]| (x - place[0]).hypot(y - place[1]) > 2.0));
    // The chance of each wrong home is stated as 1 %.
    assert!(wrong.count() <= 8);
}
