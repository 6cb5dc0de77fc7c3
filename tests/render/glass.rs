//! Panes before a wall: what they leave of the light, by Fresnel and Snell.

use std::f64::consts::PI;

use crate::common::{mean_and_error, tracer};
use glam::{Vec3, vec3};
use krylux::image::Resolution;
use krylux::render::TraceSettings;
use krylux::scene::builtin;
use krylux::scene::{Material, Scene, Triangle, Volume};
use krylux::transport::{Channels, Part, assemble};

const SIDE: usize = 16;
const DISTANCE: f64 = 1.5;
const ALBEDO: f64 = 0.7;
const INDEX: f64 = 1.5;

/// A wall with a sheet of `material` before it at each of these depths; the first faces the camera, the second the wall.
fn behind(material: Material, depths: &[f32]) -> Scene {
    let mut scene = builtin::plane(DISTANCE as f32, ALBEDO as f32);
    let index = scene.materials.len() as u32;
    scene.materials.push(material);
    let wall: Vec<Triangle> = scene.triangles.clone();
    for (number, &depth) in depths.iter().enumerate() {
        scene.triangles.extend(wall.iter().map(|triangle| {
            let mut pane = Triangle { material: index, ..*triangle };
            for position in &mut pane.positions {
                position.z = -depth;
            }
            if number == 1 {
                pane.positions.swap(1, 2);
            }
            pane
        }));
    }
    scene
}

fn glass() -> Material {
    Material { roughness: 0.0, specular: 1.0, transmission: 1.0, ior: INDEX as f32, ..Material::default() }
}

/// Direct light pixel by pixel from independent seeds; nothing else may come back.
fn direct(scene: &Scene, max_bounces: u32) -> (Vec<f64>, Vec<f64>) {
    let mut tracer = tracer(scene);
    let photos: Vec<Vec<f64>> = (0..8)
        .map(|seed| {
            let settings =
                TraceSettings { seed, max_bounces, ..TraceSettings::new(Resolution::new(SIDE, SIDE), 64) };
            let traced = assemble(&mut tracer, &settings, Channels::Luma);
            let matrix = traced.expect("the scene can be traced").matrix;
            let (ones, mut photo) = (vec![1.0; SIDE * SIDE], vec![0.0; SIDE * SIDE]);
            matrix.apply(Part::Global, 0, &ones, &mut photo);
            assert!(photo.iter().all(|&value| value == 0.0), "the pane's own chain is the only way back");
            matrix.apply(Part::Direct, 0, &ones, &mut photo);
            photo
        })
        .collect();
    mean_and_error(&photos)
}

/// Asserts that photo and expectation agree: the sum's z, with eight seeds, and no pixel far off.
fn assert_photo(name: &str, scene: &Scene, max_bounces: u32, expected: impl Fn(f64) -> f64) {
    let (photo, errors) = direct(scene, max_bounces);
    let tangent = f64::from(scene.camera.tan_half_fov);
    let at = |pixel: usize| ((pixel as f64 + 0.5) / SIDE as f64 * 2.0 - 1.0) * tangent;
    // At the pixel's centre: what changes over a pixel is of second order, 1e-4 here.
    let expected: Vec<f64> =
        (0..SIDE * SIDE).map(|pixel| expected(at(pixel % SIDE).hypot(at(pixel / SIDE)))).collect();
    let (sum, expected_sum) = (photo.iter().sum::<f64>(), expected.iter().sum::<f64>());
    let error = errors.iter().map(|error| error * error).sum::<f64>().sqrt();
    println!("{name}: {:+.2e} ± {:.1e} of the light", sum / expected_sum - 1.0, error / expected_sum);
    // The paths that the pane mirrors instead are the only noise.
    assert!(error < 3e-3 * expected_sum, "{name}: too noisy to show anything");
    assert!(
        (sum - expected_sum).abs() < 4.0 * error + 1e-4 * expected_sum,
        "{name}: {sum}, not {expected_sum}"
    );
}

/// glTF's thin wall: Schlick's reflectance once, the rest goes straight on.
#[test]
fn a_thin_pane_dims_by_the_fresnel_factor_squared() {
    let scene = behind(Material { base_color: vec3(0.9, 0.9, 0.9), ..glass() }, &[0.8]);
    assert_photo("thin pane", &scene, 1, |image| {
        let cosine = 1.0 / (1.0 + image * image).sqrt();
        let reflected = 0.04 + 0.96 * (1.0 - cosine).powi(5);
        ALBEDO / (PI * DISTANCE * DISTANCE) * (0.9 * (1.0 - reflected)).powi(2)
    });
}

/// Two faces, by Fresnel's equations each, and the bend between them moves the light on the wall.
#[test]
fn a_solid_pane_dims_by_its_two_faces_squared_and_bends_the_light() {
    const THICKNESS: f64 = 0.3;
    let volume = Volume { attenuation_color: Vec3::splat(0.8), attenuation_distance: 0.5 };
    let scene = behind(Material { volume: Some(volume), ..glass() }, &[0.8, 0.8 + THICKNESS as f32]);
    assert_photo("solid pane", &scene, 5, |image| {
        let cosine = 1.0 / (1.0 + image * image).sqrt();
        let inside = (1.0 - (1.0 - cosine * cosine) / (INDEX * INDEX)).sqrt();
        let s = (cosine - INDEX * inside) / (cosine + INDEX * inside);
        let p = (INDEX * cosine - inside) / (INDEX * cosine + inside);
        let face = 1.0 - (s * s + p * p) / 2.0;
        let clear = (0.8_f64.ln() * THICKNESS / inside / 0.5).exp();
        // The place where a ray of image radius u lands: (d − t) u + t tan θ'.
        let lands = |u: f64| {
            (DISTANCE - THICKNESS) * u + THICKNESS * u / (INDEX * INDEX * (1.0 + u * u) - u * u).sqrt()
        };
        let step = 1e-4;
        let slope = (lands(image + step) - lands(image - step)) / (2.0 * step);
        let density = image / lands(image) / slope;
        ALBEDO / PI * density * (face * face * clear).powi(2)
    });
}
