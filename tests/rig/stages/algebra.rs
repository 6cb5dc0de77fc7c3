//! Each stage by itself gives the expected matrix, and a symmetric one.

use krylux::image::{Image, Resolution};
use krylux::measure::{DirectBy, MeasureOptions, Registration, SignedBy};
use krylux::transport::Part;

use super::support::{Dense, Rig, columns, dot, plain, product, vector};

fn scene() -> Dense {
    Dense::new(Resolution::new(9, 6), 1000.0, 5)
}

/// A camera with twice as many pixels on a side that sees everything mirrored, and the pixel map for it.
fn mirrored(mut rig: Rig) -> Rig {
    let size = rig.matrix.resolution;
    let camera = Resolution::new(2 * size.width, 2 * size.height);
    let sees = |pixel: usize| {
        let (x, y) = (pixel % camera.width, pixel / camera.width);
        y / 2 * size.width + size.width - 1 - x / 2
    };
    rig.optics = Some((0..camera.pixels()).map(|pixel| vec![(sees(pixel), 1.0)]).collect());
    let row = |seen: usize| (0..camera.pixels()).filter(move |&pixel| sees(pixel) == seen);
    let pixels: Vec<u32> = (0..size.pixels()).flat_map(row).map(|pixel| pixel as u32).collect();
    rig.registration = Some(Registration {
        camera,
        projector: size,
        starts: (0..=size.pixels()).map(|pixel| 4 * pixel).collect(),
        weights: vec![0.25; pixels.len()],
        pixels,
        lens: None,
    });
    rig.camera.resolution = camera;
    rig
}

/// The weight of a Gaussian blur between two pixels of a row that is mirrored at its ends.
fn gaussian(from: usize, to: usize, length: usize, deviation: f64) -> f64 {
    let weight = |at: isize| (-0.5 * (at as f64 / deviation).powi(2)).exp();
    let reach = (4.0 * deviation).ceil() as isize;
    let sum: f64 = (-reach..=reach).map(weight).sum();
    let period = 2 * length as isize;
    let lands = |at: isize| {
        let within = (from as isize + at).rem_euclid(period);
        within.min(period - 1 - within) == to as isize
    };
    (-reach..=reach).filter(|&at| lands(at)).map(weight).sum::<f64>() / sum
}

#[test]
fn each_stage_gives_its_dense_matrix_and_a_symmetric_one() {
    let n = scene().resolution.pixels();
    let quiet = Rig::new(scene());
    let room = Rig { ambient: 900.0, black_level: 0.1, ..quiet.clone() };
    let curved = Rig { gamma: 2.2, response: 1.6, offset: 300.0, ..quiet.clone() };
    let mut coarse = quiet.clone();
    coarse.projector.bits = 2;
    let affine = MeasureOptions { signed: SignedBy::Affine, ..plain() };
    // Projector and camera with 16 bits round by up to 2⁻¹⁷ of their range. Most entries of a column are a
    // hundredth of it.
    let cases: [(&str, &Rig, MeasureOptions, f64); 9] = [
        ("affine", &quiet, affine.clone(), 3e-4),
        ("split", &quiet, MeasureOptions { signed: SignedBy::Split, ..plain() }, 3e-4),
        ("averaging", &quiet, MeasureOptions { takes: 3, ..plain() }, 3e-4),
        ("HDR", &quiet, MeasureOptions { exposures: vec![1.0, 4.0, 16.0], ..plain() }, 3e-4),
        ("ambient", &room, affine.clone(), 3e-4),
        ("response", &curved, plain(), 3e-4),
        ("registration", &mirrored(quiet.clone()), plain(), 3e-4),
        ("bit planes", &coarse, MeasureOptions { bit_planes: 9, ..plain() }, 3e-4),
        (
            "drift",
            // The white photo is the fifth one of 5 seconds. Its light is the unit.
            &Rig { lamp: |t| 1.0 + 1e-4 * (t - 25.0), ..quiet.clone() },
            MeasureOptions { sentinel_every: 2, exposures: vec![5.0], ..plain() },
            2e-3,
        ),
    ];
    for (stage, rig, options, tolerance) in cases {
        let mut measurement = rig.measure(&options);
        let expected = |x: &[f64]| rig.matrix.apply(Part::Full, x);
        let error = columns(n, |x| product(&mut measurement, Part::Full, x), expected);
        println!("{stage}: relative error {error:.1e}");
        assert!(error < tolerance, "{stage}: {error}");
        let [u, v] = [vector(n, 1), vector(n, 2)];
        let [au, av] = [&u, &v].map(|x| product(&mut measurement, Part::Full, x));
        let scale = (dot(&av, &av) * dot(&u, &u)).sqrt();
        assert!((dot(&u, &av) - dot(&au, &v)).abs() < tolerance * scale, "{stage}: not symmetric");
    }
}

