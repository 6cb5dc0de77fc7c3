//! Photos of scenes whose light is known in closed form.

use std::f64::consts::PI;
use std::ops::Range;
use std::sync::Arc;

use glam::{DMat3, DVec3, Quat, Vec3, dvec3, vec3};

use crate::common::{csr, mean_and_error, rms, settings, trace, tracer};
use krylux::image::{Image, Resolution};
use krylux::render::{Sampler, TraceSettings};
use krylux::scene::{Camera, Scene, Triangle, builtin};
use krylux::transport::{Channels, Part, Transport};

/// One white photo.
fn white_photo(scene: &Scene, settings: TraceSettings, channels: Channels) -> Vec<f64> {
    let mut rig = Arc::new(trace(&mut tracer(scene), settings, channels));
    let photo = rig.photograph(&Image::filled(settings.resolution, 1, 1.0)).expect("the pattern fits");
    photo.samples().iter().map(|&sample| f64::from(sample)).collect()
}

/// The largest relative deviation from `expected`; NaN counts as the largest.
fn worst(photo: &[f64], expected: f64) -> f64 {
    let deviations = photo.iter().map(|value| (value / expected - 1.0).abs());
    deviations.max_by(f64::total_cmp).expect("photos have pixels")
}

#[test]
fn a_fronto_parallel_plane_photographs_as_albedo_over_pi_d_squared() {
    for (distance, albedo) in [(0.3_f32, 1.0_f32), (1.0, 0.8), (2.7, 0.25)] {
        // A wide raster, so that rows and columns cannot be confused; one bounce is all that a plane gives.
        let settings =
            TraceSettings { max_bounces: 4, seed: 1, ..TraceSettings::new(Resolution::new(24, 16), 8) };
        let photo = white_photo(&builtin::plane(distance, albedo), settings, Channels::Rgb);
        let error = worst(&photo, f64::from(albedo) / (PI * f64::from(distance).powi(2)));
        println!("plane at {distance} m: relative error {error:.1e}");
        // d³, a division, 1/π and a mean: a handful of roundings.
        assert!(error < 4.0 * f64::from(f32::EPSILON), "at {distance} m: relative error {error:e}");
    }
}

#[test]
fn a_plane_far_from_the_worlds_origin_photographs_the_same() {
    for distance in [0.3_f32, 1.0, 2.7] {
        let mut scene = builtin::plane(distance, 1.0);
        let shift = vec3(1000.0, -500.0, 2000.0);
        scene.camera.position += shift;
        scene.triangles.iter_mut().flat_map(|triangle| &mut triangle.positions).for_each(|p| *p += shift);
        // World coordinates round to 1.2e-4 m there. All four corners round alike, so the plane stays square to the axis,
        // at a distance that is known exactly; nothing else may be lost.
        let rounded = f64::from(shift.z) - f64::from(shift.z - distance);
        let photo = white_photo(&scene, settings(16, 8, 1, 1), Channels::Luma);
        let error = worst(&photo, 1.0 / (PI * rounded * rounded));
        println!("plane at {distance} m, {} m out: relative error {error:.1e}", shift.length());
        // The same as above, with the weights of luminance.
        assert!(error < 6.0 * f64::from(f32::EPSILON), "at {distance} m: relative error {error:e}");
        assert!((rounded / f64::from(distance) - 1.0).abs() < 3e-4);
    }
}

#[test]
fn a_turned_rig_photographs_the_same() {
    for (axis, angle) in
        [(vec3(1.0, 2.0, 3.0), 1.1), (vec3(-2.0, 0.3, 0.1), 2.9), (vec3(0.0, 1.0, 0.0), PI as f32)]
    {
        let turn = Quat::from_axis_angle(axis.normalize(), angle);
        let mut scene = builtin::plane(1.0, 1.0);
        for direction in [&mut scene.camera.right, &mut scene.camera.up, &mut scene.camera.forward] {
            *direction = turn * *direction;
        }
        scene.triangles.iter_mut().flat_map(|triangle| &mut triangle.positions).for_each(|p| *p = turn * *p);
        let photo = white_photo(&scene, settings(16, 8, 1, 1), Channels::Luma);
        let error = worst(&photo, 1.0 / PI);
        println!("turned by {angle}: relative error {error:.1e}");
        // The corners lie 14 m out and the axes are unit vectors to 1e-7: the plane moves by a few 1e-6 m, and the
        // square and the cosine double that.
        assert!(error < 1e-5, "turned by {angle} around {axis}: relative error {error:e}");
    }
}

