//! The conversion of light to counts (noise, quantization, saturation, exposure), and the misregistration of pixels.

use krylux::Error;
use krylux::image::Resolution;
use krylux::rig::{Devices, VirtualRig};

use super::support::{capture, counts, diagonal, moments, open, rig, show};

/// A rig with a noisy camera, on a scene whose pixels are a ramp from dark to white.
fn noisy() -> (VirtualRig, Devices) {
    let mut rig = rig(40, 25);
    let camera = &mut rig.camera;
    (camera.bits, camera.black_level, camera.shot_noise, camera.read_noise) = (14, 200.0, true, 5.0);
    (camera.white_fill, camera.dark_current) = (0.9, 30.0);
    let devices = rig.open(diagonal(rig.scene.size(), |pixel| pixel as f64 / 999.0), None);
    let devices = show(devices.expect("it fits"), &rig, 255, 0.1);
    (rig, devices)
}

#[test]
fn mean_and_variance_of_counts_are_those_of_the_model() {
    let (_, mut devices) = noisy();
    const FRAMES: usize = 400;
    let electrons_per_count = 60_000.0 / (16383.0 - 200.0);
    // The 99th percentile of 1000 pixels is pixel 989.
    let electrons = |pixel: usize| 0.9 * 60_000.0 * pixel as f64 / 989.0 + 30.0 * 0.1;
    let (mut mean_squares, mut variance_squares, mut variance_sum) = (0.0, 0.0, 0.0);
    let moments = moments(&mut devices, FRAMES);
    for (pixel, [mean, variance]) in moments.iter().enumerate() {
        let expected = 200.0 + electrons(pixel) / electrons_per_count;
        let noise = (electrons(pixel) + 25.0) / electrons_per_count.powi(2) + 1.0 / 12.0;
        mean_squares += (mean - expected).powi(2) / (noise / FRAMES as f64);
        let z = (variance / noise - 1.0) / (2.0 / (FRAMES as f64 - 1.0)).sqrt();
        variance_squares += z * z;
        variance_sum += z;
    }
    // The root mean square of 1000 standard normal variates is 1 ± 0.022; the bound is five of these.
    let pixels = moments.len() as f64;
    let [mean, variance] = [mean_squares, variance_squares].map(|squares: f64| (squares / pixels).sqrt());
    println!(
        "rms z of means {mean:.3}, of variances {variance:.3}, mean z of variances {:.3}",
        variance_sum / pixels
    );
    assert!((mean - 1.0).abs() < 0.11 && (variance - 1.0).abs() < 0.11, "rms z: {mean}, {variance}");
    assert!((variance_sum / pixels).abs() < 5.0 / pixels.sqrt(), "mean z of variances");
}

#[test]
fn dim_light_has_poisson_counts() {
    let mut rig = rig(50, 40);
    // One electron for each count.
    let camera = &mut rig.camera;
    (camera.bits, camera.black_level, camera.full_well, camera.shot_noise) = (10, 23.0, 1000.0, true);
    (camera.white_fill, camera.white_exposure) = (0.0015, 1.0);
    let mut devices = show(open(&rig), &rig, 255, 1.0);
    let frames: Vec<f64> = (0..50).flat_map(|_| counts(&mut devices)).map(|count| count - 23.0).collect();
    let total = frames.len() as f64;
    let mut probability = (-1.5_f64).exp();
    for photons in 0..8 {
        let share = frames.iter().filter(|&&count| count == f64::from(photons)).count() as f64 / total;
        // Five standard errors of a relative frequency in 100,000 counts.
        let bound = 5.0 * (probability / total).sqrt();
        assert!((share - probability).abs() < bound, "{photons}: {share} for {probability}");
        probability *= 1.5 / f64::from(photons + 1);
    }
}

