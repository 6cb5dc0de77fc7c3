//! What is shot follows from the options and from earlier frames alone.

use std::cell::RefCell;
use std::rc::Rc;

use krylux::Result;
use krylux::image::Resolution;
use krylux::measure::{CaptureRequest, DirectBy, Effort, FrameSource, MeasureOptions, Measurement};
use krylux::rig::{CameraInfo, ProjectorInfo, RawFrame};
use krylux::transport::Part;

use super::support::{Dense, Rig, product, vector};

/// A journal in memory: no photo is taken twice.
struct Memory {
    rig: Rig,
    journal: Rc<RefCell<Vec<(CaptureRequest, RawFrame)>>>,
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

    fn capture(&mut self, shot: &CaptureRequest) -> Result<RawFrame> {
        let known =
            self.journal.borrow().iter().find(|(known, _)| known == shot).map(|(_, frame)| frame.clone());
        if let Some(frame) = known {
            return Ok(frame);
        }
        assert!(self.live, "take {} at {} s was never shot", shot.take, shot.exposure);
        let frame = self.rig.capture(shot)?;
        self.journal.borrow_mut().push((shot.clone(), frame.clone()));
        Ok(frame)
    }

    fn set_settle(&mut self, _: f64) {}

    fn effort(&self) -> Effort {
        self.rig.effort
    }
}

#[test]
fn a_replay_asks_for_the_same_photos_and_gives_the_same_bits() {
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
    let journal = Rc::new(RefCell::new(Vec::new()));
    let run = |live: bool| {
        let shots = Memory { rig: rig.clone(), journal: Rc::clone(&journal), live };
        let mut measurement =
            Measurement::new(Box::new(shots), rig.calibration(), options.clone()).expect("they fit");
        let products: Vec<Vec<f64>> =
            (0..6).map(|seed| product(&mut measurement, Part::Global, &vector(54, seed))).collect();
        (products, measurement.drift().expect("white is there"))
    };
    let first = run(true);
    let taken = journal.borrow().len();
    let sentinels = first.1.sentinels.len() - 1;
    assert!(sentinels >= 4, "{sentinels}");
    assert!(first == run(false), "a replay differs");
    assert_eq!(journal.borrow().len(), taken);
}
