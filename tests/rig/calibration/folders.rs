//! Calibration folders: a calibration is loaded as it was saved, and damage or another rig's calibration is
//! reported by name.

use std::path::Path;

use krylux::Error;
use krylux::image::Resolution;
use krylux::io::npy;

use krylux::measure::{Calibration, FlatField, LensMap};
use krylux::rig::{CameraInfo, ProjectorInfo};

fn devices() -> (ProjectorInfo, CameraInfo) {
    let projector = ProjectorInfo {
        name: "a \"beamer\"".into(),
        resolution: Resolution::new(8, 6),
        channels: 1,
        bits: 4,
        frame_time: 1.0 / 60.0,
    };
    let camera = CameraInfo {
        name: "eye".into(),
        resolution: Resolution::new(10, 9),
        channels: 1,
        bits: 8,
        exposures: [1e-4, 1.0],
    };
    (projector, camera)
}

fn saved(folder: &Path) -> Calibration {
    let (projector, camera) = devices();
    let mut calibration = Calibration::ideal(&projector, &camera);
    // These numbers have no short decimal form.
    calibration.camera.gain = 11.0 / 3.0;
    calibration.camera.read_noise = 0.1 + 0.2;
    calibration.stability.settle = f64::MIN_POSITIVE;
    calibration.camera.curve = Some((0..256).map(|count| f64::from(count).powf(1.1)).collect());
    let pixels = projector.resolution.pixels();
    calibration.registration.lens = Some(LensMap {
        camera: camera.resolution,
        projector: projector.resolution,
        homography: [1.0, 0.1 / 3.0, 0.0, -1e-17, 1.0, 0.2, 0.0, 0.0],
        distortion: [0.01, -2.0 / 3.0],
    });
    let ratio: Vec<f64> = (0..pixels).map(|pixel| 1.0 + pixel as f64 / 7.0).collect();
    calibration.flat_field = Some(FlatField::of_ratio(&ratio).expect("positive factors"));
    calibration.save(folder).expect("a temporary folder can be written");
    calibration
}

#[test]
fn a_saved_calibration_is_loaded_to_the_last_bit() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let calibration = saved(folder.path());
    let loaded = Calibration::load(folder.path()).expect("it was just saved");
    assert_eq!(loaded, calibration);
    assert_eq!(loaded.identity(), calibration.identity());
    let mut other = calibration;
    other.stability.settle = 0.5;
    assert_ne!(loaded.identity(), other.identity(), "photos depend on the settle time");
}

#[test]
fn damage_in_any_file_is_reported_by_name() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    saved(folder.path());
    let files = std::fs::read_dir(folder.path()).expect("it is there");
    let files: Vec<_> = files.map(|entry| entry.expect("it can be listed").path()).collect();
    assert_eq!(files.len(), 8);
    for file in files {
        let whole = std::fs::read(&file).expect("just written");
        // The last digit of a number in the record, or the last byte of an array.
        let mut changed = whole.clone();
        let at = (0..whole.len()).rev().find(|&at| !whole[at].is_ascii_whitespace()).expect("not empty");
        changed[at] ^= 1;
        for damaged in [changed, whole[..whole.len() / 2].to_vec(), Vec::new()] {
            std::fs::write(&file, &damaged).expect("writable");
            let loaded = Calibration::load(folder.path());
            let named = matches!(&loaded, Err(Error::Data { path, .. }) if path.starts_with(folder.path()));
            assert!(named, "{} was damaged, and that gave {loaded:?}", file.display());
        }
        std::fs::write(&file, &whole).expect("writable");
    }
    assert!(Calibration::load(folder.path()).is_ok(), "all is as it was");
    let missing = Calibration::load(&folder.path().join("nowhere"));
    assert!(matches!(missing, Err(Error::Read { .. })), "{missing:?}");
}

#[test]
fn arrays_of_another_shape_are_refused_with_both_shapes() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    saved(folder.path());
    for (name, shape, wanted) in [
        ("projector-curve.npy", vec![1, 15], "[1, 16]"),
        ("projector-curve.npy", vec![16], "[1, 16]"),
        ("flat-projector.npy", vec![49], "[48]"),
        ("flat-camera.npy", vec![6, 8], "[48]"),
    ] {
        let file = folder.path().join(name);
        let whole = std::fs::read(&file).expect("just written");
        npy::write_npy(&file, &shape, &vec![0.5; shape.iter().product()]).expect("writable");
        let found = Calibration::load(folder.path());
        let says = |fault: &str| fault.contains(&format!("{shape:?}")) && fault.contains(wanted);
        let named = matches!(&found, Err(Error::Data { path, fault, .. }) if *path == file && says(fault));
        assert!(named, "{name} of {shape:?} gave {found:?}");
        std::fs::write(&file, &whole).expect("writable");
    }
}

#[test]
fn a_calibration_of_other_devices_is_refused_with_the_name_of_the_device() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let calibration = saved(folder.path());
    let (projector, camera) = devices();
    assert!(calibration.check(&projector, &camera).is_ok());
    let others = [
        (ProjectorInfo { bits: 8, ..projector.clone() }, camera.clone(), "projector"),
        (ProjectorInfo { name: "other".into(), ..projector.clone() }, camera.clone(), "projector"),
        (projector.clone(), CameraInfo { resolution: Resolution::new(10, 10), ..camera.clone() }, "camera"),
        (projector.clone(), CameraInfo { channels: 3, ..camera.clone() }, "camera"),
    ];
    for (projector, camera, named) in others {
        let checked = calibration.check(&projector, &camera);
        let by_name = matches!(&checked, Err(Error::Rig { device, .. }) if device == named);
        assert!(by_name, "{projector:?} and {camera:?} are not those that were calibrated: {checked:?}");
    }
}
