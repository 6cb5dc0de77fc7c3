//! Tests of the weights of paths from both endpoints: paths from both endpoints give the same photos as paths from one endpoint alone.

use glam::{Vec3, vec3};

use super::support::{trace, tracer};
use crate::image::Resolution;
use crate::render::{Sampler, TraceSettings, Tracer};
use crate::scene::builtin::{Model, Part, plane};
use crate::scene::{AlphaMode, Lens, Material, Scene, Volume};

const SIDE: usize = 16;

fn block(name: &str, low: Vec3, high: Vec3, material: u32) -> Part {
    let mut part = Part::new(name, None);
    part.material = material;
    let at = |x: bool, y: bool, z: bool| {
        vec3(if x { high.x } else { low.x }, if y { high.y } else { low.y }, if z { high.z } else { low.z })
    };
    for [a, b, c, d] in [
        [(false, false, true), (true, false, true), (true, true, true), (false, true, true)],
        [(true, false, false), (false, false, false), (false, true, false), (true, true, false)],
        [(true, false, true), (true, false, false), (true, true, false), (true, true, true)],
        [(false, false, false), (false, false, true), (false, true, true), (false, true, false)],
        [(false, true, true), (true, true, true), (true, true, false), (false, true, false)],
        [(false, false, false), (true, false, false), (true, false, true), (false, false, true)],
    ] {
        part.quad([a, b, c, d].map(|(x, y, z)| at(x, y, z)));
    }
    part
}

fn sheet(name: &str, centre: Vec3, half: f32, material: u32) -> Part {
    let mut part = Part::new(name, None);
    part.material = material;
    let corner = |x: f32, y: f32| centre + vec3(x * half, y * half, x * 0.3 * half);
    part.quad([corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)]);
    part
}

/// A room with one object of every material that refracts or transmits light, except mirrors and smooth glass.
fn room() -> Scene {
    let camera = plane(1.0, 0.5).camera;
    let matte = Material::default();
    let materials = vec![
        Material { base_color: Vec3::splat(0.8), ..matte.clone() },
        Material {
            roughness: 0.5,
            metallic: 1.0,
            specular: 1.0,
            base_color: vec3(0.9, 0.6, 0.3),
            ..matte.clone()
        },
        Material {
            roughness: 0.4,
            specular: 1.0,
            transmission: 1.0,
            volume: Some(Volume { attenuation_color: vec3(0.5, 0.8, 0.9), attenuation_distance: 0.3 }),
            ..matte.clone()
        },
        Material {
            roughness: 0.6,
            specular: 1.0,
            transmission: 0.8,
            base_color: vec3(0.9, 0.9, 0.5),
            ..matte.clone()
        },
        Material {
            opacity: 0.4,
            alpha_mode: AlphaMode::Blend,
            base_color: vec3(0.2, 0.9, 0.3),
            ..matte.clone()
        },
        Material {
            diffuse_transmission: 0.6,
            diffuse_transmission_color: vec3(0.9, 0.7, 0.6),
            ..matte.clone()
        },
        // This is a tinted filter without reflection.
        Material { roughness: 0.0, transmission: 0.7, base_color: vec3(0.4, 0.6, 0.9), ..matte.clone() },
        Material { roughness: 0.3, specular: 1.0, base_color: vec3(0.7, 0.2, 0.2), ..matte },
    ];
    let mut wall = Part::new("wall", None);
    wall.quad([vec3(-1.0, -0.5, -1.6), vec3(1.0, -0.5, -1.6), vec3(1.0, 1.0, -1.6), vec3(-1.0, 1.0, -1.6)]);
    let mut floor = Part::new("floor", None);
    floor.quad([
        vec3(-1.0, -0.35, -0.4),
        vec3(1.0, -0.35, -0.4),
        vec3(1.0, -0.35, -1.7),
        vec3(-1.0, -0.35, -1.7),
    ]);
    let parts = vec![
        wall,
        floor,
        block("metal", vec3(-0.5, -0.35, -1.5), vec3(-0.3, 0.0, -1.2), 1),
        block("glass", vec3(-0.2, -0.34, -1.3), vec3(0.0, -0.1, -1.1), 2),
        sheet("frosted", vec3(0.15, -0.15, -1.2), 0.1, 3),
        sheet("veil", vec3(-0.15, 0.2, -1.2), 0.15, 4),
        sheet("paper", vec3(0.2, 0.2, -1.1), 0.12, 5),
        sheet("filter", vec3(0.33, -0.1, -1.0), 0.12, 6),
        block("plastic", vec3(0.2, -0.35, -1.5), vec3(0.45, -0.05, -1.3), 7),
    ];
    Model { name: "room", parts, materials, camera }.to_scene()
}

