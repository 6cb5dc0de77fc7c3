//! Colour: each channel has its own surfaces, room light and response, and its own arithmetic.

use krylux::Result;
use krylux::image::{Image, Resolution};
use krylux::measure::{Calibration, CaptureRequest, Effort, FrameSource, MeasureOptions, Measurement, Plane};
use krylux::operator::Operator;
use krylux::rig::{CameraInfo, ProjectorInfo, RawFrame};
use krylux::transport::Part;

use super::support::{Dense, error, plain, vector};

const SIZE: Resolution = Resolution { width: 6, height: 5 };
/// The projector's gamma in red, green and blue.
const GAMMA: [f64; 3] = [1.0, 2.2, 3.0];
/// The light of the room in linear DN per second, in red, green and blue.
const ROOM: [f64; 3] = [100.0, 900.0, 400.0];

/// A rig without noise whose channels are three dense matrices.
struct Rig {
    matrices: [Dense; 3],
    projector: ProjectorInfo,
    camera: CameraInfo,
    effort: Effort,
}

impl Rig {
    fn new(bits: u32) -> Self {
        let (name, resolution, channels) = ("colour".to_owned(), SIZE, 3);
        let projector = ProjectorInfo { name: name.clone(), resolution, channels, bits, frame_time: 0.0 };
        let camera = CameraInfo { name, resolution, channels, bits: 16, exposures: [1e-4, 1e4] };
        let matrices = [5, 6, 7].map(|seed| Dense::new(SIZE, 500.0, seed));
        Self { matrices, projector, camera, effort: Effort::default() }
    }

    /// A measurement of it with its exact calibration.
    fn measure(self, options: MeasureOptions) -> Measurement {
        let mut calibration = Calibration::ideal(&self.projector, &self.camera);
        for (curve, gamma) in calibration.projector.iter_mut().zip(GAMMA) {
            curve.iter_mut().for_each(|light| *light = light.powf(gamma));
        }
        // White and the room are less than 3,000 DN per second: 20 seconds do not saturate 16 bits.
        let options = MeasureOptions { exposures: vec![20.0], ..options };
        Measurement::new(Box::new(self), calibration, options).expect("options of a test fit")
    }
}

impl FrameSource for Rig {
    fn projector(&self) -> &ProjectorInfo {
        &self.projector
    }

    fn camera(&self) -> &CameraInfo {
        &self.camera
    }

    fn capture(&mut self, request: &CaptureRequest) -> Result<RawFrame> {
        self.effort.shown += 1;
        self.effort.taken += 1;
        let top = f64::from((1_u32 << self.projector.bits) - 1);
        let mut counts = vec![0; 3 * SIZE.pixels()];
        for (channel, matrix) in self.matrices.iter().enumerate() {
            let levels = request.frame.levels().iter().skip(channel).step_by(3);
            let lit: Vec<f64> = levels.map(|&level| (f64::from(level) / top).powf(GAMMA[channel])).collect();
            for (pixel, light) in matrix.apply(Part::Full, &lit).iter().enumerate() {
                let count = (light + ROOM[channel]) * request.exposure;
                assert!(count < 65_535.0, "the test's exposure saturates");
                counts[3 * pixel + channel] = count.round() as u16;
            }
        }
        let (id, started) = (self.effort.taken, self.effort.taken as f64);
        Ok(RawFrame { resolution: SIZE, channels: 3, counts, exposure: request.exposure, id, started })
    }

    fn set_settle(&mut self, _: f64) {}

    fn effort(&self) -> Effort {
        self.effort
    }
}

/// A pattern of its own in each channel, from 0 to 1; or the same in all.
fn pattern(is_gray: bool) -> Image {
    let planes = [21, 22, 23].map(|seed| vector(SIZE.pixels(), if is_gray { 21 } else { seed }));
    let sample = |at: usize| (0.5 + 0.5 * planes[at % 3][at / 3]) as f32;
    let image = Image::new(SIZE, 3, (0..3 * SIZE.pixels()).map(sample).collect()).expect("it fits");
    if is_gray {
        Image::new(SIZE, 1, image.plane(0).iter().map(|&x| x as f32).collect()).expect("it fits")
    } else {
        image
    }
}

/// The relative error of each channel of a photo of this pattern.
fn errors(photo: &[Plane], pattern: &Image) -> Vec<f64> {
    let matrices = Rig::new(8).matrices;
    let of_channel = |(channel, plane): (usize, &Plane)| {
        let shown = pattern.plane(channel.min(pattern.channels() - 1));
        error(&plane.values, &matrices[channel].apply(Part::Full, &shown))
    };
    photo.iter().enumerate().map(of_channel).collect()
}

#[test]
fn the_light_of_the_room_is_subtracted_once_from_each_channel() {
    let mut measurement = Rig::new(16).measure(plain());
    for is_gray in [true, false] {
        let pattern = pattern(is_gray);
        let photo = measurement.photograph(&pattern).expect("a dense rig never fails");
        let errors = errors(&photo.planes, &pattern);
        println!("photo: {errors:?}");
        // Counts and levels of 16 bits; in the darkest patterns, a light is a hundredth of white.
        assert!(errors.len() == 3 && errors.iter().all(|&error| error < 3e-4), "{errors:?}");
    }
    let room = measurement.ambient().expect("a dense rig never fails");
    for (plane, light) in room.planes.iter().zip(ROOM) {
        assert!(plane.values.iter().all(|value| (value - light).abs() < 0.05), "{light}: {:?}", plane.values);
    }
}

#[test]
fn products_of_each_channel_are_those_of_its_own_matrix() {
    let x = vector(SIZE.pixels(), 4);
    let matrices = Rig::new(8).matrices;
    let mut measurement = Rig::new(16).measure(plain());
    assert_eq!(measurement.channels(), 3);
    for (channel, matrix) in matrices.iter().enumerate() {
        let mut y = vec![0.0; x.len()];
        measurement.operator(Part::Full, channel).apply(&x, &mut y).expect("a dense rig never fails");
        let error = error(&y, &matrix.apply(Part::Full, &x));
        assert!(error < 3e-4, "channel {channel}: {error}");
    }
}

/// Frames of coarse levels leave other remainders in each channel, as each has its own response.
#[test]
fn bit_planes_show_each_channels_own_remainder() {
    for is_gray in [true, false] {
        let pattern = pattern(is_gray);
        let by = |bit_planes| {
            let mut measurement = Rig::new(2).measure(MeasureOptions { bit_planes, ..plain() });
            errors(&measurement.photograph(&pattern).expect("a dense rig never fails").planes, &pattern)
        };
        let (one, nine) = (by(1), by(9));
        println!("2 bits in one frame: {one:?}, in nine: {nine:?}");
        // The widest step of the three curves, 0.7 of white, leaves (0.7 / 1.7)⁹ = 3e-4 of it.
        for channel in 0..3 {
            assert!(nine[channel] < 1e-3 && one[channel] > 0.02, "channel {channel}: {one:?} {nine:?}");
        }
    }
}
