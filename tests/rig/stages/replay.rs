//! Which photos are taken depends only on the options and on earlier frames.

use std::sync::{Arc, Mutex, PoisonError};

use krylux::Result;
use krylux::image::Resolution;
use krylux::measure::{CaptureRequest, DirectBy, Effort, FrameSource, MeasureOptions, Measurement};
use krylux::rig::{CameraInfo, ProjectorInfo, RawFrame};
use krylux::transport::Part;

use super::support::{Dense, Rig, product, vector};

/// A journal in memory: no photo is taken twice.
struct Memory {
    rig: Rig,
    journal: Arc<Mutex<Vec<(CaptureRequest, RawFrame)>>>,
    /// Whether a photo may be taken at all.
    live: bool,
}

impl FrameSource for Memory {
    fn projector(&self) -> &ProjectorInfo {
        &self.rig.projector
    }

    fn camera(&self) -> &CameraInfo {
        &self.rig.camera
    }

    fn capture(&mut self, request: &CaptureRequest) -> Result<RawFrame> {
        let mut journal = self.journal.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, frame)) = journal.iter().find(|(known, _)| known == request) {
            return Ok(frame.clone());
        }
        assert!(self.live, "take {} at {} s was never taken", request.take, request.exposure);
        let frame = self.rig.capture(request)?;
        journal.push((request.clone(), frame.clone()));
        Ok(frame)
    }

    fn set_settle(&mut self, _: f64) {}

    fn effort(&self) -> Effort {
        self.rig.effort
    }
}

#[test]
fn a_replay_requests_the_same_photos_and_gives_the_same_bits() {
    let rig = Rig {
        lamp: |t| 1.0 + 1e-3 * t,
        ambient: 100.0,
        ..Rig::new(Dense::new(Resolution::new(9, 6), 1000.0, 5)).noisy()
    };
    let options = MeasureOptions {
        direct: DirectBy::Patterns,
        sentinel_every: 3,
        brackets: 3,
        takes: 2,
        bit_planes: 2,
        ..MeasureOptions::default()
    };
    let journal = Arc::new(Mutex::new(Vec::new()));
    let run = |live: bool| {
        let frames = Memory { rig: rig.clone(), journal: Arc::clone(&journal), live };
        let mut measurement =
            Measurement::new(Box::new(frames), rig.calibration(), options.clone()).expect("they fit");
        let products: Vec<Vec<f64>> =
            (0..6).map(|seed| product(&mut measurement, Part::Global, &vector(54, seed))).collect();
        (products, measurement.drift().expect("white is there"))
    };
    let first = run(true);
    let taken = || journal.lock().unwrap_or_else(PoisonError::into_inner).len();
    let before = taken();
    let sentinels = first.1.sentinels.len() - 1;
    assert!(sentinels >= 4, "{sentinels}");
    assert!(first == run(false), "a replay differs");
    assert_eq!(taken(), before);
}