/// White photos, one for each seed, computed from the paths of both endpoints or from the camera's paths alone.
fn photos(
    tracer: &mut Tracer,
    settings: &TraceSettings,
    camera_alone: bool,
    seeds: std::ops::Range<u32>,
) -> Vec<Vec<f64>> {
    let mut one = |seed: u32| {
        let settings = TraceSettings { seed, ..*settings };
        let mut photo = vec![0.0; SIDE * SIDE];
        let mut strategies = tracer.strategies(&settings).expect("the scene fits");
        if camera_alone {
            strategies.truncate(1);
            // Without samples from the projector, every weight becomes 1.
            strategies[0].parameters.end_to_start = 0.0;
        }
        for strategy in &strategies {
            trace(tracer, strategy, |batch| {
                for index in 0..batch.len() {
                    if batch.symmetric() {
                        photo[batch.pixel(index) as usize] += f64::from(batch.direct(index)[1]);
                    }
                    for connection in batch.connections(index) {
                        photo[connection.camera as usize] += f64::from(connection.value[1]);
                        if batch.symmetric() && !camera_alone {
                            photo[connection.projector as usize] += f64::from(connection.value[1]);
                        }
                    }
                }
            });
        }
        photo.iter().map(|value| value / f64::from(settings.samples)).collect()
    };
    seeds.map(&mut one).collect()
}

/// Compares two sets of photos. Returns the root mean square, over the pixels, of the difference in standard errors, and the difference of
/// the total sums in standard errors.
fn compare(a: &[Vec<f64>], b: &[Vec<f64>]) -> (f64, f64) {
    let moments = |values: Vec<f64>| {
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        (mean, values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (n - 1.0) / n)
    };
    let z = |at: &dyn Fn(&Vec<f64>) -> f64| {
        let (a, a_variance) = moments(a.iter().map(at).collect());
        let (b, b_variance) = moments(b.iter().map(at).collect());
        (a - b) / (a_variance + b_variance).sqrt()
    };
    let pixels: Vec<f64> = (0..a[0].len()).map(|pixel| z(&|photo| photo[pixel])).collect();
    let rms = (pixels.iter().map(|z| z * z).sum::<f64>() / pixels.len() as f64).sqrt();
    (rms, z(&|photo| photo.iter().sum()))
}

const SEEDS: u32 = 20;

fn independent(max_bounces: u32, samples: u32) -> TraceSettings {
    let settings = TraceSettings::new(Resolution::new(SIDE, SIDE), samples);
    TraceSettings { max_bounces, sampler: Sampler::Independent, ..settings }
}

/// Asserts that the camera's paths alone and the paths of both endpoints give the same photos. Each kind of path has its own settings.
fn assert_same_photos(name: &str, scene: &Scene, (of_camera, of_both): (&TraceSettings, &TraceSettings)) {
    let mut tracer = tracer(scene);
    let alone = photos(&mut tracer, of_camera, true, 0..SEEDS);
    // These seeds differ from the seeds of the camera's paths alone.
    let both = photos(&mut tracer, of_both, false, 100..100 + SEEDS);
    let (spread, sum) = compare(&alone, &both);
    println!("{name}: z rms of pixels {spread:.3}, z of the sum {sum:+.2}");
    // Student's t with 38 degrees of freedom has an rms of √(38/36) = 1.027, with an error of ± 0.05 over 256 pixels. The camera's own
    // paths rarely find bright spots, and the standard error of a pixel is underestimated if they found none there.
    assert!((0.8..1.25).contains(&spread), "{name}: z rms {spread}");
    assert!(sum.abs() < 4.0, "{name}: z of the sum {sum}");
}