/// The density `D = cosθ_x/(r² cos³θ)` where the ray along `direction` meets the plane `normal · x = offset`, in the
/// pinhole's frame.
fn plane_density(normal: DVec3, offset: f64, direction: DVec3) -> f64 {
    let point = direction * (offset / normal.dot(direction));
    normal.dot(point).abs() / -point.z.powi(3)
}

/// The direction through a pixel's centre, in the pinhole's frame.
fn pixel_direction(pixel: usize, side: usize, tangent: f64) -> DVec3 {
    let raster = |index: usize| (2.0 * (index as f64 + 0.5) / side as f64 - 1.0) * tangent;
    dvec3(raster(pixel % side), -raster(pixel / side), -1.0)
}

#[test]
fn a_tilted_plane_photographs_as_its_density() {
    const SIDE: usize = 48;
    const SAMPLES: u32 = 64;
    const ALBEDO: f64 = 0.7;
    const FINE: usize = 16;
    let mut scene = builtin::plane(1.5, ALBEDO as f32);
    // Turned by 50° around a slanted axis through the point on the optical axis.
    let turn = Quat::from_axis_angle(vec3(0.6, 0.8, 0.0), 50_f32.to_radians());
    let centre = vec3(0.0, 0.0, -1.5);
    for position in scene.triangles.iter_mut().flat_map(|triangle| &mut triangle.positions) {
        *position = centre + turn * (*position - centre);
    }
    let normal = turn.as_dquat() * DVec3::Z;
    let offset = normal.dot(centre.as_dvec3());
    let tangent = f64::from(scene.camera.tan_half_fov);
    // Independent numbers have the variance that is worked out below; scrambled ones have less.
    let settings = TraceSettings { sampler: Sampler::Independent, ..settings(SIDE, SAMPLES, 1, 3) };
    let photo = white_photo(&scene, settings, Channels::Luma);

    // Mean and variance within each pixel by a 16² midpoint rule, so that the Monte Carlo error is known, not estimated.
    let z: Vec<f64> = (0..SIDE * SIDE)
        .map(|pixel| {
            let radiance = |cell: usize| {
                let raster = |pixel: usize, cell: usize| {
                    (pixel as f64 + (cell as f64 + 0.5) / FINE as f64) / SIDE as f64 * 2.0 - 1.0
                };
                let x = raster(pixel % SIDE, cell % FINE) * tangent;
                let y = -raster(pixel / SIDE, cell / FINE) * tangent;
                ALBEDO / PI * plane_density(normal, offset, dvec3(x, y, -1.0))
            };
            let cells = (FINE * FINE) as f64;
            let mean = (0..FINE * FINE).map(radiance).sum::<f64>() / cells;
            let variance = (0..FINE * FINE).map(|cell| (radiance(cell) - mean).powi(2)).sum::<f64>() / cells;
            (photo[pixel] - mean) / (variance / f64::from(SAMPLES)).sqrt()
        })
        .collect();
    let mean = z.iter().sum::<f64>() / (SIDE as f64);
    println!("tilted plane: z rms {:.4}, z of the mean {mean:+.2}", rms(&z));
    // 2304 pixels: the rms of as many standard normals is 1 ± 0.015, the sum over √2304 = 48 is one more standard normal.
    assert!((rms(&z) - 1.0).abs() < 4.0 * 0.015, "z rms {}", rms(&z));
    assert!(mean.abs() < 4.0, "z of the mean {mean}");
}

/// The white photo's light by number of bounces, `[seed][bounces − 1][pixel]`, first channel.
fn photos_by_bounces(scene: &Scene, settings: TraceSettings, seeds: Range<u32>) -> Vec<Vec<Vec<f64>>> {
    let mut tracer = tracer(scene);
    let photos = seeds.map(|seed| {
        let mut photos = vec![vec![0.0; settings.resolution.pixels()]; settings.max_bounces as usize];
        let settings = TraceSettings { seed, ..settings };
        tracer
            .trace(&settings, &mut |batch| {
                for index in 0..batch.len() {
                    let pixel = batch.pixel(index) as usize;
                    photos[0][pixel] += f64::from(batch.direct(index)[0]);
                    for connection in batch.connections(index) {
                        let photo = &mut photos[connection.bounces as usize - 1];
                        photo[pixel] += f64::from(connection.value[0]);
                        photo[connection.projector as usize] += f64::from(connection.value[0]);
                    }
                }
                Ok(())
            })
            .expect("the scene can be traced");
        photos.iter_mut().flatten().for_each(|value| *value /= f64::from(settings.samples));
        photos
    });
    photos.collect()
}

