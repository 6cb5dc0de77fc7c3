//! Time per photo on a rig with real protocols: a window of a headless X server, and a GigE Vision camera on the loopback
//! interface. `cargo bench --bench photos`; see `benches/README.md`.

#![allow(clippy::panic, reason = "the test's camera panics when it fails")]

#[path = "../tests/gige_camera/mod.rs"]
mod gige_camera;
#[path = "../tests/x_server/mod.rs"]
mod x_server;

use std::sync::Arc;

use gige_camera::{GigeCamera, Scene, own_address};
use krylux::image::Resolution;
use krylux::journal::{Identity, Journal};
use krylux::measure::{CaptureRequest, FrameSource, JournaledFrames, LiveFrames, Times};
use krylux::rig::{
    CameraSpec, Frame, GenicamSpec, HardwareRig, Helper, PixelFormat, VirtualRig, VirtualScene, X11Spec,
};
use krylux::sparse::Csr;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use x_server::XServer;

const SIZE: Resolution = Resolution { width: 128, height: 96 };
/// Number of measured photos, after `BEFORE` warm-up photos.
const PHOTOS: usize = 60;
const BEFORE: usize = 5;

type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

fn main() -> Outcome<()> {
    // `cargo test --benches` passes `--test`; there is nothing to test here.
    if std::env::args().any(|argument| argument == "--test") {
        return Ok(());
    }
    println!(
        "krylux {}, {PHOTOS} photos of {SIZE} patterns each, ms a photo; beyond the exposure: median (least to most)\n",
        env!("CARGO_PKG_VERSION")
    );
    println!(
        "refresh  settle  exposure  magnify | beyond the exposure    | refresh  settle | show  transfer  process | camera"
    );
    for refreshes in [60, 600] {
        for settle_frames in [0, 1] {
            for exposure in [0.004, 1.0 / 60.0] {
                Row { refreshes, settle_frames, exposure, magnify: 1 }.measure()?;
            }
        }
    }
    Row { refreshes: 60, settle_frames: 1, exposure: 0.004, magnify: 8 }.measure()
}

/// One configuration of the rig.
struct Row {
    /// Refreshes of the X server per second.
    refreshes: u32,
    /// Refreshes to wait after the window confirms a pattern.
    settle_frames: u64,
    /// Exposure time in seconds.
    exposure: f64,
    /// Screen pixels per pattern pixel, on each side.
    magnify: usize,
}

impl Row {
    fn measure(self) -> Outcome<()> {
        let Self { refreshes, settle_frames, exposure, magnify } = self;
        let shown = [SIZE.width, SIZE.height].map(|side| side * magnify);
        let screen = format!("{}x{}x24", shown[0] + 64, shown[1] + 64);
        let server = XServer::with(&["-screen", "0", &screen, "-fakescreenfps", &refreshes.to_string()]);
        let address = own_address(1);
        let camera = GigeCamera::start(address, sheet(exposure)?, server.view([32, 32], magnify, SIZE));
        let projector = X11Spec {
            display: Some(server.display.clone()),
            frame_time: 1.0 / f64::from(refreshes),
            settle_frames,
            magnify,
            ..X11Spec::new(SIZE.width, SIZE.height)
        };
        let of_camera = GenicamSpec {
            pixel_format: PixelFormat::Mono16,
            exposures: [1e-4, 1.0],
            ..GenicamSpec::gige(address, SIZE.width, SIZE.height)
        };
        let rig = HardwareRig { projector, camera: CameraSpec::Genicam(of_camera) };
        let folder = tempfile::tempdir()?;
        let journal = Journal::create(folder.path(), &Identity::new())?;
        let open = Box::new(|after| {
            let bench = rig.open(&Helper::at(env!("CARGO_BIN_EXE_krylux")), after)?;
            let live: Box<dyn FrameSource> = Box::new(LiveFrames::new(bench, 0.0, 3));
            Ok(live)
        });
        let mut shots = JournaledFrames::new(journal, open)?;
        let mut random = Pcg64::seed_from_u64(1);
        let (mut beyond, mut first, mut computing) = (Vec::new(), Times::default(), 0.0);
        let mut last = 0.0;
        for photo in 0..BEFORE + PHOTOS {
            let levels = (0..SIZE.pixels()).map(|_| random.random_range(0..256)).collect();
            let shot = CaptureRequest { frame: Arc::new(Frame::new(SIZE, 1, levels)?), exposure, take: 0 };
            shots.capture(&shot)?;
            let effort = shots.effort();
            if photo + 1 == BEFORE {
                (first, computing) = (effort.times, camera.computing());
            } else if photo >= BEFORE {
                beyond.push(1e3 * (effort.seconds - last - exposure));
            }
            last = effort.seconds;
        }
        let effort = shots.effort();
        let of = |part: fn(&Times) -> f64| 1e3 * (part(&effort.times) - part(&first)) / PHOTOS as f64;
        beyond.sort_by(f64::total_cmp);
        println!(
            "{refreshes:4} Hz {settle_frames:7} {:9.1} {magnify:8} | {:5.1} ({:5.1} to {:5.1}) | {:7.1} {:7.1} | {:4.1} {:9.1} {:8.1} | {:6.1}",
            1e3 * exposure,
            beyond[PHOTOS / 2],
            beyond[0],
            beyond[PHOTOS - 1],
            of(|times| times.refresh),
            of(|times| times.settle),
            of(|times| times.show),
            of(|times| times.transfer),
            of(|times| times.process),
            1e3 * (camera.computing() - computing) / PHOTOS as f64,
        );
        Ok(())
    }
}

/// A sheet whose white photo fills half of the sensor's range within `exposure` seconds.
fn sheet(exposure: f64) -> Outcome<Scene> {
    let pixels = SIZE.pixels();
    let mut rig = VirtualRig::ideal(VirtualScene::Matrix { path: "sheet.npz".into(), size: SIZE });
    rig.camera.white_exposure = exposure;
    rig.camera.exposures = [1e-4, 1.0];
    let ones = vec![1.0; pixels];
    Ok(Scene { rig, matrix: Csr::new(pixels, (0..=pixels).collect(), (0..pixels as u32).collect(), ones)? })
}
