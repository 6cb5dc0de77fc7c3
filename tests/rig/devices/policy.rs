//! Which frames are accepted, tested with a scripted camera.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex};

use krylux::Error;
use krylux::image::Resolution;
use krylux::measure::{Effort, FrameSource, LiveFrames};
use krylux::rig::{Camera, CameraInfo, Devices, RawFrame};

use super::support::{open, rig, shot};

/// The requests to the camera, in order.
type Log = Arc<Mutex<Vec<&'static str>>>;

/// A camera that returns the scripted frames.
struct Scripted {
    info: CameraInfo,
    frames: VecDeque<Option<RawFrame>>,
    set: f64,
    log: Log,
}

impl Camera for Scripted {
    fn info(&self) -> &CameraInfo {
        &self.info
    }

    fn configure(&mut self, _: f64) -> krylux::Result<f64> {
        self.log.lock().expect("no thread failed").push("configure");
        Ok(self.set)
    }

    fn capture(&mut self) -> krylux::Result<Option<RawFrame>> {
        self.log.lock().expect("no thread failed").push("capture");
        Ok(self.frames.pop_front().flatten())
    }

    fn restart(&mut self) -> krylux::Result<()> {
        self.log.lock().expect("no thread failed").push("restart");
        Ok(())
    }
}

fn frame(id: u64, started: f64) -> RawFrame {
    RawFrame {
        resolution: Resolution::new(2, 2),
        channels: 1,
        counts: vec![0; 4],
        exposure: 0.1,
        id,
        started,
    }
}

/// A frame source with a settle time of 0.5 s and four tries, and the log of the camera's calls.
fn scripted(frames: Vec<Option<RawFrame>>) -> (LiveFrames, Log) {
    with_exposure(frames, 0.1)
}

fn with_exposure(frames: Vec<Option<RawFrame>>, set: f64) -> (LiveFrames, Log) {
    let log = Log::default();
    let Devices { projector, clock, .. } = open(&rig(2, 2));
    let info = CameraInfo { name: "the camera".into(), ..rig(2, 2).camera_info() };
    let camera = Box::new(Scripted { info, frames: frames.into(), set, log: Arc::clone(&log) });
    (LiveFrames::new(Devices { projector, camera, clock }, 0.5, 4), log)
}

/// The numbers of the frames that were accepted for three photos of one pattern.
fn taken(live: &mut LiveFrames) -> Vec<u64> {
    (0..3)
        .map_while(|take| live.capture(&shot(&rig(2, 2), 7, 0.1, take)).ok())
        .map(|frame| frame.id)
        .collect()
}

#[test]
fn frames_are_accepted_after_the_pattern_has_settled() {
    let frames = [frame(1, 0.0), frame(2, 0.4999), frame(3, 0.5), frame(4, 0.7), frame(5, 0.8)];
    let (mut live, log) = scripted(frames.into_iter().map(Some).collect());
    assert_eq!(taken(&mut live), [3, 4, 5]);
    let times = live.effort().times;
    let expected = Effort { shown: 1, taken: 3, late: 2, seconds: 0.5, times, ..Effort::default() };
    assert_eq!(live.effort(), expected);
    assert_eq!(times.settle, 0.5);
    assert_eq!(
        log.lock().expect("no thread failed").iter().filter(|&&told| told == "configure").count(),
        1,
        "the exposure did not change"
    );
}

#[test]
fn a_number_that_does_not_increase_is_a_repetition() {
    let frames = [frame(5, 1.0), frame(5, 2.0), frame(9, 3.0), frame(4, 4.0), frame(10, 5.0)];
    let (mut live, _) = scripted(frames.into_iter().map(Some).collect());
    assert_eq!(taken(&mut live), [5, 9, 10]);
    assert_eq!(live.effort().repeated, 2);
}

#[test]
fn a_time_that_does_not_increase_is_late() {
    let frames = [frame(1, 2.0), frame(2, 1.0), frame(3, 1.9), frame(4, 3.0), frame(5, 4.0)];
    let (mut live, _) = scripted(frames.into_iter().map(Some).collect());
    assert_eq!(taken(&mut live), [1, 4, 5]);
    assert_eq!(live.effort().late, 2);
}

#[test]
fn after_a_restart_repetitions_are_recognized_by_their_time() {
    let frames =
        vec![Some(frame(70, 1.0)), None, None, Some(frame(1, 1.0)), Some(frame(1, 2.0)), Some(frame(2, 3.0))];
    let (mut live, log) = scripted(frames);
    assert_eq!(taken(&mut live), [70, 1, 2]);
    assert_eq!((live.effort().dropped, live.effort().repeated, live.effort().restarts), (2, 1, 1));
    let told = ["configure", "capture", "capture", "capture", "restart", "capture", "capture", "capture"];
    assert_eq!(*log.lock().expect("no thread failed"), told);
}

#[test]
fn a_frame_with_another_exposure_is_late() {
    let other = RawFrame { exposure: 0.2, ..frame(1, 1.0) };
    let (mut live, _) =
        scripted(vec![Some(other), Some(frame(2, 2.0)), Some(frame(3, 3.0)), Some(frame(4, 4.0))]);
    assert_eq!(taken(&mut live), [2, 3, 4]);
    assert_eq!(live.effort().late, 1);
}

#[test]
fn invalid_frames_are_errors_without_a_retry() {
    let short = RawFrame { counts: vec![0; 3], ..frame(1, 1.0) };
    let wide = RawFrame { resolution: Resolution::new(4, 1), ..frame(1, 1.0) };
    let timeless = RawFrame { started: f64::NAN, ..frame(1, 1.0) };
    for wrong in [short, wide, timeless] {
        let (mut live, log) = scripted(vec![Some(wrong), Some(frame(2, 2.0))]);
        let fault = live.capture(&shot(&rig(2, 2), 7, 0.1, 0));
        assert!(matches!(fault, Err(Error::Rig { .. } | Error::Dimension { .. })), "{fault:?}");
        assert_eq!(*log.lock().expect("no thread failed"), ["configure", "capture"], "it would come again");
    }
    for set in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let (mut live, _) = with_exposure(vec![Some(frame(1, 1.0))], set);
        assert!(matches!(live.capture(&shot(&rig(2, 2), 7, 0.1, 0)), Err(Error::Rig { .. })), "{set}");
    }
}