/// Total area of the surfaces.
fn area(scene: &Scene) -> f64 {
    let of = |Triangle { positions: [a, b, c], .. }: &Triangle| {
        let [a, b, c] = [a, b, c].map(|corner| corner.as_dvec3());
        (b - a).cross(c - a).length() / 2.0
    };
    scene.triangles.iter().map(of).sum()
}

/// Inside a sphere of radius `R` the kernel `cosθ cosθ'/(π r²)` is `1/(4πR²)` between any two points: what leaves a
/// matte wall arrives evenly everywhere. The projector's power is `Φ = ∫ D dA`, its image-plane area `(2 tan)²`, whatever it
/// lights. After the first bounce `ρΦ` goes round, and the light of bounce `k ≥ 2` leaves every point with radiance
///
/// ```text
/// L_k = ρᵏ Φ / (π · 4πR²)
/// ```
///
/// For the closed polyhedron that stands for the sphere, energy conservation makes the mean of `L_k` over its surface exactly
/// `ρᵏ Φ / (π · area)`; only its evenness is lost, to second order in the edge. What the camera sees of
/// the second bounce is 6e-4 too bright for 20,480 triangles, by an integral taken apart from the tracer (1.2e-3 for
/// a quarter of them): below the Monte Carlo error. Later bounces are more even. Once, two thousand seeds of the
/// second bounce came to +2.1e-4 ± 2.8e-4.
#[test]
fn light_in_a_sphere_becomes_even_and_is_neither_gained_nor_lost() {
    const SIDE: usize = 16;
    const BOUNCES: u32 = 6;
    // Other paths for the other albedo: equal seeds would make the same test of it.
    for (albedo, seeds) in [(1.0_f64, 0..20), (0.5, 100..112)] {
        let scene = builtin::inside_sphere(1.3, 5, albedo as f32);
        let power = (2.0 * f64::from(scene.camera.tan_half_fov)).powi(2);
        let runs = photos_by_bounces(&scene, settings(SIDE, 128, BOUNCES, 0), seeds);
        for bounces in 2..=BOUNCES as usize {
            let expected = albedo.powi(bounces as i32) * power / (PI * area(&scene));
            let photos: Vec<Vec<f64>> = runs.iter().map(|photos| photos[bounces - 1].clone()).collect();
            let means: Vec<Vec<f64>> =
                photos.iter().map(|photo| vec![photo.iter().sum::<f64>() / photo.len() as f64]).collect();
            let (mean, mean_error) = mean_and_error(&means);
            let (pixels, errors) = mean_and_error(&photos);
            let z: Vec<f64> =
                pixels.iter().zip(&errors).map(|(value, error)| (value - expected) / error).collect();
            let (deviation, error) = (mean[0] / expected - 1.0, mean_error[0] / expected);
            println!(
                "sphere, albedo {albedo}, bounce {bounces}: {:+.2e} ± {:.1e}, z {:+.2}, z rms of pixels {:.3}",
                deviation,
                error,
                deviation / error,
                rms(&z)
            );
            assert!(error < 5e-3, "too noisy to show anything: {error}");
            // Student's t with eleven degrees of freedom is beyond 5.2 three times in ten thousand, and there are ten
            // of them.
            assert!(deviation.abs() < 5.2 * error, "bounce {bounces}: {deviation:+.1e} ± {error:.1e}");
            // Evenness: each pixel by its own error, from twelve seeds or more: rms √(11/9) = 1.106, over 256 pixels ± 0.07.
            assert!((0.85..1.4).contains(&rms(&z)), "bounce {bounces}: z rms {}", rms(&z));
        }
    }
}

