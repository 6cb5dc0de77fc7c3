//! The scene or matrix in front of the devices of a virtual rig.

use std::path::Path;

use super::scene::SceneSource;
use crate::analysis::plan::Twin;
use crate::error::{Error, Result};
use crate::io::sparse;
use crate::lab::SharedObserver;
use crate::lab::settings::Settings;
use crate::render::TraceSettings;
use crate::rig::{VirtualRig, VirtualScene};
use crate::transport::ExplicitMatrix;

/// Opens the scene of a virtual rig. `settings` replace the settings in its file. Returns `None` if the rig's matrix is in a file.
pub(in crate::lab) fn scene_of(
    scene: &mut VirtualScene,
    rig: &Path,
    settings: &Settings,
    observer: &SharedObserver,
) -> Result<Option<SceneSource>> {
    match scene {
        VirtualScene::File { path, camera, camera_file, size, samples, max_bounces, seed } => {
            let mut view = settings.view.clone();
            view.camera = view.camera.or(camera.take());
            view.camera_file = view.camera_file.or(camera_file.take());
            let of_file = TraceSettings {
                max_bounces: *max_bounces,
                seed: *seed,
                ..TraceSettings::new(*size, *samples)
            };
            let trace = settings.trace.for_rig(of_file);
            if trace.projector.is_some() {
                return Err(projector_of_its_own(rig));
            }
            (*size, *samples, *max_bounces) = (trace.resolution, trace.samples, trace.max_bounces);
            SceneSource::open(path, &view, trace, settings, observer).map(Some)
        }
        VirtualScene::Matrix { .. } => refuse_tracing(rig, settings).map(|()| None),
    }
}

/// Describes an open scene in the form of a rig file.
pub(in crate::lab) fn traced_scene(scene: &SceneSource, rig: &Path) -> Result<VirtualScene> {
    let TraceSettings { resolution: size, projector, samples, max_bounces, seed, .. } = scene.settings;
    if projector.is_some_and(|projector| projector != size) {
        return Err(projector_of_its_own(rig));
    }
    let path = scene.scene.path.clone();
    Ok(VirtualScene::File { path, camera: None, camera_file: None, size, samples, max_bounces, seed })
}

fn projector_of_its_own(rig: &Path) -> Error {
    let fault = format!("{} has as many projector pixels as its scene has", rig.display());
    Error::option("--projector-size", fault).help("leave it out, or give --size")
}

pub(in crate::lab) fn refuse_tracing(rig: &Path, settings: &Settings) -> Result<()> {
    let Some(option) = settings.first_of_trace() else { return Ok(()) };
    Err(Error::option(option, format!("nothing is traced for {}", rig.display()))
        .help("leave it out: the rig file says what is seen"))
}

/// The twin of a virtual rig: the scene, traced now, or the matrix in a file.
pub(in crate::lab) fn twin(scene: Option<&SceneSource>, devices: &VirtualRig, rig: &Path) -> Result<Twin> {
    Ok(match (scene, &devices.scene) {
        (Some(scene), _) => Twin::Traced(scene.assemble(devices.channels(), false)?),
        (None, VirtualScene::Matrix { path, size }) => {
            Twin::Explicit(ExplicitMatrix::new(sparse::read(path)?, *size)?)
        }
        (None, VirtualScene::File { .. }) => return Err(no_scene(rig)),
    })
}

pub(in crate::lab) fn no_scene(path: &Path) -> Error {
    Error::data(path, "there is no scene in it that could be traced")
        .help("give a rig whose [scene] names a scene's `file`")
}

pub(in crate::lab) fn not_virtual(path: &Path) -> Error {
    Error::data(path, "its devices are real: there is no virtual twin to predict by")
        .help("describe scene and devices in a rig file of kind = \"virtual\"")
}
