//! Rig files: the shipped ones load, and errors name what is wrong.

use std::path::{Path, PathBuf};

use krylux::Error;
use krylux::image::Resolution;
use krylux::measure::{RigFile, RigKind};
use krylux::rig::{VirtualRig, VirtualScene};
use proptest::prelude::*;

const WHOLE: &str = "kind = \"virtual\"\n[scene]\nmatrix = \"a.npz\"\nsize = [4, 3]\n";

fn shipped(name: &str) -> RigFile {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/rigs").join(name);
    RigFile::load(&path).expect("shipped rigs load")
}

fn virtual_rig(file: &RigFile) -> &VirtualRig {
    match &file.kind {
        RigKind::Virtual(rig) => rig,
        other => panic!("not virtual: {other:?}"),
    }
}

fn from(text: &str) -> krylux::Result<RigFile> {
    RigFile::from_bytes(Path::new("folder/my.toml"), text.as_bytes())
}

/// The fault and the help of the error about this file.
#[track_caller]
fn refused(text: &str) -> [String; 2] {
    match from(text) {
        Err(Error::Data { path, fault, help }) => {
            assert_eq!(path, Path::new("folder/my.toml"), "the error names the file");
            [fault, help]
        }
        other => panic!("not an error about the file: {other:?}"),
    }
}

#[test]
fn every_shipped_rig_loads_and_its_scene_exists() {
    for name in ["ideal.toml", "realistic.toml", "one-bit.toml", "faulty.toml"] {
        let file = shipped(name);
        let VirtualScene::File { path, size, .. } = &virtual_rig(&file).scene else {
            panic!("{name} is on a scene")
        };
        assert!(path.is_file() && *size == Resolution::new(64, 64), "{name}");
    }
}

#[test]
fn the_shipped_rigs_match_their_names() {
    let file = shipped("realistic.toml");
    let rig = virtual_rig(&file);
    assert_eq!((rig.projector.bits, rig.projector.gamma, rig.camera.bits), (8, Some(2.2), 14));
    assert!(rig.projector.black_level > 0.0);
    assert_eq!((rig.camera.full_well, rig.camera.read_noise, rig.ambient.level), (60e3, 5.0, 0.1));
    assert_eq!(rig.camera.shift[0].hypot(rig.camera.shift[1]), 0.5);
    assert_eq!(virtual_rig(&shipped("one-bit.toml")).projector.bits, 1);
    let file = shipped("ideal.toml");
    let ideal = virtual_rig(&file);
    let mut expected = VirtualRig::ideal(ideal.scene.clone());
    expected.projector.bits = 12;
    assert_eq!(*ideal, expected);
    let faults = &virtual_rig(&shipped("faulty.toml")).faults.clone();
    assert!(
        faults.dropped > 0.0 && faults.repeated > 0.0 && faults.late > 0.0 && !faults.freeze_after.is_empty()
    );
}

#[test]
fn a_rig_file_has_defaults_and_relative_paths() {
    let file =
        from(&WHOLE.replace("[scene]", "calibration = \"found\"\nseed = 9\n[scene]")).expect("it is whole");
    assert_eq!(file.calibration, Some(PathBuf::from("folder/found")));
    assert_eq!(
        file.hash,
        *blake3::hash(WHOLE.replace("[scene]", "calibration = \"found\"\nseed = 9\n[scene]").as_bytes())
            .as_bytes()
    );
    let scene = VirtualScene::Matrix { path: "folder/a.npz".into(), size: Resolution::new(4, 3) };
    let expected = VirtualRig { seed: 9, ..VirtualRig::ideal(scene) };
    assert_eq!(*virtual_rig(&file), expected, "what is left out is ideal");
    assert_eq!(file.measurement, krylux::measure::MeasureOptions::default());
}

