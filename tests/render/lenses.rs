//! Thin lenses: how large the blur is, and what is sharp.

use std::sync::Arc;

use crate::common::{self, mean_and_error, tracer};
use krylux::image::{Image, Resolution};
use krylux::render::TraceSettings;
use krylux::scene::{Lens, builtin};
use krylux::transport::{Channels, Transport, assemble};

const SIDE: usize = 48;
const RADIUS: f64 = 0.15;
const FOCUS: f64 = 1.0;
const LIT: usize = SIDE / 2 * SIDE + SIDE / 2;

/// Photos of one lit pixel of a projector with an open lens, on a wall at `distance`, seen by a pinhole in its middle.
fn photos(distance: f64) -> (f64, Vec<Vec<f64>>) {
    let mut scene = builtin::plane(distance as f32, 0.8);
    let mut projector = scene.camera.clone();
    projector.lens = Lens { radius: RADIUS as f32, focus: FOCUS as f32 };
    scene.projector = Some(projector);
    let mut tracer = tracer(&scene);
    let mut pattern = vec![0.0; SIDE * SIDE];
    pattern[LIT] = 1.0;
    let resolution = Resolution::new(SIDE, SIDE);
    let pattern = Image::new(resolution, 1, pattern).expect("one sample a pixel");
    let photos = (0..8).map(|seed| {
        let settings = TraceSettings { max_bounces: 1, seed, ..TraceSettings::new(resolution, 64) };
        let traced = assemble(&mut tracer, &settings, Channels::Luma);
        let mut rig = Arc::new(traced.expect("the scene can be traced"));
        rig.photograph(&pattern).expect("the pattern has the rig's size").plane(0)
    });
    (f64::from(scene.camera.tan_half_fov), photos.collect())
}

/// A point of the wall at depth z is lit through image points within `r |1/z − 1/F|` of its own: a disc, and an even one,
/// since a fronto-parallel wall has one density. Its radius follows from the photo's second moment: a disc of radius
/// R has R²/4 along an axis, the lit pixel and the pixel of the camera 1/12 each.
#[test]
fn the_blur_circle_has_the_diameter_of_the_formula_on_both_sides_of_the_focus() {
    for distance in [0.7, 1.6] {
        let (tangent, photos) = photos(distance);
        let radii: Vec<Vec<f64>> = photos
            .iter()
            .map(|photo| {
                let moment = |weight: &dyn Fn(f64, f64) -> f64| {
                    let at = |pixel: usize| ((pixel % SIDE) as f64, (pixel / SIDE) as f64);
                    photo
                        .iter()
                        .enumerate()
                        .map(|(pixel, value)| value * weight(at(pixel).0, at(pixel).1))
                        .sum::<f64>()
                };
                let total = moment(&|_, _| 1.0);
                let (x, y) = (moment(&|x, _| x) / total, moment(&|_, y| y) / total);
                let spread = moment(&|a, b| (a - x).powi(2) + (b - y).powi(2)) / total / 2.0;
                vec![2.0 * (spread - 1.0 / 6.0).sqrt()]
            })
            .collect();
        let (radius, error) = mean_and_error(&radii);
        let expected = RADIUS * (1.0 / distance - 1.0 / FOCUS).abs() / (2.0 * tangent / SIDE as f64);
        println!(
            "wall at {distance} m: blur {:.3} ± {:.3} pixels, by the formula {expected:.3}",
            radius[0], error[0]
        );
        assert!(error[0] < 0.02 * expected, "too noisy to show anything: {} ± {}", radius[0], error[0]);
        // Seven degrees of freedom: Student's t is beyond 5.4 once in a thousand.
        assert!(
            (radius[0] - expected).abs() < 5.4 * error[0],
            "{} ± {}, not {expected}",
            radius[0],
            error[0]
        );
    }
}

#[test]
fn what_is_in_focus_is_sharp_and_as_bright_as_by_a_pinhole() {
    let (_, photos) = photos(FOCUS);
    let (photo, error) = mean_and_error(&photos);
    // Rounding at the pixel's border lets a few of a million rays into its neighbours.
    let elsewhere: f64 = photo.iter().sum::<f64>() - photo[LIT];
    assert!(elsewhere < 1e-3 * photo[LIT], "{elsewhere} beside {}", photo[LIT]);
    let expected = 0.8 / std::f64::consts::PI;
    assert!(
        (photo[LIT] - expected).abs() < 5.4 * error[LIT] + 1e-3 * expected,
        "{} ± {}",
        photo[LIT],
        error[LIT]
    );
}

#[test]
fn equal_lenses_on_both_sides_leave_transport_symmetric() {
    let mut scene = builtin::plane(1.6, 0.8);
    scene.camera.lens = Lens { radius: 0.1, focus: 1.0 };
    let resolution = Resolution::new(24, 16);
    let traced = assemble(&mut tracer(&scene), &TraceSettings::new(resolution, 16), Channels::Luma);
    let matrix =
        common::csr(&traced.expect("the scene can be traced").matrix, krylux::transport::Part::Full, 0);
    assert!(matrix.is_symmetric(), "to the last bit");
    // The wall is out of focus: one pixel lights its neighbours.
    assert!(matrix.entries().any(|(row, column, _)| row != column));
}
