//! A furnace: in a closed room whose walls glow evenly, everything that loses no light is invisible.

use crate::common;
use glam::{Vec3, vec3};
use krylux::image::Resolution;
use krylux::render::TraceSettings;
use krylux::scene::builtin;
use krylux::scene::{AlphaMode, Material, Scene, Volume};
use krylux::transport::{Channels, assemble};

const SIDE: usize = 24;
/// Light leaves a glass ball through total reflections only if its facets are uneven: what is still inside after so many
/// surfaces is lost to the photo.
const BOUNCES: u32 = 64;

/// A glowing sphere that reflects nothing, the camera at its centre, and a ball of `material` before it.
fn furnace(material: Material) -> Scene {
    let mut scene = builtin::inside_sphere(2.0, 3, 0.0);
    scene.materials[0].emission = Vec3::ONE;
    let ball = builtin::inside_sphere(0.4, 3, 0.0);
    let index = scene.materials.len() as u32;
    scene.materials.push(material);
    scene.triangles.extend(ball.triangles.into_iter().map(|mut triangle| {
        for position in &mut triangle.positions {
            *position += vec3(0.1, 0.05, -1.2);
        }
        // The sphere is seen from inside; the ball, from outside.
        let [a, b, c] = triangle.positions;
        if (b - a).cross(c - a).dot(a - vec3(0.1, 0.05, -1.2)) < 0.0 {
            triangle.positions.swap(1, 2);
        }
        triangle.material = index;
        triangle
    }));
    scene
}

/// Mean, least and largest radiance over the photo without projector.
fn seen(material: Material, samples: u32) -> [f64; 3] {
    let scene = furnace(material);
    let settings =
        TraceSettings { max_bounces: BOUNCES, ..TraceSettings::new(Resolution::new(SIDE, SIDE), samples) };
    let traced = assemble(&mut common::tracer(&scene), &settings, Channels::Luma);
    let photo = traced.expect("the scene can be traced").ambient.plane(0);
    let mean = photo.iter().sum::<f64>() / photo.len() as f64;
    let fold = |start: f64, pick: fn(f64, f64) -> f64| photo.iter().fold(start, |a, &b| pick(a, b));
    [mean, fold(f64::INFINITY, f64::min), fold(0.0, f64::max)]
}

#[test]
fn what_loses_no_light_is_invisible_in_a_furnace() {
    let clear = Material { specular: 1.0, ..Material::default() };
    let volume = Some(Volume { attenuation_color: Vec3::ONE, attenuation_distance: f32::INFINITY });
    let smooth = |material: Material| Material { roughness: 0.0, ..material };
    for (name, material) in [
        ("mirror", smooth(Material { metallic: 1.0, ..clear.clone() })),
        ("solid glass", smooth(Material { transmission: 1.0, volume, ..clear.clone() })),
        ("soap bubble", smooth(Material { transmission: 1.0, ..clear.clone() })),
        ("veil", Material { opacity: 0.0, alpha_mode: AlphaMode::Blend, ..clear.clone() }),
        ("filter", smooth(Material { transmission: 1.0, specular: 0.0, ..clear.clone() })),
    ] {
        // Each path is exact by itself.
        let [mean, least, largest] = seen(material, 32);
        println!("{name}: mean {mean:.6}, from {least:.6} to {largest:.6}");
        // Every path carries exactly what it met, to rounding over 64 products.
        assert!((largest - 1.0).abs() < 1e-4, "{name}: up to {largest}");
        // Light that goes round under the facets of the glass ball is lost after so many of them, one path in a thousand.
        let trapped = if name == "solid glass" { 2e-3 } else { 1e-4 };
        assert!((mean - 1.0).abs() < trapped, "{name}: {mean}");
    }
}

#[test]
fn nothing_gives_back_more_than_it_receives() {
    let coated = Material { specular: 1.0, ..Material::default() };
    let volume = Some(Volume { attenuation_color: Vec3::ONE, attenuation_distance: f32::INFINITY });
    for (name, material) in [
        ("white paper", Material::default()),
        ("glazed white", Material { roughness: 0.0, ..coated.clone() }),
        ("satin white", Material { roughness: 0.3, ..coated.clone() }),
        ("rough metal", Material { roughness: 0.6, metallic: 1.0, ..coated.clone() }),
        ("frosted glass", Material { roughness: 0.4, transmission: 1.0, volume, ..coated.clone() }),
        ("frosted bubble", Material { roughness: 0.4, transmission: 1.0, ..coated.clone() }),
        ("lantern", Material { diffuse_transmission: 0.7, ..coated.clone() }),
        (
            "half a lantern",
            Material { diffuse_transmission: 0.5, opacity: 0.5, alpha_mode: AlphaMode::Blend, ..coated },
        ),
    ] {
        let [mean, _, _] = seen(material, 64);
        println!("{name}: mean {mean:.6}");
        // The ball fills a third of the picture; 36,864 paths of at most twice the light are known to 0.5 %, four times of which...
        assert!(mean < 1.0 + 0.02, "{name}: {mean}");
        // ... and single scattering on rough facets loses light, but not most of it.
        assert!(mean > 0.8, "{name}: {mean}");
    }
}

/// A shell of paper, the camera inside, a glowing room outside: with albedos `r` of reflection and `t` of transmission, the
/// light inside is even, and `L = r L + t` on it.
#[test]
fn a_shell_of_paper_glows_by_what_it_lets_through_and_keeps() {
    const REFLECTED: f64 = 0.3;
    const TRANSMITTED: f64 = 0.5;
    let mut scene = builtin::inside_sphere(2.0, 2, 0.0);
    scene.materials[0].emission = Vec3::ONE;
    let mut shell = builtin::inside_sphere(1.0, 3, 0.0).triangles;
    shell.iter_mut().for_each(|triangle| triangle.material = 1);
    scene.triangles.extend(shell);
    scene.materials.push(Material {
        base_color: Vec3::splat(2.0 * REFLECTED as f32),
        diffuse_transmission: 0.5,
        diffuse_transmission_color: Vec3::splat(2.0 * TRANSMITTED as f32),
        ..Material::default()
    });
    // Light that goes round more often is 0.3⁴⁰.
    let settings = TraceSettings { max_bounces: 40, ..TraceSettings::new(Resolution::new(SIDE, SIDE), 256) };
    let traced = assemble(&mut common::tracer(&scene), &settings, Channels::Luma);
    let photo = traced.expect("the scene can be traced").ambient.plane(0);
    let mean = photo.iter().sum::<f64>() / photo.len() as f64;
    let expected = TRANSMITTED / (1.0 - REFLECTED);
    println!("paper shell: {mean:.5}, by the closed form {expected:.5}");
    // Each of 147,456 paths sees 1 or 0 in the end: a standard deviation of at most 1/2, 1.3e-3 of the mean; four times that.
    assert!((mean - expected).abs() < 5.2e-3, "{mean}, not {expected}");
}
