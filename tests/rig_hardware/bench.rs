//! The bench: two rooms that exchange no light, before a projector and a camera.

use std::net::Ipv4Addr;
use std::path::{Path, PathBuf};

use krylux::image::Resolution;
use krylux::rig::{Frame, GigeSpec, HardwareRig, PixelFormat, VirtualRig, VirtualScene, X11Monitor, X11Spec};
use krylux::sparse::Csr;

use crate::gige_camera::{GigeCamera, Scene};
use crate::x_server::XServer;

/// Pixels on a side.
pub const SIDE: usize = 12;

/// The monitor's pixels for one of a pattern's, on a side.
pub const MAGNIFY: usize = 7;

/// Two rooms, left and right: within one each pixel lights every other, between them there is no light. Pixels send back
/// twenty times as much to themselves.
pub fn rooms() -> Csr {
    let pixels = SIDE * SIDE;
    let room = |pixel: usize| pixel % SIDE < SIDE / 2;
    let (mut row_start, mut columns, mut weights) = (vec![0], Vec::new(), Vec::new());
    for row in 0..pixels {
        for column in (0..pixels).filter(|&column| room(column) == room(row)) {
            columns.push(column as u32);
            // Not all alike, so that there is one eigenvector to each eigenvalue.
            let near = (row / SIDE).abs_diff(column / SIDE) as f64;
            weights.push(if row == column { 20.0 } else { 1.0 / (1.0 + near) });
        }
        row_start.push(columns.len());
    }
    Csr::new(pixels, row_start, columns, weights).expect("well formed")
}

/// The devices without fault or noise; white fills half of 16 bits in 4 ms.
pub fn devices(matrix: &Path) -> VirtualRig {
    let scene = VirtualScene::Matrix { path: PathBuf::from(matrix), size: Resolution::new(SIDE, SIDE) };
    let mut rig = VirtualRig::ideal(scene);
    rig.camera.white_exposure = 0.004;
    rig.camera.exposures = [1e-4, 1.0];
    rig
}

/// The same with little noise, as calibration needs some to tell the gain from.
pub fn noisy(matrix: &Path) -> VirtualRig {
    let mut rig = devices(matrix);
    (rig.camera.shot_noise, rig.camera.full_well, rig.camera.read_noise) = (true, 1e7, 100.0);
    rig
}

/// A server with two monitors, and a camera that sees what is on the second.
pub struct Stage {
    pub address: Ipv4Addr,
    pub server: XServer,
    pub camera: GigeCamera,
    pub hardware: HardwareRig,
}

/// The stage of one test, with these devices: tests run at the same time.
pub fn stage(last: u8, rig: &VirtualRig) -> Stage {
    let server = XServer::start(400, 200);
    server.add_monitor("desk", [0, 0, 200, 200]);
    server.add_monitor("beamer", [200, 0, 200, 200]);
    let address = Ipv4Addr::new(127, 0, 8, last);
    let corner = (200 - SIDE * MAGNIFY) as i16 / 2;
    let mut eye = server.eye([200 + corner, corner], MAGNIFY, SIDE);
    let look =
        move || eye().map(|levels| Frame::new(Resolution::new(SIDE, SIDE), 1, levels).expect("a square"));
    let scene = Scene { rig: rig.clone(), matrix: rooms() };
    let camera = GigeCamera::start(address, scene, look);
    let projector = X11Spec {
        display: Some(server.display.clone()),
        monitor: X11Monitor::Name("beamer".into()),
        magnify: MAGNIFY,
        ..X11Spec::new(SIDE, SIDE)
    };
    let bits = PixelFormat::Mono16;
    let of_camera =
        GigeSpec { pixel_format: bits, exposures: [1e-4, 1.0], ..GigeSpec::new(address, SIDE, SIDE) };
    Stage { address, server, camera, hardware: HardwareRig { projector, camera: of_camera.into() } }
}
