//! Rigs on shipped scenes: each scene is traced once for all tests of a binary.
#![allow(dead_code, reason = "each test binary uses its own part of this")]

use std::ops::ControlFlow;
use std::sync::{Arc, Mutex, OnceLock};

use krylux::analysis::plan::{Planner, Twin};
use krylux::image::Image;
use krylux::io::npy;
use krylux::measure::calibrate::{CalibrateOptions, calibrate};
use krylux::measure::{Calibration, LiveFrames, MeasureOptions};
use krylux::measure::{RigFile, RigKind};
use krylux::rig::VirtualRig;
use krylux::transport::{Assembled, Channels};

use crate::common;

/// Pixels on a side.
pub const SIDE: usize = 64;

/// A scene in front of a rig, with what is known of that rig.
pub struct Stage {
    pub rig: VirtualRig,
    pub measurement: MeasureOptions,
    pub twin: Twin,
    pub calibration: Calibration,
}

/// The rig of `assets/rigs/realistic.toml`, every imperfection on, calibrated from captures alone.
pub fn realistic(scene: &'static str) -> &'static Stage {
    static STAGES: Mutex<Vec<(&'static str, &'static Stage)>> = Mutex::new(Vec::new());
    let mut stages = STAGES.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
    if let Some((_, stage)) = stages.iter().find(|(name, _)| *name == scene) {
        return stage;
    }
    let file = RigFile::load(&common::root().join("assets/rigs/realistic.toml")).expect("shipped rigs load");
    let RigKind::Virtual(rig) = file.kind else { unreachable!("it is a virtual one") };
    let twin = Twin::Traced(traced(scene));
    let calibration = captured(&rig, &twin);
    let stage = Box::leak(Box::new(Stage { rig, measurement: file.measurement, twin, calibration }));
    stages.push((scene, stage));
    stage
}

/// The 64x64 matrix of a shipped scene, as `realistic.toml` traces it.
fn traced(scene: &str) -> Arc<Assembled> {
    let mut tracer = common::tracer(&common::load(scene));
    Arc::new(common::trace(&mut tracer, common::settings(SIDE, 64, 6, 0), Channels::Luma))
}

/// The true labels of a shipped scene.
pub fn labels(scene: &'static str) -> &'static [u8] {
    static LABELS: OnceLock<Vec<u8>> = OnceLock::new();
    assert_eq!(scene, "zigzag", "one scene has its labels kept");
    LABELS.get_or_init(|| {
        let scene = common::load(scene);
        let resolution = krylux::image::Resolution::new(SIDE, SIDE);
        let regions = common::tracer(&scene).regions(resolution).expect("it has regions");
        regions.into_iter().map(|region| region.map_or(255, |region| region as u8)).collect()
    })
}

/// The target of `tests/reference`.
pub fn target() -> Image {
    npy::read_image(&common::root().join("tests/reference/target_64.npy"))
        .expect("reference data is in the repository")
}

impl Stage {
    /// To plan with these options in the place of the file's.
    pub fn planner<'a>(&'a self, rig: &'a VirtualRig, measurement: &'a MeasureOptions) -> Planner<'a> {
        Planner { rig, twin: &self.twin, calibration: &self.calibration, measurement, observer: &() }
    }
}

/// A calibration as `krylux rig calibrate` finds it, in front of this scene.
fn captured(rig: &VirtualRig, twin: &Twin) -> Calibration {
    let bench = rig.open(twin.transport(), None).expect("it fits its scene");
    let mut shots = LiveFrames::new(bench, 0.0, MeasureOptions::default().tries);
    let mut go_on = |_| ControlFlow::Continue(());
    calibrate(&mut shots, &CalibrateOptions::default(), &mut go_on).expect("it can be calibrated").0
}

/// A calibration from what the rig's file says: what captures would find, but for their noise. Vignetting and blur are in no
/// calibration.
pub fn known(rig: &VirtualRig) -> Calibration {
    let (projector, camera) = (rig.projector_info(), rig.camera_info());
    let mut calibration = Calibration::ideal(&projector, &camera);
    let response = rig.projector.response();
    let top = (1_u32 << projector.bits) - 1;
    calibration.projector =
        vec![
            (0..=top).map(|level| response.at(f64::from(level) / f64::from(top))).collect();
            projector.channels
        ];
    let range = f64::from(rig.camera.highest()) - rig.camera.black_level;
    calibration.camera.black = rig.camera.black_level;
    calibration.camera.gain = rig.camera.full_well / range;
    calibration.camera.read_noise = rig.camera.read_noise / calibration.camera.gain;
    calibration.stability.settle = rig.projector.latency * 1.25;
    let map = rig.camera.misregistration();
    let (from, to) = (camera.resolution, projector.resolution);
    let mut rows: Vec<std::collections::BTreeMap<u32, f64>> =
        vec![std::collections::BTreeMap::new(); to.pixels()];
    const SUB: usize = 6;
    for y in 0..from.height * SUB {
        for x in 0..from.width * SUB {
            let place =
                |at: usize, of: usize, size: usize| (at as f64 + 0.5) * size as f64 / (of * SUB) as f64;
            let [u, v] = map.apply(to, [place(x, from.width, to.width), place(y, from.height, to.height)]);
            if u >= 0.0 && v >= 0.0 && (u as usize) < to.width && (v as usize) < to.height {
                let pixel = (y / SUB * from.width + x / SUB) as u32;
                *rows[v as usize * to.width + u as usize].entry(pixel).or_default() += 1.0;
            }
        }
    }
    let registration = &mut calibration.registration;
    (registration.starts, registration.pixels, registration.weights) = (vec![0], Vec::new(), Vec::new());
    for row in rows {
        // Camera pixels that lie mostly in it.
        let sum: f64 = row.values().map(|share| share * share).sum();
        for (pixel, share) in row {
            registration.pixels.push(pixel);
            registration.weights.push(share * share / sum);
        }
        registration.starts.push(registration.pixels.len());
    }
    calibration
}