#[test]
fn unknown_keys_are_named_with_the_line_and_the_nearest_known_key() {
    for (added, expected) in [
        (
            "[camera]\nbits = 12\nful_well = 3.0\n",
            "line 7, in [camera]: unknown key `ful_well`; did you mean `full_well`?",
        ),
        ("[projector]\ngama = 2.2\n", "line 6, in [projector]: unknown key `gama`; did you mean `gamma`?"),
        (
            "[measurement]\nblack_take = 2\n",
            "line 6, in [measurement]: unknown key `black_take`; did you mean `black_takes`?",
        ),
        ("[faults]\nfreezes = 2\n", "line 6, in [faults]: unknown key `freezes`"),
        ("[ambiant]\nlevel = 2\n", "line 5: unknown key `ambiant`; did you mean `ambient`?"),
        ("sample = 4\n", "line 5, in [scene]: unknown key `sample`; did you mean `samples`?"),
    ] {
        let [fault, help] = refused(&format!("{WHOLE}{added}"));
        assert!(fault.starts_with(expected), "{fault}");
        assert!(help.starts_with("known here: "), "{help}");
    }
}

#[test]
fn values_out_of_range_are_named_with_their_range() {
    for (added, fault, help) in [
        ("[camera]\nbits = 20\n", "camera.bits is 20", "give 8 to 16"),
        ("[projector]\nbits = 0\n", "projector.bits is 0", "give 1 to 12"),
        ("[projector]\nchannels = 2\n", "projector.channels is 2", "give 1 (gray) or 3 (red, green, blue)"),
        ("[projector]\nblur = nan\n", "projector.blur is NaN", "give 0 to 100"),
        ("[camera]\nexposures = [2, 1]\n", "camera.exposures[1] is 1", "give 2 to 1000000"),
        (
            "[faults]\ndropped = 0.6\nlate = 0.6\n",
            "the chances of [faults] add up to 1.2",
            "give dropped, repeated, late and early such that they add up to 1 at most",
        ),
        (
            "[drift]\nswing = 0.1\n",
            "drift.swing is 0.1, but drift.period is missing",
            "give its period in seconds",
        ),
        ("[measurement]\ntries = 0\n", "measurement.tries is 0", "give a whole number from 1 to 1000"),
        ("[projector]\noverscan = 0.6\n", "projector.overscan is 0.6", "give 0 to 0.5"),
        ("[projector]\niris = { dimming = 1.0 }\n", "projector.iris.dimming is 1", "give -1 to 0.95"),
        ("[projector]\niris = { time = -1.0 }\n", "projector.iris.time is -1", "give 0 to 3600"),
        ("[projector]\npulse = { period = -0.01 }\n", "projector.pulse.period is -0.01", "give 0 to 60"),
        (
            "[projector]\npulse = { period = 0.01, duty = 0.0 }\n",
            "projector.pulse.duty is 0",
            "give 0.001 to 1",
        ),
        (
            "[projector]\npulse = { duty = 0.5 }\n",
            "projector.pulse has no period",
            "give period in seconds, e.g. pulse = { period = 0.0083, duty = 0.5 }",
        ),
        (
            "[projector]\npulse = { period = 0.01, wheel = true }\n",
            "projector.pulse.wheel shows three colours, but the projector has one channel",
            "give the projector channels = 3, or leave wheel out",
        ),
        (
            "[projector]\nwhite_segment = 0.5\n",
            "projector.white_segment adds to what three colours have in common, but the projector has one channel",
            "give the projector channels = 3, or leave white_segment out",
        ),
        ("[camera]\nblur = -1\n", "camera.blur is -1", "give 0 to 100"),
        ("[camera]\nrolling_shutter = nan\n", "camera.rolling_shutter is NaN", "give 0 to 60"),
        ("[splitter]\nstray = -0.1\n", "splitter.stray is -0.1", "give 0 to 10"),
        (
            "[splitter]\nghost = 0.02\n",
            "splitter.ghost is 0.02, but splitter.ghost_shift is missing",
            "give the displacement of the second image in projector pixels, e.g. ghost_shift = [5.0, 0.0]",
        ),
    ] {
        assert_eq!(refused(&format!("{WHOLE}{added}")), [fault, help], "{added}");
    }
    let contradictions = [
        "[projector]\ngamma = 2.0\ncurve = [0.0, 1.0]\n",
        "[projector]\ncurve = [0.0, 0.7, 0.5, 1.0]\n",
        "[camera]\ncurve = [0.1, 1.0]\n",
        "[camera]\nhomography = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]\nrotation = 1\n",
        "[camera]\nhomography = [[1, 0, 0], [0, 1, 0], [1, 1, 0]]\n",
        "file = \"scene.glb\"\n",
        "samples = 3\n",
    ];
    for added in contradictions {
        refused(&format!("{WHOLE}{added}"));
    }
}