#[test]
fn noise_differs_between_frames_and_pixels_and_repeats_between_runs() {
    let ((_, mut first), (_, mut again)) = (noisy(), noisy());
    let frames = [capture(&mut first), capture(&mut first)];
    assert_eq!(frames, [capture(&mut again), capture(&mut again)]);
    let [a, b] = frames.map(|frame| frame.counts);
    let residual: Vec<[f64; 2]> = a
        .chunks(2)
        .zip(b.chunks(2))
        .map(|(a, b)| [f64::from(a[0]) - f64::from(b[0]), f64::from(a[1]) - f64::from(b[1])])
        .collect();
    let correlation: f64 = residual.iter().map(|[left, right]| left * right).sum::<f64>()
        / residual.iter().map(|[left, right]| left.hypot(*right).powi(2) / 2.0).sum::<f64>();
    // 500 pairs of neighbours with different variances give a standard error of up to 0.06.
    assert!(correlation.abs() < 0.3, "neighbours are independent: {correlation}");
    let (mut rig, _) = noisy();
    rig.seed = 1;
    let devices = rig.open(diagonal(rig.scene.size(), |pixel| pixel as f64 / 999.0), None).expect("it fits");
    assert_ne!(capture(&mut show(devices, &rig, 255, 0.1)).counts, a);
}

#[test]
fn a_saturated_pixel_counts_the_highest_number_and_no_more() {
    let mut rig = rig(2, 2);
    (rig.camera.bits, rig.camera.shot_noise, rig.camera.read_noise) = (12, true, 10.0);
    let mut devices = show(open(&rig), &rig, 255, 0.3);
    assert_eq!(counts(&mut devices), [4095.0; 4], "1.5 times the full well");
    rig.camera.saturation = Some(4000);
    assert_eq!(counts(&mut show(open(&rig), &rig, 255, 0.3)), [4000.0; 4]);
    rig.camera.white_fill = 0.94 / 3.0;
    let near = counts(&mut show(open(&rig), &rig, 255, 0.3));
    // The mean is 3849, with a standard deviation of 16.
    assert!(near.iter().all(|&count| (3760.0..3940.0).contains(&count)), "just below: {near:?}");
}

#[test]
fn without_light_a_pixel_counts_the_black_level_and_the_dark_current() {
    let mut rig = rig(2, 2);
    (rig.camera.bits, rig.camera.black_level, rig.camera.dark_current) = (16, 535.0, 1000.0);
    let per_second = 1000.0 * 65000.0 / 60_000.0;
    for exposure in [1e-4_f64, 0.5, 3.0] {
        let expected = (535.0 + per_second * exposure).round();
        assert_eq!(counts(&mut show(open(&rig), &rig, 0, exposure)), [expected; 4]);
    }
}

#[test]
fn counts_are_rounded_to_the_nearest_step() {
    let mut rig = rig(256, 1);
    (rig.camera.bits, rig.camera.white_fill) = (8, 0.999);
    let devices = rig.open(diagonal(rig.scene.size(), |pixel| (pixel as f64 + 0.3) / 253.3), None);
    let counts = counts(&mut show(devices.expect("it fits"), &rig, 255, 0.1));
    for (pixel, count) in counts.iter().enumerate() {
        // Pixel 252 of 256 is the 99th percentile, and its light is 252.3 / 253.3.
        let expected = (255.0 * 0.999 * (pixel as f64 + 0.3) / 252.3).round().min(255.0);
        assert_eq!(*count, expected, "{pixel}");
    }
}

#[test]
fn the_response_bends_counts_between_its_ends() {
    let mut rig = rig(2, 2);
    rig.camera.gamma = Some(0.5);
    let found = counts(&mut show(open(&rig), &rig, 255, 0.05))[0];
    // A count is rounded to the nearest integer.
    assert!((found - 65535.0 * 0.25_f64.sqrt()).abs() <= 0.5 + 1e-6, "{found}");
    (rig.camera.gamma, rig.camera.curve) = (None, Some(vec![0.0, 0.7, 1.0]));
    let found = counts(&mut show(open(&rig), &rig, 255, 0.1))[0];
    assert!((found - 65535.0 * 0.7).abs() <= 0.5 + 1e-6, "{found}");
}

