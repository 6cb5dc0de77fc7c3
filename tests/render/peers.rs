//! Whole photos of lenses, rigs apart, rough metal, paper and glass against independent renderers, by z-test: our noise
//! from independent seeds, theirs from their files. `tests/reference/peer` says how those were made.

use crate::common::{self, mean_and_error, reference, rms, root, tracer};
use krylux::image::Resolution;
use krylux::render::TraceSettings;
use krylux::scene::{self, Lens, Scene};
use krylux::transport::{Channels, Part, TransportMatrix, assemble};

const SEEDS: u32 = 8;
const SAMPLES: u32 = 96;

fn load(name: &str) -> Scene {
    let path = root().join("tests/reference/peer").join(format!("{name}.glb"));
    scene::load(&path, None).expect("the reference scenes load")
}

fn peer(name: &str) -> Vec<f64> {
    reference(&format!("peer/{name}.npy"))
}

/// One matrix a seed.
fn matrices(scene: &Scene, settings: TraceSettings) -> Vec<TransportMatrix> {
    let mut tracer = tracer(scene);
    let mut trace = |seed| {
        let settings = TraceSettings { seed, ..settings };
        let traced = assemble(&mut tracer, &settings, Channels::Luma);
        traced.expect("the scene can be traced").matrix
    };
    (0..SEEDS).map(&mut trace).collect()
}

/// Mean and standard error of the photos of `pattern`.
fn photos(matrices: &[TransportMatrix], part: Part, pattern: &[f64], pixels: usize) -> (Vec<f64>, Vec<f64>) {
    let photo = |matrix: &TransportMatrix| {
        let mut photo = vec![0.0; pixels];
        matrix.apply(part, 0, pattern, &mut photo);
        photo
    };
    mean_and_error(&matrices.iter().map(photo).collect::<Vec<_>>())
}

/// Compares pixel by pixel and in the sum. Student's t with seven degrees of freedom has an rms of 1.18, ours and theirs
/// together less; 2304 pixels tell it to 2 %.
fn assert_agreement(name: &str, ours: (Vec<f64>, Vec<f64>), theirs: &str) {
    let (values, errors) = ours;
    let (expected, expected_errors) = (peer(theirs), peer(&format!("{theirs}_stderr")));
    let rounding = 1e-5 * expected.iter().copied().fold(0.0, f64::max);
    let error: Vec<f64> =
        errors.iter().zip(&expected_errors).map(|(a, b)| a.hypot(*b).hypot(rounding)).collect();
    // Both are exactly 0 if no light can arrive.
    let noisy = (0..values.len()).filter(|&i| error[i] > 2.0 * rounding);
    let z: Vec<f64> = noisy.map(|i| (values[i] - expected[i]) / error[i]).collect();
    let (sum, expected_sum) = (values.iter().sum::<f64>(), expected.iter().sum::<f64>());
    let total_error = error.iter().map(|error| error * error).sum::<f64>().sqrt();
    println!(
        "{name}: z rms {:.3}, sum {:+.3} % ± {:.3} %, noise {:.2} %",
        rms(&z),
        100.0 * (sum / expected_sum - 1.0),
        100.0 * total_error / expected_sum,
        100.0 * rms(&error) / rms(&expected)
    );
    assert!((0.8..1.3).contains(&rms(&z)), "{name}: z rms {}", rms(&z));
    assert!((sum - expected_sum).abs() < 4.0 * total_error, "{name}: {sum}, not {expected_sum}");
    assert!(rms(&error) < 0.03 * rms(&expected), "{name}: too noisy to show anything");
}

#[test]
fn a_rig_apart_photographs_as_it_should_both_ways() {
    let camera = Resolution::new(48, 48);
    let projector = Resolution::new(64, 48);
    let scene = load("separated");
    assert!(scene.projector.is_some(), "the file marks its projector");
    let settings = TraceSettings { projector: Some(projector), ..TraceSettings::new(camera, SAMPLES) };
    let pattern = peer("separated_pattern");
    let ones = vec![1.0; projector.pixels()];
    let rigs = matrices(&scene, settings);
    let seen = |part: Part, pattern: &[f64]| photos(&rigs, part, pattern, camera.pixels());
    assert_agreement("apart, ones", seen(Part::Full, &ones), "separated_48_ones");
    assert_agreement("apart, pattern", seen(Part::Full, &pattern), "separated_48_pattern");
    assert_agreement("apart, pattern, direct", seen(Part::Direct, &pattern), "separated_48_pattern_direct");
    let back = |matrix: &TransportMatrix| {
        let mut x = vec![0.0; projector.pixels()];
        matrix.apply_transpose(Part::Full, 0, &vec![1.0; camera.pixels()], &mut x);
        x
    };
    let transposed = mean_and_error(&rigs.iter().map(back).collect::<Vec<_>>());
    assert_agreement("apart, transposed", transposed, "separated_64x48_transposed_ones");
}

