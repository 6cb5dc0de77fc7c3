//! A projector and a camera of your own behind the rig traits: here both are in memory, a laboratory's own SDK is as near.
//!
//! `cargo run --release --example own_camera`

use std::sync::{Arc, Mutex};

use krylux::image::Resolution;
use krylux::krylov::{EigsOptions, eigs};
use krylux::measure::{Calibration, LiveFrames, MeasureOptions, Measurement};
use krylux::rig::{Camera, CameraInfo, Devices, Frame, Projector, ProjectorInfo, RawFrame, Shown, WallClock};
use krylux::transport::Part;

struct MyProjector(ProjectorInfo, Arc<Mutex<Frame>>, WallClock);

impl Projector for MyProjector {
    fn info(&self) -> &ProjectorInfo {
        &self.0
    }
    fn show(&mut self, frame: &Frame) -> krylux::Result<Shown> {
        *self.1.lock().expect("no thread panics with the frame") = frame.clone();
        Ok(Shown { at: self.2.seconds() })
    }
}

struct MyCamera(CameraInfo, Arc<Mutex<Frame>>, WallClock, u64);

impl Camera for MyCamera {
    fn info(&self) -> &CameraInfo {
        &self.0
    }
    fn configure(&mut self, exposure: f64) -> krylux::Result<f64> {
        Ok(exposure)
    }
    fn capture(&mut self) -> krylux::Result<Option<RawFrame>> {
        let (started, exposure) = (self.2.seconds(), 1e-3);
        std::thread::sleep(std::time::Duration::from_secs_f64(exposure));
        self.3 += 1;
        // Each pixel sees its own level and a tenth of every other one.
        let frame = self.1.lock().expect("no thread panics with the frame");
        let levels: Vec<f64> = frame.levels().iter().map(|&level| level.into()).collect();
        let others = 0.1 * levels.iter().sum::<f64>();
        let counts = levels.iter().map(|level| (4.0 * (0.9 * level + others)) as u16).collect();
        Ok(Some(RawFrame {
            resolution: self.0.resolution,
            channels: 1,
            counts,
            exposure,
            id: self.3,
            started,
        }))
    }
}

fn main() -> krylux::Result<()> {
    let resolution = Resolution::new(4, 2);
    let projector = ProjectorInfo { name: "mine".into(), resolution, channels: 1, bits: 8, frame_time: 0.0 };
    let camera =
        CameraInfo { name: "mine".into(), resolution, channels: 1, bits: 12, exposures: [1e-4, 1e-2] };
    let calibration = Calibration::ideal(&projector, &camera);
    let (clock, screen) =
        (WallClock::starting_at(0.0), Arc::new(Mutex::new(Frame::filled(resolution, 1, 0))));
    let devices = Devices::new(
        MyProjector(projector, screen.clone(), clock),
        MyCamera(camera, screen, clock, 0),
        clock,
    );
    let options = MeasureOptions { exposures: vec![1e-3], ..MeasureOptions::default() };
    let mut rig = Measurement::new(Box::new(LiveFrames::new(devices, 0.0, 3)), calibration, options)?;
    let pairs =
        eigs(&mut rig.operator(Part::Full, 0), &EigsOptions { count: 1, products: 6, ..Default::default() })?;
    // The matrix is 0.9 I + 0.1 for every pair: its largest eigenvalue is 1.7 of the smallest one's 0.9.
    println!("{} photos, largest eigenvalue {:.3e} DN/s", pairs.stats.products, pairs.values[0]);
    Ok(())
}
