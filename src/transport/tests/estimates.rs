//! Two tests check a prediction by independent light paths: sums of squares and a sign test. Here, their results are compared with values
//! calculated by hand.

use crate::image::Resolution;
use crate::render::TraceSettings;
use crate::transport::{EstimatedProduct, Squares, with_fewer_samples, with_other_seed};

#[test]
fn the_excess_is_what_noise_and_allowed_errors_leave_in_standard_errors() {
    // The noise of photo and prediction is 4 + 4, and errors of the norm 3 are allowed. The sum of squares scatters by √(36 + 2² 16) = 10.
    let sums = Squares { difference: 30.0, noise: 4.0, product: 100.0, fourth: [36.0, 16.0] };
    assert_eq!(sums.excess(1.0, 3.0), 1.3);
    assert_eq!(Squares { difference: 1.0, ..sums }.excess(1.0, 3.0), -1.6);
    let exact = Squares { difference: 0.5, ..Squares::default() };
    assert_eq!(exact.excess(0.0, 0.0), f64::INFINITY, "without noise any difference is one");
    assert_eq!(Squares::default().excess(1.0, 0.0), 0.0, "nothing differs from nothing");
}

#[test]
fn the_resolution_is_the_error_that_is_seen_in_half_of_all_cases() {
    // Without its noise, the photo has the sum of squares 96. The sum of squared differences scatters by 2 √(2·18) = 12, so the smallest
    // detectable error is √(4.5·12 / 96).
    let sums = Squares { difference: 30.0, noise: 4.0, product: 100.0, fourth: [36.0, 18.0] };
    assert_eq!(sums.resolution(1.0, 4.5), 0.75);
    for fourth in [0.0, 18.0] {
        let nothing = Squares { product: 4.0, fourth: [36.0, fourth], ..sums };
        assert_eq!(nothing.resolution(1.0, 4.5), f64::INFINITY, "the photo is nothing but noise");
    }
}

#[test]
fn relative_errors_are_without_the_noise_of_the_photo() {
    let sums = Squares { difference: 20.0, noise: 4.0, product: 20.0, ..Squares::default() };
    assert_eq!(sums.relative(), Some([1.0, 0.5]));
    assert_eq!(Squares { difference: 3.0, ..sums }.relative(), Some([0.0, 0.5]), "all of it is noise");
    assert_eq!(Squares { product: 4.0, ..sums }.relative(), None);
}

#[test]
fn sums_of_several_channels_are_sums_of_each() {
    let one = Squares { difference: 3.0, noise: 4.0, product: 5.0, fourth: [6.0, 7.0] };
    let more = Squares { difference: 20.0, noise: 30.0, product: 40.0, fourth: [50.0, 60.0] };
    let all = Squares { difference: 23.0, noise: 34.0, product: 45.0, fourth: [56.0, 67.0] };
    assert_eq!([one, more].into_iter().sum::<Squares>(), all);
}

fn product(product: &[f64], error: &[f64]) -> EstimatedProduct {
    EstimatedProduct { product: product.to_vec(), error: error.to_vec(), quadratic: None }
}

#[test]
fn squares_of_a_product_are_those_of_its_differences_errors_and_values() {
    let squares = product(&[1.0, 5.0], &[2.0, 3.0]).squares(&[2.0, 7.0]);
    let expected =
        Squares { difference: 1.0 + 4.0, noise: 4.0 + 9.0, product: 26.0, fourth: [1.0 + 16.0, 16.0 + 81.0] };
    assert_eq!(squares, expected);
}

#[test]
fn the_noise_of_independent_light_is_no_error_of_the_answer() {
    // The noise alone explains differences of 0.3 and 0.4, but not of 3 and 4.
    let independent = product(&[10.3, 9.6], &[0.3, 0.4]);
    let exact = independent.squares(&[10.0, 10.0]).relative();
    assert!(exact.is_some_and(|[error, _]| error < 1e-7), "{exact:?}");
    let wrong = independent.squares(&[7.3, 5.6]).relative();
    let size = 10.3_f64.powi(2) + 9.6_f64.powi(2) - 0.25;
    let expected = ((25.0 - 0.25) / size).sqrt();
    assert!(wrong.is_some_and(|[error, _]| (error - expected).abs() < 1e-12));
    let nothing = product(&[0.1, -0.1], &[0.2, 0.2]);
    assert_eq!(nothing.squares(&[0.0, 0.0]).relative(), None);
}

#[test]
fn signs_count_the_pixels_that_are_farther_than_a_draw_of_the_noise() {
    // The sum of the photo's squared errors is 21. The prediction has as much noise, and errors of the norm 3 are allowed. The draw at a
    // pixel with the error `e` has the square `(2 + 9/21) e² + 9/6`. The difference at a pixel of error 1 is therefore larger from 1.982
    // on, and at a pixel of error 3 from 4.833 on.
    let photo = product(&[0.0; 6], &[1.0, -1.0, 0.0, 3.0, 3.0, 1.0]);
    let signs = photo.signs(&[1.99, 1.98, 7.0, 4.84, 4.83, -1.99], 1.0, 3.0);
    // The difference is larger at three of five pixels. The expected number is 2.5, with the variance 5/4. The pixel without noise does not
    // count.
    assert!((signs - 0.5 / 1.25_f64.sqrt()).abs() < 1e-12, "{signs}");
    let one = product(&[2.0], &[1.0]);
    let of_one = [2.9, 3.0, 3.1, 0.9].map(|prediction| one.signs(&[prediction], 0.0, 0.0));
    assert_eq!(of_one, [-1.0, -1.0, 1.0, 1.0], "as far as the noise is not farther");
    assert_eq!(product(&[0.0; 2], &[0.0; 2]).signs(&[9.0; 2], 0.0, 0.0), f64::NEG_INFINITY, "no pixel tells");
}

#[test]
fn another_seed_is_never_the_same_and_its_own_other_is() {
    for seed in [0, 1, 7, 0xffff_0000, u32::MAX, 0x5eed_cafe] {
        let settings = TraceSettings { seed, ..TraceSettings::new(Resolution::new(3, 2), 5) };
        let other = with_other_seed(&settings);
        assert!(other.seed != seed && with_other_seed(&other) == settings);
        assert_eq!(TraceSettings { seed, ..other }, settings, "nothing else differs");
    }
}

#[test]
fn a_check_has_fewer_samples_for_more_pixels_and_enough_to_tell_its_noise() {
    let samples = |size: usize, samples: u32, projector: Option<Resolution>| {
        let settings =
            TraceSettings { projector, ..TraceSettings::new(Resolution::new(size, size), samples) };
        let fewer = with_fewer_samples(&settings);
        assert_eq!(TraceSettings { samples, ..fewer }, settings, "nothing else differs");
        fewer.samples
    };
    let sizes = [1, 16, 24, 32, 64, 128, 128, 1024, 128, 128];
    let given = [64, 64, 64, 64, 64, 64, 16, 64, 3, 1];
    let expected = [64, 64, 64, 64, 64, 32, 8, 4, 3, 1];
    assert_eq!([0, 1, 2, 3, 4, 5, 6, 7, 8, 9].map(|at| samples(sizes[at], given[at], None)), expected);
    assert_eq!(samples(128, 64, Some(Resolution::new(64, 64))), 64, "a projector with pixels of its own");
}
