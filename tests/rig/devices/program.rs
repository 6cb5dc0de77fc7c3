//! Devices that a program hands over, by a rig file of `kind = "program"`: the journal, a replay, and what is refused.

use std::sync::{Arc, Mutex};

use krylux::krylov::{EigsOptions, Start, eigs};
use krylux::lab::{Lab, SourceKind};
use krylux::measure::{RigFile, RigKind};
use krylux::rig::{
    Camera, CameraInfo, DeviceOpener, Devices, Frame, Projector, ProjectorInfo, RawFrame, Shown, WallClock,
};
use krylux::transport::Part;
use krylux::{Error, Result};

const RIG: &str = "kind = \"program\"\n[projector]\nsize = [4, 2]\n[camera]\nsize = [4, 2]\nbits = 12\nexposures = [1e-5, 1e-2]\n[measurement]\nexposures = [1e-4]\nsentinel_every = 0\n";

/// A device that shares the frame on screen, and a clock.
struct Mine<Info>(Info, Arc<Mutex<Option<Frame>>>, WallClock, u64);

impl Projector for Mine<ProjectorInfo> {
    fn info(&self) -> &ProjectorInfo {
        &self.0
    }
    fn show(&mut self, frame: &Frame) -> Result<Shown> {
        *self.1.lock().expect("no thread panics with the frame") = Some(frame.clone());
        Ok(Shown { at: self.2.seconds() })
    }
}

impl Camera for Mine<CameraInfo> {
    fn info(&self) -> &CameraInfo {
        &self.0
    }
    fn configure(&mut self, exposure: f64) -> Result<f64> {
        Ok(exposure)
    }
    fn capture(&mut self) -> Result<Option<RawFrame>> {
        let started = self.2.seconds();
        self.3 += 1;
        let frame = self.1.lock().expect("no thread panics with the frame");
        let levels = frame.as_ref().map_or(&[][..], Frame::levels);
        let sum: f64 = levels.iter().map(|&level| f64::from(level)).sum();
        let counts = levels.iter().map(|&level| (2.0 * f64::from(level) + 0.2 * sum) as u16).collect();
        let (resolution, id) = (self.0.resolution, self.3);
        Ok(Some(RawFrame { resolution, channels: 1, counts, exposure: 1e-4, id, started }))
    }
}

fn devices() -> Result<DeviceOpener> {
    let RigKind::Program(rig) = RigFile::from_bytes("mine.toml".as_ref(), RIG.as_bytes())?.kind else {
        unreachable!("the file says so")
    };
    Ok(DeviceOpener::new(move |after| {
        let clock = WallClock::starting_at(after.map_or(0.0, |stamp| stamp.time));
        let (screen, id) = (Arc::default(), after.map_or(0, |stamp| stamp.id));
        let projector = Mine(rig.projector_info(), Arc::clone(&screen), clock, 0);
        Ok(Devices::new(projector, Mine(rig.camera_info(), screen, clock, id), clock))
    }))
}

#[test]
fn a_run_of_a_programs_devices_is_replayed_without_them() -> Result<()> {
    let folder = tempfile::tempdir().expect("a temporary folder can be made");
    let run = folder.path().join("run");
    // Random signs of so few pixels may be orthogonal to the white that is looked for.
    let start = Start::Gaussian { seed: 1 };
    let options = EigsOptions { count: 1, products: 6, start, ..EigsOptions::default() };
    let mut rig = Lab::builder_of_rig("mine.toml", RIG).devices(devices()?).folder(&run).open()?;
    assert_eq!((rig.kind(), rig.name().as_str()), (SourceKind::Rig, "mine"));
    let found = eigs(&mut rig.operator(Part::Full)?, &options)?;
    drop(rig);
    // Twice the identity plus 0.2 everywhere, in counts for each of 255 levels within 0.1 ms; a count is cut to a whole number.
    let exact = (2.0 + 8.0 * 0.2) * 255.0 / 1e-4;
    assert!((found.values[0] / exact - 1.0).abs() < 0.01, "{} against {exact}", found.values[0]);
    let again = eigs(&mut krylux::open(&run)?.operator(Part::Full)?, &options)?;
    assert_eq!(found.values, again.values);
    Ok(())
}

#[test]
fn devices_that_are_missing_or_do_not_belong_to_the_source_are_refused() -> Result<()> {
    let said =
        |done: Result<krylux::image::Image>| done.err().map(|error| error.to_string()).unwrap_or_default();
    let without = said(Lab::builder_of_rig("mine.toml", RIG).open()?.white());
    assert!(without.contains("not handed them over"), "{without}");
    let elsewhere = Lab::builder("assets/scenes/corner/scene.glb").devices(devices()?).open();
    assert!(matches!(elsewhere.err(), Some(Error::Option { fault, .. }) if fault.contains("is no rig")));
    for (wrong, right, key) in
        [("[4, 2]", "[0, 2]", "projector.size"), ("bits = 12", "bits = 17", "camera.bits")]
    {
        let text = RIG.replacen(wrong, right, 1);
        let error = RigFile::from_bytes("mine.toml".as_ref(), text.as_bytes()).err();
        assert!(error.as_ref().is_some_and(|error| error.to_string().contains(key)), "{error:?}");
    }
    Ok(())
}
