//! Virtual rigs on shipped scenes. Each scene is traced once for all tests of a binary.
#![allow(dead_code, reason = "each test binary uses its own part of this")]

use std::sync::Mutex;

use krylux::analysis::plan::{Planner, Twin};
use krylux::calibrate::CalibrateOptions;
use krylux::image::Image;
use krylux::io::npy;
use krylux::lab::Lab;
use krylux::measure::{Calibration, MeasureOptions, RigFile};
use krylux::rig::VirtualRig;

use crate::common;

/// The width and height in pixels.
pub const SIDE: usize = 64;

/// A scene in front of a rig, the rig's calibration, and the scene's true labels.
pub struct Stage {
    pub rig: VirtualRig,
    pub measurement: MeasureOptions,
    pub twin: Twin,
    pub calibration: Calibration,
    pub labels: Vec<u8>,
}

/// The rig of `assets/rigs/realistic.toml` with every imperfection, calibrated from captures alone.
pub fn realistic(scene: &'static str) -> &'static Stage {
    static STAGES: Mutex<Vec<(&'static str, &'static Stage)>> = Mutex::new(Vec::new());
    let mut stages = STAGES.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
    if let Some((_, stage)) = stages.iter().find(|(name, _)| *name == scene) {
        return stage;
    }
    let stage =
        Box::leak(Box::new(Stage::new(scene).expect("shipped scenes and rigs load and can be calibrated")));
    stages.push((scene, stage));
    stage
}

/// The target of `tests/reference`.
pub fn target() -> Image {
    npy::read_image(&common::root().join("tests/reference/target_64.npy"))
        .expect("reference data is in the repository")
}

impl Stage {
    fn new(scene: &str) -> krylux::Result<Self> {
        let exact = Lab::builder_of_scene(common::load(scene)).size(SIDE, SIDE).open()?;
        let mut lab =
            exact.through_rig(RigFile::load(&common::root().join("assets/rigs/realistic.toml"))?)?;
        lab.calibrate(&CalibrateOptions::default())?;
        let labels = lab.labels()?;
        let rig = lab.rig().expect("it is one");
        Ok(Self {
            rig: rig.devices()?.clone(),
            measurement: rig.file.measurement.clone(),
            twin: rig.twin()?,
            calibration: rig.calibration.clone(),
            labels,
        })
    }

    /// A planner with these options, which replace those of the file.
    pub fn planner<'a>(&'a self, rig: &'a VirtualRig, measurement: &'a MeasureOptions) -> Planner<'a> {
        Planner { rig, twin: &self.twin, calibration: &self.calibration, measurement, observer: &() }
    }
}

/// The calibration that follows from the rig file: the result of noiseless captures. No calibration contains vignetting and blur.
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
    let map = &rig.camera;
    let (from, to) = (camera.resolution, projector.resolution);
    let mut rows: Vec<std::collections::BTreeMap<u32, f64>> =
        vec![std::collections::BTreeMap::new(); to.pixels()];
    const SUB: usize = 6;
    for y in 0..from.height * SUB {
        for x in 0..from.width * SUB {
            let place =
                |at: usize, of: usize, size: usize| (at as f64 + 0.5) * size as f64 / (of * SUB) as f64;
            let [u, v] = map.sees(to, [place(x, from.width, to.width), place(y, from.height, to.height)]);
            if u >= 0.0 && v >= 0.0 && (u as usize) < to.width && (v as usize) < to.height {
                let pixel = (y / SUB * from.width + x / SUB) as u32;
                *rows[v as usize * to.width + u as usize].entry(pixel).or_default() += 1.0;
            }
        }
    }
    let registration = &mut calibration.registration;
    (registration.starts, registration.pixels, registration.weights) = (vec![0], Vec::new(), Vec::new());
    // The lens of an ideal map is not that of this one.
    registration.lens = None;
    for row in rows {
        // The weights favour camera pixels that lie mostly inside the projector pixel.
        let sum: f64 = row.values().map(|share| share * share).sum();
        for (pixel, share) in row {
            registration.pixels.push(pixel);
            registration.weights.push(share * share / sum);
        }
        registration.starts.push(registration.pixels.len());
    }
    calibration
}
