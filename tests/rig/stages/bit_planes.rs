//! The bit-plane stage: more levels than the projector has (the paper's Fig. 13).

use krylux::image::{Image, Resolution};
use krylux::measure::{MeasureOptions, bit_plane_amplification, bit_plane_weights};
use krylux::transport::Part;

use super::support::{Dense, Rig, error, plain};

const SIZE: usize = 16;

fn one_bit() -> Rig {
    let mut rig = Rig::new(Dense::new(Resolution::new(SIZE, SIZE), 1000.0, 5));
    rig.projector.bits = 1;
    rig
}

fn sinusoid() -> Vec<f64> {
    let at = |pixel: usize| 0.5 + 0.5 * (std::f64::consts::TAU * (pixel % SIZE) as f64 / 11.0).sin();
    (0..SIZE * SIZE).map(|pixel| f64::from(at(pixel) as f32)).collect()
}

/// The relative error of a photo of the sinusoid.
fn photo_error(rig: &Rig, options: &MeasureOptions) -> f64 {
    let pattern = sinusoid();
    let image =
        Image::new(rig.matrix.resolution, 1, pattern.iter().map(|&x| x as f32).collect()).expect("it fits");
    let photo = rig.measure(options).photograph(&image).expect("a dense rig never fails");
    error(&photo.planes[0].values, &rig.matrix.apply(Part::Full, &pattern))
}

#[test]
fn bit_planes_show_a_sinusoid_on_a_one_bit_projector() {
    let rig = one_bit();
    let by = |bit_planes| photo_error(&rig, &MeasureOptions { bit_planes, ..plain() });
    let plain = by(1);
    let decomposed: Vec<f64> = (2..=8).map(by).collect();
    println!("1 bit: {plain:.4}; in 2 to 8 planes: {decomposed:.4?}");
    assert!(decomposed[6] <= plain / 20.0);
    assert!(decomposed.windows(2).all(|pair| pair[1] < pair[0]));
}

/// More planes with little light amplify the noise. All have equal total exposure.
#[test]
fn with_little_light_more_planes_are_worse() {
    let rig = one_bit().noisy();
    let with_light = |total: f64| -> Vec<f64> {
        let by = |count: u32| {
            let exposures = vec![total / f64::from(count)];
            let options = MeasureOptions { bit_planes: count, exposures, black_takes: 64, ..plain() };
            let squares: f64 = (0..20).map(|seed| photo_error(&rig.reseeded(seed), &options).powi(2)).sum();
            (squares / 20.0).sqrt()
        };
        (1..=8).map(by).collect()
    };
    let amplification: Vec<f64> =
        (1..=8).map(|count| bit_plane_amplification(&bit_plane_weights(count, 1.0))).collect();
    let (some, little) = (with_light(0.03), with_light(0.01));
    println!("error with 1 to 8 planes: {some:.3?} and, with a third of the light, {little:.3?}");
    println!("read noise amplified by {amplification:.2?}");
    let best = some.iter().copied().fold(f64::INFINITY, f64::min);
    assert!(best < 0.9 * some[0] && some[7] > 1.5 * best, "some planes help, and too many do not");
    assert!(
        little[1..].windows(2).all(|pair| pair[1] > pair[0]),
        "with less light every further plane is worse"
    );
    // When noise dominates, it grows as predicted: read noise by the amplification, and shot noise less.
    let growth = little[7] / little[4] / (amplification[7] / amplification[4]);
    assert!((0.9..=1.05).contains(&growth), "{growth}");
}
