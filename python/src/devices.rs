//! Cameras and projectors that are written in Python, for the traits of krylux's rigs.

use krylux::Error;
use krylux::rig::{
    Camera, CameraInfo, DeviceOpener, Devices, Frame, ProgramRig, Projector, ProjectorInfo, RawFrame, Shown,
    Stamp, WallClock,
};
use numpy::PyReadonlyArray1;
use pyo3::prelude::*;

use crate::{arrays, work};

/// Devices written in Python, with their descriptions in the rig file.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct ProgramDevices {
    projector: Py<PyAny>,
    camera: Py<PyAny>,
    /// The descriptions of both devices as JSON.
    description: String,
}

/// Calls a device written in Python. If it raises an exception, the caller in Python receives this exception in place of the error.
fn ask<T>(device: &str, call: impl FnOnce(Python<'_>) -> PyResult<T>) -> krylux::Result<T> {
    match Python::try_attach(call) {
        Some(Ok(answer)) => Ok(answer),
        Some(Err(error)) => {
            let fault = error.to_string();
            work::keep(error);
            Err(Error::rig(device, fault).help("see the exception that its Python code raised"))
        }
        None => Err(Error::rig(device, "the interpreter ends").help("take photos before the program ends")),
    }
}

impl ProgramDevices {
    /// Opens the devices on each request. All requests return the same objects.
    pub(crate) fn opener(self) -> DeviceOpener {
        DeviceOpener::new(move |after: Option<Stamp>| {
            let described: ProgramRig = serde_json::from_str(&self.description)
                .map_err(|error| Error::Numerical(format!("the description of the devices: {error}")))?;
            let clock = WallClock::starting_at(after.map_or(0.0, |stamp| stamp.time));
            ask("rig", |py| {
                let projector = PythonProjector {
                    device: self.projector.clone_ref(py),
                    info: described.projector_info(),
                    clock,
                };
                let camera = PythonCamera {
                    device: self.camera.clone_ref(py),
                    info: described.camera_info(),
                    clock,
                    exposure: 0.0,
                    id: after.map_or(0, |stamp| stamp.id),
                };
                Ok(Devices::new(projector, camera, clock))
            })
        })
    }
}

/// A projector with the method `show(levels)`.
struct PythonProjector {
    device: Py<PyAny>,
    info: ProjectorInfo,
    clock: WallClock,
}

impl Projector for PythonProjector {
    fn info(&self) -> &ProjectorInfo {
        &self.info
    }

    fn show(&mut self, frame: &Frame) -> krylux::Result<Shown> {
        self.info.check(frame)?;
        ask("projector", |py| {
            let shape = arrays::shape(frame.resolution(), frame.channels());
            let levels = arrays::shaped(py, &shape, frame.levels().to_vec())?;
            py.check_signals()?;
            self.device.call_method1(py, "show", (levels,)).map(|_| ())
        })?;
        Ok(Shown { at: self.clock.seconds() })
    }
}

/// A camera with the methods `configure(exposure)` and `capture()`, as wrapped by the Python side.
struct PythonCamera {
    device: Py<PyAny>,
    info: CameraInfo,
    clock: WallClock,
    exposure: f64,
    id: u64,
}

impl Camera for PythonCamera {
    fn info(&self) -> &CameraInfo {
        &self.info
    }

    fn configure(&mut self, exposure: f64) -> krylux::Result<f64> {
        self.info.check_exposure(exposure)?;
        self.exposure =
            ask("camera", |py| self.device.call_method1(py, "configure", (exposure,))?.extract(py))?;
        Ok(self.exposure)
    }

    fn capture(&mut self) -> krylux::Result<Option<RawFrame>> {
        let (called, info) = (self.clock.seconds(), &self.info);
        let taken = ask("camera", |py| {
            py.check_signals()?;
            let answer = self.device.call_method0(py, "capture")?;
            // The result is the counts, and the number of seconds since the exposure began, if the camera states it.
            let counts: Option<(PyReadonlyArray1<'_, u16>, Option<f64>)> = answer.extract(py)?;
            let Some((counts, age)) = counts else { return Ok(None) };
            // Without this number, the exposure began with this call.
            let started = age.map_or(called, |age| self.clock.seconds() - age);
            Ok(Some((counts.as_slice()?.to_vec(), started)))
        })?;
        let Some((counts, started)) = taken else { return Ok(None) };
        self.id += 1;
        Ok(Some(RawFrame {
            resolution: info.resolution,
            channels: info.channels,
            counts,
            exposure: self.exposure,
            id: self.id,
            started,
        }))
    }

    fn restart(&mut self) -> krylux::Result<()> {
        ask("camera", |py| match self.device.getattr(py, "restart") {
            Ok(restart) => restart.call0(py).map(|_| ()),
            Err(_) => Ok(()),
        })
    }
}
