//! A simulated projector (the lamp), a white sheet, and a simulated camera with its own address.

use std::net::Ipv4Addr;
use std::path::PathBuf;
use std::sync::{Arc, Mutex};

use krylux::image::Resolution;
use krylux::measure::{CaptureRequest, LiveFrames};
use krylux::rig::{
    Devices, Frame, GenicamSpec, GigeVision, Projector, ProjectorInfo, Shown, VirtualRig, VirtualScene,
    WallClock,
};
use krylux::sparse::Csr;

use crate::gige_camera::{GigeCamera, Scene};

pub const SIZE: Resolution = Resolution { width: 48, height: 20 };

/// A sheet whose reflectance increases from pixel to pixel, seen by a noiseless camera with this number of bits.
pub fn scene(bits: u32) -> Scene {
    let mut rig = VirtualRig::ideal(VirtualScene::Matrix { path: PathBuf::from("sheet.npz"), size: SIZE });
    rig.camera.bits = bits;
    let pixels = SIZE.pixels();
    let reflects = (0..pixels).map(|pixel| 0.2 + 0.8 * pixel as f64 / pixels as f64);
    let matrix = Csr::new(pixels, (0..=pixels).collect(), (0..pixels as u32).collect(), reflects.collect());
    Scene { rig, matrix: matrix.expect("a diagonal is well formed") }
}

/// The counts of a virtual rig on the same scene.
pub fn expected(scene: &Scene, frame: &Frame, exposure: f64) -> Vec<u16> {
    let light = krylux::transport::ExplicitMatrix::new(scene.matrix.clone(), SIZE).expect("it fits");
    let mut devices = scene.rig.open(Box::new(light), None).expect("it can be seen");
    devices.camera.configure(exposure).expect("within range");
    devices.projector.show(frame).expect("it fits");
    devices.camera.capture().expect("it is there").expect("it comes").counts
}

/// A projector that only remembers what it shows.
#[derive(Clone)]
pub struct Lamp {
    info: ProjectorInfo,
    shown: Arc<Mutex<Frame>>,
    clock: WallClock,
}

impl Lamp {
    pub fn new(clock: WallClock) -> Self {
        let info =
            ProjectorInfo { name: "lamp".into(), resolution: SIZE, channels: 1, bits: 8, frame_time: 0.0 };
        Self { info, shown: Arc::new(Mutex::new(Frame::filled(SIZE, 1, 0))), clock }
    }

    pub fn look(&self) -> impl FnMut() -> Option<Frame> + Send + 'static {
        let shown = Arc::clone(&self.shown);
        move || Some(shown.lock().expect("nobody fails").clone())
    }
}

impl Projector for Lamp {
    fn info(&self) -> &ProjectorInfo {
        &self.info
    }

    fn show(&mut self, frame: &Frame) -> krylux::Result<Shown> {
        *self.shown.lock().expect("nobody fails") = frame.clone();
        Ok(Shown { at: self.clock.seconds() })
    }
}

/// The address of one test's camera: tests run at the same time, and the whole suite may run twice.
pub fn address(last: u8) -> Ipv4Addr {
    let [low, high, ..] = std::process::id().to_le_bytes();
    Ipv4Addr::new(127, high, low, last)
}

pub fn spec(last: u8) -> GenicamSpec {
    let exposures = [1e-4, 0.5];
    // A busy machine may leave the camera waiting for a while.
    GenicamSpec { exposures, timeout: 5.0, ..GenicamSpec::gige(address(last), SIZE.width, SIZE.height) }
}

/// A camera of 12 bits that sees the lamp's light on the sheet.
pub fn camera(last: u8, lamp: &Lamp) -> GigeCamera {
    GigeCamera::start(address(last), scene(12), lamp.look())
}

pub fn live(spec: &GenicamSpec, lamp: &Lamp, clock: WallClock) -> krylux::Result<LiveFrames> {
    let camera = GigeVision::open(spec, clock, 0)?;
    Ok(LiveFrames::new(Devices::new(lamp.clone(), camera, clock), 0.0, 6))
}

/// A frame for each number; all are different.
pub fn frame(number: usize) -> Frame {
    let level = |pixel: usize| ((pixel * 7 + number * 29) % 256) as u16;
    Frame::new(SIZE, 1, (0..SIZE.pixels()).map(level).collect()).expect("one level for each pixel")
}

pub fn shot(number: usize, exposure: f64) -> CaptureRequest {
    CaptureRequest { frame: Arc::new(frame(number)), exposure, take: 0 }
}

#[track_caller]
pub fn refused<T>(result: krylux::Result<T>) -> String {
    match result {
        Ok(_) => panic!("it is refused"),
        Err(error) => error.to_string(),
    }
}
