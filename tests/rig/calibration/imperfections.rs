//! `rig check` names each imperfection of a bench, and nothing else.

use std::ops::ControlFlow;
use std::path::Path;

use krylux::Error;
use krylux::bench::rig_check::{self, Finding, Grade, RigToCheck};
use krylux::image::Resolution;
use krylux::measure::{FrameSource, LiveFrames, RigFile, RigKind};
use krylux::rig::{Iris, Pulse, Splitter, VirtualProjector, VirtualRig};

use super::realistic;
use super::scene::Folded;

/// A rig file that describes this rig. The scene in its text stands for the rig's own, which no file describes.
pub fn rig_file(rig: &VirtualRig) -> RigFile {
    let text = "kind = \"virtual\"\n[scene]\nmatrix = \"a.npz\"\nsize = [64, 64]\n[measurement]\nexposures = [0.1]\n";
    let mut file = RigFile::from_bytes(Path::new("folder/my.toml"), text.as_bytes()).expect("it is valid");
    file.kind = RigKind::Virtual(rig.clone());
    file
}

/// The findings of a check, without a calibration.
fn findings(rig: &VirtualRig, scene: &Folded) -> Vec<Finding> {
    let file = rig_file(rig);
    let settle = file.settle(None);
    let mut open = || {
        let devices = rig.open(Box::new(scene.clone()), None)?;
        Ok(Box::new(LiveFrames::new(devices, settle, 5)) as Box<dyn FrameSource>)
    };
    let folder = std::env::temp_dir();
    let rig = RigToCheck {
        file: &file,
        folder: &folder,
        helper: &|| Err(Error::Numerical("a virtual rig has no window".into())),
        open: &mut open,
    };
    let found = rig_check::check(rig, &mut |finding| {
        println!("{finding}");
        ControlFlow::Continue(())
    });
    let found = found.expect("nothing interrupts it");
    assert!(found.complete, "everything was examined");
    found.all
}

/// The names of the findings that are not ok, without the missing calibration and the pixel map that is off for want of it.
fn named(rig: &VirtualRig, scene: &Folded) -> Vec<String> {
    let wrong = findings(rig, scene).into_iter().filter(|finding| finding.grade != Grade::Ok);
    wrong
        .map(|finding| finding.name.into_owned())
        .filter(|name| !["calibration", "pixel map"].contains(&name.as_str()))
        .collect()
}

fn scene() -> Folded {
    Folded::new(Resolution::new(64, 64), 0.3)
}

#[test]
fn benches_without_these_imperfections_raise_no_alarm() {
    // Little exchange of light, and much.
    for global in [0.1, 0.3, 0.6] {
        let scene = Folded::new(Resolution::new(64, 64), global);
        let ideal = scene.rig();
        let noisy = realistic(&scene);
        let mut bent = realistic(&scene);
        bent.camera.gamma = Some(0.95);
        let mut dim = realistic(&scene);
        dim.camera.white_fill = 0.3;
        dim.camera.bits = 8;
        dim.camera.black_level = 4.0;
        dim.camera.full_well = 8000.0;
        for (name, rig) in [("ideal", ideal), ("noisy", noisy), ("bent", bent), ("dim", dim)] {
            println!("{name}, {global} of the light exchanged:");
            assert_eq!(named(&rig, &scene), [""; 0], "{name}, {global}");
        }
    }
}

#[test]
fn fewer_pixels_than_the_projector_has_are_named_alone() {
    alone("pixels", |rig| rig.camera.size = Some([48, 48]));
}

/// A check of a realistic rig with one imperfection more names `expected` alone.
#[track_caller]
fn alone(expected: &str, imperfection: impl Fn(&mut VirtualRig)) {
    let scene = scene();
    let mut rig = realistic(&scene);
    imperfection(&mut rig);
    assert_eq!(named(&rig, &scene), [expected]);
    // And on devices that have no other.
    let mut rig = scene.rig();
    rig.projector.latency = 0.02;
    imperfection(&mut rig);
    assert_eq!(named(&rig, &scene), [expected], "on an ideal rig");
}

