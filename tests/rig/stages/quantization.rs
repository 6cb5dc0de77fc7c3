//! The error that rounding a pattern to the projector's levels causes in a product, and its correction.

use krylux::image::Resolution;
use krylux::measure::{DirectBy, DitherBy, MeasureOptions};
use krylux::transport::Part;

use super::support::{Dense, Rig, error, plain, product, vector};

/// A projector with this many bits and gamma 2.2, as real ones have.
fn rig(bits: u32) -> Rig {
    let mut rig = Rig { gamma: 2.2, ..Rig::new(Dense::smooth(Resolution::new(24, 24), 1000.0)) };
    rig.projector.bits = bits;
    rig
}

/// A smooth vector, as eigenvectors are. Rounding makes contours of it.
fn smooth(n: usize) -> Vec<f64> {
    (0..n).map(|i| (0.1 * (i % 24) as f64).sin() + 0.4 * (0.07 * (i / 24) as f64).cos()).collect()
}

fn error_of(rig: &Rig, part: Part, options: &MeasureOptions, x: &[f64]) -> f64 {
    error(&product(&mut rig.measure(options), part, x), &rig.matrix.apply(part, x))
}

#[test]
fn the_automatic_choice_of_dither_has_the_least_error() {
    let rig = rig(8);
    let n = rig.matrix.resolution.pixels();
    for (what, x) in [("smooth", smooth(n)), ("random", vector(n, 8))] {
        for part in [Part::Full, Part::Global] {
            let direct = if part == Part::Global { DirectBy::Patterns } else { DirectBy::None };
            let errors = [DitherBy::None, DitherBy::Random, DitherBy::Diffusion]
                .map(|dither| error_of(&rig, part, &MeasureOptions { dither, direct, ..plain() }, &x));
            let chosen = error_of(&rig, part, &MeasureOptions { direct, ..plain() }, &x);
            let best = errors.into_iter().fold(f64::INFINITY, f64::min);
            assert!(chosen <= 1.01 * best, "{what}, {part:?}: {chosen} of {errors:?}");
            println!(
                "{what}, {part:?}: nearest {:.2e}, random {:.2e}, diffusion {:.2e}",
                errors[0], errors[1], errors[2]
            );
        }
    }
}

#[test]
fn the_direct_light_of_the_rounding_error_can_be_compensated() {
    let rig = rig(8);
    let x = smooth(rig.matrix.resolution.pixels());
    let options = MeasureOptions { direct: DirectBy::Patterns, ..plain() };
    let without = error_of(&rig, Part::Full, &options, &x);
    let with = error_of(&rig, Part::Full, &MeasureOptions { compensate_rounding: true, ..options }, &x);
    println!("full: relative error {without:.1e}, compensated {with:.1e}");
    assert!(with < without / 10.0);
}

#[test]
fn direct_light_is_removed_for_the_pattern_shown() {
    let rig = rig(3);
    let n = rig.matrix.resolution.pixels();
    let x: Vec<f64> = smooth(n).iter().map(|x| x.abs()).collect();
    let options = MeasureOptions { direct: DirectBy::Patterns, ..plain() };
    let truth = rig.matrix.apply(Part::Global, &x);
    let mut measurement = rig.measure(&options);
    let shown = error(&product(&mut measurement, Part::Global, &x), &truth);
    let [full, direct] = [Part::Full, Part::Direct].map(|part| product(&mut measurement, part, &x));
    let target: Vec<f64> = full.iter().zip(&direct).map(|(full, direct)| full - direct).collect();
    let target = error(&target, &truth);
    println!("3 bits: relative error {target:.4} with the target pattern, {shown:.4} with the pattern shown");
    assert!(shown < target / 20.0);
}