/// With two bounces at most, `A_ji = ∫∫ D(x₁)/a · (ρ/π)² G(x₁, x₂) · D(x₂) dx₁ dx₂` over what pixels `j` and `i` see, `a` the
/// image-plane area of a pixel. With `u = 1/D` at the centres of the pixels that see the left plate, and `v` likewise
/// for the right one, the densities cancel and
///
/// ```text
/// uᵀ A v = ρ²/(π² a) ∫∫ G dx₁ dx₂ = ρ²/(π a) · A₁ F₁₂
/// ```
///
/// but for the variation of `1/D` within a pixel: `D` is the cube of the image's x, so with the plates' vertical edges on
/// boundaries of pixels that is of second order in the pixel's size. Integrated apart from the tracer it is −2.3e-3 at
/// 32² pixels, −5.8e-4 at 64², and so −1.4e-4 at 128², below the Monte Carlo error.
#[test]
fn parallel_plates_exchange_light_by_their_form_factor() {
    const SIDE: usize = 128;
    const ALBEDO: f64 = 0.9;
    const SEEDS: u32 = 8;
    let (side, separation) = (1.0_f64, 1.0_f64);
    let mut scene = builtin::parallel_plates(side as f32, separation as f32, ALBEDO as f32);
    // The vertical edges appear at ±1/2 and ±1/4: the border of the image, and half-way from its middle.
    let tangent = 0.5;
    scene.camera.tan_half_fov = tangent as f32;

    let x = side / separation;
    let (square, root) = (x * x, (1.0 + x * x).sqrt());
    let logarithm = ((1.0 + square).powi(2) / (1.0 + 2.0 * square)).sqrt().ln();
    let form_factor =
        2.0 / (PI * square) * (logarithm + 2.0 * x * root * (x / root).atan() - 2.0 * x * x.atan());

    let inverse_density = |pixel: usize| {
        let direction = pixel_direction(pixel, SIDE, tangent);
        1.0 / plane_density(DVec3::X, (separation / 2.0).copysign(direction.x), direction)
    };
    let plate = |left: bool| -> Vec<f64> {
        let weight =
            |pixel: usize| f64::from(u8::from((pixel % SIDE < SIDE / 2) == left)) * inverse_density(pixel);
        (0..SIDE * SIDE).map(weight).collect()
    };
    let (left, right) = (plate(true), plate(false));
    let mut tracer = tracer(&scene);
    let estimates: Vec<Vec<f64>> = (0..SEEDS)
        .map(|seed| {
            let matrix = trace(&mut tracer, settings(SIDE, 64, 2, seed), Channels::Rgb).matrix;
            let mut lit = vec![0.0; right.len()];
            matrix.apply(Part::Global, 0, &right, &mut lit);
            let sum: f64 = left.iter().zip(&lit).map(|(u, v)| u * v).sum();
            let pixel_area = (2.0 * tangent / SIDE as f64).powi(2);
            vec![sum * PI * pixel_area / (ALBEDO * ALBEDO * side * side)]
        })
        .collect();
    let (mean, error) = mean_and_error(&estimates);
    let (deviation, error) = (mean[0] / form_factor - 1.0, error[0] / form_factor);
    println!("form factor {form_factor:.6}: {deviation:+.2e} ± {error:.1e}, z {:+.2}", deviation / error);
    assert!(error < 2e-3, "too noisy to show anything: {error}");
    // Eight seeds: Student's t with seven degrees of freedom is beyond 4.8 once in 500 times.
    assert!(deviation.abs() < 4.8 * error, "{deviation:+.1e} ± {error:.1e}");
}