#[test]
fn a_file_of_another_kind_is_recognized() {
    let pose = "[camera]\nposition = [0, 0, 0]\n";
    assert!(refused(pose)[1].contains("--camera-file"), "a file of poses is recognized");
    assert_eq!(refused("")[0], "it does not say what kind of rig it describes");
    assert!(refused("kind = \"hardware\"\n")[0].contains("missing field `projector`"));
    assert_eq!(refused("kind = \"hardwear\"\n")[0], "unknown kind \"hardwear\"; did you mean \"hardware\"?");
    assert_eq!(refused("kind = \"vitrual\"\n")[0], "unknown kind \"vitrual\"; did you mean \"virtual\"?");
    assert!(refused("kind = 3\n")[0].contains("not a string"));
    assert!(refused("kind = \"virtual\"\n")[0].contains("missing field `scene`"));
    assert!(matches!(RigFile::load(Path::new("/nowhere/rig.toml")), Err(Error::Read { .. })));
    let folder = RigFile::load(Path::new("/")).expect_err("a folder is no rig file").to_string();
    assert!(folder.contains("it is a folder"), "{folder}");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn random_bytes_are_refused_without_a_panic(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        let _ = RigFile::from_bytes(Path::new("a.toml"), &bytes);
    }

    #[test]
    fn a_damaged_shipped_rig_loads_or_its_error_names_the_file(
        name in prop::sample::select(vec!["realistic.toml", "faulty.toml"]),
        edits in prop::collection::vec((any::<prop::sample::Index>(), any::<prop::sample::Index>(), "[\\PC\n]{0,6}"), 1..4),
    ) {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/rigs").join(name);
        let mut text: Vec<char> = std::fs::read_to_string(&path).expect("it is there").chars().collect();
        for (from, length, with) in edits {
            let from = from.index(text.len() + 1);
            let to = from + length.index(20).min(text.len() - from);
            text.splice(from..to, with.chars());
        }
        let text: String = text.into_iter().collect();
        if let Err(error) = RigFile::from_bytes(&path, text.as_bytes()) {
            prop_assert!(error.to_string().contains(name) && error.to_string().contains("help:"));
        }
    }
}

#[test]
fn a_response_is_a_curve_from_0_to_1_that_never_falls() {
    let with = |curve: &str| format!("{WHOLE}[projector]\n{curve}\n");
    for curve in ["curve = [0.0, 1.0]", "curve = [0.0, 0.2, 1.0]", "curve = [0.0, 0.3, 0.3, 0.9, 1.0]"] {
        assert!(from(&with(curve)).is_ok(), "{curve}");
    }
    for curve in ["[]", "[0.0]", "[1.0]", "[0.0, 0.9]", "[0.1, 1.0]", "[0.0, 0.6, 0.5, 1.0]"] {
        let [fault, help] = refused(&with(&format!("curve = {curve}")));
        assert!(
            fault.contains("projector.curve") && help.contains("at least two values"),
            "{curve}: {fault}"
        );
    }
}

#[test]
fn colours_mix_only_where_both_devices_have_them() {
    let with = |projector: usize, camera: usize| {
        let crosstalk = "crosstalk = [[1, 0.1, 0], [0.05, 1, 0.05], [0, 0.1, 1]]";
        format!("{WHOLE}[projector]\nchannels = {projector}\n[camera]\nchannels = {camera}\n{crosstalk}\n")
    };
    assert!(from(&with(3, 3)).is_ok());
    for (projector, camera) in [(1, 1), (3, 1), (1, 3)] {
        let [fault, help] = refused(&with(projector, camera));
        assert!(fault.contains("camera.crosstalk") && help.contains("channels = 3"), "{fault}");
    }
}
