//! The scene and the devices of these tests: two rooms that exchange no light, in front of a projector and a camera.

use std::net::Ipv4Addr;
use std::path::{Path, PathBuf};

use krylux::image::Resolution;
use krylux::io::npy;
use krylux::rig::{
    CameraSpec, GenicamSpec, HardwareRig, PixelFormat, VirtualRig, VirtualScene, X11Monitor, X11Spec,
};
use krylux::sparse::Csr;

use crate::gige_camera::{GigeCamera, Scene, own_address};
use crate::program;
use crate::x_server::XServer;

/// Pixels on a side.
pub const SIDE: usize = 12;

/// Monitor pixels on a side of a pattern pixel.
pub const MAGNIFY: usize = 7;

/// The matrix of the two rooms.
pub fn rooms() -> Csr {
    program::rooms(SIDE, 20.0)
}

/// Devices without faults or noise; white fills half of 16 bits in 4 ms.
pub fn devices(matrix: &Path) -> VirtualRig {
    let scene = VirtualScene::Matrix { path: PathBuf::from(matrix), size: Resolution::new(SIDE, SIDE) };
    let mut rig = VirtualRig::ideal(scene);
    rig.camera.white_exposure = 0.004;
    rig.camera.exposures = [1e-4, 1.0];
    rig
}

/// The same devices with a little noise, from which calibration finds the gain.
pub fn noisy(matrix: &Path) -> VirtualRig {
    let mut rig = devices(matrix);
    (rig.camera.shot_noise, rig.camera.full_well, rig.camera.read_noise) = (true, 1e7, 100.0);
    rig
}

/// A server with two monitors, and a camera that sees the second one.
pub struct Stage {
    pub address: Ipv4Addr,
    pub server: XServer,
    pub camera: GigeCamera,
    pub hardware: HardwareRig,
    /// The imperfections of the devices.
    rig: VirtualRig,
}

impl Stage {
    /// Switches the camera on with a new state, as after a power failure.
    pub fn switch_camera_on(&mut self) {
        self.camera = camera(self.address, &self.rig, &self.server);
    }
}

/// The stage of one test with these devices. `last` selects the camera's address, because tests run at the same time.
pub fn stage(last: u8, rig: &VirtualRig) -> Stage {
    stage_at(last, rig, None)
}

/// Like [`stage`], on the X server of this display.
pub fn stage_at(last: u8, rig: &VirtualRig, display: Option<&str>) -> Stage {
    let server = display.map_or_else(|| XServer::start(400, 200), |display| XServer::at(display, 400, 200));
    monitors(&server);
    let address = own_address(last);
    let camera = camera(address, rig, &server);
    let projector = X11Spec {
        display: Some(server.display.clone()),
        monitor: X11Monitor::Name("beamer".into()),
        magnify: MAGNIFY,
        ..X11Spec::new(SIDE, SIDE)
    };
    let bits = PixelFormat::Mono16;
    let of_camera =
        GenicamSpec { pixel_format: bits, exposures: [1e-4, 1.0], ..GenicamSpec::gige(address, SIDE, SIDE) };
    Stage {
        address,
        server,
        camera,
        hardware: HardwareRig { projector, camera: CameraSpec::Genicam(of_camera) },
        rig: rig.clone(),
    }
}

/// Adds the server's two monitors; the second one is the projector.
pub fn monitors(server: &XServer) {
    server.add_monitor("desk", [0, 0, 200, 200]);
    server.add_monitor("beamer", [200, 0, 200, 200]);
}

fn camera(address: Ipv4Addr, rig: &VirtualRig, server: &XServer) -> GigeCamera {
    let corner = (200 - SIDE * MAGNIFY) as i16 / 2;
    let view = server.view([200 + corner, corner], MAGNIFY, Resolution::new(SIDE, SIDE));
    GigeCamera::start(address, Scene { rig: rig.clone(), matrix: rooms() }, view)
}

/// Writes the rig file of the real protocols; `more` are lines before its tables.
pub fn rig_file(folder: &Path, stage: &Stage, more: &str) -> String {
    let path = folder.join("real.toml");
    let projector = &stage.hardware.projector;
    let display = projector.display.as_deref().unwrap_or_default();
    let text = format!(
        "kind = \"hardware\"\n{more}\n\
         [projector]\nkind = \"x11\"\ndisplay = \"{display}\"\nmonitor = \"beamer\"\nsize = [{SIDE}, {SIDE}]\nmagnify = {MAGNIFY}\n\
         [camera]\nkind = \"gige\"\naddress = \"{}\"\nsize = [{SIDE}, {SIDE}]\npixel_format = \"mono16\"\n\
         exposures = [1e-4, 1.0]\n[measurement]\ndirect_square = 1\n",
        stage.address
    );
    std::fs::write(&path, text).expect("the folder can be written");
    path.display().to_string()
}

/// The labels that a segmentation found.
pub fn labels(run: &Path) -> Vec<f64> {
    npy::read_npy(&run.join("labels-2.npy")).expect("it is written").values
}

/// The options of a segmentation into two groups.
pub const QUESTION: [&str; 6] = ["--photos", "12", "--groups", "2", "--eigenvectors", "3"];