/// All that pixel `j` sees leaves the surface there with radiosity `π · photo_j`, from an area `a/D_j`. Summed up over the
/// image that is the power of one bounce, as far as the camera sees it: all of the projector's `(2 tan)²` for the first at
/// albedo 1, and never more for those that follow.
#[test]
fn a_white_corner_gains_no_energy() {
    const SIDE: usize = 32;
    let mut scene = builtin::corner().to_scene();
    scene.materials.iter_mut().for_each(|material| material.base_color = Vec3::ONE);
    let tangent = f64::from(scene.camera.tan_half_fov);
    let pixel_area = (2.0 * tangent / SIDE as f64).powi(2);
    let power = pixel_area * (SIDE * SIDE) as f64;
    let photos = photos_by_bounces(&scene, settings(SIDE, 64, 6, 0), 0..1).remove(0);
    let powers: Vec<f64> = photos
        .iter()
        .map(|photo| {
            let of_pixel = |pixel: usize| {
                let direction = pixel_direction(pixel, SIDE, tangent);
                // The planes |x| − z = 1.2.
                let normal = dvec3(1_f64.copysign(direction.x), 0.0, -1.0) * std::f64::consts::FRAC_1_SQRT_2;
                let density = plane_density(normal, 1.2 * std::f64::consts::FRAC_1_SQRT_2, direction);
                PI * photo[pixel] * pixel_area / density
            };
            (0..SIDE * SIDE).map(of_pixel).sum::<f64>() / power
        })
        .collect();
    println!("white corner, power by bounces: {powers:.4?}");
    // D at the centre of a pixel instead of its mean: second order in the pixel, (1/32)².
    assert!((powers[0] - 1.0).abs() < 2e-3, "first bounce {}", powers[0]);
    for pair in powers.windows(2) {
        // An open corner at a right angle sends less than half of its light to the other side (1 − 1/√2 in the limit of
        // long planes, and more close to the edge).
        assert!(pair[1] < 0.5 * pair[0] && pair[1] > 0.0, "{powers:?}");
    }
}

/// The parallel plates, and half-way between them a one-sided sheet that hides each from the other, with its front
/// towards `front`. The camera sees it edge-on.
fn plates_with_a_sheet_between(front: Vec3) -> Scene {
    let mut scene = builtin::parallel_plates(1.0, 1.0, 0.9);
    let mut sheet = scene.materials[0].clone();
    sheet.double_sided = false;
    scene.materials.push(sheet);
    let corners = [vec3(0.0, -2.0, -0.9), vec3(0.0, -2.0, -2.1), vec3(0.0, 2.0, -2.1), vec3(0.0, 2.0, -0.9)];
    for [a, b, c] in [[0, 1, 2], [0, 2, 3]] {
        let mut positions = [corners[a], corners[b], corners[c]];
        if (positions[1] - positions[0]).cross(positions[2] - positions[0]).dot(front) < 0.0 {
            positions.swap(1, 2);
        }
        let template = scene.triangles[0];
        scene.triangles.push(Triangle { positions, material: 1, ..template });
    }
    scene
}

#[test]
fn the_back_of_a_one_sided_surface_is_black() {
    let mut scene = builtin::plane(1.0, 0.8);
    scene.materials[0].double_sided = false;
    let front = white_photo(&scene, settings(8, 4, 4, 1), Channels::Luma);
    assert!(worst(&front, 0.8 / PI) < 1e-6);
    scene.triangles.iter_mut().for_each(|triangle| triangle.positions.swap(1, 2));
    let back = white_photo(&scene, settings(8, 4, 4, 1), Channels::Luma);
    assert!(back.iter().all(|&value| value == 0.0));
}

#[test]
fn a_one_sided_surface_blocks_light_from_both_sides() {
    const SIDE: usize = 24;
    let left = |pixel: usize| pixel % SIDE < SIDE / 2;
    let crossing = |scene: &Scene| {
        let traced = trace(&mut tracer(scene), settings(SIDE, 32, 6, 1), Channels::Luma);
        let global = csr(&traced.matrix, Part::Global, 0);
        assert!(global.is_symmetric());
        let entries = || global.entries().map(|(row, column, weight)| (left(row), left(column), weight));
        let crossing = entries().filter(|(row, column, _)| row != column).count();
        let within = |side: bool| {
            entries()
                .filter(|&(row, column, _)| row == side && column == side)
                .map(|entry| entry.2)
                .sum::<f64>()
        };
        (crossing, within(true), within(false))
    };
    let (open, ..) = crossing(&builtin::parallel_plates(1.0, 1.0, 0.9));
    assert!(open > 1000, "without a sheet the plates see each other: {open} entries");
    for front in [Vec3::X, Vec3::NEG_X] {
        let (between, left, right) = crossing(&plates_with_a_sheet_between(front));
        assert_eq!(between, 0, "light passes a sheet with its front towards {front}");
        // The plate before its front gets light back from it, the plate behind it sees black.
        let (front_side, back_side) = if front.x > 0.0 { (right, left) } else { (left, right) };
        assert!(front_side > 0.0 && back_side == 0.0, "{front}: {front_side} and {back_side}");
    }
}