#[test]
fn the_exposure_that_was_set_is_returned_and_used() {
    let mut rig = rig(2, 2);
    (rig.camera.exposures, rig.camera.exposure_step) = ([0.00025, 1.0], 0.001);
    let mut devices = show(open(&rig), &rig, 255, 0.1);
    for (asked, expected) in [(0.0123, 0.012), (0.0126, 0.013), (0.00025, 0.001), (1.0, 1.0)] {
        let set = devices.camera.configure(asked).expect("within the range");
        assert!((set - expected).abs() < 1e-12, "{asked}: {set}");
        let frame = capture(&mut devices);
        assert_eq!(frame.exposure, set);
        let light = (0.5 * 65535.0 * set / 0.1).min(65535.0).round();
        assert!((f64::from(frame.counts[0]) - light).abs() <= 1.0, "{asked}");
    }
    for asked in [0.0, 0.0002, 1.1, f64::NAN, -1.0, f64::INFINITY] {
        assert!(matches!(devices.camera.configure(asked), Err(Error::Rig { .. })), "{asked}");
    }
}

#[test]
fn exposures_and_readout_take_time() {
    let mut rig = rig(2, 2);
    rig.camera.readout = 0.25;
    let mut devices = show(open(&rig), &rig, 255, 0.5);
    let frames = [capture(&mut devices), capture(&mut devices)];
    assert_eq!([frames[0].started, frames[1].started, devices.clock.now()], [0.0, 0.75, 1.5]);
    assert_eq!([frames[0].id, frames[1].id], [1, 2]);
}

/// The places in projector pixels at which the camera's pixels look: along each axis from a photo that is a ramp along it.
fn seen(rig: &VirtualRig) -> [Vec<f64>; 2] {
    let size = rig.scene.size();
    [0, 1].map(|axis| {
        let at = move |pixel: usize| [pixel % size.width, pixel / size.width][axis] as f64 + 0.5;
        let devices = rig.open(diagonal(size, at), None).expect("it fits");
        let ramp = counts(&mut show(devices, rig, 255, 0.1));
        let white = rig.open(diagonal(size, |_| 1.0), None).expect("it fits");
        let white = counts(&mut show(white, rig, 255, 0.1));
        // The two scenes' sensitivities differ by a factor, which the pixel that is known by symmetry gives.
        let centre = rig.camera_info().resolution;
        let centre = centre.height / 2 * centre.width + centre.width / 2;
        let [width, height] = [size.width, size.height];
        let middle = [width as f64 / 2.0, height as f64 / 2.0][axis] + rig.camera.shift[axis];
        let scale = middle / (ramp[centre] / white[centre]);
        ramp.iter().zip(white).map(|(ramp, white)| scale * ramp / white).collect()
    })
}

/// The largest difference in projector pixels between the point that a camera pixel sees and the expected point, over the pixels whose
/// expected point is at least `margin` from the photo's border.
fn compare(rig: &VirtualRig, margin: f64, expected: impl Fn([f64; 2]) -> [f64; 2]) -> f64 {
    let (camera, size) = (rig.camera_info().resolution, rig.scene.size());
    let [across, down] = seen(rig);
    let mut worst: f64 = 0.0;
    let mut compared = 0;
    for (pixel, seen) in across.into_iter().zip(down).enumerate() {
        let at = [
            ((pixel % camera.width) as f64 + 0.5) * size.width as f64 / camera.width as f64,
            ((pixel / camera.width) as f64 + 0.5) * size.height as f64 / camera.height as f64,
        ];
        let [x, y] = expected(at);
        let inside = |at: f64, of: usize| (margin..=of as f64 - margin).contains(&at);
        if inside(x, size.width) && inside(y, size.height) {
            worst = worst.max((seen.0 - x).abs()).max((seen.1 - y).abs());
            compared += 1;
        }
    }
    assert!(2 * compared > camera.pixels(), "most pixels are compared");
    worst
}

#[test]
fn a_shifted_camera_sees_a_ramp_shifted() {
    let mut rig = rig(40, 30);
    rig.camera.size = Some([41, 31]);
    rig.camera.shift = [0.5, -0.3];
    let worst = compare(&rig, 1.5, |[x, y]| [x + 0.5, y - 0.3]);
    // Pixels of nearly the same size average the steps of the ramp with an error of their difference in size.
    println!("shifted: {worst:.4} px at worst");
    assert!(worst < 0.05, "{worst}");
}

