//! What `krylux info` tells of a rig file.

use anyhow::Result;
use serde_json::{Value, json};

use super::console::Console;
use crate::report::stages;
use crate::rig::{RigFile, RigKind, VirtualRig, VirtualScene};

/// A few lines.
pub(super) fn say(file: &RigFile, console: &Console) -> Result<()> {
    let RigKind::Virtual(rig) = &file.kind;
    console.say(format_args!("rig       {} (virtual)", file.path.display()))?;
    console.say(format_args!("  scene   {}", scene(rig)))?;
    let (projector, camera) = (rig.projector_info(), rig.camera_info());
    console.say(format_args!(
        "  shows   {} pixels, {} bits, {}",
        projector.resolution,
        projector.bits,
        colour(projector.channels)
    ))?;
    console.say(format_args!(
        "  sees    {} pixels, {} bits, {}, exposures from {} to {} s",
        camera.resolution,
        camera.bits,
        colour(camera.channels),
        camera.exposures[0],
        camera.exposures[1]
    ))?;
    console.say(format_args!(
        "  known   {}",
        file.calibration.as_ref().map_or_else(
            || "nothing: it names no calibration, so its devices are taken as ideal".into(),
            |folder| format!("calibration {}", folder.display())
        )
    ))?;
    console.say(format_args!("  stages  {}", stages(&file.measurement)))
}

/// The same for `--json`.
pub(super) fn describe(file: &RigFile) -> Value {
    let RigKind::Virtual(rig) = &file.kind;
    let (projector, camera) = (rig.projector_info(), rig.camera_info());
    json!({
        "path": file.path,
        "hash": blake3::Hash::from_bytes(file.hash).to_string(),
        "kind": "virtual",
        "scene": scene(rig),
        "projector": {
            "resolution": projector.resolution,
            "channels": projector.channels,
            "bits": projector.bits,
            "frame_time": projector.frame_time,
        },
        "camera": {
            "resolution": camera.resolution,
            "channels": camera.channels,
            "bits": camera.bits,
            "exposures": camera.exposures,
        },
        "calibration": file.calibration,
        "measurement": file.measurement,
    })
}

fn scene(rig: &VirtualRig) -> String {
    match &rig.scene {
        VirtualScene::File { path, size, samples, .. } => {
            format!("{}, {size} pixels, {samples} light paths each", path.display())
        }
        VirtualScene::Matrix { path, size } => format!("{}, {size} pixels", path.display()),
    }
}

fn colour(channels: usize) -> &'static str {
    if channels == 1 { "gray" } else { "colours" }
}
