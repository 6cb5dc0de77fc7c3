//! A projector and a camera of your own behind the rig traits: both are in memory here; the SDK of a real device takes as few lines.
//!
//! `cargo run --release --example own_camera`

use std::sync::{Arc, Mutex};

use krylux::image::Resolution;
use krylux::krylov::{EigsOptions, Start, eigs};
use krylux::measure::{Calibration, LiveFrames, MeasureOptions, Measurement};
use krylux::rig::{Camera, CameraInfo, Devices, Frame, Projector, ProjectorInfo, RawFrame, Shown, WallClock};
use krylux::transport::Part;

struct Mine<Info>(Info, Arc<Mutex<Frame>>, WallClock, u64);

impl Projector for Mine<ProjectorInfo> {
    fn info(&self) -> &ProjectorInfo {
        &self.0
    }
    fn show(&mut self, frame: &Frame) -> krylux::Result<Shown> {
        *self.1.lock().expect("no thread panics with the frame") = frame.clone();
        Ok(Shown { at: self.2.seconds() })
    }
}

impl Camera for Mine<CameraInfo> {
    fn info(&self) -> &CameraInfo {
        &self.0
    }
    fn configure(&mut self, exposure: f64) -> krylux::Result<f64> {
        Ok(exposure)
    }
    fn capture(&mut self) -> krylux::Result<Option<RawFrame>> {
        let (resolution, started, exposure) = (self.0.resolution, self.2.seconds(), 1e-3);
        std::thread::sleep(std::time::Duration::from_secs_f64(exposure));
        self.3 += 1;
        let frame = self.1.lock().expect("no thread panics with the frame");
        let sum: f64 = frame.levels().iter().map(|&level| f64::from(level)).sum();
        let counts =
            frame.levels().iter().map(|&level| (2.0 * f64::from(level) + 0.2 * sum) as u16).collect();
        Ok(Some(RawFrame { resolution, channels: 1, counts, exposure, id: self.3, started }))
    }
}

fn main() -> krylux::Result<()> {
    let (resolution, name) = (Resolution::new(4, 2), String::from("mine"));
    let projector = ProjectorInfo { name: name.clone(), resolution, channels: 1, bits: 8, frame_time: 0.0 };
    let camera = CameraInfo { name, resolution, channels: 1, bits: 12, exposures: [1e-4, 1e-2] };
    let calibration = Calibration::ideal(&projector, &camera);
    let (clock, screen) =
        (WallClock::starting_at(0.0), Arc::new(Mutex::new(Frame::filled(resolution, 1, 0))));
    let (projector, camera) = (Mine(projector, screen.clone(), clock, 0), Mine(camera, screen, clock, 0));
    let frames = LiveFrames::new(Devices::new(projector, camera, clock), 0.0, 3);
    let options = MeasureOptions { exposures: vec![1e-3], ..MeasureOptions::default() };
    let mut rig = Measurement::new(Box::new(frames), calibration, options)?;
    // The largest eigenvalue of I plus 0.1 everywhere is 1.8 times all others.
    // Eight random signs may add up to nothing, and then have no part of its eigenvector, which is constant.
    let start = Start::Gaussian { seed: 0 };
    let wanted = EigsOptions { count: 1, products: 6, start, ..EigsOptions::default() };
    let found = eigs(&mut rig.operator(Part::Full, 0), &wanted)?;
    println!("{} photos; largest eigenvalue {:.4e} DN/s", found.stats.products, found.values[0]);
    Ok(())
}
