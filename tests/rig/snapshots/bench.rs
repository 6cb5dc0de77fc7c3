//! The benches of these tests.

use krylux::calibrate::{CalibrateOptions, CalibrationReport};
use krylux::image::{Image, Resolution};
use krylux::measure::{Calibration, LiveFrames, MeasureOptions, Measurement};
use krylux::rig::VirtualRig;
use krylux::transport::{Channels, Transport};

use crate::rig::calibration::calibrated_from;
use crate::rig::calibration::scene::Folded;

/// Pixels of the projector.
pub const SIZE: Resolution = Resolution { width: 32, height: 28 };

/// Light between two walls, of which some colours are reflected more than others.
#[derive(Clone)]
pub struct Coloured(pub Folded);

impl Transport for Coloured {
    fn pattern_resolution(&self) -> Resolution {
        self.0.pattern_resolution()
    }

    fn photo_resolution(&self) -> Resolution {
        self.0.photo_resolution()
    }

    fn channels(&self) -> Channels {
        Channels::Rgb
    }

    fn photograph(&mut self, pattern: &Image) -> krylux::Result<Image> {
        let plane = |channel: usize| self.0.apply(&pattern.plane(channel.min(pattern.channels() - 1)));
        let photos = [plane(0), plane(1), plane(2)];
        let sample = |index: usize| ([1.0, 0.7, 0.5][index % 3] * photos[index % 3][index / 3]) as f32;
        Image::new(
            self.pattern_resolution(),
            3,
            (0..3 * self.pattern_resolution().pixels()).map(sample).collect(),
        )
    }
}

pub fn scene() -> Folded {
    Folded::new(SIZE, 0.3)
}

/// A bench with every imperfection that a calibration measures, in gray.
pub fn realistic() -> VirtualRig {
    let mut rig = crate::rig::calibration::realistic(&scene());
    rig.projector.vignetting = 0.1;
    rig.projector.blur = 0.3;
    rig.camera.size = Some([72, 64]);
    rig.camera.gamma = Some(0.95);
    rig.camera.vignetting = 0.15;
    rig.camera.dark_current = 10.0;
    rig.camera.scale = 1.01;
    rig.camera.readout = 0.01;
    rig.ambient.variation = 0.01;
    rig.ambient.period = 0.01;
    rig.drift.per_hour = -0.05;
    rig
}

/// The same in colour; the camera's filters overlap.
pub fn coloured() -> VirtualRig {
    let mut rig = realistic();
    rig.projector.channels = 3;
    rig.camera.channels = 3;
    rig.camera.gamma = None;
    rig.camera.crosstalk = Some([[1.0, 0.1, 0.0], [0.05, 1.0, 0.05], [0.0, 0.1, 1.0]]);
    rig
}

pub fn frames(rig: &VirtualRig, settle: f64) -> LiveFrames {
    let scene: Box<dyn Transport + Send> =
        if rig.camera.channels == 3 { Box::new(Coloured(scene())) } else { Box::new(scene()) };
    LiveFrames::new(rig.open(scene, None).expect("the scene fits its rig"), settle, 5)
}

pub fn calibrated(rig: &VirtualRig, options: &CalibrateOptions) -> (Calibration, CalibrationReport) {
    calibrated_from(frames(rig, 0.0), options)
}

/// One take of 33 levels: what is left to chance is seeded, and need not be small.
pub fn quick() -> CalibrateOptions {
    CalibrateOptions { takes: 1, levels: Some(33), ..CalibrateOptions::default() }
}

pub fn measurement(rig: &VirtualRig, calibration: &Calibration, options: MeasureOptions) -> Measurement {
    let frames = Box::new(frames(rig, calibration.stability.settle));
    Measurement::new(frames, calibration.clone(), options).expect("options that make sense")
}
