//! A bench that is opened after an earlier session's last frame goes on as if that had never ended.

use std::sync::Arc;

use krylux::measure::{CaptureRequest, FrameSource, LiveFrames};
use krylux::rig::{Ambient, Drift, Faults, Frame, RawFrame, Stamp, VirtualRig};

use super::support::{open_after, rig};

/// Everything that depends on time or chance, at once.
fn restless() -> VirtualRig {
    let mut rig = rig(7, 5);
    rig.seed = 11;
    (rig.projector.latency, rig.projector.frame_time, rig.projector.blur) = (0.03, 1.0 / 60.0, 0.4);
    let camera = &mut rig.camera;
    (camera.shot_noise, camera.read_noise, camera.readout, camera.timeout) = (true, 7.0, 0.013, 0.3);
    (camera.size, camera.shift, camera.exposure_step) = (Some([9, 8]), [0.3, 0.2], 1e-3);
    rig.ambient = Ambient { level: 0.1, variation: 0.3, period: 1.7 };
    rig.drift = Drift { per_hour: 40.0, swing: 0.2, period: 3.1 };
    rig.faults = Faults {
        dropped: 0.1,
        repeated: 0.1,
        late: 0.1,
        early: 0.1,
        freeze_after: vec![9, 31],
        ..Faults::default()
    };
    rig
}

/// Photos of several patterns at several exposures, with takes; the same pattern returns.
fn shots(rig: &VirtualRig) -> Vec<CaptureRequest> {
    let size = rig.scene.size();
    let frame = |index: usize| {
        let levels = (0..size.pixels()).map(|pixel| (pixel * (index + 3) * 29 % 256) as u16);
        Arc::new(Frame::new(size, 1, levels.collect()).expect("a level for each pixel"))
    };
    let exposures = [0.05, 0.2, 0.0123];
    (0..36_usize)
        .map(|index| CaptureRequest {
            frame: frame(index / 3 % 5),
            exposure: exposures[index / 2 % 3],
            take: index as u32,
        })
        .collect()
}

fn capture(live: &mut LiveFrames, shots: &[CaptureRequest]) -> Vec<RawFrame> {
    shots.iter().map(|shot| live.capture(shot).expect("within the tries")).collect()
}

#[test]
fn wherever_it_stops_it_goes_on_to_the_last_bit() {
    let rig = restless();
    let shots = shots(&rig);
    let mut live = LiveFrames::new(open_after(&rig, None), 0.04, 12);
    let whole = capture(&mut live, &shots);
    let effort = live.effort();
    assert!(
        effort.dropped > 0 && effort.repeated > 0 && effort.late > 0 && effort.restarts == 2,
        "{effort:?}"
    );
    for stop in 1..shots.len() {
        let last = &whole[stop - 1];
        let mut live = LiveFrames::new(open_after(&rig, Some(Stamp::of(last))), 0.04, 12);
        live.follow(&shots[stop - 1], last).expect("it fits");
        assert_eq!(capture(&mut live, &shots[stop..]), whole[stop..], "stopped after {stop}");
    }
}

#[test]
fn opened_without_the_stamp_it_would_not() {
    let rig = restless();
    let shots = shots(&rig);
    let whole = capture(&mut LiveFrames::new(open_after(&rig, None), 0.04, 12), &shots);
    let anew = capture(&mut LiveFrames::new(open_after(&rig, None), 0.04, 12), &shots[7..]);
    assert!(anew.iter().zip(&whole[7..]).all(|(anew, whole)| anew.counts != whole.counts));
}

#[test]
fn open_devices_give_the_same_frames_on_another_thread() {
    let rig = restless();
    let shots = shots(&rig);
    let here = capture(&mut LiveFrames::new(open_after(&rig, None), 0.04, 12), &shots);
    let mut live = LiveFrames::new(open_after(&rig, None), 0.04, 12);
    let there = std::thread::spawn({
        let shots = shots.clone();
        move || capture(&mut live, &shots)
    });
    assert_eq!(there.join().expect("the thread ends well"), here);
}