#[test]
fn an_iris_that_dims_dark_frames_is_named_and_so_is_a_limit_of_power() {
    alone("iris", |rig| rig.projector.iris = Iris { dimming: 0.2, time: 0.0 });
    alone("iris", |rig| rig.projector.iris = Iris { dimming: -0.2, time: 0.0 });
}

#[test]
fn a_slow_iris_is_named_although_it_has_not_settled() {
    let scene = scene();
    let mut rig = realistic(&scene);
    rig.projector.iris = Iris { dimming: 0.3, time: 1.0 };
    let named = named(&rig, &scene);
    let has = |name: &str| named.iter().any(|named| named == name);
    assert!(has("iris") && has("settling"), "{named:?}");
}

#[test]
fn limited_range_video_is_named() {
    alone("levels", |rig| rig.projector.limited_range = true);
}

#[test]
fn stray_light_that_follows_the_pattern_is_named_with_its_share() {
    alone("stray light", |rig| rig.splitter = Splitter { stray: 0.06, ..Splitter::default() });
    let scene = scene();
    let mut rig = realistic(&scene);
    rig.splitter.stray = 0.06;
    let found = findings(&rig, &scene);
    let said = &found.iter().find(|finding| finding.name == "stray light").expect("it is examined").found;
    let percent: f64 = said.split(' ').next().and_then(|word| word.parse().ok()).expect("a number");
    // 6 % of white without it are 5.7 % of white with it.
    assert!((percent - 5.7).abs() < 1.0, "{said}");
}

#[test]
fn a_ghost_of_the_splitter_is_named_with_its_share_and_distance() {
    let ghost = Splitter { ghost: 0.04, ghost_shift: [5.0, 2.0], ..Splitter::default() };
    alone("ghost", |rig| rig.splitter = ghost);
    let scene = scene();
    let mut rig = realistic(&scene);
    rig.splitter = ghost;
    let found = findings(&rig, &scene);
    let said = &found.iter().find(|finding| finding.name == "ghost").expect("it is examined").found;
    let numbers: Vec<f64> = said.split(' ').filter_map(|word| word.parse().ok()).collect();
    // The camera has one and a half pixels for each of the projector's, so that a distance is known to a part of one.
    assert!((numbers[0] - 4.0).abs() < 1.2 && (numbers[1] - 29.0_f64.sqrt()).abs() < 0.6, "{said}");
}

#[test]
fn pulses_of_light_are_named_although_the_exposure_is_a_whole_multiple_of_their_period() {
    alone("pulses", |rig| rig.projector.pulse = Pulse { period: 1.0 / 120.0, duty: 0.5, wheel: false });
    alone("pulses", |rig| rig.projector.pulse = Pulse { period: 0.02, duty: 0.7, wheel: false });
}

#[test]
fn a_rolling_shutter_is_named() {
    alone("shutter", |rig| rig.camera.rolling_shutter = 0.015);
}

#[test]
fn overscan_is_named() {
    alone("border", |rig| rig.projector.overscan = 0.05);
}

#[test]
fn blur_of_the_camera_is_named() {
    alone("sharpness", |rig| rig.camera.blur = 1.5);
}

#[test]
fn a_white_segment_is_named_and_none_where_colours_add_up() {
    let scene = scene().coloured();
    for camera in [1, 3] {
        for (segment, expected) in [(0.0, &[][..]), (0.8, &["colours"][..])] {
            let mut rig = realistic(&scene);
            rig.projector.channels = 3;
            rig.projector.white_segment = segment;
            rig.camera.channels = camera;
            assert_eq!(
                named(&rig, &scene),
                expected,
                "a camera of {camera} channels, a segment of {segment}"
            );
        }
    }
    // A colour wheel's pulses hide what colours add up to.
    let mut rig = realistic(&scene);
    rig.projector = VirtualProjector {
        channels: 3,
        white_segment: 0.8,
        pulse: Pulse { period: 1.0 / 120.0, duty: 1.0, wheel: true },
        ..rig.projector
    };
    assert_eq!(named(&rig, &scene), ["pulses"]);
}
