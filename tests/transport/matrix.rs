//! The transport matrix as an operator: symmetric, linear, repeatable, and the same whether replayed or traced anew.

use std::sync::Arc;

use crate::common::{self, checker, csr, load, magnitudes, random_vector, settings, trace, tracer};
use krylux::image::{Image, Resolution};
use krylux::render::{TraceSettings, Tracer};
use krylux::transport::{
    Assembled, Bounces, Channels, Part, Retraced, Transport, TransportMatrix, assemble_layers,
};

/// Two gray scenes and a coloured one.
const SCENES: [(&str, Channels); 3] =
    [("corner", Channels::Luma), ("zigzag", Channels::Luma), ("cornell", Channels::Rgb)];

fn traced(name: &'static str, channels: Channels) -> &'static Assembled {
    common::traced(name, settings(20, 24, 6, 7), channels)
}

fn product(matrix: &TransportMatrix, part: Part, channel: usize, x: &[f64]) -> Vec<f64> {
    let mut y = vec![f64::NAN; x.len()];
    matrix.apply(part, channel, x, &mut y);
    y
}

#[test]
fn every_part_is_symmetric_to_the_last_bit_and_never_negative() {
    for (name, channels) in SCENES {
        let matrix = &traced(name, channels).matrix;
        for channel in 0..channels.count() {
            for part in [Part::Full, Part::Direct, Part::Global] {
                let csr = csr(matrix, part, channel);
                assert!(csr.is_symmetric(), "{name}: {part:?} of channel {channel}");
                assert!(
                    csr.entries().all(|(.., weight)| weight.is_finite() && weight >= 0.0),
                    "{name}: {part:?}"
                );
                let on_diagonal = csr.entries().all(|(row, column, _)| row == column);
                assert_eq!(on_diagonal, part == Part::Direct, "{name}: {part:?}");
            }
            // Not by way of `is_symmetric`: the same statement, entry by entry, in a dense square.
            let n = matrix.resolution().pixels();
            let mut dense = vec![0.0; n * n];
            csr(matrix, Part::Full, channel).entries().for_each(|(row, column, weight)| {
                dense[row * n + column] = weight;
            });
            for row in 0..n {
                for column in 0..row {
                    assert_eq!(
                        dense[row * n + column].to_bits(),
                        dense[column * n + row].to_bits(),
                        "{name}"
                    );
                }
            }
        }
    }
}

#[test]
fn products_are_linear() {
    for (name, channels) in SCENES {
        let matrix = &traced(name, channels).matrix;
        let n = matrix.resolution().pixels();
        let [x, y] = [random_vector(n, 1), random_vector(n, 2)];
        let (alpha, beta) = (1.7, -0.3);
        let combined: Vec<f64> = x.iter().zip(&y).map(|(x, y)| alpha * x + beta * y).collect();
        for channel in 0..channels.count() {
            for part in [Part::Full, Part::Direct, Part::Global] {
                let csr = csr(matrix, part, channel);
                let together = product(matrix, part, channel, &combined);
                let [ax, ay] = [&x, &y].map(|v| product(matrix, part, channel, v));
                let [mx, my] = [&x, &y].map(|v| magnitudes(&csr, v));
                for row in 0..n {
                    // A sum of m products is off by at most m ε Σ|a x| (Higham 2002, eq. 3.5); three such sums, and
                    // three more roundings in the combination.
                    let terms = (csr.row(row).0.len() + 4) as f64;
                    let bound =
                        2.0 * terms * f64::EPSILON * (alpha.abs() * mx[row] + f64::abs(beta) * my[row]);
                    let error = (together[row] - (alpha * ax[row] + beta * ay[row])).abs();
                    assert!(error <= bound, "{name}, {part:?}, row {row}: {error:e} above {bound:e}");
                }
            }
        }
    }
}

#[test]
fn products_agree_with_the_exported_matrix() {
    for (name, channels) in SCENES {
        let matrix = &traced(name, channels).matrix;
        let x = random_vector(matrix.resolution().pixels(), 3);
        for channel in 0..channels.count() {
            for part in [Part::Full, Part::Direct, Part::Global] {
                let csr = csr(matrix, part, channel);
                let mut by_entries = vec![0.0; x.len()];
                csr.entries().for_each(|(row, column, weight)| by_entries[row] += weight * x[column]);
                let magnitudes = magnitudes(&csr, &x);
                let applied = product(matrix, part, channel, &x);
                for row in 0..x.len() {
                    // The full matrix adds direct and global light on the diagonal in f32: half a unit in its last place.
                    let bound = f64::from(f32::EPSILON) * magnitudes[row];
                    let error = (applied[row] - by_entries[row]).abs();
                    assert!(error <= bound, "{name}, {part:?}, row {row}: {error:e} above {bound:e}");
                }
            }
        }
    }
}

#[test]
fn the_direct_part_is_what_the_global_part_leaves_of_the_whole() {
    for (name, channels) in SCENES {
        let matrix = &traced(name, channels).matrix;
        let x = random_vector(matrix.resolution().pixels(), 4);
        for channel in 0..channels.count() {
            let [full, direct, global] =
                [Part::Full, Part::Direct, Part::Global].map(|part| product(matrix, part, channel, &x));
            for row in 0..x.len() {
                assert_eq!(direct[row], f64::from(matrix.direct(channel)[row]) * x[row]);
                // One f64 addition, of terms that may cancel.
                let bound = 2.0 * f64::EPSILON * (direct[row].abs() + global[row].abs());
                assert!((full[row] - global[row] - direct[row]).abs() <= bound, "{name}, row {row}");
            }
        }
    }
}

#[test]
fn equal_seeds_give_equal_bits_and_other_seeds_do_not() {
    for (name, channels) in SCENES {
        let scene = load(name);
        let wanted = settings(20, 24, 6, 7);
        let first = trace(&mut tracer(&scene), wanted, channels);
        // On a tracer that has traced something else before, and whose batches are therefore cut differently.
        let mut used = tracer(&scene);
        trace(
            &mut used,
            TraceSettings { resolution: Resolution::new(33, 9), ..settings(1, 5, 3, 1) },
            channels,
        );
        let again = trace(&mut used, wanted, channels);
        assert_eq!(first.matrix, again.matrix, "{name}");
        assert_eq!(first.ambient, again.ambient, "{name}");
        let other = trace(&mut used, TraceSettings { seed: 8, ..wanted }, channels);
        assert_ne!(first.matrix, other.matrix, "{name}");
        assert_ne!(first.matrix.direct(0), other.matrix.direct(0), "{name}");
    }
}

#[test]
fn work_by_the_machine_meanwhile_does_not_change_a_bit() {
    let scene = load("corner");
    let quiet = trace(&mut tracer(&scene), settings(24, 64, 6, 3), Channels::Luma).matrix;
    let done = std::sync::atomic::AtomicBool::new(false);
    let busy = std::thread::scope(|scope| {
        let idle = || {
            while !done.load(std::sync::atomic::Ordering::Relaxed) {
                std::hint::spin_loop();
            }
        };
        (0..3).for_each(|_| drop(scope.spawn(idle)));
        // Slow dispatches make other batches.
        let busy = trace(&mut tracer(&scene), settings(24, 64, 6, 3), Channels::Luma).matrix;
        done.store(true, std::sync::atomic::Ordering::Relaxed);
        busy
    });
    assert_eq!(quiet, busy);
}

fn replay_and_retrace(tracer: &mut Tracer, channels: Channels, patterns: &[Image]) -> Vec<f64> {
    let settings = settings(20, 24, 6, 7);
    let mut replayed = Arc::new(trace(tracer, settings, channels));
    let mut retraced = Retraced { tracer, settings, channels };
    let differences = patterns.iter().map(|pattern| {
        let [replay, retrace] = [&mut replayed as &mut dyn Transport, &mut retraced]
            .map(|rig| rig.photograph(pattern).expect("the pattern fits"));
        assert_eq!((replay.resolution(), replay.channels()), (retrace.resolution(), retrace.channels()));
        let norm =
            |values: &mut dyn Iterator<Item = f64>| values.map(|value| value * value).sum::<f64>().sqrt();
        let pairs =
            || replay.samples().iter().zip(retrace.samples()).map(|(a, b)| (f64::from(*a), f64::from(*b)));
        norm(&mut pairs().map(|(a, b)| a - b)) / norm(&mut pairs().map(|(_, b)| b))
    });
    differences.collect()
}

#[test]
fn a_replayed_photo_is_the_retraced_one() {
    let resolution = Resolution::new(20, 20);
    let signed = random_vector(resolution.pixels(), 5).into_iter().map(|value| value as f32).collect();
    let gray = vec![
        Image::filled(resolution, 1, 1.0),
        checker(resolution, 4),
        Image::new(resolution, 1, signed).expect("one sample per pixel"),
    ];
    let colors = random_vector(3 * resolution.pixels(), 6).into_iter().map(|value| value as f32).collect();
    let mut colored = gray.clone();
    colored.push(Image::new(resolution, 3, colors).expect("three samples per pixel"));
    for (name, _) in SCENES {
        let mut scene = load(name);
        // With ambient light: the photo holds it, too.
        scene.materials[0].emission = glam::vec3(0.01, 0.02, 0.03);
        let mut tracer = tracer(&scene);
        for (channels, patterns) in [(Channels::Luma, &gray), (Channels::Rgb, &colored)] {
            let differences = replay_and_retrace(&mut tracer, channels, patterns);
            let worst = differences.iter().copied().max_by(f64::total_cmp).expect("there are patterns");
            println!("{name}, {channels:?}: replay differs from retrace by {worst:.1e}");
            // Matrix and photos are rounded to f32, to 6e-8 each; signed patterns cancel to about a tenth.
            assert!(worst < 1e-6, "{name}: {differences:?}");
        }
    }
}

#[test]
fn a_photo_under_one_lit_pixel_is_that_pixels_row() {
    for (name, channels) in SCENES {
        let mut rig = Arc::new(trace(&mut tracer(&load(name)), settings(20, 24, 6, 7), channels));
        let resolution = rig.photo_resolution();
        let n = resolution.pixels();
        for pixel in [0, 7 * 20 + 3, n / 2 + 10, n - 1] {
            let mut pattern = Image::filled(resolution, 1, 0.0);
            pattern.samples_mut()[pixel] = 1.0;
            let photo = rig.photograph(&pattern).expect("the pattern fits");
            for channel in 0..channels.count() {
                let csr = csr(&rig.matrix, Part::Full, channel);
                let mut row = vec![0.0; n];
                csr.entries().filter(|&(r, ..)| r == pixel).for_each(|(_, column, w)| row[column] = w);
                assert!(row[pixel] > 0.0 && row.iter().filter(|&&weight| weight > 0.0).count() > 1, "{name}");
                for (seen, expected) in photo.plane(channel).iter().zip(&row) {
                    // The diagonal is a sum, rounded once here and once there.
                    assert!(
                        (seen - expected).abs() <= f64::from(f32::EPSILON) * expected,
                        "{name}, pixel {pixel}"
                    );
                }
            }
        }
    }
}

#[test]
fn luminance_is_the_weighted_sum_of_the_colours() {
    let [gray, color] = [Channels::Luma, Channels::Rgb].map(|channels| &traced("cornell", channels).matrix);
    let x = random_vector(gray.resolution().pixels(), 9);
    let luma = product(gray, Part::Full, 0, &x);
    let planes = [0, 1, 2].map(|channel| product(color, Part::Full, channel, &x));
    let magnitudes = magnitudes(&csr(gray, Part::Full, 0), &x);
    for row in 0..x.len() {
        let sum = 0.2126 * planes[0][row] + 0.7152 * planes[1][row] + 0.0722 * planes[2][row];
        // Weighted before or after the sums over paths, and rounded to f32 in either.
        assert!((luma[row] - sum).abs() <= 4.0 * f64::from(f32::EPSILON) * magnitudes[row], "row {row}");
    }
}

#[test]
fn matrices_are_equal_by_their_entries_and_take_the_memory_of_all_their_parts() {
    let mut tracer = tracer(&load("corner"));
    let mut of = |bounces| trace(&mut tracer, settings(12, 8, bounces, 3), Channels::Luma).matrix;
    let [direct, some, more] = [1, 2, 6].map(&mut of);
    // Direct light is the same.
    assert_ne!(some, more);
    assert_eq!(more, of(6));
    // Four bytes at least for each pixel's direct light, and for the weight of each entry on one side of the diagonal.
    let least = 4 * 144;
    assert!(direct.bytes() >= least, "{}", direct.bytes());
    assert!(more.bytes() >= least + 4 * more.nonzeros() / 2, "{}", more.bytes());
}

#[test]
fn a_coaxial_pinhole_rig_has_no_layer_of_one_bounce() {
    let mut tracer = tracer(&load("corner"));
    let mut bounces = |projector, split| {
        let settings = TraceSettings { projector, ..settings(8, 4, 3, 1) };
        let traced =
            assemble_layers(&mut tracer, &settings, Channels::Luma, split).expect("it can be traced");
        (traced.matrix.bounces().collect::<Vec<_>>(), traced.matrix.direct(0).len())
    };
    assert_eq!(bounces(None, false), (vec![Bounces::Global], 64));
    assert_eq!(bounces(None, true), (vec![Bounces::Two, Bounces::Rest], 64));
    let apart = Some(Resolution::new(7, 5));
    assert_eq!(bounces(apart, false), (vec![Bounces::One, Bounces::Global], 0));
    assert_eq!(bounces(apart, true), (vec![Bounces::One, Bounces::Two, Bounces::Rest], 0));
}

#[test]
fn norms_are_those_of_the_entries() {
    for (name, channels) in SCENES {
        let matrix = &traced(name, channels).matrix;
        for channel in 0..channels.count() {
            let squares = |part| matrix.frobenius_norm(part, channel).powi(2);
            let of_entries =
                |part| csr(matrix, part, channel).entries().map(|(.., weight)| weight * weight).sum::<f64>();
            for part in [Part::Direct, Part::Global] {
                let (found, expected) = (squares(part), of_entries(part));
                // Sums of at most 160000 squares, in another order.
                assert!(expected > 0.0 && (found - expected).abs() < 1e-10 * expected, "{name}, {part:?}");
            }
            let both = squares(Part::Direct) + squares(Part::Global);
            assert!((squares(Part::Full) - both).abs() < 1e-10 * both, "{name}: entries of both count apart");
        }
    }
}