#[test]
fn emission_is_ambient_light_and_no_part_of_the_matrix() {
    let emission = vec3(0.25, 0.5, 2.0);
    let mut scene = builtin::plane(1.0, 0.8);
    let settings = settings(8, 4, 3, 1);
    let dark = trace(&mut tracer(&scene), settings, Channels::Rgb);
    assert!(dark.ambient.samples().iter().all(|&value| value == 0.0));
    scene.materials[0].emission = emission;
    let mut rig = Arc::new(trace(&mut tracer(&scene), settings, Channels::Rgb));
    assert_eq!(rig.matrix, dark.matrix, "the matrix does not know of emission");
    let black = rig.photograph(&Image::filled(settings.resolution, 1, 0.0)).expect("the pattern fits");
    let white = rig.photograph(&Image::filled(settings.resolution, 1, 1.0)).expect("the pattern fits");
    for channel in 0..3 {
        let emitted = f64::from(emission[channel]);
        // The emission itself is a number that f32 holds.
        assert!(black.plane(channel).iter().all(|&value| value == emitted));
        assert!(worst(&white.plane(channel), emitted + 0.8 / PI) < 4.0 * f64::from(f32::EPSILON));
    }
}

/// Emission seen by way of other surfaces, in the sphere: `L_k = ρᵏ⁻¹ E` after `k` surfaces.
#[test]
fn ambient_light_is_reflected_too() {
    let (albedo, emission, bounces) = (0.5_f64, 0.75_f64, 6);
    let mut scene = builtin::inside_sphere(1.0, 2, albedo as f32);
    scene.materials[0].emission = Vec3::splat(emission as f32);
    let traced = trace(&mut tracer(&scene), settings(8, 16, bounces, 1), Channels::Rgb);
    let expected = emission * (0..bounces as i32).map(|k| albedo.powi(k)).sum::<f64>();
    // Closed and even: every path sees the same, without noise. A ray that slipped out between triangles would show.
    let photo: Vec<f64> = traced.ambient.samples().iter().map(|&sample| f64::from(sample)).collect();
    assert!(worst(&photo, expected) < 1e-6, "{}", worst(&photo, expected));
}

#[test]
fn one_bounce_has_no_global_part() {
    for scene in [builtin::corner().to_scene(), builtin::inside_sphere(1.0, 2, 0.9)] {
        let matrix = trace(&mut tracer(&scene), settings(12, 8, 1, 1), Channels::Luma).matrix;
        assert_eq!(matrix.nonzeros(), 0);
        assert!(matrix.direct(0).iter().all(|&value| value > 0.0));
    }
}

/// The pinhole's frame in the shader is the camera's: a point that the camera projects to a pixel is seen there.
#[test]
fn what_the_camera_projects_to_a_pixel_is_seen_there() {
    let resolution = Resolution::new(20, 12);
    let turn = DMat3::from_axis_angle(dvec3(0.3, 1.0, -0.5).normalize(), 0.8);
    let camera = Camera {
        position: vec3(3.0, -1.0, 2.0),
        right: turn.x_axis.as_vec3(),
        up: turn.y_axis.as_vec3(),
        forward: -turn.z_axis.as_vec3(),
        ..builtin::plane(1.0, 1.0).camera
    };
    for (x, y) in [(0, 0), (19, 0), (3, 11), (10, 6)] {
        // A patch the size of a fifth of a pixel, in the middle of pixel (x, y).
        let direction = |dx: f32, dy: f32| {
            let at = |pixel: usize, offset: f32| pixel as f32 + 0.5 + 0.1 * offset;
            camera.position + 2.0 * camera.ray_direction(at(x, dx), at(y, dy), resolution)
        };
        let template = builtin::plane(1.0, 1.0);
        let positions = [direction(-1.0, -1.0), direction(1.0, -1.0), direction(0.0, 1.0)];
        let triangles = vec![Triangle { positions, ..template.triangles[0] }];
        let scene = Scene { triangles, camera: camera.clone(), ..template };
        let settings = TraceSettings { max_bounces: 1, seed: 1, ..TraceSettings::new(resolution, 256) };
        let photo = white_photo(&scene, settings, Channels::Luma);
        let seen: Vec<usize> = (0..photo.len()).filter(|&pixel| photo[pixel] > 0.0).collect();
        assert_eq!(seen, [y * resolution.width + x], "pixel ({x}, {y})");
    }
}
