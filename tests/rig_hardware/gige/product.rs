//! A product with the scene's matrix, measured with a colour camera and all stages.

use krylux::image::Resolution;
use krylux::measure::{Calibration, LiveFrames, MeasureOptions, Measurement};
use krylux::operator::Operator;
use krylux::rig::{Camera, Colour, Devices, GenicamSpec, GigeVision, PixelFormat, Projector, WallClock};
use krylux::transport::Part;

use super::support::{Lamp, SIZE, address, scene, spec};
use crate::gige_camera::GigeCamera;

#[test]
fn a_product_measured_with_a_bayer_camera_is_that_of_the_scenes_matrix() {
    // A cell of the sensor sees the light of one lamp pixel.
    let sensor = [2 * SIZE.width, 2 * SIZE.height];
    let pixels = SIZE.pixels();
    let x: Vec<f64> = (0..pixels).map(|pixel| (pixel as f64 * 0.37).sin() + 0.2).collect();
    let mut scene = scene(12);
    scene.rig.camera.size = Some(sensor);
    let mut truth = vec![0.0; pixels];
    scene.matrix.entries().for_each(|(row, column, weight)| truth[row] += weight * x[column]);
    for (at, colour) in [Colour::Rgb, Colour::Luma, Colour::Green].into_iter().enumerate() {
        let (clock, last) = (WallClock::starting_at(0.0), 90 + at as u8);
        let lamp = Lamp::new(clock);
        let _device = GigeCamera::start(address(last), scene.clone(), lamp.look());
        let spec = GenicamSpec { size: sensor, pixel_format: PixelFormat::BayerGR12p, colour, ..spec(last) };
        let camera = GigeVision::open(&spec, clock, 0).expect("it answers");
        let info = camera.info().clone();
        assert_eq!(info.resolution, Resolution::new(SIZE.width, SIZE.height));
        let calibration = Calibration::ideal(lamp.info(), &info);
        let devices = Devices::new(lamp, camera, clock);
        // The scene has direct light only, which is not separated here.
        let options = MeasureOptions { direct_square: Some(1), ..MeasureOptions::default() };
        let live = Box::new(LiveFrames::new(devices, 0.0, 5));
        let mut measurement = Measurement::new(live, calibration, options).expect("they belong together");
        assert_eq!(measurement.channels(), info.channels);
        for channel in 0..info.channels {
            let mut y = vec![0.0; pixels];
            measurement.operator(Part::Full, channel).apply(&x, &mut y).expect("no frame is lost");
            let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
            let error = (1.0 - dot(&y, &truth).powi(2) / (dot(&y, &y) * dot(&truth, &truth))).max(0.0).sqrt();
            println!("{colour:?}, channel {channel}: relative error {error:.5}");
            // Rounding to the nearest levels alone is an error of 0.29 levels of 2 / 255 each; the root mean square of x is 0.735.
            assert!(error < 3.1e-3, "{colour:?}, channel {channel}: {error}");
        }
    }
}
