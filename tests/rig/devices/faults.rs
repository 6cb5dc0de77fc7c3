//! Frames that are lost, come twice or too early, and a camera that hangs: noticed, taken anew within the limit, reported.

use krylux::Error;
use krylux::measure::{Effort, FrameSource, LiveFrames, Times};
use krylux::rig::{Faults, VirtualRig};

use super::support::{capture, counts, flat, live, open, rig, shot, show};

/// A rig whose frames tell by their counts which pattern was on, and how often it was exposed.
fn telling() -> VirtualRig {
    let mut rig = rig(6, 5);
    (rig.projector.latency, rig.projector.frame_time) = (0.05, 0.02);
    rig.camera.shot_noise = true;
    (rig.camera.full_well, rig.camera.white_fill) = (1e6, 0.8);
    rig
}

/// Shoots `shots` patterns, `takes` times each; each must be its own pattern, and each frame another.
fn capture_all(live: &mut LiveFrames, rig: &VirtualRig, shots: u16, takes: u32) -> Effort {
    let mut seen: Vec<(u64, Vec<u16>)> = Vec::new();
    for (index, take) in (0..shots).flat_map(|index| (0..takes).map(move |take| (index, take))) {
        // Levels that are three apart, each after a very different one.
        let level = (3 * index * 37) % 256;
        let frame = live.capture(&shot(rig, level, 0.1, take)).expect("within the tries");
        let mean = frame.counts.iter().map(|&count| f64::from(count)).sum::<f64>() / 30.0;
        let found = mean / (0.8 * 65535.0) * 255.0;
        // Some 3000 electrons for each level: 30 pixels tell the level to 0.05.
        assert!((found - f64::from(level)).abs() < 0.5, "level {found} for {level}");
        assert!(seen.last().is_none_or(|(id, _)| frame.id > *id), "numbers grow");
        assert!(level == 0 || seen.iter().all(|(_, counts)| *counts != frame.counts), "another exposure");
        seen.push((frame.id, frame.counts));
    }
    live.effort()
}

#[test]
fn without_faults_each_photo_takes_one_frame_and_takes_share_a_showing() {
    let rig = telling();
    let mut live = live(&rig, 0.05, 1);
    let effort = capture_all(&mut live, &rig, 10, 3);
    // Each pattern: 0.02 s to show, 0.05 s to settle, three exposures.
    let seconds = 10.0 * (0.02 + 0.05 + 3.0 * 0.1);
    assert!((effort.seconds - seconds).abs() < 1e-9, "{}", effort.seconds);
    let Effort { seconds, times, .. } = effort;
    let expected = Effort { shown: 10, taken: 30, seconds, times, ..Effort::default() };
    assert_eq!(effort, expected);
    for (found, expected) in
        [(times.show, 0.2), (times.settle, 0.5), (times.expose, 3.0), (times.sum(), seconds)]
    {
        assert!((found - expected).abs() < 1e-9, "{times:?}");
    }
}

#[test]
fn of_lost_repeated_late_and_early_frames_none_is_taken_for_a_photo() {
    let mut rig = telling();
    for seed in 0..8 {
        rig.seed = seed;
        rig.faults = Faults { dropped: 0.15, repeated: 0.15, late: 0.15, early: 0.15, ..Faults::default() };
        let mut live = live(&rig, 0.05, 40);
        let effort = capture_all(&mut live, &rig, 40, 2);
        assert_eq!((effort.shown, effort.taken, effort.restarts), (40, 80, 0));
        assert!(effort.dropped > 5 && effort.repeated > 5 && effort.late > 15, "they did happen: {effort:?}");
    }
}

#[test]
fn frames_that_are_named_are_refused_and_counted_one_by_one() {
    let mut rig = telling();
    rig.faults = Faults {
        dropped_frames: vec![2],
        repeated_frames: vec![4, 5],
        late_frames: vec![7],
        early_frames: vec![9, 10],
        ..Faults::default()
    };
    let effort = capture_all(&mut live(&rig, 0.05, 6), &rig, 6, 1);
    assert_eq!(
        Effort { seconds: 0.0, times: Times::default(), ..effort },
        Effort { shown: 6, taken: 6, dropped: 1, repeated: 2, late: 3, ..Effort::default() }
    );
}

#[test]
fn a_first_frame_that_would_repeat_does_not_come() {
    let mut rig = telling();
    rig.faults.repeated_frames = vec![1];
    let effort = capture_all(&mut live(&rig, 0.05, 2), &rig, 1, 1);
    assert_eq!((effort.dropped, effort.taken), (1, 1));
}