fn coaxial<const N: usize>(name: &str, files: [(&str, Vec<f64>); N]) {
    let resolution = Resolution::new(48, 48);
    let scene = load(name);
    let rigs = matrices(&scene, TraceSettings::new(resolution, SAMPLES));
    for (file, pattern) in files {
        let seen = photos(&rigs, Part::Full, &pattern, resolution.pixels());
        assert_agreement(&format!("{name}, {file}"), seen, &format!("{name}_48_{file}"));
    }
}

fn checker() -> Vec<f64> {
    common::checker(Resolution::new(48, 48), 8).plane(0)
}

#[test]
fn rough_metal_photographs_as_it_should() {
    coaxial("rough-metal", [("ones", vec![1.0; 48 * 48]), ("checker8", checker())]);
}

#[test]
fn a_glossy_coat_photographs_as_it_should() {
    coaxial("glossy-dielectric", [("ones", vec![1.0; 48 * 48])]);
}

#[test]
fn paper_lit_from_behind_photographs_as_it_should() {
    coaxial("diffuse-transmission", [("ones", vec![1.0; 48 * 48]), ("checker8", checker())]);
}

#[test]
fn a_camera_with_a_lens_photographs_as_it_should() {
    let resolution = Resolution::new(48, 48);
    let mut scene = load("lens");
    // The projector stays a pinhole.
    scene.projector = Some(scene.camera.clone());
    scene.camera.lens = Lens { radius: 0.02, focus: 1.0 };
    let stripes: Vec<f64> = (0..48 * 48).map(|pixel| f64::from(u8::from(pixel % 48 / 6 % 2 == 0))).collect();
    let rigs = matrices(&scene, TraceSettings::new(resolution, SAMPLES));
    for (name, pattern) in [("ones", vec![1.0; 48 * 48]), ("stripes6", stripes)] {
        let seen = photos(&rigs, Part::Full, &pattern, resolution.pixels());
        assert_agreement(&format!("lens, {name}"), seen, &format!("lens_48_{name}"));
    }
}

/// The caustic under a glass ball: light that reaches the floor through the ball or off it and is then seen in plain sight.
/// A path tracer from the camera cannot meet it; ours are the reverse of paths that see the floor through the ball.
#[test]
fn the_caustic_of_a_glass_ball_carries_the_light_that_goes_through_it() {
    let resolution = Resolution::new(64, 64);
    let mut scene = load("glass-sphere");
    let floor = scene.triangles[0].material as usize;
    // So dark that light which meets the floor twice is out of the count.
    const DARKER: f64 = 100.0;
    scene.materials[floor].base_color /= DARKER as f32;
    // Up to five surfaces of the ball, and the floor.
    let settings = TraceSettings { max_bounces: 7, ..TraceSettings::new(resolution, SAMPLES) };
    let on_the_floor: Vec<bool> = peer("glass-sphere_64_seen_transmitted")
        .iter()
        .zip(peer("glass-sphere_64_seen_reflected"))
        .map(|(a, b)| *a == 0.0 && b == 0.0)
        .collect();
    let rigs = matrices(&scene, settings);
    // So bright that the floor is as light as the reference's.
    let ones = vec![DARKER; resolution.pixels()];
    let (caustic, errors) = photos(&rigs, Part::Global, &ones, resolution.pixels());
    let among = |values: &[f64]| -> Vec<f64> {
        values.iter().zip(&on_the_floor).map(|(value, &counts)| if counts { *value } else { 0.0 }).collect()
    };
    let expected: Vec<f64> = peer("glass-sphere_64_transmitted")
        .iter()
        .zip(peer("glass-sphere_64_reflected"))
        .map(|(a, b)| a + b)
        .collect();
    let expected_errors: Vec<f64> = peer("glass-sphere_64_transmitted_stderr")
        .iter()
        .zip(peer("glass-sphere_64_reflected_stderr"))
        .map(|(a, b)| a.hypot(b))
        .collect();
    let (sum, expected_sum) = (among(&caustic).iter().sum::<f64>(), among(&expected).iter().sum::<f64>());
    let variance = |errors: &[f64]| among(errors).iter().map(|error| error * error).sum::<f64>();
    let error = (variance(&errors) + variance(&expected_errors)).sqrt();
    println!(
        "caustic: {:+.2} % ± {:.2} % of the light",
        100.0 * (sum / expected_sum - 1.0),
        100.0 * error / expected_sum
    );
    assert!(error < 0.01 * expected_sum, "too noisy to show anything");
    // The reference leaves out 1e-4 of the light.
    assert!(
        (sum - expected_sum).abs() < 4.0 * error + 1e-3 * expected_sum,
        "{sum}, not {expected_sum} ± {error}"
    );
    let brightest = |values: &[f64]| values.iter().copied().fold(0.0, f64::max);
    assert!(brightest(&among(&caustic)) > 0.5 * brightest(&among(&expected)), "it is a caustic, not a haze");
}
