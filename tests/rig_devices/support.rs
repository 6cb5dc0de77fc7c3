//! A scene that needs no graphics device, rigs on it, and frames that tell which pattern was on.

use std::path::PathBuf;
use std::sync::Arc;

use krylux::image::Resolution;
use krylux::measure::{Live, Shot};
use krylux::rig::{Bench, Frame, RawFrame, Stamp, VirtualRig, VirtualScene};
use krylux::sparse::Csr;
use krylux::transport::{Given, Transport};

/// A rig without fault on a scene of so many pixels.
pub fn rig(width: usize, height: usize) -> VirtualRig {
    let size = Resolution::new(width, height);
    VirtualRig::ideal(VirtualScene::Matrix { path: PathBuf::from("diagonal.npz"), size })
}

/// A scene whose pixel `i` reflects `diagonal(i)` of its own light, and nothing else's.
pub fn diagonal(size: Resolution, diagonal: impl Fn(usize) -> f64) -> Box<dyn Transport> {
    let pixels = size.pixels();
    let matrix = Csr::new(
        pixels,
        (0..=pixels).collect(),
        (0..pixels as u32).collect(),
        (0..pixels).map(diagonal).collect(),
    );
    let matrix = matrix.expect("a diagonal is well formed");
    Box::new(Given::new(matrix, size).expect("one row and column for each pixel"))
}

/// The rig on a scene that is white all over.
pub fn open(rig: &VirtualRig) -> Bench {
    open_after(rig, None)
}

/// As [`open`], after an earlier session.
pub fn open_after(rig: &VirtualRig, after: Option<Stamp>) -> Bench {
    rig.open(diagonal(rig.scene.size(), |_| 1.0), after).expect("the scene fits the rig")
}

/// A frame of one level.
pub fn flat(rig: &VirtualRig, level: u16) -> Frame {
    Frame::filled(rig.scene.size(), rig.projector.channels, level)
}

/// A photo of a frame of one level.
pub fn shot(rig: &VirtualRig, level: u16, exposure: f64, take: u32) -> Shot {
    Shot { frame: Arc::new(flat(rig, level)), exposure, take }
}

/// The bench with the policy.
pub fn live(rig: &VirtualRig, settle: f64, tries: u32) -> Live {
    Live::new(open(rig), settle, tries)
}

/// The bench set to an exposure, showing this frame, settled.
pub fn showing(rig: &VirtualRig, frame: &Frame, exposure: f64) -> Bench {
    let mut bench = open(rig);
    bench.camera.configure(exposure).expect("within the range");
    bench.projector.show(frame).expect("it fits");
    bench.clock.sleep(rig.projector.latency);
    bench
}

/// The next frame, which must come.
pub fn capture(bench: &mut Bench) -> RawFrame {
    bench.camera.capture().expect("a virtual camera is never gone").expect("it comes")
}

/// Mean and variance of each pixel over many frames.
pub fn moments(bench: &mut Bench, frames: usize) -> Vec<[f64; 2]> {
    let taken: Vec<Vec<u16>> = (0..frames).map(|_| capture(bench).counts).collect();
    let count = frames as f64;
    (0..taken[0].len())
        .map(|pixel| {
            let values = || taken.iter().map(|counts| f64::from(counts[pixel]));
            let mean = values().sum::<f64>() / count;
            let squares: f64 = values().map(|value| (value - mean).powi(2)).sum();
            [mean, squares / (count - 1.0)]
        })
        .collect()
}
