//! What a virtual rig looks at, for its devices and for whoever predicts photos.

use std::path::Path;
use std::sync::Arc;

use anyhow::Result;

use super::console::Console;
use super::simulation::Simulation;
use crate::analysis::plan::Twin;
use crate::error::Error;
use crate::io::sparse;
use crate::rig::{VirtualRig, VirtualScene};
use crate::transport::{Backend, ExplicitMatrix};

/// Its photos are those of the simulation, traced when this is asked for, or of a matrix in a file.
pub(super) fn twin(
    simulation: &mut Option<Box<Simulation>>,
    devices: &VirtualRig,
    rig: &Path,
    console: &Console,
) -> Result<Twin> {
    Ok(match (simulation, &devices.scene) {
        (Some(simulation), _) => {
            let mut traced = simulation.assemble(devices.channels(), console)?;
            simulation.place(&mut traced, Backend::Auto, console)?;
            Twin::Traced(Arc::new(traced))
        }
        (None, VirtualScene::Matrix { path, size }) => {
            Twin::Explicit(ExplicitMatrix::new(sparse::read(path)?, *size)?)
        }
        (None, VirtualScene::File { .. }) => return Err(no_scene(rig).into()),
    })
}

/// The library's error, in which all that opens a rig ends but for an output that cannot be written.
pub(super) fn into_error(error: anyhow::Error) -> Error {
    error.downcast().unwrap_or_else(|error| Error::Rig {
        device: "virtual rig".into(),
        fault: format!("{error:#}"),
        help: "make standard output writable, or add -q".into(),
    })
}

pub(super) fn no_scene(path: &Path) -> Error {
    Error::Data {
        path: path.to_path_buf(),
        fault: "there is no scene in it that could be traced".into(),
        help: "give a rig whose [scene] names a scene's `file`".into(),
    }
}

pub(super) fn not_virtual(path: &Path) -> Error {
    Error::Data {
        path: path.to_path_buf(),
        fault: "its devices are real: there is no virtual twin to predict by".into(),
        help: "describe scene and devices in a rig file of kind = \"virtual\"".into(),
    }
}