#[test]
fn the_blur_is_applied_to_pattern_and_photo() {
    let rig = Rig::new(scene());
    let (size, n) = (rig.matrix.resolution, rig.matrix.resolution.pixels());
    let kernel = |x: &[f64]| -> Vec<f64> {
        let to = |j: usize| {
            let one = |i: usize| {
                x[i] * gaussian(i % size.width, j % size.width, size.width, 1.2)
                    * gaussian(i / size.width, j / size.width, size.height, 1.2)
            };
            (0..n).map(one).sum()
        };
        (0..n).map(to).collect()
    };
    let mut measurement = rig.measure(&MeasureOptions { blur: 1.2, ..plain() });
    let dense = |x: &[f64]| kernel(&rig.matrix.apply(Part::Full, &kernel(x)));
    let error = columns(n, |x| product(&mut measurement, Part::Full, x), dense);
    assert!(error < 1e-4, "{error}");
    let [u, v] = [vector(n, 1), vector(n, 2)];
    let [au, av] = [&u, &v].map(|x| product(&mut measurement, Part::Full, x));
    assert!((dot(&u, &av) - dot(&au, &v)).abs() < 1e-5 * (dot(&av, &av) * dot(&u, &u)).sqrt());
}

#[test]
fn a_constant_costs_nothing_after_the_white_photo() {
    let mut measurement = Rig::new(scene()).measure(&plain());
    let white = measurement.white().expect("a dense rig never fails").planes.remove(0).values;
    let before = measurement.effort().taken;
    let found = product(&mut measurement, Part::Full, &[-3.0; 54]);
    assert_eq!(measurement.effort().taken, before);
    assert!(found.iter().zip(&white).all(|(found, white)| *found == -3.0 * white));
}

#[test]
fn projector_pixels_that_no_camera_pixel_sees_are_masked_in_pattern_and_photo() {
    let mut rig = Rig::new(scene());
    let n = rig.matrix.resolution.pixels();
    let mut map = rig.calibration().registration;
    // The pixel at column 3, row 0 loses its only camera pixel.
    map.starts.iter_mut().skip(4).for_each(|start| *start -= 1);
    map.pixels.remove(3);
    map.weights.remove(3);
    rig.registration = Some(map);
    let mut measurement = rig.measure(&plain());
    assert_eq!(measurement.seen().iter().filter(|&&seen| !seen).count(), 1);
    let masked = |x: &[f64]| -> Vec<f64> {
        x.iter().enumerate().map(|(i, x)| if i == 3 { 0.0 } else { *x }).collect()
    };
    let expected = |x: &[f64]| masked(&rig.matrix.apply(Part::Full, &masked(x)));
    let error = columns(n, |x| product(&mut measurement, Part::Full, x), expected);
    assert!(error < 3e-4, "{error}");
    assert_eq!(product(&mut measurement, Part::Full, &vec![1.0; n])[3], 0.0);
}

#[test]
fn the_direct_image_of_a_scene_with_smooth_global_light_is_measured_and_removed() {
    let rig = Rig::new(Dense::smooth(Resolution::new(24, 24), 1000.0));
    let n = rig.matrix.resolution.pixels();
    let mut measurement = rig.measure(&MeasureOptions { direct: DirectBy::Patterns, ..plain() });
    let direct = measurement.direct().expect("a dense rig never fails");
    assert_eq!(measurement.patterns(), 10, "black, white, and eight shifts");
    let error = super::support::error(&direct.planes[0].values, &rig.matrix.direct);
    println!("direct image: relative error {error:.1e}");
    // Rank-one global light has the same mean for all shifts, except for the squares that are cut off at the
    // edges.
    assert!(error < 2e-3, "{error}");
    let x = vector(n, 3);
    let found = product(&mut measurement, Part::Direct, &x);
    assert!(super::support::error(&found, &rig.matrix.apply(Part::Direct, &x)) < 3e-3);
    let positive: Vec<f64> = x.iter().map(|x| x.abs()).collect();
    let found = product(&mut measurement, Part::Global, &positive);
    assert!(super::support::error(&found, &rig.matrix.apply(Part::Global, &positive)) < 3e-3);
}

#[test]
fn a_photo_is_the_product_with_the_matrix() {
    let rig = Rig::new(scene());
    let n = rig.matrix.resolution.pixels();
    let pattern: Vec<f64> = vector(n, 9).iter().map(|x| f64::from((x.abs() * 0.9) as f32)).collect();
    let image =
        Image::new(rig.matrix.resolution, 1, pattern.iter().map(|&x| x as f32).collect()).expect("fits");
    let mut measurement = rig.measure(&plain());
    let photo = measurement.photograph(&image).expect("a dense rig never fails");
    let error = super::support::error(&photo.planes[0].values, &rig.matrix.apply(Part::Full, &pattern));
    assert!(error < 1e-4, "{error}");
    assert!(measurement.photograph(&Image::filled(rig.matrix.resolution, 1, 1.5)).is_err());
    assert!(measurement.photograph(&Image::filled(Resolution::new(2, 2), 1, 0.5)).is_err());
}
