//! Photos against an independent renderer, by z-test: our noise from independent seeds, the reference's from its files.

use std::sync::Arc;

use crate::common::{checker, load, mean_and_error, reference, rms, settings, tracer};
use krylux::image::Image;
use krylux::transport::{Channels, Transport, assemble};

const SIDE: usize = 64;
/// Independent runs; with 24 the estimate of the error itself is good to 15 % per pixel, which the rms over 4096 pixels
/// averages away but for a factor √(23/21) = 1.05 on our share of it.
const SEEDS: u32 = 24;

struct Agreement {
    z_rms: f64,
    bias: f64,
    combined_error: f64,
}

/// Compares photos of `scene` under both patterns, `[ones, checker8]`.
fn compare(scene: &str, file: &str, channels: Channels, samples: u32) -> [Agreement; 2] {
    let scene = load(scene);
    let mut tracer = tracer(&scene);
    let patterns = {
        let resolution = settings(SIDE, 1, 1, 0).resolution;
        [Image::filled(resolution, 1, 1.0), checker(resolution, 8)]
    };
    let mut photos = [Vec::new(), Vec::new()];
    for seed in 0..SEEDS {
        // The limit of surface hits is the reference's.
        let traced = assemble(&mut tracer, &settings(SIDE, samples, 15, seed), channels);
        let mut rig = Arc::new(traced.expect("shipped scenes can be traced"));
        for (photos, pattern) in photos.iter_mut().zip(&patterns) {
            let photo = rig.photograph(pattern).expect("the pattern has the rig's size");
            photos.push(photo.samples().iter().map(|&sample| f64::from(sample)).collect::<Vec<f64>>());
        }
    }
    [(0, "ones"), (1, "checker8")].map(|(index, pattern)| {
        let (ours, our_error) = mean_and_error(&photos[index]);
        let theirs = reference(&format!("{file}_64_{pattern}.npy"));
        let their_error = reference(&format!("{file}_64_{pattern}_stderr.npy"));
        let error: Vec<f64> = our_error.iter().zip(&their_error).map(|(a, b)| a.hypot(*b)).collect();
        let z: Vec<f64> = (0..ours.len()).map(|i| (ours[i] - theirs[i]) / error[i]).collect();
        let agreement = Agreement {
            z_rms: rms(&z),
            bias: ours.iter().sum::<f64>() / theirs.iter().sum::<f64>() - 1.0,
            combined_error: rms(&error) / rms(&theirs),
        };
        println!(
            "{file} {pattern}: z rms {:.3}, mean bias {:+.4} %, combined error {:.2} %",
            agreement.z_rms,
            100.0 * agreement.bias,
            100.0 * agreement.combined_error
        );
        agreement
    })
}

fn assert_agreement(agreements: [Agreement; 2], noise_limit: f64) {
    for Agreement { z_rms, bias, combined_error } in agreements {
        assert!(combined_error < noise_limit, "the test is too noisy to show anything: {combined_error}");
        assert!((0.9..1.15).contains(&z_rms), "z rms {z_rms}");
        assert!(bias.abs() < 0.001, "mean bias {bias}");
    }
}

#[test]
fn corner_photos_agree_with_the_reference() {
    assert_agreement(compare("corner", "corner90", Channels::Luma, 128), 0.005);
}

#[test]
fn zigzag_photos_agree_with_the_reference() {
    assert_agreement(compare("zigzag", "zigzag", Channels::Luma, 192), 0.005);
}

#[test]
fn cornell_photos_agree_with_the_reference() {
    // The reference alone has an error of 0.48 % and 0.53 %, so that 0.5 % cannot be reached, and
    // more samples of ours would hardly help.
    assert_agreement(compare("cornell", "cornell", Channels::Rgb, 64), 0.0075);
}
