//! Scenes that need no graphics device, and rigs on them.

use std::path::PathBuf;
use std::sync::Arc;

use krylux::image::{Image, Resolution};
use krylux::measure::{CaptureRequest, LiveFrames};
use krylux::rig::{Devices, Frame, RawFrame, Stamp, VirtualRig, VirtualScene};
use krylux::sparse::Csr;
use krylux::transport::{Channels, ExplicitMatrix, Transport};

/// A rig without imperfections on a scene of this size.
pub fn rig(width: usize, height: usize) -> VirtualRig {
    let size = Resolution::new(width, height);
    VirtualRig::ideal(VirtualScene::Matrix { path: PathBuf::from("diagonal.npz"), size })
}

/// A scene with a diagonal matrix: pixel `i` reflects `diagonal(i)` of its own light.
pub fn diagonal(size: Resolution, diagonal: impl Fn(usize) -> f64) -> Box<dyn Transport + Send> {
    let pixels = size.pixels();
    let matrix = Csr::new(
        pixels,
        (0..=pixels).collect(),
        (0..pixels as u32).collect(),
        (0..pixels).map(diagonal).collect(),
    );
    let matrix = matrix.expect("a diagonal is well formed");
    Box::new(ExplicitMatrix::new(matrix, size).expect("one row and column for each pixel"))
}

/// A coloured sheet that emits light: each pixel reflects `colour` of its light, and adds `glow`.
pub struct Sheet {
    pub size: Resolution,
    pub colour: [f32; 3],
    pub glow: [f32; 3],
}

impl Transport for Sheet {
    fn pattern_resolution(&self) -> Resolution {
        self.size
    }

    fn photo_resolution(&self) -> Resolution {
        self.size
    }

    fn channels(&self) -> Channels {
        Channels::Rgb
    }

    fn photograph(&mut self, pattern: &Image) -> krylux::Result<Image> {
        let channels = pattern.channels();
        let sample = |index: usize| {
            let (pixel, channel) = (index / 3, index % 3);
            let light = pattern.samples()[pixel * channels + channel.min(channels - 1)];
            self.glow[channel] + self.colour[channel] * light
        };
        Image::new(self.size, 3, (0..3 * self.size.pixels()).map(sample).collect())
    }
}

/// Opens the rig on a scene that is white everywhere.
pub fn open(rig: &VirtualRig) -> Devices {
    open_after(rig, None)
}

/// Like [`open`], but continues an earlier session.
pub fn open_after(rig: &VirtualRig, after: Option<Stamp>) -> Devices {
    rig.open(diagonal(rig.scene.size(), |_| 1.0), after).expect("the scene fits the rig")
}

/// A frame that has one level everywhere.
pub fn flat(rig: &VirtualRig, level: u16) -> Frame {
    Frame::filled(rig.scene.size(), rig.projector.channels, level)
}

/// A request for a photo of a frame of one level.
pub fn shot(rig: &VirtualRig, level: u16, exposure: f64, take: u32) -> CaptureRequest {
    CaptureRequest { frame: Arc::new(flat(rig, level)), exposure, take }
}

/// The open rig as a frame source with its policy for faulty frames.
pub fn live(rig: &VirtualRig, settle: f64, tries: u32) -> LiveFrames {
    LiveFrames::new(open(rig), settle, tries)
}

/// Sets the exposure, shows a frame of one level, and waits until it has settled.
pub fn show(mut devices: Devices, rig: &VirtualRig, level: u16, exposure: f64) -> Devices {
    devices.camera.configure(exposure).expect("within the range");
    devices.projector.show(&flat(rig, level)).expect("it fits");
    devices.clock.sleep(rig.projector.latency);
    devices
}

/// The next frame, which must arrive.
pub fn capture(devices: &mut Devices) -> RawFrame {
    devices.camera.capture().expect("a virtual camera is never gone").expect("it comes")
}

/// The counts of one frame.
pub fn counts(devices: &mut Devices) -> Vec<f64> {
    capture(devices).counts.into_iter().map(f64::from).collect()
}

/// The mean and the variance of each pixel over many frames.
pub fn moments(devices: &mut Devices, frames: usize) -> Vec<[f64; 2]> {
    let taken: Vec<Vec<f64>> = (0..frames).map(|_| counts(devices)).collect();
    let count = frames as f64;
    (0..taken[0].len())
        .map(|pixel| {
            let values = || taken.iter().map(|counts| counts[pixel]);
            let mean = values().sum::<f64>() / count;
            let squares: f64 = values().map(|value| (value - mean).powi(2)).sum();
            [mean, squares / (count - 1.0)]
        })
        .collect()
}