#[test]
fn a_camera_that_freezes_is_restarted_once_for_a_photo() {
    let mut rig = telling();
    rig.faults.freeze_after = vec![0, 5, 6];
    let effort = capture_all(&mut live(&rig, 0.05, 4), &rig, 10, 1);
    // Two of four tries, then the restart.
    assert_eq!((effort.taken, effort.restarts, effort.dropped), (10, 3, 6));
}

#[test]
fn a_camera_that_freezes_for_good_is_given_up_by_name() {
    let mut rig = telling();
    rig.faults = Faults { freeze_after: vec![3], freeze_for_good: true, ..Faults::default() };
    let mut live = live(&rig, 0.05, 5);
    capture_all(&mut live, &rig, 3, 1);
    let Err(Error::Rig { device, fault, help }) = live.capture(&shot(&rig, 200, 0.1, 0)) else {
        panic!("it cannot be taken")
    };
    assert_eq!(device, "virtual camera");
    assert_eq!(
        fault,
        "no good frame in 5 tries: 5 did not come, 0 came a second time, 0 were exposed before the pattern had settled; \
         a restart of the camera did not help"
    );
    assert!(help.contains("cable") && help.contains("tries"));
    let effort = live.effort();
    assert_eq!((effort.taken, effort.dropped, effort.restarts), (3, 5, 1));
}

#[test]
fn a_camera_that_only_repeats_is_restarted_and_then_given_up() {
    let mut rig = telling();
    rig.faults.repeated_frames = (2..100).collect();
    let mut live = live(&rig, 0.05, 6);
    capture_all(&mut live, &rig, 1, 1);
    // The same frame, so that nothing but its number tells a repetition.
    let fault = live.capture(&shot(&rig, 0, 0.1, 1)).err().map(|error| error.to_string());
    assert!(fault.is_some_and(|fault| fault.contains("6 came a second time")));
    assert_eq!((live.effort().repeated, live.effort().restarts), (6, 1));
}

#[test]
fn a_camera_whose_frames_are_always_early_is_given_up_with_another_advice() {
    let mut rig = telling();
    rig.faults.early = 1.0;
    let fault = live(&rig, 0.05, 4).capture(&shot(&rig, 9, 0.1, 0)).err().map(|error| error.to_string());
    assert!(fault.is_some_and(|fault| fault.contains("4 were exposed before") && fault.contains("settle")));
}

#[test]
fn within_the_tries_means_within_the_tries() {
    let mut rig = telling();
    rig.faults.dropped_frames = vec![1, 2];
    assert!(live(&rig, 0.05, 2).capture(&shot(&rig, 9, 0.1, 0)).is_err());
    assert!(live(&rig, 0.05, 3).capture(&shot(&rig, 9, 0.1, 0)).is_ok());
}

#[test]
fn without_settling_the_pattern_before_comes_through() {
    // What the checks are for: here they have nothing to go by.
    let rig = telling();
    let mut hasty = live(&rig, 0.0, 1);
    hasty.capture(&shot(&rig, 255, 0.1, 0)).expect("nothing goes wrong");
    hasty.capture(&shot(&rig, 255, 0.1, 1)).expect("nothing goes wrong");
    let frame = hasty.capture(&shot(&rig, 0, 0.1, 0)).expect("no check fails");
    let share = f64::from(frame.counts[0]) / (0.8 * 65535.0);
    // The first half of the exposure saw white.
    assert!((share - 0.5).abs() < 0.01, "{share}");
}

#[test]
fn without_the_policy_a_late_frame_shows_the_pattern_before_and_a_repeated_one_comes_twice() {
    let mut rig = telling();
    (rig.faults.late_frames, rig.faults.repeated_frames) = (vec![2], vec![4]);
    let mut bench = show(open(&rig), &rig, 255, 0.1);
    let white = counts(&mut bench)[0];
    let shown = bench.projector.show(&flat(&rig, 0)).expect("it fits");
    bench.clock.sleep(0.05);
    let late = capture(&mut bench);
    assert!(f64::from(late.counts[0]) > 0.9 * white && late.id == 2 && late.started < shown.at);
    let dark = capture(&mut bench);
    assert_eq!((dark.id, dark.counts[0]), (3, 0));
    bench.projector.show(&flat(&rig, 255)).expect("it fits");
    bench.clock.sleep(0.05);
    assert_eq!(capture(&mut bench), dark, "white is on");
}