/// Without delta lobes, the camera's paths alone are unbiased. The paths of both endpoints are unbiased if their weights sum to 1, so a
/// wrong density or probability of the reverse path would show as a difference.
#[test]
fn paths_of_both_endpoints_give_the_photos_of_the_cameras_paths() {
    let settings = independent(5, 128);
    let roulette = TraceSettings { russian_roulette: true, ..settings };
    assert_same_photos("coaxial", &room(), (&settings, &roulette));

    let mut apart = room();
    let mut projector = apart.camera.clone();
    projector.position += vec3(0.3, 0.1, 0.05);
    projector.tan_half_fov *= 1.3;
    projector.lens = Lens { radius: 0.01, focus: 1.3 };
    apart.camera.lens = Lens { radius: 0.02, focus: 1.0 };
    apart.projector = Some(projector);
    let settings = TraceSettings { projector: Some(Resolution::new(24, 16)), ..settings };
    assert_same_photos("apart, with lenses", &apart, (&settings, &settings));
}

/// A matte room behind sheets. A sheet lets seven tenths of the light pass straight through, so nearly every path scatters at several
/// sheets.
fn veils() -> Scene {
    let matte = Material::default();
    let materials = vec![
        Material { base_color: Vec3::splat(0.8), ..matte.clone() },
        Material { opacity: 0.3, alpha_mode: AlphaMode::Blend, base_color: Vec3::splat(0.95), ..matte },
    ];
    let parts = vec![
        sheet("wall", vec3(0.0, 0.0, -1.6), 1.0, 0),
        sheet("first", vec3(0.0, 0.0, -1.2), 0.8, 1),
        sheet("second", vec3(0.05, 0.0, -1.25), 0.8, 1),
        sheet("third", vec3(-0.05, 0.0, -1.3), 0.8, 1),
        sheet("fourth", vec3(0.0, 0.05, -1.35), 0.8, 1),
    ];
    Model { name: "veils", parts, materials, camera: plane(1.0, 0.5).camera }.to_scene()
}

/// At every vertex, not only at the first, the reverse density is multiplied by the probability that the surface interacts with light.
#[test]
fn the_weights_of_paths_between_veils_add_up_to_one() {
    let settings = independent(6, 128);
    assert_same_photos("veils", &veils(), (&settings, &settings));
}

/// A matte wall behind a pane of smooth glass. All light passes the glass on its way from the projector and on its way to the camera.
fn behind_glass() -> Scene {
    let matte = Material::default();
    let volume = Volume { attenuation_color: Vec3::ONE, attenuation_distance: 1.0 };
    let materials = vec![
        Material { base_color: Vec3::splat(0.8), ..matte.clone() },
        Material { roughness: 0.0, specular: 1.0, transmission: 1.0, volume: Some(volume), ..matte },
    ];
    let parts = vec![
        sheet("wall", vec3(-0.8, 0.0, -1.5), 1.0, 0),
        sheet("other wall", vec3(0.8, 0.0, -1.6), 0.8, 0),
        block("pane", vec3(-3.0, -3.0, -0.6), vec3(3.0, 3.0, -0.4), 1),
    ];
    let mut scene =
        Model { name: "behind-glass", parts, materials, camera: plane(1.0, 0.5).camera }.to_scene();
    let mut projector = scene.camera.clone();
    projector.position += vec3(0.2, 0.05, 0.05);
    projector.tan_half_fov *= 1.5;
    scene.projector = Some(projector);
    scene
}

/// The weights of connections by gathered photons depend on the numbers of paths that start at either endpoint. Without paths from the
/// projector, the camera's connections have the weight 1.
#[test]
fn gathered_connections_are_weighted_by_the_paths_from_either_end() {
    let settings = TraceSettings { projector: Some(Resolution::new(24, 16)), ..independent(7, 32) };
    assert_same_photos("behind glass", &behind_glass(), (&settings, &settings));
}
