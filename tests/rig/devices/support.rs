//! Scenes that need no graphics device, and rigs on them.

use std::path::PathBuf;
use std::sync::Arc;

use krylux::image::{Image, Resolution};
use krylux::measure::{CaptureRequest, LiveFrames};
use krylux::rig::{Devices, Frame, RawFrame, Stamp, VirtualRig, VirtualScene};
use krylux::sparse::Csr;
use krylux::transport::{Channels, ExplicitMatrix, Transport};

/// A rig without fault on a scene of so many pixels.
pub fn rig(width: usize, height: usize) -> VirtualRig {
    let size = Resolution::new(width, height);
    VirtualRig::ideal(VirtualScene::Matrix { path: PathBuf::from("diagonal.npz"), size })
}

/// A scene whose pixel `i` reflects `diagonal(i)` of its own light, and nothing else's.
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

/// A coloured sheet that glows by itself: each pixel reflects `colour` of its light, and adds `glow`.
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

/// The rig on a scene that is white all over.
pub fn open(rig: &VirtualRig) -> Devices {
    open_after(rig, None)
}

/// As [`open`], after an earlier session.
pub fn open_after(rig: &VirtualRig, after: Option<Stamp>) -> Devices {
    rig.open(diagonal(rig.scene.size(), |_| 1.0), after).expect("the scene fits the rig")
}

/// A frame of one level.
pub fn flat(rig: &VirtualRig, level: u16) -> Frame {
    Frame::filled(rig.scene.size(), rig.projector.channels, level)
}

/// A photo of a frame of one level.
pub fn shot(rig: &VirtualRig, level: u16, exposure: f64, take: u32) -> CaptureRequest {
    CaptureRequest { frame: Arc::new(flat(rig, level)), exposure, take }
}

/// The bench with the policy.
pub fn live(rig: &VirtualRig, settle: f64, tries: u32) -> LiveFrames {
    LiveFrames::new(open(rig), settle, tries)
}

/// This bench set to an exposure, showing a frame of one level, settled.
pub fn show(mut bench: Devices, rig: &VirtualRig, level: u16, exposure: f64) -> Devices {
    bench.camera.configure(exposure).expect("within the range");
    bench.projector.show(&flat(rig, level)).expect("it fits");
    bench.clock.sleep(rig.projector.latency);
    bench
}

/// The next frame, which must come.
pub fn capture(bench: &mut Devices) -> RawFrame {
    bench.camera.capture().expect("a virtual camera is never gone").expect("it comes")
}

/// The counts of one frame.
pub fn counts(bench: &mut Devices) -> Vec<f64> {
    capture(bench).counts.into_iter().map(f64::from).collect()
}

/// Mean and variance of each pixel over many frames.
pub fn moments(bench: &mut Devices, frames: usize) -> Vec<[f64; 2]> {
    let taken: Vec<Vec<f64>> = (0..frames).map(|_| counts(bench)).collect();
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
