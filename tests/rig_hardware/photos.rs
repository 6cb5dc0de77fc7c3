//! Photos on real protocols, compared with the scene's matrix.

use std::path::Path;
use std::sync::Arc;

use krylux::image::Resolution;
use krylux::measure::{CaptureRequest, FrameSource, LiveFrames};
use krylux::rig::{Devices, Frame, Helper, RawFrame, VirtualRig};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use crate::bench::{SIDE, Stage, devices, rooms, stage};

const FULL: f64 = 65535.0;

/// Frames of random levels.
fn frames(count: u64) -> Vec<Arc<Frame>> {
    (0..count)
        .map(|seed| {
            let mut random = Pcg64::seed_from_u64(seed);
            let levels = (0..SIDE * SIDE).map(|_| random.random_range(0..256)).collect();
            Arc::new(Frame::new(Resolution::new(SIDE, SIDE), 1, levels).expect("a square"))
        })
        .collect()
}

/// The expected counts of a frame from the scene's matrix, before rounding.
fn truth(rig: &VirtualRig, frame: &Frame, exposure: f64) -> Vec<f64> {
    let photo = |light: &dyn Fn(usize) -> f64| {
        let mut photo = vec![0.0; SIDE * SIDE];
        rooms().entries().for_each(|(row, column, weight)| photo[row] += weight * light(column));
        photo
    };
    let mut white = photo(&|_| 1.0);
    white.sort_by(f64::total_cmp);
    // The 99th percentile of white fills half of the range, as `VirtualCamera` documents.
    let bright = white[(white.len() - 1) * 99 / 100];
    let scale = FULL * rig.camera.white_fill * exposure / (rig.camera.white_exposure * bright);
    photo(&|pixel| f64::from(frame.levels()[pixel]) / 255.0).into_iter().map(|light| scale * light).collect()
}

fn open(stage: &Stage) -> Devices {
    let helper = Helper::at(env!("CARGO_BIN_EXE_krylux"));
    stage.hardware.open(&helper, None).expect("both devices are there")
}

fn capture(live: &mut LiveFrames, frame: &Arc<Frame>, exposure: f64) -> RawFrame {
    live.capture(&CaptureRequest { frame: Arc::clone(frame), exposure, take: 0 }).expect("it comes")
}

#[test]
fn without_noise_every_photo_equals_the_product_up_to_rounding() {
    let rig = devices(Path::new("rooms.npz"));
    let stage = stage(1, &rig);
    let mut live = LiveFrames::new(open(&stage), 0.0, 3);
    let mut worst = 0.0_f64;
    let began = std::time::Instant::now();
    let frames = frames(24);
    for (number, frame) in frames.iter().enumerate() {
        let exposure = if number % 2 == 0 { 0.004 } else { 0.007 };
        let found = capture(&mut live, frame, exposure);
        for (count, expected) in found.counts.iter().zip(truth(&rig, frame, exposure)) {
            worst = worst.max((f64::from(*count) - expected).abs());
        }
    }
    let each = began.elapsed().as_secs_f64() / frames.len() as f64;
    println!("worst {worst:.4} DN; {:.1} ms for each photo of 5.5 ms on average", 1e3 * each);
    // Rounding is half a count; light in single precision adds an error of 65535 / 2^24 counts.
    assert!(worst <= 0.51, "{worst} DN");
    assert_eq!(live.effort().late, 0);
}

#[test]
fn noise_is_as_large_as_the_camera_says() {
    let mut rig = devices(Path::new("rooms.npz"));
    rig.camera.shot_noise = true;
    rig.camera.read_noise = 8.0;
    rig.camera.full_well = 20_000.0;
    let stage = stage(2, &rig);
    let mut live = LiveFrames::new(open(&stage), 0.0, 3);
    let gain = rig.camera.full_well / FULL;
    let (mut squares, mut samples) = (0.0, 0.0);
    for frame in &frames(40) {
        let found = capture(&mut live, frame, 0.004);
        for (count, expected) in found.counts.iter().zip(truth(&rig, frame, 0.004)) {
            let variance = expected / gain + (rig.camera.read_noise / gain).powi(2) + 1.0 / 12.0;
            squares += (f64::from(*count) - expected).powi(2) / variance;
            samples += 1.0;
        }
    }
    let rms = (squares / samples).sqrt();
    println!("rms z {rms:.4} of {samples} samples");
    // The standard deviation of the mean of 5760 squares is 1.9 %, that of its root 0.9 %; the bound is five of these.
    assert!((rms - 1.0).abs() < 0.05, "{rms}");
}

#[test]
fn the_times_of_a_photos_parts_add_up() {
    let rig = devices(Path::new("rooms.npz"));
    let stage = stage(3, &rig);
    let mut live = LiveFrames::new(open(&stage), 0.002, 3);
    let frames = frames(20);
    frames.iter().for_each(|frame| drop(capture(&mut live, frame, 0.004)));
    let effort = live.effort();
    let times = effort.times;
    println!("{} (each photo)", times.each(effort.taken));
    assert!((times.sum() - effort.seconds).abs() < 1e-9, "{effort:?}");
    assert!((times.expose - 20.0 * 0.004).abs() < 1e-9, "{times:?}");
    // A frame is shown at a refresh, which on this server is on average half an interval away.
    assert!(times.refresh + times.settle >= 20.0 * (0.007 + 0.002), "{times:?}");
    assert!(times.show > 0.0 && times.transfer > 0.0, "{times:?}");
}