#[test]
fn a_rotated_scaled_and_distorted_camera_sees_what_the_formula_says() {
    let mut rig = rig(84, 60);
    // Each camera pixel covers 4×4 projector pixels, which averages the steps of the ramp.
    rig.camera.size = Some([21, 15]);
    (rig.camera.rotation, rig.camera.scale, rig.camera.distortion) = (5.0, 0.9, 0.05);
    rig.camera.shift = [1.0, 0.5];
    let expected = |[x, y]: [f64; 2]| {
        let (dx, dy) = (x - 42.0, y - 30.0);
        let k = 1.0 + 0.05 * (dx * dx + dy * dy) / (42.0 * 42.0 + 30.0 * 30.0);
        let (sin, cos) = 5.0_f64.to_radians().sin_cos();
        [42.0 + 0.9 * k * (cos * dx - sin * dy) + 1.0, 30.0 + 0.9 * k * (sin * dx + cos * dy) + 0.5]
    };
    let worst = compare(&rig, 3.0, expected);
    // Sub-pixels that are rotated by 5 degrees are treated as upright, an error of a hundredth of a pixel; and counts are rounded.
    println!("turned, scaled and distorted: {worst:.4} px at worst");
    assert!(worst < 0.04, "{worst}");
    let sinless = compare(&rig, 3.0, |[x, y]| [x + 1.0, y + 0.5]);
    assert!(sinless > 1.0, "the comparison tells them apart: {sinless}");
}

#[test]
fn a_homography_equals_its_rotation_scale_and_shift() {
    let mut parts = rig(24, 18);
    parts.camera.size = Some([30, 20]);
    (parts.camera.rotation, parts.camera.scale, parts.camera.shift) = (3.0, 1.05, [0.4, -0.7]);
    let mut whole = parts.clone();
    (whole.camera.rotation, whole.camera.scale, whole.camera.shift) = (0.0, 1.0, [0.0; 2]);
    let (sin, cos) = 3.0_f64.to_radians().sin_cos();
    let [a, b] = [1.05 * cos, 1.05 * sin];
    // H p = c + R (p − c) + shift, with all entries doubled: a homography is defined up to a factor.
    whole.camera.homography = Some([
        [2.0 * a, -2.0 * b, 2.0 * (12.0 - a * 12.0 + b * 9.0 + 0.4)],
        [2.0 * b, 2.0 * a, 2.0 * (9.0 - b * 12.0 - a * 9.0 - 0.7)],
        [0.0, 0.0, 2.0],
    ]);
    let size = Resolution::new(24, 18);
    for point in [[0.0, 0.0], [24.0, 0.0], [3.5, 11.25]] {
        let [one, other] = [&parts, &whole].map(|rig| rig.camera.sees(size, point));
        assert!(one.iter().zip(other).all(|(one, other)| (one - other).abs() < 1e-12), "{one:?} {other:?}");
    }
    let counts = [&parts, &whole].map(|rig| counts(&mut show(open(rig), rig, 255, 0.1)));
    assert_eq!(counts[0].len(), 600);
    // The areas are equal up to rounding, which may change a count by 1.
    assert!(counts[0].iter().zip(&counts[1]).all(|(a, b)| (a - b).abs() <= 1.0));
}

#[test]
fn the_light_of_a_pixel_is_distributed_by_area_without_loss() {
    let mut rig = rig(6, 4);
    rig.camera.size = Some([15, 10]);
    let lit = |pixel: usize| f64::from(u8::from(pixel == 8));
    let devices = rig.open(diagonal(rig.scene.size(), lit), None).expect("it fits");
    let counts = counts(&mut show(devices, &rig, 255, 0.1));
    let total: f64 = counts.iter().sum();
    assert!((total / WHITE_COUNT - 6.25).abs() < 1e-3, "{}", total / WHITE_COUNT);
    // Column 2 of 6 is 5.0 to 7.5 of 15, row 1 of 4 is 2.5 to 5.0 of 10.
    for (at, share) in
        [((5, 3), 1.0), ((7, 3), 0.5), ((5, 2), 0.5), ((7, 2), 0.25), ((4, 3), 0.0), ((5, 5), 0.0)]
    {
        let found = counts[at.1 * 15 + at.0] / WHITE_COUNT;
        assert!((found - share).abs() < 1e-4, "{at:?}: {found} for {share}");
    }
}

/// The count of the 99th percentile after 0.1 s.
const WHITE_COUNT: f64 = 0.5 * 65535.0;
