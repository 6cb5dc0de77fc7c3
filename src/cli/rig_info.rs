//! What `krylux info` tells of a rig file.

use serde_json::{Value, json};

use super::console::Console;
use crate::error::Result;
use crate::io::name::Name;
use crate::measure::{RigFile, RigKind};
use crate::report::stages;
use crate::rig::{VirtualRig, VirtualScene};

/// A few lines.
pub(super) fn say(file: &RigFile, console: &Console) -> Result<()> {
    console.say(format_args!("rig       {} ({})", file.path.display(), kind(&file.kind)))?;
    match &file.kind {
        RigKind::Virtual(rig) => console.say(format_args!("  scene   {}", scene(rig)))?,
        kind => console.say(format_args!(
            "  devices {}, {}",
            kind.projector_info().name,
            kind.camera_info().name
        ))?,
    }
    let (projector, camera) = (file.kind.projector_info(), file.kind.camera_info());
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
    let (projector, camera) = (file.kind.projector_info(), file.kind.camera_info());
    let scene = match &file.kind {
        RigKind::Virtual(rig) => Some(scene(rig)),
        _ => None,
    };
    json!({
        "path": Name::from(&file.path),
        "hash": blake3::Hash::from_bytes(file.hash).to_string(),
        "kind": kind(&file.kind),
        "scene": scene,
        "projector": {
            "name": projector.name,
            "resolution": projector.resolution,
            "channels": projector.channels,
            "bits": projector.bits,
            "frame_time": projector.frame_time,
        },
        "camera": {
            "name": camera.name,
            "resolution": camera.resolution,
            "channels": camera.channels,
            "bits": camera.bits,
            "exposures": camera.exposures,
        },
        "calibration": file.calibration.as_ref().map(Name::from),
        "measurement": file.measurement,
    })
}

fn kind(kind: &RigKind) -> &'static str {
    match kind {
        RigKind::Virtual(_) => "virtual",
        RigKind::Hardware(_) => "hardware",
        RigKind::Program(_) => "program",
    }
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
