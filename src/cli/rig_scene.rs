//! The scene that a virtual rig looks at.

use std::path::Path;

use anyhow::Result;

use super::console::Console;
use super::options::ViewArgs;
use super::simulation::Simulation;
use super::trace::TraceArgs;
use crate::error::Error;
use crate::render::TraceSettings;
use crate::rig::VirtualScene;

/// Opens the scene of a virtual rig with what is given in the place of what its file says; none where its matrix is there.
pub(super) fn scene_of(
    scene: &mut VirtualScene,
    rig: &Path,
    view: &ViewArgs,
    trace: &TraceArgs,
    console: &Console,
) -> Result<Option<Box<Simulation>>> {
    let refuse = |option: &str, fault: String, help: &str| {
        Err(Error::Option { option: option.into(), fault, help: help.into() }.into())
    };
    match scene {
        VirtualScene::File { path, camera, camera_file, size, samples, max_bounces, seed } => {
            let wanted = ViewArgs {
                camera: view.camera.clone().or(camera.take()),
                camera_file: view.camera_file.clone().or(camera_file.take()),
            };
            let said = TraceSettings {
                max_bounces: *max_bounces,
                seed: *seed,
                ..TraceSettings::new(*size, *samples)
            };
            let settings = trace.settings_of_rig(said);
            if settings.projector.is_some() {
                let fault = format!("{} has as many projector pixels as its scene has", rig.display());
                return refuse("--projector-size", fault, "leave it out, or give --size");
            }
            (*size, *samples, *max_bounces) = (settings.resolution, settings.samples, settings.max_bounces);
            let simulation = Simulation::open(path, &wanted, settings, trace, console)?;
            Ok(Some(Box::new(simulation)))
        }
        VirtualScene::Matrix { .. } => refuse_tracing(rig, view, trace).map(|()| None),
    }
}

/// That no option of the tracer is given where nothing is traced.
pub(super) fn refuse_tracing(rig: &Path, view: &ViewArgs, trace: &TraceArgs) -> Result<()> {
    let Some(option) = trace.given().or(view.given()) else { return Ok(()) };
    Err(Error::Option {
        option: option.into(),
        fault: format!("nothing is traced for {}", rig.display()),
        help: "leave it out: the rig file says what is seen".into(),
    }
    .into())
}
